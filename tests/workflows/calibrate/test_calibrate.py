"""`lsm calibrate` of a toy on workers of this machine: files, going on, other targets of the same runs."""

import json

import numpy as np
import pytest
import xarray

from workflows.cli.main import main

pytestmark = pytest.mark.usefixtures("noisy")

FILE = """
experiment = "noisy-run"
scatter = 0.001
[calibrate]
runs = 6
batch = 2
priors.length = {from = 0.1, to = 4.0}
targets.height = {value = 5.0, error = 0.05}
"""


@pytest.mark.validate
def test_a_calibration_of_runs_gives_the_parameter_and_goes_on(tmp_path, capsys):
    """height = 2.5 length, so that 5 m are given by 2 m, with an error of 0.05/2.5."""
    file, out = tmp_path / "study.toml", tmp_path / "out"
    file.write_text(FILE)
    command = ["calibrate", str(file), "--out", str(out), "-j", "1", "--quiet"]
    assert main(command) == 0
    assert capsys.readouterr().err == ""
    summary = json.loads((out / "summary.json").read_text())
    metrics = {name: entry["value"] for name, entry in summary["metrics"].items()}
    assert metrics["length"] == pytest.approx(2.0, abs=0.02) and metrics["length_error"] == pytest.approx(0.02, rel=0.2)
    assert summary["metrics"]["length"]["unit"] == "m" and abs(metrics["height_misfit"]) < 0.5
    assert metrics["runs"] == metrics["used"] == 6
    with xarray.open_datatree(out / "posterior.nc") as tree:
        assert set(tree.children) >= {"posterior", "prior", "observed_data", "posterior_predictive"}
        draws = tree["posterior"].length
        assert draws.dims == ("chain", "draw") and draws.units == "m" and draws.long_name == "length of the layer"
        assert float(draws.mean()) == pytest.approx(metrics["length"], rel=1e-3)
        assert float(tree["posterior_predictive"].height.std()) == pytest.approx(0.05 * np.sqrt(2.0), rel=0.15)
        assert float(tree["observed_data"].height) == 5.0 and tree["observed_data"].height.units == "m"
        assert "noisy-run" in tree.attrs["title"] and tree.attrs["config_toml"] == FILE
    assert (out / "calibration.png").stat().st_size > 10_000

    # Other targets, and what is out of reach, from the runs that are there.
    runs = {path: path.stat().st_mtime_ns for path in out.glob("batches/*/runs/*/summary.json")}
    file.write_text(FILE.replace("value = 5.0", "value = 50.0"))
    assert main(command) == 0
    said = capsys.readouterr().err
    assert "no parameters within the priors give height = 50: the nearest is " in said
    assert {path: path.stat().st_mtime_ns for path in out.glob("batches/*/runs/*/summary.json")} == runs
    assert len(runs) == 6
    file.write_text(FILE.replace("scatter = 0.001", "scatter = 0.002"))
    assert main(command) == 2 and "holds another calibration" in capsys.readouterr().err


def test_mistakes_end_before_a_folder_is_made(tmp_path, capsys):
    file, out = tmp_path / "study.toml", tmp_path / "out"
    file.write_text(FILE.replace("priors.length", "priors.lengths"))
    assert main(["calibrate", str(file), "--out", str(out)]) == 2
    assert "priors.lengths: unknown parameter. Did you mean length?" in capsys.readouterr().err
    assert main(["calibrate", str(file), "--out", str(out), "-j", "0"]) == 2
    assert not out.exists()
