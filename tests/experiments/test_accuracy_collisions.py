"""Single collisions against their closed form: the orders of the schemes, averaged over phases of the step."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.helpers.scenes import PRECISION
from workflows.accuracy import collisions
from workflows.accuracy.curves import curves

pytestmark = pytest.mark.skipif(PRECISION == "f32", reason="errors of the schemes are below those of f32")


@pytest.mark.validate
def test_orders_of_the_schemes(runtime, monkeypatch):
    monkeypatch.setattr(collisions, "SCHEMES", ("symplectic_euler", "onset_verlet"))
    monkeypatch.setattr(collisions, "LEVELS", (24, 48, 96))
    found = curves(collisions.measure_collisions(SimpleNamespace(seed=3, phases=16, replicas=4), "linear"))
    after, during, distance = collisions.OF_PAIRS[1], collisions.OF_PAIRS[0], collisions.OF_PAIRS[2]
    assert found["symplectic_euler", during].order() == pytest.approx(1.0, abs=0.2)
    assert found["symplectic_euler", after].order() == pytest.approx(2.0, abs=0.2)  # Verlet's: the update is the same
    assert found["onset_verlet", after].order() == pytest.approx(4.0, abs=0.3)
    assert found["onset_verlet", distance].order() == pytest.approx(2.0, abs=0.2)


def leapfrog(force_law, per_contact, offsets):
    """(rms error of the energy, rms error of the distance) of pairs that Verlet's difference equation carries.

    The overlap x, in units of the approach in one step, obeys x[j+1] - 2 x[j] + x[j-1] = -a(x[j]) where x > 0;
    a(x) = (pi/n)^2 x for springs, and 5/4 (x/D)^1.5/D after Hertz, whose impacts of n steps are D = n/2.9432 deep.
    Touch lies 3 + offset steps after the start.
    """
    depth = per_contact / collisions.HERTZ_TIME
    deceleration = {
        "linear": lambda x: (np.pi / per_contact) ** 2 * x,
        "hertz": lambda x: 1.25 * (x / depth) ** 1.5 / depth,
    }[force_law]
    steps = 3 * (int(per_contact + 14) // 3 + 1)
    energy, distance = [], []
    for offset in offsets:
        before, now = -offset, 1.0 - offset  # of the third and the fourth step
        for _ in range(4, steps):
            before, now = now, 2.0 * now - before - (deceleration(now) if now > 0.0 else 0.0)
        assert now < 0.0  # apart again
        energy.append((now - before) ** 2 - 1.0)
        distance.append((-now - (steps - 3.0 - offset - per_contact)) / per_contact)
    return [float(np.sqrt(np.mean(np.square(values)))) for values in (energy, distance)]


@pytest.mark.parametrize("force_law", collisions.FORCE_LAWS)
def test_impacts_of_both_force_laws_are_those_of_the_difference_equation(runtime, force_law):
    """With the same duration, deviation after deviation: stiffness, duration and closed form belong together."""
    offsets = np.random.default_rng(1).uniform(0.0, 1.0, 8)
    during, *found = collisions.errors_of_pairs({}, "velocity_verlet", force_law, 96, 8, 1)
    assert found == pytest.approx(leapfrog(force_law, 96, offsets), rel=1e-5)
    assert found[0] < during  # inside the contact the energy of Verlet ripples more than it has changed at its end
