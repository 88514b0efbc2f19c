"""The smoke presets of the protocols: a run meets what it claims, and shows something of what is looked for."""

import json

import pytest

from workflows.cli.main import main

SHOWN = {  # a metric that says so
    "velocity-steps": "direct_effect",
    "slide-hold-slide": "healing_per_decade",
    "stick-slip": "event_slip",
    "normal-stress-steps": "friction_change",
    "shear-cell": "friction_mean",
}


@pytest.mark.validate
@pytest.mark.parametrize("name", SHOWN)
def test_a_smoke_run_meets_its_claims(name, tmp_path):
    assert main([name, "--preset", "smoke", "--out", str(tmp_path / "run"), "--quiet", "--strict"]) == 0
    metrics = json.loads((tmp_path / "run" / "summary.json").read_text())["metrics"]
    assert metrics[SHOWN[name]]["value"] is not None
    assert any("holds" in metric for metric in metrics.values())
