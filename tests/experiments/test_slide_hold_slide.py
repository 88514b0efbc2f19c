"""Slide-hold-slide: what a run tells of its hold, how that grows with its time, and that all holds begin alike."""

import netCDF4
import numpy as np
import pytest
import xarray as xr

import taichi_lsm as lsm
from workflows import shear_gouge, slide_hold_slide
from workflows.gouge import layer_cost
from workflows.gouge.forks import fork
from workflows.gouge.hold_response import COLUMNS, healing_of, response_to_hold

D = 1e-4


def held(peak=0.4, steady=0.3):
    """run.nc of a layer that slides at 0.3, relaxes to 0.25, compacts by 0.01, and peaks 0.1 diameters later."""
    slide, hold, again = 100, 30, 200
    slip = np.concatenate([np.linspace(0.0, 2.0, slide), np.full(hold, 2.0), 2.0 + np.linspace(0.01, 1.0, again)]) * D
    after = slip[-again:] / D - 2.0
    friction = np.concatenate([
        np.linspace(0.0, steady, slide // 2), np.full(slide // 2, steady), np.linspace(steady, 0.25, hold),
        steady + (peak - steady) * (after / 0.1) * np.exp(1.0 - after / 0.1),
    ])  # fmt: skip
    porosity = np.concatenate([np.full(slide, 0.2), 0.2 - 0.01 * np.linspace(0, 1, hold), np.full(again, 0.2)])
    stage = ["run-in"] * slide + ["hold"] * hold + ["reload"] * again
    data = {"displacement": slip, "shear_strain": slip / D, "porosity": porosity, "platen_shear_stress": friction * 5e6}
    data |= {"platen_normal_stress": np.full(len(slip), 5e6)}
    run = xr.Dataset({name: ("time", values) for name, values in data.items()}, {"stage": ("time", stage)})
    return run.assign_attrs(run_status="complete")


def test_a_hold_has_its_relaxation_compaction_and_peak():
    found = response_to_hold(held(), D, within=0.3)
    assert found["steady_friction"] == pytest.approx(0.3)
    assert found["peak_friction"] == pytest.approx(0.4, abs=2e-3) and found["peak_slip"] == pytest.approx(
        0.1 * D, rel=0.2
    )
    assert found["healing"] == pytest.approx(0.1, abs=2e-3)
    assert found["relaxation"] == pytest.approx(0.05) and found["compaction"] == pytest.approx(0.01)
    later = held()
    later.platen_shear_stress[-1:] = 0.9 * 5e6  # noise, far from the hold
    assert response_to_hold(later, D, within=0.3)["peak_friction"] == pytest.approx(0.4, abs=2e-3)
    assert np.isnan(response_to_hold(held().assign_attrs(run_status="interrupted"), D, 0.3)["healing"])


def test_the_peak_is_found_however_far_a_layer_slides_after_it():
    far = held()
    far["displacement"] = far.displacement.where(far.displacement < 2.95 * D, 60.0 * D)
    assert response_to_hold(far, D, within=0.3)["peak_friction"] == pytest.approx(0.4, abs=2e-3)


def test_every_run_of_a_hold_starts_anew():
    """Two run-ins and eight holds, two at a time: each loads its kernels."""
    params = slide_hold_slide.Params(**slide_hold_slide.Params.presets["smoke"])
    expected = slide_hold_slide.estimate(params).seconds
    assert expected > 5 * layer_cost.start_seconds(params) > 0.5 * expected


def table(seeds=6, slope=0.01, noise=0.002, of_seed=0.02, seed=1):
    """healing.nc of seeds whose healing has one slope per decade, each at a level of its own."""
    rng, rows = np.random.default_rng(seed), []
    for number in range(seeds):
        own = of_seed * rng.normal()
        for hold in (0.0, 10.0, 100.0, 1000.0, 10000.0):
            value = own + (slope * np.log10(hold) if hold else -0.05) + noise * rng.normal()
            rows.append((number, hold, value))
    columns = {c.name: ("run", np.full(len(rows), 0.1)) for c in COLUMNS}
    for i, name in enumerate(("seed", "hold_inertial_times", "healing")):
        columns[name] = ("run", np.array([row[i] for row in rows]))
    return xr.Dataset(columns)


def test_healing_grows_with_the_logarithm_of_the_hold():
    """What the holds of a seed share neither blurs the slope nor makes chi square small."""
    found = [healing_of(table(seed=seed)) for seed in range(40)]
    slopes = np.array([one.line.per_decade.mean for one in found])
    errors = np.array([one.line.per_decade.standard_error for one in found])
    assert slopes.mean() == pytest.approx(0.01, abs=2e-4)
    assert slopes.std() == pytest.approx(errors.mean(), rel=0.3)
    assert np.mean([one.line.chi_square / one.line.degrees_of_freedom for one in found]) == pytest.approx(1.0, abs=0.4)
    assert list(found[0].hold) == [10.0, 100.0, 1000.0, 10000.0]
    unfinished = table()
    unfinished["healing"][7] = np.nan  # of the second seed, which is left out
    assert healing_of(unfinished).line.per_decade.mean == pytest.approx(0.01, abs=1e-3)
    assert healing_of(table(seeds=1)) is None


SMALL = {"layer_thickness": 8, "length": 8, "inertial_number": 0.02, "run_in": 0.1, "reload_slip": 0.4}
SMALL |= {"holds": 3, "shortest_hold": 3.0, "longest_hold": 12.0, "replicas": 2}


def same_rows(one, other):
    names = ("time", "friction", "displacement", "stage_slip", "energy_residual")
    return all(np.array_equal(one[name].values, other[name].values, equal_nan=True) for name in names)


@pytest.mark.validate
def test_a_branch_is_the_run_that_goes_through_all_its_stages_at_once(runtime, tmp_path, monkeypatch):
    """Bit for bit, though the run-in is made once for all branches."""
    monkeypatch.setattr(shear_gouge.run_plots, "plot_run", lambda *_: None)
    trunks, branches = slide_hold_slide.build(slide_hold_slide.Params(**SMALL))
    assert list(trunks) == ["seed-1", "seed-2"] and len(branches) == 8
    trunk, hold, params = branches["seed-1-hold-12"]
    assert (trunk, hold) == ("seed-1", 12.0)
    before = shear_gouge.run(trunks[trunk], tmp_path / "trunk")
    fork(tmp_path / "trunk", tmp_path / "branch")
    assert lsm.open_run(tmp_path / "branch" / "run.nc").run_status == "interrupted"  # its hold is still to come
    branch = shear_gouge.run(params, tmp_path / "branch", existing="resume")
    assert same_rows(branch.isel(time=slice(before.sizes["time"])), before)
    assert same_rows(branch, shear_gouge.run(params, tmp_path / "whole"))
    assert not (tmp_path / "branch" / "checkpoint.nc").exists() and (tmp_path / "trunk" / "checkpoint.nc").exists()


@pytest.mark.validate
def test_all_holds_of_a_seed_begin_with_the_same_bits(tmp_path):
    found = slide_hold_slide.run(slide_hold_slide.Params(**SMALL), tmp_path)
    assert found.sizes["run"] == 2 * 4 and set(found.status.values) == {"complete"}
    assert (tmp_path / "healing.png").stat().st_size > 10_000
    for seed in (1, 2):
        trunk = lsm.open_run(tmp_path / "runs" / f"seed-{seed}" / "run.nc")
        own = found.isel(run=found.seed.values == seed)
        for path in own.path.values:
            assert same_rows(lsm.open_run(tmp_path / path / "run.nc").isel(time=slice(trunk.sizes["time"])), trunk)
        assert len(set(own.steady_friction.values)) == 1


def test_only_a_run_that_kept_its_checkpoint_can_be_forked(tmp_path):
    (tmp_path / "trunk").mkdir()
    (tmp_path / "trunk" / "config.toml").touch()
    with pytest.raises(
        lsm.InputError, match=r"has no run\.nc, grains\.nc, checkpoint\.nc, must be a complete run with"
    ):
        fork(tmp_path / "trunk", tmp_path / "branch")
    assert not (tmp_path / "branch").exists()
    for name in ("run.nc", "grains.nc", "checkpoint.nc"):
        with netCDF4.Dataset(tmp_path / "trunk" / name, "w") as file:
            file.run_status = "complete"
    fork(tmp_path / "trunk", tmp_path / "branch")
    (tmp_path / "branch" / "run.nc").write_text("longer")
    fork(tmp_path / "trunk", tmp_path / "branch")  # one that is there stays
    assert (tmp_path / "branch" / "run.nc").read_text() == "longer"
