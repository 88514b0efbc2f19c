"""Intervals of fitted rate-and-state parameters cover the truth as often as they say, and the right law is preferred.

Synthetic stacks with noise as that of a layer: 30 cycles, friction 0.3, noise of 5 % or 10 % of it that is correlated
over a slip of 0.1 d, steps by a factor 3 up and down, a = 0.02, b = 0.03, D_c = d.
"""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from taichi_lsm.statistics import compare_laws, fit_velocity_step
from taichi_lsm.statistics.rate_and_state import friction_after_step, spring_slider
from taichi_lsm.statistics.resampling import LEAST_CYCLES

A, B, DISTANCE = 0.02, 0.03, 1.0  # [1], [1], [d]
FRICTION, CYCLES, CORRELATION = 0.3, 30, 0.1  # [1], [1], [d]
SLIP = np.arange(-1.0, 4.0, 0.1) + 0.05  # [d]
BEFORE, AFTER = [1.0, 3.0], [3.0, 1.0]
TRUTHS = {"a": A, "b": B, "slip_distance": DISTANCE, "rate_dependence": A - B}


def cycles(rng, law, relative_noise, stiffness=math.inf, count=CYCLES):
    """(cycle, step, sample) of friction whose noise is an autoregressive series along slip."""
    if math.isinf(stiffness):
        clean = [friction_after_step(SLIP, v, w, A, B, DISTANCE, law) for v, w in zip(BEFORE, AFTER, strict=True)]
    else:
        clean = [spring_slider(SLIP, v, w, A, B, DISTANCE, stiffness, law) for v, w in zip(BEFORE, AFTER, strict=True)]
    levels = np.array([[0.0], [(A - B) * math.log(3.0)]])
    memory = math.exp(-(SLIP[1] - SLIP[0]) / CORRELATION)
    white = rng.normal(size=(count, 2, SLIP.size + 30)) * math.sqrt(1.0 - memory**2)
    noise = lfilter([1.0], [1.0, -memory], white)[..., 30:]
    return FRICTION * (1.0 + relative_noise * noise) + np.array(clean) + levels


def covered(fits):
    """{name: (share of the known intervals that hold the truth, share that is known)}."""
    found = {}
    for name, truth in TRUTHS.items():
        known = [value for value in (getattr(fit, name) for fit in fits) if not value.unknown]
        held = np.mean([value.low <= truth <= value.high for value in known])
        found[name] = (float(held), len(known) / len(fits))
    return found


def study(law, relative_noise, count, stiffness=math.inf):
    """(coverage, share in which the right law is preferred) of `count` fits."""
    rng = np.random.default_rng([len(law), round(100 * relative_noise), count])
    stacks = [cycles(rng, law, relative_noise, stiffness) for _ in range(count)]
    compared = [compare_laws(SLIP, y, BEFORE, AFTER, stiffness=stiffness, resamples=200) for y in stacks]
    return covered([getattr(c, law) for c in compared]), float(np.mean([c.better == law for c in compared]))


@pytest.mark.parametrize("law", ["ageing", "slip"])
def test_few_stacks_are_covered(law):
    found, preferred = study(law, 0.05, 40)
    assert all(share > 0.85 and known == 1.0 for share, known in found.values()), found
    assert preferred > 0.85


@pytest.mark.validate
@pytest.mark.parametrize(("relative_noise", "least", "count"), [(0.05, 0.95, 1000), (0.1, 0.75, 3000)])
@pytest.mark.parametrize("law", ["ageing", "slip"])
def test_stacks_are_covered_in_95_per_cent(law, relative_noise, least, count):
    """b ln 3 over the noise of one sample is 2.2 and 1.1."""
    found, preferred = study(law, relative_noise, count)
    print(f"\n{law}, noise {relative_noise:.0%}: (covered, known) {found}, right law preferred {preferred:.3f}")
    assert all(abs(share - 0.95) < 0.03 and known > 0.9 for share, known in found.values()), found
    assert preferred > least


@pytest.mark.validate
@pytest.mark.parametrize("law", ["ageing", "slip"])
def test_stacks_of_a_spring_slider_are_covered(law):
    """k D_c = 0.1, ten times (b - a): the direct effect is smeared over a slip of a/k = 0.2 d."""
    rng = np.random.default_rng(7)
    fits = [
        fit_velocity_step(SLIP, cycles(rng, law, 0.05, 0.1), BEFORE, AFTER, law, stiffness=0.1, resamples=200)
        for _ in range(500)
    ]
    found = covered(fits)
    print(f"\n{law}, spring: (covered, known) {found}")
    assert all(abs(share - 0.95) < 0.03 and known > 0.9 for share, known in found.values()), found


@pytest.mark.validate
def test_the_least_number_of_cycles_is_covered():
    """Eight cycles, at the noise of 30 of them with 10 %."""
    rng = np.random.default_rng(8)
    stacks = [cycles(rng, "slip", 0.05, count=LEAST_CYCLES) for _ in range(500)]
    found = covered([fit_velocity_step(SLIP, y, BEFORE, AFTER, "slip", resamples=200) for y in stacks])
    print(f"\n{LEAST_CYCLES} cycles: (covered, known) {found}")
    assert all(abs(share - 0.95) < 0.03 and known > 0.9 for share, known in found.values()), found
