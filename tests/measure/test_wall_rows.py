"""Columns of run.nc of plane walls: what they mean, that a file takes them, and that a layer with walls has them."""

from types import SimpleNamespace

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes
from tests.helpers.output_files import attributes

ROOT_HALF = np.sqrt(0.5)


def two_walls():
    """What stands for a simulation with a floor and a slope, whose forces in every step are known."""
    force = np.array([[30.0, -400.0], [5.0, -7.0]])
    still = {
        "point": np.array([[0.0, 1.0], [2.0, 3.0]]),
        "normal": np.array([[0.0, 1.0], [-ROOT_HALF, ROOT_HALF]]),
        "displacement": np.array([[0.0, 0.5], [0.0, 0.0]]),
        "velocity": np.array([[0.1, 0.2], [0.0, 0.0]]),
        "work": np.array([3.0, 4.0]),
    }
    sim = SimpleNamespace(step=100, time=1.0, scene=SimpleNamespace(dim=2), force=force)
    walls = SimpleNamespace(names=["floor", "slope"], servos=None)
    walls.snapshot = lambda: still | {"force": sim.force, "force_sum": sim.force * sim.step}
    sim.walls = walls
    return sim


def test_a_row_has_normal_and_tangential_forces_of_the_steps_since_the_last_one():
    sim = two_walls()
    series = lsm.WallSeries(sim)
    now = series.row()  # no step since: the force of now
    sim.step = 150
    row = series.row()
    for found in (now, row):
        assert found["wall_normal_force"] == pytest.approx([400.0, 12.0 * ROOT_HALF])
        assert found["wall_tangential_force"] == pytest.approx(np.array([[30.0, 0.0], [-1.0, -1.0]]))
    assert row["wall_position"] == pytest.approx(np.array([[0.0, 1.5], [2.0, 3.0]]))
    assert set(row) == {variable.name for variable in series.variables}
    sim.force, sim.step = 3.0 * sim.force, 200  # the sum is 3 * 200 times the first force, it was 150 times that
    assert series.row()["wall_normal_force"][0] == pytest.approx(400.0 * (600 - 150) / 50)


def test_a_script_writes_the_columns_to_its_file(tmp_path):
    sim = two_walls()
    series = lsm.WallSeries(sim)
    file = lsm.RunWriter(tmp_path / "run.nc", series.variables, attributes(), series.coordinates)
    file.append({"time": sim.time, **series.row()})
    file.close("complete")
    run = lsm.open_run(tmp_path).run
    assert list(run.wall_name.values) == ["floor", "slope"] and run.wall_normal_force.attrs["units"] == "N"
    assert run.wall_tangential_force.dims == ("time", "wall", "space")
    assert run.wall_normal_force.values[0] == pytest.approx([400.0, 12.0 * ROOT_HALF])
    sim.walls = None
    with pytest.raises(lsm.InputError, match="WallSeries: the simulation has no plane walls"):
        lsm.WallSeries(sim)


@pytest.mark.validate
def test_a_layer_between_walls_has_their_columns_and_its_budget_is_closed(runtime, tmp_path):
    """Discs between two platens and two walls, of which a servo presses one against them."""
    column, row = (index.ravel() for index in np.meshgrid(np.arange(5), np.arange(5)))
    platen = np.select([row == 0, row == 4], [0, 1], -1)
    press = lsm.WallServo(force=4e3, stiffness=1e6, inertia=2e3, speed_limit=1.0)
    drives = [lsm.Fixed(), lsm.ServoStress(1e3, 1, 1e6, 4e3, 1.0)]
    sim = scenes.simulate(
        scenes.scene(
            1.02 * np.stack([column + 0.5 * (row % 2), row], axis=1),
            scenes.frictional(1e6),
            platen_index=platen,
            platens=[lsm.Platen("lower", [lsm.Fixed(), lsm.Fixed()]), lsm.Platen("upper", drives)],
            area=5.0,
            walls=[
                lsm.PlaneWall("left", (-0.55, 0.0), (1.0, 0.0)),
                lsm.PlaneWall("right", (5.2, 0.0), (-1.0, 0.0), servo=press),
            ],
        )
    )
    layer = lsm.ShearedLayer(sim, 1e3, 1.0)
    with lsm.LayerRecorder(tmp_path, layer, "Layer", "Between walls", "", 1) as recorder:
        for _ in range(3):
            sim.run(8000)
            layer.sample()
            recorder.row()
    run, now = lsm.open_run(tmp_path).run, lsm.energies(sim)
    assert list(run.wall_name.values) == ["left", "right"]
    left, right = run.wall_normal_force.values[-1]
    assert right == pytest.approx(press.force, rel=1e-3) and 0.1 * right < left < right  # the platens take the rest
    assert run.wall_work.values[-1, 1] == pytest.approx(press.force * (5.2 - run.wall_position.values[-1, 1, 0]))
    lost = float(run.dissipated_energy.values[-1].sum())
    assert lost == pytest.approx(now.dissipated, rel=1e-12) and lost > 0.1 * run.wall_work.values[-1, 1] > 0.0
    assert abs(run.energy_residual.values[-1]) < 1e-3 * now.work
