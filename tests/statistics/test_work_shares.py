"""Where the work went, in synthetic runs whose shares are known."""

import numpy as np
import pytest
import xarray as xr

from taichi_lsm import InputError, open_run
from taichi_lsm.io.run_file import RunWriter
from taichi_lsm.measure.layer_rows import layer_rows
from taichi_lsm.statistics import work_by_stage, work_partition


def run(rows=400, seed=1):
    """Friction dissipates three quarters, damping one quarter, of powers that fluctuate alike; 1 J is stored in all."""
    rng = np.random.default_rng(seed)
    lost = np.cumsum(np.array([0.75, 0.25]) + 0.1 * rng.normal(size=(rows, 2)), axis=0)
    time = np.arange(rows, dtype=float)
    stored = time / (rows - 1)
    series = {"translational_energy": 0 * time, "rotational_energy": 0 * time, "elastic_energy": stored}
    series["external_work"] = lost.sum(axis=1) + stored + 0.01 * time
    data = {name: ("time", values) for name, values in series.items()}
    data["dissipated_energy"] = (("time", "effect"), lost)
    coords = {"time": time, "shear_strain": ("time", time / 100.0)}
    return xr.Dataset(data, coords | {"effect_name": ("effect", ["coulomb_friction", "viscous_damping"])})


def test_shares_of_a_window():
    full = run()
    found = work_partition(full, 1.0, 3.0)
    lost = full.dissipated_energy.values
    assert found.dissipated_energy.values == pytest.approx(lost[300] - lost[100])
    assert found.share.sel(effect="coulomb_friction") == pytest.approx(0.75, abs=0.03)
    assert float(found.share.sum()) == pytest.approx(1.0)
    assert float(found.stored_energy) == pytest.approx(200 / 399)
    assert float(found.energy_residual) == pytest.approx(0.01 * 200)


def test_shares_of_a_run_file(tmp_path):
    """As run.nc is written, with its labels of effects and stages."""
    rows = [row for row in layer_rows() if row.name in run().variables]
    path, full = tmp_path / "run.nc", run(rows=30)
    labels = {"effect": list(full.effect_name.values)}
    stage = {"stage": "stage of the run"}
    writer = RunWriter(path, rows, {}, labels, auxiliary=("shear_strain",), text=stage)
    for i in range(30):
        writer.append({name: full[name].values[i] for name in ("time", *(v.name for v in rows))} | {"stage": "shear"})
    writer.close("complete")
    found = work_partition(open_run(path))
    assert found.share.values == pytest.approx(work_partition(full).share.values)
    assert list(found.effect.values) == ["coulomb_friction", "viscous_damping"]


def test_errors_of_shares_cover():
    found = [work_partition(run(seed=seed)) for seed in range(60)]
    pull = [(float(f.share[0]) - 0.75) / float(f.share_error[0]) for f in found]
    assert np.std(pull) == pytest.approx(1.0, abs=0.25) and abs(np.mean(pull)) < 0.4


def test_work_of_a_stage_is_what_its_rows_lost():
    """What a row lost since the row before belongs to the stage of that row, also at the begin of a stage."""
    lost = np.array([[0.0, 0.0], [1.0, 1.0], [3.0, 1.0], [3.0, 5.0], [6.0, 6.0]])
    data = {"dissipated_energy": (("time", "effect"), lost), "stage": ("time", ["a", "a", "b", "b", "a"])}
    found = work_by_stage(xr.Dataset(data, {"effect_name": ("effect", ["friction", "damping"])}))
    assert found.dissipated_energy.sel(stage="a").values == pytest.approx([4.0, 2.0])
    assert found.dissipated_energy.sel(stage="b").values == pytest.approx([2.0, 4.0])
    assert found.share.sel(stage="b", effect="damping") == pytest.approx(2 / 3)
    with pytest.raises(InputError, match="has no stage"):
        work_by_stage(run())


def test_windows_without_rows_or_losses_are_refused():
    with pytest.raises(InputError, match="0 rows between them"):
        work_partition(run(), 10.0, 11.0)
    with pytest.raises(InputError, match="must be below the second"):
        work_partition(run(), 2.0, 1.0)
    with pytest.raises(InputError, match="has no external_work"):
        work_partition(run().drop_vars("external_work"))
    still = run()
    still["dissipated_energy"] = 0.0 * still.dissipated_energy
    with pytest.raises(InputError, match="0 J dissipated"):
        work_partition(still)
    assert np.isnan(work_partition(run(), 0.0, 0.05).share_error).all()
