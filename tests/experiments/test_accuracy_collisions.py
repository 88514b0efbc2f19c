"""Single collisions against their closed form: the orders of the schemes, averaged over phases of the step."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.helpers.scenes import PRECISION
from workflows.accuracy import collisions
from workflows.accuracy.curves import curves

pytestmark = pytest.mark.skipif(PRECISION == "f32", reason="errors of the schemes are below those of f32")


def test_orders_of_the_schemes(runtime, monkeypatch):
    monkeypatch.setattr(collisions, "SCHEMES", ("symplectic_euler", "onset_verlet"))
    monkeypatch.setattr(collisions, "LEVELS", (24, 48, 96))
    found = curves(collisions.measure_collisions(SimpleNamespace(seed=3, phases=16, replicas=4), "linear"))
    after, during, distance = collisions.OF_PAIRS[1], collisions.OF_PAIRS[0], collisions.OF_PAIRS[2]
    assert found["symplectic_euler", during].order() == pytest.approx(1.0, abs=0.2)
    assert found["symplectic_euler", after].order() == pytest.approx(2.0, abs=0.2)  # Verlet's: the update is the same
    assert found["onset_verlet", after].order() == pytest.approx(4.0, abs=0.3)
    assert found["onset_verlet", distance].order() == pytest.approx(2.0, abs=0.2)


def test_impacts_of_both_laws_last_as_long(runtime):
    """The speed after a contact of 96 steps shows that it has ended where the closed form says."""
    for effect in collisions.LAWS:
        during, after, distance = collisions.errors_of_pairs({}, "velocity_verlet", effect, 96, 8, 1)
        assert after < 1e-3 < 0.1 and distance < 1e-3 and np.isfinite(during)
