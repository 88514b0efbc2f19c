"""A run that is stopped and goes on writes the same bits as one that is not: for every experiment, at any step."""

import os
import shutil
import signal
from types import SimpleNamespace

import netCDF4
import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError
from tests.crash.random_kills import differences
from workflows import shear_gouge
from workflows.cli.main import main
from workflows.common import signals
from workflows.common.discovery import find_workflows
from workflows.common.metrics import read_summary
from workflows.common.parameters import merge
from workflows.common.run_folder import is_complete
from workflows.gouge import layer_run, subject
from workflows.plots import run_plots

# Smallest runs of the experiments; one that is not named here has parameters that need no telling.
LAYER = {"layer_thickness": 8, "length": 8, "inertial_number": 0.02, "strain": 1.3}
GAS = {"grains": 36, "steps": 200, "long_steps": 200, "seeds": 1, "order_seeds": 1, "order_grains": 36, "samples": 10}
SMALLEST = {
    "shear-gouge": LAYER,
    "compare-shapes": LAYER | {"replicas": 1},
    "energy-conservation": GAS,
    "hard-cases": {"kinds": ["steps", "lists"], "runs": "short", "precision": "f64"},
}
# Report at which each is stopped: the so many-th that it makes, or, of those in parts, that a part has ended.
STOPS = {"shear-gouge": 8, "compare-shapes": 3, "accuracy-cost": 2}
TIMED = {"seconds", "cost", "relative_cost"}  # variables that no two runs share
WORKFLOWS = find_workflows()


@pytest.fixture
def lsm_signals(monkeypatch):
    monkeypatch.setattr(signals, "SAME_REQUEST_S", 0.0)
    previous = signals.install()
    yield
    signals.restore(previous)


def stop_at(report_number, kind=None):
    """A progress that asks the process to end at its so many-th report, of those with the key `kind`."""
    count = 0

    def progress(report):
        nonlocal count
        counts = kind is None or kind in report
        count += counts
        if counts and count == report_number:
            os.kill(os.getpid(), signal.SIGTERM)

    return progress


def variables(folder):
    """Bytes of all variables of all files below a folder, but for times and names of folders."""
    found = {}
    for path in sorted(folder.rglob("*.nc")):
        with netCDF4.Dataset(path) as file:
            file.set_auto_mask(False)
            for name, variable in file.variables.items():
                if name not in TIMED | {"run"}:
                    values = np.asarray(variable[...])
                    text = values.dtype == object
                    found[path.relative_to(folder), name] = values.tolist() if text else values.tobytes()
    return found


@pytest.mark.usefixtures("lsm_signals")
def test_a_layer_stopped_in_its_shear_goes_on_to_the_same_bits(runtime, sheared, tmp_path):
    folder, params, _ = sheared("sphere")
    out = tmp_path / folder.name
    with pytest.raises(signals.Interrupted):
        shear_gouge.run(params, out, stop_at(30))
    stopped = lsm.open_run(out / "run.nc")
    assert stopped.run_status == "interrupted" and "shear" in stopped.stage.values
    assert len(stopped.time) < len(lsm.open_run(folder / "run.nc").time)
    shear_gouge.run(params, out, existing="resume")
    assert differences(out, folder) == []
    assert not list(out.glob("*checkpoint*"))


@pytest.mark.validate
@pytest.mark.usefixtures("lsm_signals")
def test_a_layer_stopped_in_any_stage_goes_on_to_the_same_bits(runtime, sheared, tmp_path):
    """In the consolidation, then in the shear; the last two checkpoints, the first of them damaged in between."""
    folder, params, _ = sheared("sphere")
    out = tmp_path / folder.name
    with pytest.raises(signals.Interrupted):
        shear_gouge.run(params, out, stop_at(4))
    assert lsm.open_run(out / "run.nc").run_status == "interrupted"
    assert set(lsm.open_run(out / "run.nc").stage.values) == {"generate", "consolidate"}
    with pytest.raises(signals.Interrupted):
        shear_gouge.run(params, out, stop_at(30), existing="resume")
    assert "shear" in lsm.open_run(out / "run.nc").stage.values
    (out / "checkpoint.nc").write_bytes((out / "checkpoint.nc").read_bytes()[:-3000])
    reports = []
    shear_gouge.run(params, out, reports.append, existing="resume")
    assert any("before the last one" in report.get("state", "") for report in reports)
    assert differences(out, folder) == []
    assert not list(out.glob("*checkpoint*"))
    assert lsm.open_run(out / "run.nc").history.count("resumed") == 2


