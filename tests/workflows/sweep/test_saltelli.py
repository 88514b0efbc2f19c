"""Indices of Sobol, beside those of a function in closed form, and of a sweep with a run that failed."""

import sys

import numpy as np
import pytest
import xarray

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError
from workflows.cli.main import main
from workflows.sweep.factors import points_of
from workflows.sweep.saltelli import indices_of, saltelli_sample

A, B = 7.0, 0.1  # of the function of Ishigami and Homma (1990)


def ishigami(shares):
    x = np.pi * (2.0 * shares - 1.0)
    return np.sin(x[:, 0]) + A * np.sin(x[:, 1]) ** 2 + B * x[:, 2] ** 4 * np.sin(x[:, 0])


def exact_indices():
    """(first order, total): the variance has the shares of x1 alone, x2 alone, and x1 with x3."""
    alone = 0.5 * (1.0 + B * np.pi**4 / 5.0) ** 2, A**2 / 8.0
    together = B**2 * np.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    whole = sum(alone) + together
    return np.array([*alone, 0.0]) / whole, np.array([alone[0] + together, alone[1], together]) / whole


def test_indices_are_those_of_the_closed_form():
    found = indices_of(ishigami(saltelli_sample(1024, 3, 1)), 3, seed=0)
    first, total = exact_indices()
    assert np.all(np.abs(found.first - first) < found.first_error) and np.all(found.first_error < 0.1)
    assert np.all(np.abs(found.total - total) < found.total_error) and np.all(found.total_error < 0.1)
    assert (found.blocks, found.left_out) == (1024, 0)


def test_blocks_with_a_run_that_gave_nothing_are_left_out_whole():
    values = ishigami(saltelli_sample(64, 3, 1))
    values[[7, 8, 100]] = np.nan  # of blocks 2 and 21
    found, kept = indices_of(values, 3, seed=0), np.delete(values.reshape(64, 5), [1, 20], axis=0)
    assert (found.blocks, found.left_out) == (62, 2)
    assert np.array_equal(found.total, indices_of(kept.ravel(), 3, seed=0).total)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.full(20, np.nan), r"^height: 0 of 4 blocks of 5 runs are whole, at least 4"),
        (np.ones(20), r"^height: is 1 in all runs, there is no variance"),
    ],
)
def test_values_without_indices_are_refused(values, message):
    with pytest.raises(InputError, match=message):
        indices_of(values, 3, seed=0, name="height")


def test_points_of_a_sweep_are_blocks():
    """The first and the last point of a block differ everywhere, those between in one parameter from the first."""
    sample = {"method": "saltelli", "count": 4, "ranges": {n: {"from": 1, "to": 2} for n in ("a", "b", "c")}}
    points = points_of({"sample": sample})
    blocks = np.array([list(point.values()) for point in points]).reshape(4, 5, 3)
    assert np.array_equal(blocks[:, 1:4] != blocks[:, :1], np.broadcast_to(np.eye(3, dtype=bool), (4, 3, 3)))
    for i in range(3):
        assert np.array_equal(blocks[:, 1 + i, i], blocks[:, 4, i])
    with pytest.raises(InputError, match=r"count = 5: must be a power of two"):
        points_of({"sample": sample | {"count": 5}})


def test_a_missing_library_is_named_with_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "SALib.sample.sobol", None)
    with pytest.raises(InputError, match=r"saltelli\": needs SALib, which is not installed; pip install 'taichi-lsm\["):
        saltelli_sample(4, 2, 1)


SWEEP = """
experiment = "toy-run"
[sweep.grid]
{grid}
[sweep.sample]
method = "{method}"
count = 16
ranges.normal_stress = {{from = 1e3, to = 2e3}}
ranges.time_step = {{from = 1e-3, to = 2e-3}}
"""


@pytest.fixture
def study(toy, tmp_path):
    """study(...): the folder of a sweep of the toy whose metric `stress` is the normal stress; runs are not made."""
    from workflows.common.metrics import Metric, write_summary
    from workflows.common.one_run import COMPLETED, FAILED, Outcome
    from workflows.sweep.drive import folder_of
    from workflows.sweep.plan import plan_of
    from workflows.sweep.table import write_sweep

    def make(method="saltelli", grid="", failed=("03",)):
        file, out = tmp_path / "sweep.toml", tmp_path / "out"
        file.write_text(SWEEP.format(method=method, grid=grid))
        plan = plan_of(file, {"toy-run": toy})
        ended = {}
        for run in plan.runs:
            ended[run.label] = Outcome(FAILED if run.label in failed else COMPLETED, "", 1.0)
            folder_of(out, run).mkdir(parents=True)
            write_summary(folder_of(out, run), "toy", None, {"stress": Metric(run.params.normal_stress, "Pa")}, True)
        write_sweep(plan, out, ended, file.read_text(), "complete").close()
        return out

    return make


def test_the_sensitivity_of_a_sweep_is_told_with_what_is_left_out(study, capsys):
    out = study()
    assert main(["sensitivity", str(out), "--metric", "stress"]) == 0
    said = capsys.readouterr()
    assert "stress: 1 of 16 blocks are left out" in said.err
    assert "stress_total_target_normal_stress" in said.out and "stress_total_time_step" in said.out
    with xarray.open_dataset(out / "sensitivity.nc") as found:
        assert found.first.dims == ("metric", "parameter") and found.first.units == "1"
        stress, step = (found.sel(metric="stress", parameter=name) for name in ("target_normal_stress", "time_step"))
        assert abs(stress.total - 1.0) < stress.total_error and abs(stress["first"] - 1.0) < stress.first_error
        assert float(step.total) == float(step["first"]) == 0.0
        assert int(stress.blocks) == 15 and int(stress.left_out) == 1
    assert (out / "sensitivity.png").stat().st_size > 5_000
    assert lsm.open_sweep(out).sizes == {"sample": 64}


@pytest.mark.parametrize(
    ("of_sweep", "options", "message"),
    [
        ({}, ["--metric", "strss"], r"--metric strss: .* has no such metric, must be one of .*Did you mean stress"),
        ({}, [], r"--metric friction_mean: .* has no such metric"),
        ({"method": "sobol"}, ["--metric", "stress"], "has no blocks of points for indices of Sobol"),
        ({"grid": "dim = [2, 3]"}, ["--metric", "stress"], "dim varies beside the sample"),
    ],
)
def test_mistakes_are_named(study, capsys, of_sweep, options, message):
    import re

    assert main(["sensitivity", str(study(**of_sweep)), *options]) == 2
    assert re.search(message, capsys.readouterr().err)
