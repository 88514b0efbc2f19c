"""An elastic gas of unions of convex parts keeps its energy."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes
from tests.physics.test_hertz_gas import drifts
from tests.shapes.non_convex_bodies import L_CORNERS, bone_outline, cross_outline, horseshoe_outline, prism
from tests.shapes.test_non_convex_meshes import boxes_of_an_l

pytestmark = [
    pytest.mark.validate,
    pytest.mark.skipif(scenes.PRECISION == "f32", reason="the drift is below the rounding of f32"),
]
STIFFNESS, STEPS_PER_CONTACT, SPEED = 1e5, 50.0, 2.0


def gas(shapes, side, seed=1):
    """Grains of these shapes at random orientations, one in each cell of a periodic lattice, with random velocities."""
    dim, rng = shapes[0].dim, np.random.default_rng(seed)
    count = side**dim
    cell = 2.05 * max(s.bounding_radius for s in shapes)
    lattice = np.stack(np.unravel_index(np.arange(count), (side,) * dim), axis=1)
    turn = rng.normal(size=(count, 4))
    turned = (
        {"angle": rng.uniform(0.0, 2.0 * np.pi, count)}
        if dim == 2
        else {"orientation": turn / np.linalg.norm(turn, axis=1, keepdims=True)}
    )
    velocity = SPEED * rng.normal(size=(count, dim)) / np.sqrt(dim)
    mass = shapes[0].measure
    return lsm.Scene(
        dim=dim,
        lengths=(side * cell,) * dim,
        periodic=(True,) * dim,
        shapes=shapes,
        shape_index=np.arange(count) % len(shapes),
        position=(lattice + 0.5) * cell,
        diameter=np.ones(count),
        density=1.0,
        velocity=velocity - velocity.mean(axis=0),
        effects=[lsm.LinearElastic(STIFFNESS)],
        integrator=lsm.OnsetVerlet,
        dt=np.pi * np.sqrt(mass / (2.0 * STIFFNESS)) / STEPS_PER_CONTACT,
        **turned,
    )


def shapes_of(dim):
    """A cross, an L, a horseshoe and a bone; in 3D an L, whose parts need no search."""
    if dim == 3:
        return [lsm.shapes.non_convex_mesh(prism(L_CORNERS, 0.8), parts=boxes_of_an_l())[0]]
    outlines = (cross_outline(), L_CORNERS, horseshoe_outline(), bone_outline())
    return [lsm.shapes.non_convex_outline(points)[0] for points in outlines]


@pytest.mark.parametrize(("dim", "side"), [(2, 10), (3, 4)])
def test_a_gas_of_non_convex_grains_keeps_its_shadow_energy(runtime, dim, side):
    """4000 steps, 50 of them in a head-on contact."""
    sim = scenes.simulate(gas(shapes_of(dim), side))
    energy, shadow = drifts(sim, lsm.ShadowEnergy(sim), 4000)
    print(f"{dim}D: energy {energy:.2e}, shadow energy {shadow:.2e}, contacts {sim.measure.sums()['contact_count']}")
    assert shadow < 1e-4
