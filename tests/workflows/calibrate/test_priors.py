"""Priors: quantiles and their inverse, what is allowed, and mistakes by name."""

import numpy as np
import pytest

from taichi_lsm.core.errors import InputError
from workflows.calibrate.priors import Prior, points_at, priors_of, shares_of
from workflows.shear_gouge import Params

SHARES = np.linspace(0.0, 1.0, 41)
KINDS = (
    Prior("friction", 0.1, 0.9),
    Prior("inertial_number", 1e-4, 1e-2, log=True),
    Prior("friction", 0.0, 100.0, mean=0.2, deviation=0.2),
)


@pytest.mark.parametrize("prior", KINDS, ids=str)
def test_shares_and_values_are_inverses_within_the_ends(prior):
    values = prior.at(SHARES)
    assert values[0] == pytest.approx(prior.low, abs=1e-12) and np.all(np.diff(values) > 0)
    assert values[-1] <= prior.high
    np.testing.assert_allclose(prior.share(values)[:-1], SHARES[:-1], atol=1e-9)


def test_the_middle_of_logarithms_is_the_geometric_mean():
    assert KINDS[1].at(np.array([0.5]))[0] == pytest.approx(1e-3)


def test_a_normal_prior_is_cut_off_at_what_is_allowed():
    """0.2 +- 0.2 above 0: of the whole distribution 84.13 % is left, so that its median is where 57.93 % lie below."""
    assert KINDS[2].at(np.array([0.5]))[0] == pytest.approx(0.2 + 0.2 * 0.20019, abs=1e-5)


def test_points_have_the_digits_of_files_and_lead_back():
    shares = np.random.default_rng(1).random((5, 2))
    points = points_at(KINDS[:2], shares)
    assert set(points[0]) == {"friction", "inertial_number"}
    np.testing.assert_allclose(shares_of(KINDS[:2], points), shares, atol=1e-10)


def test_all_kinds_are_read():
    table = {
        "friction": {"from": 0.1, "to": 0.9},
        "inertial_number": {"from": 1e-4, "to": 1e-2, "spacing": "log"},
        "restitution": {"mean": 0.5, "deviation": 0.1},
    }
    read = priors_of(table, Params)
    assert read[:2] == KINDS[:2]
    assert read[2] == Prior("restitution", 0.01, 1.0, mean=0.5, deviation=0.1)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (None, r"^calibrate.priors: must be given"),
        ({"frictoin": {"from": 0, "to": 1}}, r"priors.frictoin: unknown parameter. Did you mean friction"),
        ({"grains": {"from": 20, "to": 90}}, r"priors.grains: takes an integer.*any number in a range"),
        ({"friction": 0.5}, r"priors.friction = 0.5: must be \{from"),
        ({"friction": {"from": -1, "to": 1}}, r"priors.friction.from = -1: must be a number, from 0 to 100"),
        ({"friction": {"from": 0, "to": 1, "spacing": "log"}}, r"priors.friction.from = 0: must be > 0 with"),
        ({"friction": {"mean": 0.5}}, r"priors.friction.deviation = None: must be a number"),
        ({"friction": {"mean": 0.5, "deviation": 0}}, r"priors.friction.deviation = 0: must be > 0"),
        ({"friction": {"mean": -1, "deviation": 1}}, r"priors.friction.mean = -1: must be from 0 to 100"),
        ({"friction": {"mean": 0.5, "deviation": 1, "to": 1}}, r"priors.friction.to: unknown beside mean and dev"),
        ({f"p{i}": {} for i in range(7)}, r"priors: 7 parameters, must be at most 6"),
    ],
)
def test_mistakes_are_named(table, message):
    with pytest.raises(InputError, match=message):
        priors_of(table, Params)
