"""The table of the runs that a target error needs, made from stand-ins for their files."""

import json
from pathlib import Path

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.io.run_file import RunWriter
from tests.helpers.output_files import LABELS, RUN, attributes
from workflows import shear_gouge
from workflows.common.metrics import Metric
from workflows.gouge import target_runs

FRICTION = {"friction_mean": Metric(0.3, "1"), "friction_se": Metric(None, "1")}


@pytest.fixture
def target(tmp_path, monkeypatch):
    """(parameters, their runs, target.nc)."""

    def make_files(jobs, at_a_time, progress, resume):
        for _, _, _, folder in jobs:
            folder.mkdir(parents=True)
            RunWriter(folder / "run.nc", RUN, attributes(), LABELS).close("complete")

    monkeypatch.setattr(target_runs, "run_replicas", make_files)
    monkeypatch.setattr(target_runs.run_plots, "plot_target", lambda out, error, kind: None)  # they have no rows
    params = shear_gouge.Params(target_error=0.02, layer_thickness=8, length=20, friction=0.4, seed=5)
    runs = target_runs.runs_of(params, target_runs.target_error.plan(params, 0.02))
    run = target_runs.run_to_target(params, tmp_path / "out", None, "shear_gouge", lambda dataset, of_run: FRICTION)
    return params, runs, run


def test_the_parameters_of_the_runs_are_coordinates(target):
    params, runs, table = target
    summary = json.loads((Path(table.encoding["source"]).parent / "summary.json").read_text())
    assert "too few and too short to tell" in summary["metrics"]["friction_error"]["remedy"]
    one = runs["seed-5"]
    assert table.sizes["run"] == len(runs) > 1 and list(table.seed.values) == [r.seed for r in runs.values()]
    expected = {"particle_friction": 0.4, "target_normal_stress": 5e6, "stiffness_number": 1000.0, "length": 20.0}
    expected |= {"target_thickness_in_diameters": 8.0, "strain": one.strain, "step_safety": one.step_safety}
    expected |= {"shape": "round", "target_error": 0.02}  # of the experiment: its runs have none
    for name, value in expected.items():
        assert name in table.coords and set(table[name].values) == {value}, name
    assert table.target_normal_stress.units == "Pa" and table.density.long_name == "density of the grains"
    assert np.isnan(table.width.values).all()  # of the other dimension
    again = lsm.open_run(table.encoding["source"])
    assert set(again.coords) == set(table.coords)
