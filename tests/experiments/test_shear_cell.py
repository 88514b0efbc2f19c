"""shear-cell on small cells: what it writes, what it holds, going on to the same bits, constant volume, refusals."""

import json
import signal
import warnings

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.crash.random_kills import differences
from workflows import shear_cell
from workflows.common import signals
from workflows.common.parameters import merge
from workflows.gouge import layer_run

SMALL = {"cell_height": 10.0, "length": 10.0, "inertial_number": 0.02, "strain": 1.5, "steady_from": 0.5}


@pytest.fixture(scope="module")
def small(runtime, tmp_path_factory):
    """(folder, parameters, run.nc) of a small cell of discs."""
    folder, params = tmp_path_factory.mktemp("cell") / "small", shear_cell.Params(**SMALL)
    return folder, params, shear_cell.run(params, folder)


def test_a_run_holds_its_stress_and_closes_its_budget(small):
    folder, params, dataset = small
    summary = json.loads((folder / "summary.json").read_text())["metrics"]
    for name, bound in shear_cell.BOUNDS.items():
        assert summary[name]["holds"] and summary[name]["bound"] == bound, (name, summary[name])
    assert 0.15 < summary["friction_mean"]["value"] < 0.45
    assert 0.75 < summary["solid_fraction"]["value"] < 0.86
    assert summary["inertial_number"]["value"] == pytest.approx(0.02, rel=0.02)
    assert {path.name for path in folder.iterdir()} == {"config.toml", "run.nc", "grains.nc", "run.png", "summary.json"}
    assert dataset.title == "Shear of a cell of discs in 2D"
    assert float(dataset.shear_strain[-1]) == pytest.approx(params.strain, abs=0.02)
    stages = [str(stage) for stage in dict.fromkeys(dataset.stage.values)]
    assert stages == ["generate", "consolidate", "shear"]
    grains = lsm.open_run(folder / "grains.nc")
    assert grains.sizes["grain"] == len(grains.mass) and float(grains.cell_height[-1]) < float(grains.cell_height[0])
    # The velocities in the file follow the mean flow.
    last = grains.isel(time=-1)
    slope = np.polyfit(last.position.values[:, 1], last.velocity.values[:, 0], 1)[0]
    assert slope == pytest.approx(float(last.cell_shear_rate), rel=0.3)


@pytest.mark.validate
@pytest.mark.parametrize("share", [0.2, 0.7])
def test_a_stopped_run_goes_on_to_the_same_bits(small, tmp_path, monkeypatch, share):
    folder, params, dataset = small
    stop = int(share * float(dataset.time[-1]) / dataset.dt)
    out = tmp_path / folder.name

    class Stopping(layer_run.RunLoop):
        def _advance(self, pending):
            if self.sim.step < stop <= self.position.next_sample:
                self.sim.run(stop - self.sim.step)
                pending.signum = int(signal.SIGTERM)
            super()._advance(pending)

    monkeypatch.setattr(layer_run, "RunLoop", Stopping)
    monkeypatch.setattr(signals, "SAME_REQUEST_S", 0.0)
    signals.install()
    with pytest.raises(signals.Interrupted):
        shear_cell.run(params, out)
    shear_cell.run(params, out, existing="resume")
    assert differences(out, folder) == []


@pytest.mark.validate
@pytest.mark.parametrize("more", [{}, {"shape": "angular"}, {"dim": 3, "width": 5.0, "cell_height": 8.0}])
def test_constant_volume_has_the_solid_fraction(tmp_path, more):
    fraction = {"angular": 0.72}.get(more.get("shape"), 0.78 if more.get("dim", 2) == 2 else 0.55)
    params = shear_cell.Params(**SMALL | more | {"solid_fraction": fraction, "strain": 1.0, "steady_from": 0.3})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        dataset = shear_cell.run(params, tmp_path / "run")
    rows = dataset.isel(time=dataset.stage.values == "shear")
    assert 1.0 - rows.porosity.values == pytest.approx(fraction, rel=1e-6)
    assert np.ptp(rows.cell_height.values) < 1e-12 and (rows.cell_normal_stress > 0.0).any()
    metrics = json.loads((tmp_path / "run" / "summary.json").read_text())["metrics"]
    assert "normal_stress_rms" not in metrics and metrics["energy_residual"]["holds"]


@pytest.mark.validate
def test_no_angular_grain_is_thrown_through_a_cell_in_single_precision(tmp_path):
    # Features that had no normal one step before their contact once got an onset impulse, which threw a grain.
    given = {"shape": "angular", "dim": 3, "precision": "f32", "strain": 1.6}
    dataset = shear_cell.run(merge(shear_cell.Params, "smoke", options=given), tmp_path / "run")
    assert dataset.run_status == "complete" and float(dataset.deepest_overlap.max()) < 0.5
    metrics = json.loads((tmp_path / "run" / "summary.json").read_text())["metrics"]
    assert metrics["energy_residual"]["holds"]


def test_what_gives_no_cell_is_refused():
    with pytest.raises(lsm.InputError, match=r"strain 1.5 must be >= steady_from 1.4 .*needs 12 rows"):
        shear_cell.Params(**SMALL | {"steady_from": 1.4})
    with pytest.raises(lsm.InputError, match=r"effects: refused, as Scene.cell_servo: .*gravity.*the mean flow"):
        shear_cell.check(shear_cell.Params(**SMALL, effects=[{"name": "gravity", "acceleration": [0.0, -9.81]}]))
    with pytest.raises(lsm.InputError, match=r"--solid-fraction 0.2: the grains fill .* of the cell before"):
        shear_cell.build(shear_cell.Params(**SMALL, solid_fraction=0.2))
