"""Hertz contacts: restitution at any speed, the step that they allow, arcs against a disc, and what is refused."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes

E, NU, DENSITY = 1.0e8, 0.25, 1000.0
E_STAR = E / (2 * (1 - NU**2))
SPEEDS = 10.0 ** np.linspace(-3, 0, 7)  # [m s-1]


@pytest.fixture(scope="module")
def impacts(runtime):
    """Pairs of unequal spheres at different speeds, and how long the slowest of their impacts lasts."""
    n = len(SPEEDS)
    scale = np.tile([1.0, 0.6], n)
    x = np.zeros((2 * n, 3))
    x[:, 1] = 5.0 * np.repeat(np.arange(n), 2)
    x[1::2, 0] = 0.8
    sim = scenes.simulate(
        scenes.scene(x, [lsm.effects.Hertz(E, NU), lsm.ViscousDamping(restitution=0.5)], diameter=scale, skin=2.0)
    )
    return sim, x


@pytest.mark.parametrize("e", [0.2, 0.5, 0.9])
def test_restitution_is_the_same_at_any_speed(impacts, e):
    sim, x = impacts
    mass = DENSITY * np.pi / 6 * np.array([1.0, 0.6**3])
    reduced, radius = mass.prod() / mass.sum(), 0.15 / 0.8
    depth = (15 / 16 * reduced * SPEEDS**2 / (E_STAR * np.sqrt(radius))) ** 0.4
    duration = 2.9432 * depth / SPEEDS
    x, v = x.copy(), np.zeros_like(x)
    x[1::2, 0] += 0.01 * depth
    v[1::2, 0] = -SPEEDS
    scenes.effect(sim, "viscous_damping").write_parameters(lsm.ViscousDamping(restitution=e))
    scenes.reload(sim, duration.min() / 300, position=x, velocity=v)
    sim.run(int(3 * duration.max() / sim.dt))
    assert sim.measure.sums()["contact_count"] == 0
    v = sim.state.velocity.to_numpy()
    assert (v[1::2, 0] - v[::2, 0]) / SPEEDS == pytest.approx(e, rel=scenes.tolerance(5e-3, 2e-2))


def test_stable_step_is_that_of_the_stiffness_at_a_tenth_of_the_least_grain():
    position = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]])
    grains = scenes.scene(position, [lsm.effects.Hertz(E, NU)], diameter=[1.0, 0.1])
    radius, mass = 0.5 * 0.05 / 0.55, DENSITY * np.pi / 6 * 1e-3
    slope = 2 * E_STAR * np.sqrt(radius * 0.1 * 0.05)
    assert grains.stable_dt() == pytest.approx(2 / np.sqrt(2 * 10 * slope / mass), rel=1e-12)
    damped = scenes.scene(
        position, [lsm.effects.Hertz(E, NU), lsm.ViscousDamping(restitution=0.1)], diameter=[1.0, 0.1]
    )
    assert damped.stable_dt() < 0.9 * grains.stable_dt()
    rough = scenes.scene(position, [lsm.effects.Hertz(E, NU), lsm.effects.Mindlin(0.5, E, NU)], diameter=[1.0, 0.1])
    assert rough.stable_dt() < 0.7 * grains.stable_dt()


@pytest.mark.validate
def test_discs_of_arcs_collide_like_discs(runtime):
    """One arc or thirty, on an arc or on a seam, with friction and damping: the same impact."""
    shapes = [lsm.disc(), lsm.shapes.regular_disc_of_arcs(30)]
    which = np.array([[0, 0], [1, 1], [1, 1], [0, 1], [1, 0]])
    seam = np.pi / 30
    angle = np.array([[0, 0], [0.3, 0.7], [seam, seam], [0, 0.0], [0.0, 0]])
    n = len(which)
    x, v = np.zeros((n, 2, 2)), np.zeros((n, 2, 2))
    x[:, :, 1] = 5.0 * np.arange(n)[:, None]
    x[:, 1, 0] = 1.001
    v[:, 1] = (-1.0, 0.4)
    effects = [lsm.effects.Hertz(E, NU), lsm.ViscousDamping(restitution=0.8), lsm.effects.Mindlin(0.3, E, NU)]
    sim = scenes.simulate(
        scenes.scene(
            x.reshape(-1, 2),
            effects,
            shapes=shapes,
            shape_index=which.ravel(),
            angle=angle.ravel(),
            velocity=v.reshape(-1, 2),
            angular_velocity=np.tile([[2.0], [0.0]], (n, 1)),
            skin=0.2,
            thickness=1.0,
            dt=2e-5,
        )
    )
    start, _ = scenes.energy(sim)
    sim.run(3000)
    left, lost = scenes.energy(sim)
    assert lost > 0.1 * start
    assert left + lost == pytest.approx(start, rel=1e-4)
    assert sim.measure.sums()["contact_count"] == 0
    v = sim.state.velocity.to_numpy().reshape(n, 4)
    omega = sim.state.angular_velocity.to_numpy().reshape(n, 2)
    assert v[0, 0] < -0.85 and np.ptp(omega[0] - (2.0, 0.0)) < 1e-9 and abs(omega[0, 1]) > 0.1
    assert np.abs(v - v[0]).max() < scenes.tolerance(1e-9, 1e-3)
    assert np.abs(omega - omega[0]).max() < scenes.tolerance(1e-9, 1e-3)


def test_refusals():
    for arguments in ((0.0, NU), (-1.0, NU), (np.inf, NU), (E, 0.51), (E, -1.0), (E, np.nan)):
        with pytest.raises(lsm.InputError, match="Hertz"):
            lsm.effects.Hertz(*arguments)
    with pytest.raises(lsm.InputError, match=r"of elasticity, one may be listed"):
        scenes.scene(np.zeros((1, 3)), [lsm.effects.Hertz(E, NU), lsm.LinearElastic(1.0)])
    with pytest.raises(lsm.InputError, match=r"Hertz.radius = 'nearest': must be 'equivalent' or 'local'"):
        lsm.effects.Hertz(E, NU, radius="nearest")


def test_local_radii_are_refused_where_they_jump_and_equivalent_ones_are_not():
    box = lsm.shapes.from_polygon([(0, 0), (2, 0), (2, 1), (0, 1)], 0.1)
    disc = lsm.shapes.regular_disc_of_arcs(30)
    pair = lsm.shapes.union([lsm.shapes.place_part(disc, (x, 0.0)) for x in (-0.3, 0.3)])
    balls = lsm.shapes.clump([(-0.4, 0.0), (0.4, 0.0)], [1.0, 0.8])
    uneven = (box, lsm.shapes.crossed_bars(), lsm.shapes.from_chain(box), lsm.shapes.ball_of_faces(12, 0.1))
    for shape in uneven:
        one, local = np.zeros((1, shape.dim)), lsm.effects.Hertz(E, NU, radius="local")
        for more in ([], [lsm.effects.Mindlin(0.3, E, NU)]):
            with pytest.raises(lsm.InputError, match=r"hertz.*local radius.*jumps at the seams.*'equivalent'"):
                scenes.scene(one, [local, *more], shapes=[shape])
        scenes.scene(one, [lsm.effects.Hertz(E, NU), lsm.effects.RollingResistance(0.1, 1.0)], shapes=[shape])
    for shape in (lsm.disc(), disc, pair, balls, lsm.shapes.from_chain(disc), lsm.sphere()):
        scenes.scene(np.zeros((1, shape.dim)), [local], shapes=[shape])


def test_a_rigid_wall_needs_a_modulus_to_be_rigid_to():
    wall = lsm.PlaneWall("floor", (0.0, -1.0), (0.0, 1.0), rigid=True)
    with pytest.raises(lsm.InputError, match=r"wall 'floor': rigid = True, but no effect has a modulus"):
        scenes.scene(np.zeros((1, 2)), [lsm.LinearElastic(1.0)], walls=[wall])
    hertz = [lsm.effects.Hertz(E, NU)]
    rigid, soft = (
        scenes.scene(np.zeros((1, 2)), hertz, walls=[lsm.PlaneWall("floor", (0.0, -1.0), (0.0, 1.0), rigid=r)])
        for r in (True, False)
    )
    # The bound is that of two like grains, of half the reduced radius and twice the mobility.
    assert rigid.stable_dt() == pytest.approx(soft.stable_dt() * 2.0**-0.25, rel=1e-12)
    wall.rigid = "yes"
    with pytest.raises(lsm.InputError, match=r"wall 'floor': rigid = 'yes', must be True or False"):
        scenes.scene(np.zeros((1, 2)), hertz, walls=[wall])
