"""Both shapes under the same conditions: parameters of the runs, files, metrics, pictures, and runs that fail."""

import json
import shutil
import signal

import numpy as np
import pytest
import xarray

import taichi_lsm as lsm
from tests.helpers.pictures import panels
from workflows import compare_shapes, shear_gouge
from workflows.common import signals
from workflows.common.parameters import ParameterError, merge
from workflows.gouge.layer_metrics import BOUNDS, mean_metric, worst_claims
from workflows.plots import run_plots

SMALL = {"layer_thickness": 8, "length": 10, "inertial_number": 1e-2, "strain": 0.4, "steady_from": 0.2}


def test_the_runs_differ_in_shape_and_seed_only():
    params = compare_shapes.Params(seed=4, replicas=2, friction=0.3, **SMALL)
    runs = compare_shapes.build(params)
    assert list(runs) == ["round-4", "round-5", "angular-4", "angular-5"]
    for label, of_run in runs.items():
        assert f"{of_run.shape}-{of_run.seed}" == label
        for name in set(shear_gouge.Params.model_fields) - {"shape", "seed"}:
            assert getattr(of_run, name) == getattr(params, name)


def test_there_is_no_option_shape():
    with pytest.raises(ParameterError, match="shape"):
        merge(compare_shapes.Params, options={"shape": "angular"})


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"replicas": 0}, "replicas"),
        ({"seed": 2**31 - 2}, "last seed"),
        ({"smallest_diameter": 1.0}, "largest_diameter"),
    ],
)
def test_wrong_values_are_refused(values, words):
    with pytest.raises(ParameterError, match=words):
        compare_shapes.Params(**values)


def test_what_the_angular_run_refuses_is_refused_before_any_run():
    with pytest.raises(ParameterError, match="stiffness_number"):
        compare_shapes.Params(corner_radius=0.01, stiffness_number=200.0)


def table_of(*rows):
    """A table of runs such as compare.nc, from (shape, status, friction, why its error is unknown) of each run."""
    columns = {column.name: ("run", [mean for _, _, mean, _ in rows]) for column in compare_shapes.COLUMNS}
    columns |= {"friction_se": ("run", [np.nan if why or status != "complete" else 0.01 for _, status, _, why in rows])}
    columns |= {"seed": ("run", range(1, len(rows) + 1)), "friction_ess": columns["friction_se"]}
    for name, at in (("shape", 0), ("status", 1), ("note", 3)):
        columns[name] = ("run", [row[at] for row in rows])
    return xarray.Dataset(columns)


def test_metrics_are_named_as_the_shapes_are():
    """Discs in 2D are no spheres: the metrics call both round."""
    metrics = compare_shapes.analyse(table_of(("round", "complete", 0.2, ""), ("angular", "complete", 0.4, "")))
    means = {name: metric.value for name, metric in metrics.items() if name.endswith("_mean")}
    assert means == {"friction_round_mean": 0.2, "friction_angular_mean": 0.4}


def test_what_is_unknown_is_called_that_in_the_printed_table_with_the_reason():
    why = "unknown: 12 effective samples, at least 20 are needed: shear further"
    rows = ("round", "complete", 0.2, ""), ("round", "complete", 0.2, why), ("angular", "failed", np.nan, "")
    text = compare_shapes.table_text(table_of(*rows))
    _, known, unknown, failed = (line.split("  ") for line in text.splitlines())
    assert "nan" not in text and "0.010" in known
    assert "unknown" in unknown and unknown[-1] == why.removeprefix("unknown: ")
    assert [cell.strip() for cell in failed if cell][2:] == ["failed", *["-"] * 6]
    metrics = compare_shapes.analyse(table_of(("round", "failed", np.nan, "")))
    claims = [name for name in metrics if name.endswith("_max")]
    assert len(claims) == 4 and all(metrics[name].note == "no complete run" for name in claims)


def test_a_mean_without_an_interval_says_why():
    one, unknown = lsm.statistics.Estimate(0.2, 0.01), lsm.statistics.Estimate(0.2, np.nan, unknown="too few samples")
    assert mean_metric(one, "1", "of all").note == "of all"
    assert (
        mean_metric(unknown, "1").note == "interval unknown: too few samples"
        and mean_metric(unknown, "1").interval is None
    )


