"""The launches of a GPU, made by the CPU, give the bits of a team of threads: with boundaries of every kind."""

from dataclasses import replace

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.stepping.step_loop_cpu import StepLoopCPU
from taichi_lsm.stepping.step_loop_gpu import StepLoopGPU
from tests.helpers import scenes
from tests.helpers.bits_run import touching_contacts

STEPS = 500
K = 1e6


def arcs_between_platens_and_walls():
    """20 angular grains in four rows: a fixed platen, two rows that fly about, a driven platen; walls at the sides."""
    rng = np.random.default_rng(11)
    column, row = (index.ravel() for index in np.meshgrid(np.arange(5), np.arange(4)))
    platen = np.select([row == 0, row == 3], [0, 1], -1)
    shapes = lsm.shapes.random_angular_shapes(4, 3)
    return scenes.scene(
        1.3 * np.stack([column + 0.5, row], axis=1),
        scenes.frictional(K),
        shapes=shapes,
        shape_index=np.arange(20) % len(shapes),
        angle=rng.uniform(0.0, 2.0 * np.pi, 20),
        velocity=np.where(platen[:, None] < 0, rng.normal(0.0, 2.0, (20, 2)), 0.0),
        angular_velocity=np.where(platen[:, None] < 0, rng.normal(0.0, 2.0, (20, 1)), 0.0),
        platen_index=platen,
        platens=[
            lsm.Platen("lower", [lsm.Fixed(), lsm.Fixed()]),
            lsm.Platen("upper", [lsm.ConstantVelocity(0.5, 2.0), lsm.ServoStress(1e4, 1, K, 4e3, 1.0)]),
        ],
        area=6.5,
        walls=[
            lsm.PlaneWall("left", (-0.1, 0.0), (1.0, 0.0), (0.5, 0.2)),
            lsm.PlaneWall("right", (6.6, 0.0), (-1.0, 0.0), servo=lsm.WallServo(1e4, K, 4e3, 1.0)),
        ],
        skin=0.1,
    )


def sheared_discs():
    """48 frictional discs, dense, in a sheared cell."""
    packed = scenes.packing("discs")
    velocity = np.random.default_rng(12).normal(0.0, 0.5, (48, 2))
    return scenes.scene(effects=scenes.frictional(), velocity=velocity, shear_rate=2.0, dt=5e-4, skin=0.05, **packed)


def driven_discs():
    """The same in a cell whose height a servo moves."""
    scene = sheared_discs()
    return replace(scene, cell_servo=lsm.CellServo(2e3, 2e5, 1e4, 20.0))


def restart(sim):
    """Start again from the scene, with the present step loop."""
    scene = sim.scene
    sim.domain.set_lengths(scene.lengths)
    columns = {"orientation": scene.orientation_state()} if sim.spec.oriented else {}
    if sim.grains.has("travel"):  # which goes on when a scene is loaded
        columns["travel"] = np.zeros(len(sim))
    velocity = scene.velocity + sim.domain.mean_flow(scene.position)
    scenes.reload(sim, position=scene.position, velocity=velocity, angular_velocity=scene.angular_velocity, **columns)


def everything(sim):
    """{name: array} of what a run leaves behind: grains by id, platens, walls, contacts, sums."""
    columns = {name: getattr(sim.state, name).to_numpy() for name in set(sim.grains.variables) - {"built_position"}}
    for kind, boundary in (("platen", sim.platens), ("wall", sim.walls)):
        if boundary:
            columns |= {f"{kind}_{name}": values for name, values in boundary.snapshot().items()}
    if sim.spec.cell_servo:
        columns |= {f"cell_{name}": value for name, value in sim.domain.snapshot().items()}
    columns |= dict(zip(("pairs", "pair_force", "history"), touching_contacts(sim)))
    return columns | sim.measure.sums()


LONG = pytest.param(arcs_between_platens_and_walls, marks=pytest.mark.validate)  # compiles for long


SHEARED = pytest.param(sheared_discs, marks=pytest.mark.validate)  # a driven cell is sheared, too


@pytest.mark.parametrize("make", [LONG, SHEARED, driven_discs])
def test_both_step_loops_give_the_same_bits(runtime, make):
    sim = scenes.simulate(make())
    assert sim.spec.onset and sim.spec.has_boundaries
    found = []
    for loop in (StepLoopCPU(sim.stages), StepLoopGPU(sim.stages)):
        sim.step_loop, sim.rebuilds = loop, 0
        restart(sim)
        sim.run(STEPS)
        assert sim.step_loop is loop  # a list that outgrows its storage would have replaced it
        assert sim.step == STEPS and sim.rebuilds > 3
        found.append(everything(sim))
    one, other = found
    assert set(one) == set(other)
    # The stress of grains that no cell encloses is not a number.
    assert [name for name in one if not np.array_equal(one[name], other[name], equal_nan=name == "stress")] == []
    assert one["contact_count"] > 3 and np.abs(one["position"] - sim.scene.position).max() > 0.1
    for work in ("platen_work", "wall_work", "shear_work", "cell_work"):
        assert work not in one or np.any(one[work] != 0.0), work
