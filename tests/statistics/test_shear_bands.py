"""Shear bands and boundary slip of profiles whose width is known, with and without noise."""

import math

import numpy as np
import pytest
from scipy.special import erf

from taichi_lsm import InputError
from taichi_lsm.statistics import boundary_slip, shear_band

HEIGHT = np.arange(0.5, 20.0)  # [d]
WIDTH = 2.563103  # between a tenth and nine tenths, over w


def band(w, centre=8.0):
    return 0.5 + 0.5 * erf((HEIGHT - centre) / (math.sqrt(2.0) * w))


def test_a_band_within_the_layer_is_found_exactly():
    found = shear_band(HEIGHT, band(2.0))
    assert found.width.mean == pytest.approx(2.0 * WIDTH, rel=1e-6)
    assert found.centre.mean == pytest.approx(8.0) and found.velocity_change.mean == pytest.approx(1.0)
    low, high = (np.interp(share, band(2.0), HEIGHT) for share in (0.1, 0.9))
    assert found.width.mean == pytest.approx(high - low, rel=0.02)


@pytest.mark.parametrize("at_top", [False, True])
def test_a_band_at_a_platen_is_found_exactly(at_top):
    from_platen = HEIGHT[::-1] - 0.5 if at_top else HEIGHT - 0.5
    velocity = 1.0 - np.exp(-(HEIGHT[-1] - HEIGHT if at_top else HEIGHT - HEIGHT[0]) / 3.0)
    velocity = 1.0 - velocity if at_top else velocity
    assert from_platen.max() == 19.0
    found = shear_band(HEIGHT, velocity, form="exponential")
    assert found.width.mean == pytest.approx(3.0 * math.log(9.0), rel=1e-6)
    assert found.centre.mean == (19.5 if at_top else 0.5)
    assert found.velocity_change.mean == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("known", [True, False])
def test_widths_are_covered(known):
    rng = np.random.default_rng(int(known))
    errors = np.full(HEIGHT.size, 0.02)
    data = band(2.0) + 0.02 * rng.normal(size=(300, HEIGHT.size))
    found = [shear_band(HEIGHT, v, errors if known else None) for v in data]
    covered = np.mean([abs(f.width.mean - 2.0 * WIDTH) <= f.width.half_width for f in found])
    assert covered == pytest.approx(0.95, abs=0.035)
    if known:
        assert np.mean([f.chi_square for f in found]) == pytest.approx(16.0, rel=0.05)
        wrong = [shear_band(HEIGHT, v, errors, "exponential").chi_square for v in data[:20]]
        assert min(wrong) > 40.0  # the other form is told by its chi-square


def test_a_straight_profile_has_no_band():
    noise = 0.01 * np.random.default_rng(3).normal(size=HEIGHT.size)
    found = shear_band(HEIGHT, HEIGHT / 20.0 + noise)
    assert "shear fills the layer" in found.width.unknown or found.width.mean > 15.0
    bent = [0.47, 0.9, 1.29, 1.72, 2.09, 2.36, 2.52, 2.97, 3.16, 3.33, 3.78, 4.36]
    with pytest.raises(InputError, match=r"nearly straight, without a band .* try form = 'exponential'"):
        shear_band(HEIGHT[: len(bent)], bent)
    with pytest.raises(InputError, match="form: 'line'"):
        shear_band(HEIGHT, band(2.0), form="line")
    with pytest.raises(InputError, match="height: value 1 "):
        shear_band(HEIGHT[::-1], band(2.0))


def test_slip_at_the_platens():
    velocity = 0.1 + 0.8 * HEIGHT / 20.0
    found = boundary_slip(HEIGHT, velocity, (0.0, 20.0), (0.0, 1.0), 4.0)
    assert found.bottom.mean == pytest.approx(0.1) and found.top.mean == pytest.approx(0.1)
    assert found.share.mean == pytest.approx(0.2)
    noise = 0.01 * np.random.default_rng(1).normal(size=(400, HEIGHT.size))
    slips = [boundary_slip(HEIGHT, velocity + e, (0.0, 20.0), (0.0, 1.0), 6.0).bottom for e in noise]
    assert np.mean([abs(s.mean - 0.1) <= s.half_width for s in slips]) == pytest.approx(0.95, abs=0.035)
    with pytest.raises(InputError, match="2 heights lie within"):
        boundary_slip(HEIGHT, velocity, (0.0, 20.0), (0.0, 1.0), 2.0)
