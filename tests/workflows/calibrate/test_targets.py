"""Targets: what an error is, and mistakes by name."""

import pytest

from taichi_lsm.core.errors import InputError
from workflows.calibrate.targets import Target, targets_of, with_model_errors


def test_targets_of_laboratories_and_of_simulated_runs():
    table = {"friction_mean": {"value": 0.45, "error": 0.01}, "porosity": {"value": 0.2, "runs": 3}}
    friction, porosity = targets_of(table)
    assert (friction.value, friction.error, friction.runs) == (0.45, 0.01, None)
    assert (porosity.value, porosity.error, porosity.runs) == (0.2, None, 3)
    loose = with_model_errors((friction, porosity), {"porosity": 0.02})
    assert [target.model_error for target in loose] == [0.0, 0.02]


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (None, r"^calibrate.targets = None: must be a table"),
        ({"friction_mean": 0.45}, r"targets.friction_mean = 0.45: must be \{value"),
        ({"friction_mean": {"error": 0.1}}, r"friction_mean.value = None: must be a number"),
        ({"friction_mean": {"value": 0.4}}, r"friction_mean.error: must be given.* or runs"),
        ({"friction_mean": {"value": 0.4, "error": 0}}, r"friction_mean.error = 0: must be > 0"),
        ({"friction_mean": {"value": 0.4, "error": float("nan")}}, r"friction_mean.error = nan: must be > 0"),
        (
            {"friction_mean": {"value": 1e308, "error": 1e-308}},
            r"friction_mean.value = 1e\+308: must be a number up to",
        ),
        ({"friction_mean": {"value": 0.4, "error": 1e-308}}, r"friction_mean.error = 1e-308: must be > 0"),
        ({"friction_mean": {"value": 0.4, "runs": 0}}, r"friction_mean.runs = 0: must be a whole number"),
        ({"friction_mean": {"value": 0.4, "errors": 0.1}}, r"friction_mean.errors: unknown.*Did you mean error"),
        ({f"m{i}": {"value": 1, "error": 1} for i in range(21)}, r"targets: 21 metrics, must be at most 20"),
    ],
)
def test_mistakes_are_named(table, message):
    with pytest.raises(InputError, match=message):
        targets_of(table)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (0.1, r"^calibrate.model_error = 0.1: must be a table"),
        ({"frction": 0.1}, r"model_error.frction: is no target, must be one of friction. Did you mean friction"),
        ({"friction": -1.0}, r"model_error.friction = -1.0: must be a number >= 0"),
    ],
)
def test_mistakes_of_model_errors_are_named(table, message):
    with pytest.raises(InputError, match=message):
        with_model_errors((Target("friction", 0.4, 0.1),), table)