def test_a_claim_that_a_run_does_not_meet_is_told_with_the_run():
    good = dict.fromkeys(BOUNDS, 1e-4)
    claims = worst_claims({"round-1": good, "angular-2": good | {"energy_residual": -0.02}})
    assert claims["energy_residual_max"].value == 0.02 and not claims["energy_residual_max"].holds
    assert "angular-2" in claims["energy_residual_max"].note
    assert claims["energy_residual_max"].remedy.startswith("run angular-2: ")
    assert claims["normal_stress_rms_max"].holds
    two = worst_claims({"a": good | {"normal_stress_rms": 0.2}, "b": good | {"normal_stress_rms": 0.1}})
    assert two["normal_stress_rms_max"].note == "largest of all runs; above in a, b"


@pytest.fixture(scope="module")
def compared(runtime, tmp_path_factory):
    """(folder, table, progress reports) of a small comparison, two seeds for each shape."""
    out, reports = tmp_path_factory.mktemp("compared"), []
    params = compare_shapes.Params(replicas=2, at_a_time=1, **SMALL)  # the second run of a shape finds its kernels
    return out, compare_shapes.run(params, out, progress=reports.append), reports


@pytest.mark.validate
def test_every_run_is_in_the_table(compared):
    out, table, reports = compared
    assert list(table["shape"].values) == ["round"] * 2 + ["angular"] * 2
    assert list(table.seed.values) == [1, 2, 1, 2]
    assert not {"seed", "dt"} & set(table.attrs) and (table.time_step.values > 0.0).all()  # of one run only
    assert set(table.status.values) == {"complete"} and table.run_status == "complete"
    assert {"shape", "seed", "particle_friction", "target_normal_stress", "density"} <= set(table.coords)
    assert set(table.particle_friction.values) == {0.5} and set(table.length.values) == {10.0}
    assert np.isnan(table.corner_radius.values[:2]).all() and set(table.corner_radius.values[2:]) == {0.05}
    runs = lsm.open_runs(out)
    assert runs.friction.sizes["run"] == 4 and sorted(runs["shape"].values) == sorted(table["shape"].values)
    assert {s for s in runs.stage.values.ravel() if isinstance(s, str)} == {"generate", "consolidate", "shear"}
    for i, path in enumerate(table.path.values):
        of_run = json.loads((out / path / "summary.json").read_text())["metrics"]
        for name in ("friction_mean", "energy_residual", "porosity"):
            assert float(table[name][i]) == pytest.approx(of_run[name]["value"], rel=1e-12)
        assert of_run["friction_se"]["value"] is None and np.isnan(table.friction_se[i])  # too short to know it
    assert len({r["label"] for r in reports}) == 4
    assert np.all(table.friction_mean > 0.05) and np.all(table.energy_residual < 0.01)


@pytest.mark.validate
def test_files_are_there_and_every_variable_is_described(compared):
    out, _, _ = compared
    written = {p.name for p in out.iterdir()}
    assert written == {"compare.nc", "config.toml", "summary.json", "friction.png", "runs"}
    assert (out / "friction.png").read_bytes().startswith(b"\x89PNG")
    files = [out / "compare.nc", *out.glob("runs/*/*.nc")]
    assert len(files) == 9
    for path in files:
        dataset = lsm.open_run(path)
        assert dataset.run_status == "complete" and dataset.config_toml
        for name, variable in dataset.variables.items():
            assert variable.attrs["long_name"], name
            assert variable.attrs.get("units") or variable.dtype.kind in "UO", name


@pytest.mark.validate
def test_errors_and_intervals_follow_from_the_replicas(compared):
    out, table, _ = compared
    metrics = json.loads((out / "summary.json").read_text())["metrics"]
    mean, error = {}, {}
    for shape in compare_shapes.SHAPES:
        metric = f"friction_{shape}"
        own = table.friction_mean.values[table["shape"].values == shape]
        mean[shape], error[shape] = own.mean(), own.std(ddof=1) / np.sqrt(2)  # so short runs know no error of their own
        assert metrics[f"{metric}_mean"]["value"] == pytest.approx(mean[shape])
        low, high = metrics[f"{metric}_mean"]["interval"]
        assert high - low == pytest.approx(2 * 12.7062047 * error[shape])  # Student's t of one degree of freedom
        assert metrics[f"{metric}_se"]["value"] == pytest.approx(error[shape])
    assert metrics["friction_difference"]["value"] == pytest.approx(mean["angular"] - mean["round"])
    assert metrics["friction_difference_se"]["value"] == pytest.approx(np.hypot(*error.values()))
    assert metrics["energy_residual_max"]["value"] == pytest.approx(float(table.energy_residual.max()))
    assert metrics["energy_residual_max"]["holds"] is True
    assert metrics["seconds"]["value"] > 0
    assert all(f"{name}_max" in metrics for name in shear_gouge.BOUNDS)


