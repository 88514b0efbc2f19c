"""Metrics of the elastic gas: every one says what it is, and an order is judged from enough packings only."""

import pytest

from workflows.energy.gas_metrics import LEAST_PACKINGS, analyse
from workflows.energy.gas_runs import CONES, LEVELS, SCHEMES


def rows_of(packings, order, grains=100):
    """Rows of all schemes, whose drifts at the levels fall with this order."""
    rows = []
    for scheme in (*SCHEMES, *CONES):
        for purpose, levels in (("drift", (50, 100)), ("long", (50,)), ("order", LEVELS), ("plateau", (50, 100, 200))):
            for seed in range(packings):
                for level in levels:
                    drift = 1e-4 * (50 / level) ** order
                    row = {"scheme": scheme, "purpose": purpose, "seed": seed, "steps_per_contact": level}
                    row |= {"grains": grains, "steps": 5000}
                    rows.append(row | {"drift": drift, "shadow_drift": 1e-6 * (50 / level) ** 4})
    return rows


@pytest.mark.parametrize(("order", "holds"), [(2.0, True), (2.26, False)])
def test_an_order_is_judged_from_enough_packings(order, holds):
    few, enough = (analyse(rows_of(n, order))["order"] for n in (LEAST_PACKINGS - 1, LEAST_PACKINGS))
    assert few.value == pytest.approx(order) and few.holds is None
    assert f"from {LEAST_PACKINGS - 1} packings; 2 is claimed of {LEAST_PACKINGS} and more" in few.note
    assert enough.value == pytest.approx(order) and enough.holds is holds and "claimed" not in enough.note


def test_a_gain_over_another_experiment_says_so():
    unlike, alike = (analyse(rows_of(1, 2.0, grains))["gain_over_paper"] for grains in (100, 900))
    assert "of 100 grains in 5000 steps: not the same experiment" in unlike.note
    assert alike.note.endswith("of 900 grains in 5000 steps") and alike.value == unlike.value


def test_every_metric_says_what_it_is():
    metrics = analyse(rows_of(1, 2.0))
    assert all(metric.note for metric in metrics.values())
    assert metrics["shadow_drift_100"].note == "greatest relative change of the shadow energy at 100 steps per contact"
    assert metrics["gain_over_paper_scheme"].value == pytest.approx(1.0)
