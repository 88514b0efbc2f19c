"""Runs that write contacts and snapshots often: the same motion, the same files after a stop, events in their rows."""

import signal

import netCDF4
import numpy as np
import pytest

import taichi_lsm as lsm
from tests.crash.random_kills import contents, differences
from workflows import shear_cell, shear_gouge, stick_slip
from workflows.common import signals
from workflows.gouge import layer_run

pytestmark = pytest.mark.validate  # scenes that keep losses compile anew
LAYER = {"layer_thickness": 8, "length": 8, "inertial_number": 0.02, "strain": 0.6, "steady_from": 0.2}
OFTEN = {"contacts": ["every=0.05", "stages"], "snapshots": ["every=0.02"]}


def moments_of(path):
    """(contacts.nc, its moments with their rows)."""
    dataset = lsm.open_run(path)
    ends = np.cumsum(dataset.row_size.values)
    rows = [dataset.isel(time=i, contact=slice(e - int(dataset.row_size[i]), e)) for i, e in enumerate(ends)]
    return dataset, rows


def stopped(monkeypatch, module, params, out, share, last_step):
    """Run, stop at a share of the steps, go on."""
    stop = int(share * last_step)

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
        module.run(params, out)
    module.run(params, out, existing="resume")


def test_a_layer_writes_what_is_asked_for_and_moves_as_without(runtime, tmp_path, monkeypatch):
    plain, often = tmp_path / "plain" / "run", tmp_path / "often" / "run"
    shear_gouge.run(shear_gouge.Params(**LAYER), plain)
    params = shear_gouge.Params(**LAYER, **OFTEN)
    run = shear_gouge.run(params, often)
    same = contents(plain / "run.nc"), contents(often / "run.nc")
    assert all(same[0][name] == same[1][name] for name in same[0] if name not in ("contacts", "snapshots", "run"))
    assert not (plain / "contacts.nc").exists()
    contacts, moments = moments_of(often / "contacts.nc")
    # At the end of the consolidation, at 0.05, 0.1 ... 0.55 and at the end.
    assert contacts.stage.values.tolist() == ["consolidate"] + ["shear"] * 12 and contacts.run_status == "complete"
    assert contacts.sliding.flag_meanings == "sticking sliding" and contacts.bonded.flag_meanings == "contact bond"
    strain = contacts.shear_strain.values[1:]
    assert np.floor(strain / 0.05 + 1e-9).astype(int).tolist() == list(range(1, 13))
    assert contacts.sizes["time"] == len(moments) and contacts.attrs["id"] == run.attrs["id"]
    assert set(contacts.time.values) <= set(run.time.values)
    snapshots = lsm.open_run(often / "grains.nc")
    assert snapshots.sizes["time"] == 2 + 30 and lsm.open_run(plain / "grains.nc").sizes["time"] == 3
    for moment in moments[1:]:
        row = run.sel(time=float(moment.time))
        mobile = lsm.open_run(plain / "grains.nc").kind.values == 0
        touches_mobile = mobile[moment.first_id.values] | mobile[moment.second_id.values]
        assert 0.8 < touches_mobile.sum() / float(row.contact_count) < 1.2  # a mean over samples
        assert (moment.dissipated_power.sum() + moment.parted_power) > 0.0
    stopped(monkeypatch, shear_gouge, params, tmp_path / "stopped" / "run", 0.6, run.time[-1] / run.dt)
    assert differences(tmp_path / "stopped" / "run", often) == []


def test_a_sheared_cell_knows_its_height_at_each_moment(runtime, tmp_path, monkeypatch):
    small = {"cell_height": 10.0, "length": 10.0, "inertial_number": 0.02, "strain": 0.6, "steady_from": 0.2}
    params = shear_cell.Params(**small, contacts=["every=0.1"])
    run = shear_cell.run(params, tmp_path / "whole" / "run")
    _, moments = moments_of(tmp_path / "whole" / "run" / "contacts.nc")
    assert len(moments) == 7
    force = moments[-1].normal_force * moments[-1].normal + moments[-1].tangential_force
    volume = float(moments[-1].cell_height) * params.layer[1][0] * params.diameter
    stress = force.values.T @ moments[-1].branch.values / volume
    assert stress[1, 1] == pytest.approx(params.normal_stress, rel=0.2) and stress[0, 1] < 0.0
    stopped(monkeypatch, shear_cell, params, tmp_path / "stopped" / "run", 0.7, run.time[-1] / run.dt)
    assert differences(tmp_path / "stopped" / "run", tmp_path / "whole" / "run") == []


def test_breaking_bonds_are_events(runtime, tmp_path):
    layer = {**LAYER, "length": 10, "shape": "angular", "breakable": True, "pieces": 3, "bond_strength": 2.0}
    params = shear_gouge.Params(**layer, contacts=["events"])
    run = shear_gouge.run(params, tmp_path / "run")
    contacts, moments = moments_of(tmp_path / "run" / "contacts.nc")
    broke = np.diff(run.bond_count.values, prepend=run.bond_count.values[0]) < 0
    assert broke.sum() > 2 and np.array_equal(contacts.time.values, run.time.values[broke])
    for moment in moments:
        intact = int(run.bond_count.sel(time=float(moment.time)))
        bonds = moment.isel(contact=moment.bonded.values == 1)
        assert bonds.sizes["contact"] == intact and not np.isfinite(bonds.overlap).any()
        assert bonds.dissipative_normal_force.values == pytest.approx(0.0, abs=0.0)


def test_slip_events_have_a_moment_at_their_first_and_last_row(runtime, tmp_path):
    smoke = {name: value for name, value in stick_slip.Params.presets["smoke"].items() if name != "width"}
    params = stick_slip.Params(**smoke, contacts=["events"], snapshots=["events"])
    run = stick_slip.run(params, tmp_path / "run")
    contacts, _ = moments_of(tmp_path / "run" / "contacts.nc")
    assert contacts.sizes["time"] > 2
    slipping, expected = False, []
    for row in range(run.sizes["time"]):
        if run.stage.values[row] in ("generate", "consolidate"):
            continue
        load = float(run.load_point_velocity[row])
        fast = abs(float(run.plate_velocity[row])) > (load if slipping else 10.0 * load)
        expected += [float(run.time[row])] * (fast != slipping)
        slipping = fast
    assert contacts.time.values.tolist() == expected
    with netCDF4.Dataset(tmp_path / "run" / "grains.nc") as grains:
        assert set(expected) <= set(np.asarray(grains["time"][:]).tolist())