@pytest.mark.validate
def test_the_picture_shows_the_mean_of_each_shape_beside_published_values(compared, pictures):
    out, table, _ = compared
    run_plots.plot_comparison(out)
    friction, published, round_layer, angular_layer = panels(pictures[0], "abcd")
    estimates = compare_shapes.estimates(table)
    labels = [line.get_label() for line in friction.lines]
    for shape, name in (("round", "discs"), ("angular", "angular grains")):
        mean, (low, high) = estimates[shape].mean, estimates[shape].interval
        label = f"{name}: {mean:.3f}, 95 % interval {low:.3f} to {high:.3f} (2 runs)"
        assert label in labels
        line = friction.lines[labels.index(label) + 1]
        assert np.allclose(line.get_ydata(), mean) and line.get_xdata()[0] == SMALL["steady_from"]
        ends = [
            segment[:, 1] for bar in friction.containers for part in bar.lines[2] for segment in part.get_segments()
        ]
        assert any(np.allclose(y, [low, high]) for y in ends)
        bars = [bar.lines[0].get_xdata() for bar in published.containers]
        assert any(np.allclose(x, mean) for x in bars if len(x))
        for limits, least in ((published.get_xlim(), 0.7), (friction.get_ylim(), 0.5)):
            assert limits[0] <= min(0.0, low) and limits[1] >= max(least, high)
    assert friction.get_xlabel() == "shear strain [1]"
    assert all(axes.collections for axes in (round_layer, angular_layer))


@pytest.mark.validate
def test_the_printed_table_has_a_line_per_run(compared):
    lines = compare_shapes.table_text(compared[1]).splitlines()
    assert len(lines) == 5
    assert lines[1].split()[:3] == ["round", "1", "complete"]


@pytest.mark.validate
@pytest.mark.parametrize("survivors", [("round-1", "angular-1"), ("round-1",), ()])
def test_a_failed_run_costs_only_itself(compared, tmp_path, monkeypatch, survivors):
    done, table, _ = compared

    def some_fail(jobs, at_a_time, progress, resume):
        for label in survivors:
            shutil.copytree(done / "runs" / label, tmp_path / "runs" / label)
        raise lsm.SimulationError("run angular-2 failed")

    monkeypatch.setattr(compare_shapes, "run_replicas", some_fail)
    with pytest.raises(lsm.SimulationError, match="angular-2"):
        compare_shapes.run(compare_shapes.Params(replicas=2, **SMALL), tmp_path)
    left = lsm.open_run(tmp_path / "compare.nc")
    assert left.run_status == "failed"
    complete = left.status.values == "complete"
    assert [f"{s}-{n}" for s, n in zip(left["shape"].values[complete], left.seed.values[complete])] == list(survivors)
    assert np.array_equal(np.isfinite(left.friction_mean.values), complete)
    assert np.array_equal(left.friction_mean.values[complete], table.friction_mean.values[complete])
    metrics = json.loads((tmp_path / "summary.json").read_text())["metrics"]
    assert (metrics["friction_difference"]["value"] is not None) == (len(survivors) == 2)
    assert (tmp_path / "friction.png").exists()


@pytest.mark.validate
def test_an_interrupted_comparison_keeps_its_complete_runs(compared, tmp_path, monkeypatch):
    done, table, _ = compared

    def interrupted(jobs, at_a_time, progress, resume):
        shutil.copytree(done / "runs/round-2", tmp_path / "runs/round-2")
        raise signals.Interrupted(signal.SIGTERM)

    monkeypatch.setattr(compare_shapes, "run_replicas", interrupted)
    with pytest.raises(signals.Interrupted):
        compare_shapes.run(compare_shapes.Params(replicas=2, **SMALL), tmp_path)
    left = lsm.open_run(tmp_path / "compare.nc")
    assert left.run_status == "interrupted"
    assert list(left.status.values) == ["interrupted", "complete", "interrupted", "interrupted"]
    assert float(left.friction_mean[1]) == float(table.friction_mean[1])
