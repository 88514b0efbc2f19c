"""Bonds: their energy and its gradient, beams made of grains, strengths."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import gamma
from scipy.stats import kstest

import taichi_lsm as lsm
from taichi_lsm.bonds.bond_setup import bond_areas, bond_numbers
from taichi_lsm.core.runtime import ti
from taichi_lsm.effects import Effect
from taichi_lsm.effects.elastic_brittle_bond import bond_energy, bond_reaction
from taichi_lsm.effects.global_damping import GlobalDamping
from tests.helpers import scenes

pytestmark = pytest.mark.usefixtures("runtime")

YOUNG, POISSON, COHESION, ANGLE = 1.0e7, 0.25, 1.0e5, 0.6
RADIUS, LENGTH = 0.5, 1.0
AREA, SECOND = np.pi * RADIUS**2, np.pi * RADIUS**4 / 4
SHEAR = YOUNG / (2 * (1 + POISSON))
TENSILE = COHESION / np.tan(ANGLE)
LINKS = 10  # of the cantilever
FAR = np.array([0.0, 30.0, 0.0])


def bond(**more):
    return lsm.effects.ElasticBrittleBond(
        **{"youngs_modulus": YOUNG, "poissons_ratio": POISSON, "cohesion": COHESION, "friction_angle": ANGLE} | more
    )


# The force law by itself


@ti.kernel
def respond(dim: ti.template(), given: ti.types.ndarray(), out: ti.types.ndarray()):
    """Energy, force on l, moments on k and l of bonds of stiffness 7, 3, 2, 1.5; a row of `given` holds u, the
    rotation and both axes, in four columns each."""
    stiffness = ti.Vector([7.0, 3.0, 2.0, 1.5], ti.f64)
    for i in range(given.shape[0]):
        u = ti.Vector([given[i, 0 + c] for c in range(dim)])
        rotation = ti.Vector([given[i, 4 + c] for c in range(2 if dim == 2 else 4)])
        e_k = ti.Vector([given[i, 8 + c] for c in range(dim)])
        e_l = ti.Vector([given[i, 12 + c] for c in range(dim)])
        out[i, 0] = bond_energy(u, rotation, e_k, e_l, stiffness)
        force, moment_k, moment_l = bond_reaction(u, rotation, e_k, e_l, stiffness)
        for c in ti.static(range(dim)):
            out[i, 1 + c] = force[c]
        for c in ti.static(range(1 if dim == 2 else 3)):
            out[i, 4 + c], out[i, 7 + c] = moment_k[c], moment_l[c]


def placed(dim, branch, q_k, q_l):
    """Row of `given` for bodies with anchors (0.4, 0.3) from k and the opposite from l, and their arms."""
    anchor = np.array([0.4, 0.3, 0.0])
    arm_k, arm_l = q_k.apply(anchor), q_l.apply(-anchor)
    row = np.zeros(16)
    row[0:3] = branch + arm_l - arm_k
    rel = (q_l * q_k.inv()).as_quat(scalar_first=True)
    row[4:8] = rel if dim == 3 else (rel[0] ** 2 - rel[3] ** 2, 2 * rel[0] * rel[3], 0, 0)
    row[8:11], row[12:15] = arm_k / 0.5, -arm_l / 0.5
    return row, arm_k, arm_l


def response(dim, rows):
    out = np.zeros((len(rows), 10))
    respond(dim, np.array(rows), out)
    return out


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("size", [1e-3, 0.7])
def test_forces_and_torques_are_the_gradient_of_the_energy(dim, size):
    """To rounding at any strain, and so is the balance of torques; the force law is exact, not linearised."""
    rng = np.random.default_rng(4)
    free = np.arange(3) if dim == 3 else np.arange(2)
    about = np.arange(3) if dim == 3 else np.array([2])

    def vector(axes, size):
        v = np.zeros(3)
        v[axes] = size * rng.uniform(-1, 1, len(axes))
        return v

    q_k = Rotation.from_rotvec(vector(about, 2.0))
    q_l = Rotation.from_rotvec(vector(about, size)) * q_k
    branch = q_k.apply([0.8, 0.6, 0.0]) + vector(free, size)
    row, arm_k, arm_l = placed(dim, branch, q_k, q_l)
    energy, force, moments = np.split(response(dim, [row])[0], [1, 4])
    moment_k, moment_l = np.split(moments, 2)
    if dim == 2:
        moment_k, moment_l = np.array([0, 0, moment_k[0]]), np.array([0, 0, moment_l[0]])
    torque_k, torque_l = moment_k - np.cross(arm_k, force), moment_l + np.cross(arm_l, force)
    h = 1e-5
    for wanted, axes, move in (
        (force, free, lambda a: (branch + a, q_k, q_l)),
        (torque_k, about, lambda a: (branch, Rotation.from_rotvec(a) * q_k, q_l)),
        (torque_l, about, lambda a: (branch, q_k, Rotation.from_rotvec(a) * q_l)),
    ):
        rows = [placed(dim, *move(s * h * np.eye(3)[c]))[0] for c in axes for s in (1, -1)]
        up, down = response(dim, rows)[:, 0].reshape(-1, 2).T
        assert np.allclose(-(up - down) / (2 * h), wanted[axes], rtol=0, atol=1e-8 * max(1e-2, size))
    assert np.abs(torque_k + torque_l + np.cross(branch, force)).max() < 1e-14
    assert energy > 0
    rotation = Rotation.from_rotvec(vector(about, 3.0))
    same = response(
        dim,
        [placed(dim, rotation.apply(branch), rotation * q_k, rotation * q_l)[0]],
    )[0]
    assert same[0] == pytest.approx(energy[0], rel=1e-9)
    assert np.allclose(same[1:4], rotation.apply(force), rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("more", "field"),
    [
        ({"youngs_modulus": -1.0}, "youngs_modulus"),
        ({"poissons_ratio": 0.6}, "poissons_ratio"),
        ({"cohesion": 0.0}, "cohesion"),
        ({"friction_angle": 2.0}, "friction_angle"),
        ({"radius_ratio": np.inf}, "radius_ratio"),
        ({"weibull_modulus": 0.0}, "weibull_modulus"),
        ({"weibull_modulus": 5e-3}, "weibull_modulus"),
        ({"weibull_seed": 1.5}, "weibull_seed"),
    ],
)
def test_wrong_numbers_are_refused(more, field):
    with pytest.raises(lsm.InputError, match=field):
        bond(**more)


@pytest.mark.parametrize("modulus", [2.0, 9.0])
def test_strengths_scatter_as_weibull_says_and_keep_their_mean(modulus):
    """Its distribution function of all drawn factors is uniform: Kolmogorov's distance for 20 000 of them."""
    radii = np.full(20_000, RADIUS)
    plain, scattered = bond().bond_strength(radii), bond(weibull_modulus=modulus).bond_strength(radii)
    factors = scattered / plain
    assert np.ptp(factors, axis=1).max() < 1e-12
    chance = 1.0 - np.exp(-((factors[:, 0] * gamma(1.0 + 1.0 / modulus)) ** modulus))
    assert kstest(chance, "uniform").pvalue > 0.01
    variation = np.sqrt(gamma(1.0 + 2.0 / modulus) / gamma(1.0 + 1.0 / modulus) ** 2 - 1.0)
    assert factors[:, 0].mean() == pytest.approx(1.0, abs=4.0 * variation / np.sqrt(20_000))
    other = bond(weibull_modulus=modulus, weibull_seed=1).bond_strength(radii)
    assert abs(np.corrcoef(factors[:, 0], other[:, 0])[0, 1]) < 0.03