@pytest.mark.validate
def test_a_complete_run_is_made_longer_to_the_same_bits(runtime, sheared, tmp_path):
    folder, params, _ = sheared("sphere")
    shorter = {"strain": params.steady_from + params.least_steady, "keep_checkpoint": True}
    out = tmp_path / folder.name
    shear_gouge.run(params.model_copy(update=shorter), out)
    shear_gouge.run(params, out, existing="resume")
    assert differences(out, folder) == [] and not list(out.glob("*checkpoint*"))
    with pytest.raises(InputError, match=r"^--strain 50: the run in .* is complete at .*with --keep-checkpoint"):
        shear_gouge.run(params.model_copy(update={"strain": 50.0}), out, existing="resume")
    with pytest.raises(InputError, match=r"^--strain 0\.4: must be >= 0\.5, that of the run in"):
        shear_gouge.run(params.model_copy(update={"strain": 0.4}), out, existing="resume")
    with pytest.raises(InputError, match=r"^--friction 0\.6: is 0\.5 in the run in .*, and cannot change"):
        shear_gouge.run(params.model_copy(update={"friction": 0.6}), out, existing="resume")
    assert (out / "summary.json").exists()


def state_of(folder):
    """Contents of all files below a folder."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_complete_run_is_analysed_anew_and_not_computed(sheared, tmp_path, monkeypatch):
    folder, params, _ = sheared("sphere")
    out = shutil.copytree(folder, tmp_path / folder.name)
    monkeypatch.setattr(lsm, "Simulation", None)
    later = params.model_copy(update={"steady_from": params.steady_from + 0.1, "format": "svg"})
    shear_gouge.run(later, out, existing="resume")
    assert (out / "run.svg").exists() and differences(out, folder) == []
    assert merge(shear_gouge.Params, None, out / "config.toml") == later
    assert (out / "summary.json").read_bytes() != (folder / "summary.json").read_bytes()


@pytest.mark.validate
@pytest.mark.usefixtures("lsm_signals")
def test_a_checkpoint_goes_on_only_in_the_files_and_with_the_parameters_of_its_run(runtime, sheared, tmp_path):
    """And a refusal leaves everything as it was."""
    folder, params, _ = sheared("sphere")
    out = tmp_path / folder.name
    with pytest.raises(signals.Interrupted):
        shear_gouge.run(params, out, stop_at(30))
    config, run = out / "config.toml", (out / "run.nc").read_bytes()
    text = config.read_text()
    edited = text.replace(f"\nrows_per_strain = {params.rows_per_strain}", "\nrows_per_strain = 45")
    assert edited != text
    for change, reason in (
        (lambda: config.write_text(edited), rf"rows_per_strain {params.rows_per_strain} where this run has 45"),
        (lambda: shutil.copy(folder / "run.nc", out / "run.nc"), r"is of another run than .*run\.nc"),
        (lambda: (out / "grains.nc").rename(tmp_path / "grains.nc"), r"grains\.nc: is missing"),
    ):
        change()
        before = state_of(out)
        wanted = merge(shear_gouge.Params, None, config)
        with pytest.raises(InputError, match=reason):
            shear_gouge.run(wanted, out, existing="resume")
        assert state_of(out) == before
        config.write_text(text)
        (out / "run.nc").write_bytes(run)
    config.write_text("")  # as of a disk that was full: the parameters are in run.nc too
    (tmp_path / "grains.nc").rename(out / "grains.nc")
    assert main(["resume", str(out), "--quiet"]) == 0
    assert differences(out, folder) == []


def test_a_run_that_is_killed_before_its_summary_keeps_its_times(sheared, tmp_path, monkeypatch):
    """Its checkpoint is removed last, and a summary of before goes with the file that it tells of."""
    folder, params, _ = sheared("sphere")
    out = shutil.copytree(folder, tmp_path / folder.name)
    before = read_summary(out)
    monkeypatch.setattr(run_plots, "plot_run", raise_interrupted)
    with pytest.raises(signals.Interrupted):  # analysed anew
        shear_gouge.run(params.model_copy(update={"steady_from": 0.25}), out, existing="resume")
    assert read_summary(out) == before
    order = []
    monkeypatch.setattr(subject, "build", lambda *_: SimpleNamespace())
    monkeypatch.setattr(lsm, "Simulation", lambda *_: SimpleNamespace(dt=1.0, keep_checkpoints=lambda *a, **k: None))
    monkeypatch.setattr(lsm, "ShearedLayer", lambda *_: SimpleNamespace(thickness=1.0))
    monkeypatch.setattr(layer_run, "_record", lambda *_: SimpleNamespace(grain_steps_per_second=1.0))
    monkeypatch.setattr(layer_run, "_conclude", lambda *_: order.append("summary"))
    monkeypatch.setattr(lsm.checkpoints, "remove_checkpoints", lambda _: order.append("removed"))
    shear_gouge.run(params, out, existing="overwrite")
    assert order == ["summary", "removed"]


def raise_interrupted(*_):
    raise signals.Interrupted(signal.SIGTERM)


def test_a_run_that_goes_on_is_not_complete_though_its_old_summary_says_so(sheared, tmp_path):
    folder, _, _ = sheared("sphere")
    out = shutil.copytree(folder, tmp_path / "copy")
    assert is_complete(out)
    with netCDF4.Dataset(out / "run.nc", "a") as file:
        file.run_status = "running"
    assert not is_complete(out)


def test_a_mistake_in_the_config_of_a_run_is_told(sheared, tmp_path, capsys):
    """And not passed over for what run.nc holds, nor written over."""
    folder, _, _ = sheared("sphere")
    out = shutil.copytree(folder, tmp_path / "copy")
    text = (out / "config.toml").read_text().replace("strain = 0.5", "strain = 0,5")
    (out / "config.toml").write_text(text)
    assert main(["resume", str(out)]) == 2 and "config.toml: is not valid TOML" in capsys.readouterr().err
    assert (out / "config.toml").read_text() == text


def test_lsm_resume_names_what_it_cannot_do(sheared, tmp_path, capsys):
    folder, _, _ = sheared("sphere")
    out = shutil.copytree(folder, tmp_path / "copy")
    assert main(["resume", str(out)]) == 0 and "nothing to go on with" in capsys.readouterr().out
    for words, message in (
        (["resume", str(tmp_path)], "holds no config.toml, must be the folder of a run"),
        (["resume", "--threads", "2", str(out)], "--threads: the folder of the run comes first"),
        (["resume", str(out), "--out", "elsewhere"], "--out: must not be given to resume"),
        (["resume", str(out), "--strian", "3"], "Unknown option"),
        (["resume", str(out), "--dim", "3"], "--dim 3: is 2 in the run in"),
    ):
        assert main(words) == 2
        assert message in capsys.readouterr().err
    (out / "config.toml").write_text('experiment = "sorting"\n')
    assert main(["resume", str(out)]) == 2 and "holds a run of sorting" in capsys.readouterr().err


def test_a_file_of_a_run_repeats_it(sheared):
    folder, params, _ = sheared("sphere")
    again = merge(shear_gouge.Params, None, folder / "run.nc", experiment="shear-gouge")
    assert again == params


@pytest.mark.validate
@pytest.mark.usefixtures("lsm_signals")
@pytest.mark.parametrize("name", sorted(WORKFLOWS))
def test_every_experiment_goes_on_to_the_same_results(name, tmp_path):
    """Stopped after its first result, or in the midst of a layer."""
    module = WORKFLOWS[name]
    params = merge(module.Params, "smoke", options=SMALLEST.get(name, {}))
    whole, stopped = tmp_path / "whole" / name, tmp_path / "stopped" / name
    module.run(params, whole)
    with pytest.raises(signals.Interrupted):
        module.run(params, stopped, stop_at(STOPS[name]) if name in STOPS else stop_at(1, "ended"))
    assert not is_complete(stopped)
    assert main(["resume", str(stopped), "--quiet"]) in (0, 1)  # 1: a hard case that fails
    mine, theirs = variables(stopped), variables(whole)
    assert mine.keys() == theirs.keys()
    assert [key for key in mine if mine[key] != theirs[key]] == []
    assert not (stopped / "parts").exists()