def test_wrong_bonds_are_refused():
    x = [(0.0, 0.0), (1.0, 0.0), (1.0, 0.0)]
    for bonds, text in (
        ([[0, 3]], "0..3"),
        ([[1, 1]], "itself"),
        ([[0, 1], [1, 0]], "twice"),
        ([[0.0, 1.0]], "integers"),
        ([[0, 1], [2]], "integers"),
        ([[1, 2]], "apart"),
        (None, "both or neither"),
    ):
        with pytest.raises(lsm.InputError, match=text):
            scenes.scene(x, [bond()], bonds=bonds).stable_dt()
    with pytest.raises(lsm.InputError, match="both or neither"):
        scenes.scene(x, [lsm.LinearElastic(1.0)], bonds=[[0, 1]])


def test_bonds_have_the_sections_that_are_given_in_whatever_order():
    """A circle of the area in 3D, in 2D a rectangle as deep as the scene: EA/L and the strength in tension."""
    x = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)])
    for dim, modulus in ((2, 0.3**2 / (6.0 * 0.8)), (3, np.sqrt(0.3**3 / np.pi) / 4.0)):
        given = {"bonds": [(2, 1), (0, 1)], "bond_area": [0.3, 0.6], "thickness": 0.8}
        row = scenes.scene(x[:, :dim], [bond()], **given)
        assert row.bonds.tolist() == [[0, 1], [1, 2]] and row.bond_area.tolist() == [0.6, 0.3]
        stiffness, strength, _ = bond_numbers(row)
        assert stiffness[:, 0] == pytest.approx(YOUNG * np.array([0.6, 0.3])) and bond_areas(row)[1] == 0.3
        assert strength[1, [0, 2]] == pytest.approx(TENSILE * np.array([0.3, modulus]))
    for more, text in (
        ({"bond_area": [1.0]}, "one number > 0 m2 for each bond"),
        ({"bond_area": [1.0, 0.0]}, "one number > 0"),
        ({"bonds": None, "effects": [lsm.LinearElastic(1.0)]}, "given without bonds"),
    ):
        with pytest.raises(lsm.InputError, match=rf"Scene.bond_area: .*{text}"):
            scenes.scene(x, **{"effects": [bond()], **given, **more})


def test_the_stable_step_is_below_that_of_every_mode_of_a_pair():
    """Two discs: stretching, shear with rolling, bending; nothing is wasted where one of them rules."""
    pair = scenes.scene([(0.0, 0.0), (1.0, 0.0)], [bond()], bonds=[(1, 0)], thickness=0.8)
    (m, _), inertia = pair.masses()
    k_n, k_s, k_b, _ = bond().bond_stiffness(np.array([0.5]), np.array([1.0]), 0.8)[0]
    modes = np.array([2 * k_n / m, 2 * k_s * (1 / m + 0.25 / inertia[0, 0]), 2 * k_b / inertia[0, 0]])
    largest = 2.0 / np.sqrt(modes.max())
    assert 0.6 * largest < pair.stable_dt() <= largest
    pair.effects = [bond(youngs_modulus=1e-3 * YOUNG)]
    assert pair.stable_dt() == pytest.approx(2.0 / np.sqrt(1e-3 * 2 * (0.5 * modes[1] + 0.5 * modes[2])))


# A cantilever, and a pair that is sheared between two platens


@ti.data_oriented
@dataclass
class TipForce(Effect):
    """A force on grains heavier than a limit."""

    force: tuple
    heavier: float
    phase = "body"

    def parameters(self):
        return {"f": self.force, "inverse": 1.0 / self.heavier}

    @ti.func
    def on_grain(self, inverse_mass, force: ti.template()):
        for axis in ti.static(range(force.n)):
            force[axis] += ti.select(inverse_mass < self.inverse_[0], self.f_[axis], 0.0)


def beam_scene():
    """Spheres in a row, the first glued, the last one a little heavier; far away a pair between the platens."""
    row = np.arange(LINKS + 1)[:, None] * [LENGTH, 0.0, 0.0]
    x = np.concatenate([row, [FAR, FAR + np.array([LENGTH, 0, 0])]])
    scale = np.ones(len(x))
    scale[LINKS] = 1.001
    platen = np.full(len(x), -1)
    platen[[0, LINKS + 1]], platen[LINKS + 2] = 0, 1
    still, drive = [lsm.Fixed() for _ in range(3)], [lsm.Fixed(), lsm.ConstantVelocity(0.0), lsm.Fixed()]
    return scenes.scene(
        x,
        [lsm.LinearElastic(1e6), bond(), GlobalDamping(6.0), TipForce((0.0, 0.0, 0.0), 1.001 * 1000 * np.pi / 6)],
        diameter=scale,
        platen_index=platen,
        platens=[lsm.Platen("base", still), lsm.Platen("ram", drive)],
        area=1.0,
        bonds=np.array([(i + 1, i) for i in range(LINKS)] + [(LINKS + 1, LINKS + 2)]),
    )


@pytest.fixture(scope="module")
def beam(runtime):
    return scenes.simulate(beam_scene())


def restart(sim, scene, **columns):
    """Start again from `scene` with bonds as at its start, though there are platens."""
    rest = {
        "position": scene.position,
        "velocity": scene.velocity,
        "angular_velocity": scene.angular_velocity,
        "orientation": scene.orientation_state(),
    }
    for name, values in rest.items():
        getattr(sim.state, name).from_numpy(values)
    sim.bonds.fill(scene)
    sim.bonds.begin()
    scenes.reload(sim, **rest | columns)


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 1, 0), (0, 0, -1)])
def test_a_row_of_bonded_grains_is_a_beam(beam, direction):
    """Euler-Bernoulli and the shear that the bonds have, with their section; extension."""
    size, direction = 40.0, np.array(direction)
    effect = scenes.effect(beam, "tip_force")
    effect.f_.from_numpy(size * direction.astype(float))
    restart(beam, beam_scene())
    beam.run(60_000)
    assert np.abs(beam.state.velocity.to_numpy()).max() < 1e-8
    assert beam.measure.sums()["bond_count"] == LINKS + 1
    moved = (beam.state.position.to_numpy() - beam.scene.position)[LINKS]
    length = LINKS * LENGTH
    bending = length**3 / (3 * YOUNG * SECOND) + length / (SHEAR * AREA)
    flexibility = np.where(direction != 0, bending if direction[0] == 0 else length / (YOUNG * AREA), 0.0)
    relative = moved @ direction / (size * flexibility @ np.abs(direction)) - 1
    assert abs(relative) < (0.01 if direction[0] else 0.005)
    force = beam.platens.force.to_numpy()[0]
    assert np.allclose(force, size * direction, atol=1e-5 * size)


def test_a_sheared_pair_breaks_at_its_strength(beam):
    speed, b = 0.05, LINKS
    scenes.effect(beam, "tip_force").f_.fill(0.0)
    beam.platens.set("ram", 1, lsm.ConstantVelocity(speed))
    restart(beam, beam_scene())
    strongest = 0.0
    while beam.bonds.intact[b] and beam.step < 20_000:
        strongest = max(strongest, np.linalg.norm(beam.bonds.force[b].to_numpy()))
        beam.run(10)
    assert strongest == pytest.approx(AREA * COHESION, rel=0.01)
    beam.run(10)
    assert not beam.bonds.force[b].to_numpy().any()
    assert beam.measure.sums()["bond_count"] == LINKS
    held = 0.5 * (AREA * COHESION) ** 2 / (SHEAR * AREA / LENGTH)
    assert beam.measure.sums()["dissipated_elastic_brittle_bond"] == pytest.approx(held, rel=0.01)
    work = beam.platens.snapshot()["work"].sum()
    assert work == pytest.approx(held, rel=0.02)
    beam.platens.set("ram", 1, lsm.ConstantVelocity(0.0))
