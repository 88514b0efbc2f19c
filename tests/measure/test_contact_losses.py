"""What contacts tell, in scenes of every kind: sums of energies, losses and stress, patches, and a run left alone."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm
from tests.helpers import bonds_run, scenes
from tests.measure.test_contacts import stress_of

pytestmark = pytest.mark.validate  # each scene compiles twice
K, STEPS, READ = 1e6, 300, 150


def lattice(effects, shape, pitch=0.98, **more):
    """27 grains in a periodic cube that fly about."""
    rng = np.random.default_rng(1)
    place = pitch * np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    given = {
        "shapes": [shape],
        "lengths": (3.0 * pitch,) * 3,
        "periodic": (True,) * 3,
        "orientation": Rotation.random(27, rng=2).as_quat(scalar_first=True),
        "velocity": 0.8 * rng.standard_normal(place.shape),
        "skin": 0.05,
    }
    return scenes.scene(place, effects, **given | more)


def hertz():
    """Spheres of elastic solids, with all that their contacts remember."""
    solid = {"youngs_modulus": 1e7, "poissons_ratio": 0.25}
    mindlin = lsm.effects.Mindlin(coefficient=0.5, **solid)
    return lattice([lsm.effects.Hertz(**solid), lsm.ViscousDamping(restitution=0.6), mindlin], lsm.sphere())


def between_walls():
    """Angular grains that fall on a floor and lean on a wall."""
    packed = scenes.packing("arcs")
    side = packed["lengths"][0]
    walls = [lsm.PlaneWall("floor", (0.0, -0.1), (0.0, 1.0)), lsm.PlaneWall("left", (-0.6, 0.0), (1.0, 0.0))]
    effects = [*scenes.frictional(), lsm.Gravity((-0.05, -0.3))]
    place = np.asarray(packed["position"]) % side + (0.6, 0.9)
    open_cell = {"lengths": (np.inf, np.inf), "periodic": (False, False), "walls": walls, "position": place}
    return scenes.scene(effects=effects, **packed | open_cell)


def shaken(body):
    """A dense packing whose grains fly apart."""
    packed = scenes.packing(body)
    velocity = 0.5 * np.random.default_rng(3).standard_normal(np.shape(packed["position"]))
    return scenes.scene(effects=scenes.frictional(), velocity=velocity, **packed)


SCENES = {
    "discs": lambda: shaken("discs"),
    "arcs": lambda: shaken("arcs"),
    "spheres": lambda: lattice(scenes.frictional(K), lsm.sphere()),
    "polyhedra": lambda: lattice(scenes.frictional(K), lsm.shapes.ball_of_faces(20), 1.0),
    "hertz": hertz,
    "walls": between_walls,
    "bonds": lambda: bonds_run.rubble(columns=2, rows=2),
}


@pytest.mark.parametrize("name", SCENES)
def test_contacts_of_every_kind_of_scene(runtime, name):
    scene = SCENES[name]()
    ends = []
    for tracked in (False, True):
        sim = scenes.simulate(replace_scene(scene, tracked))
        assert sim.grains.has("parted_loss") == hasattr(sim.pairs, "pair_loss") == tracked
        sim.run(5 * STEPS if name == "bonds" else STEPS)  # whole grains have to meet first
        parted = read_steps(sim, tracked)
        names = ("position", "velocity", "force", "dissipated", *(["orientation"] * sim.spec.oriented))
        ends.append([getattr(sim.state, column).to_numpy() for column in names])
    assert all(np.array_equal(a, b) for a, b in zip(*ends))
    assert parted > 0 or name != "discs"  # where the dashpot ends the force before the contact, nothing is left to lose


def replace_scene(scene, tracked):
    """The same scene with or without the losses of its contacts."""
    scene.track_contacts = tracked
    return scene


def read_steps(sim, tracked):
    """Some more steps, in which the contacts are checked after each."""
    of_contacts = slice(None, -1 if sim.bonds else None)  # the last channel is that of bonds
    before = sim.state.dissipated.to_numpy()[:, of_contacts].sum()
    parted = sliding = rows = 0
    for _ in range(READ):
        sim.run(1)
        if not tracked:
            continue
        stress, table = stress_of(sim)
        now = sim.state.dissipated.to_numpy()[:, of_contacts].sum()
        power = float(table.dissipated_power.sum() + table.parted_power)
        scale = float(np.abs(table.dissipated_power).sum()) * sim.dt + 1e-3 * now
        assert power * sim.dt == pytest.approx(now - before, abs=scenes.tolerance(1e-10, 1e-4) * scale)
        before, parted, sliding = now, parted + int(table.parted_power != 0.0), sliding + int(table.sliding.sum())
        sums = sim.measure.sums()
        bound = scenes.tolerance(1e-12, 1e-5)
        assert stress == pytest.approx(sums["stress_volume"], abs=bound * np.abs(stress).max())
        assert float(table.elastic_energy.sum()) == pytest.approx(sums["elastic_energy"], rel=bound)
        contacts = table.isel(contact=~table.bonded.values)
        rows += contacts.sizes["contact"]
        scale = np.abs(contacts.normal_force.values).max(initial=0.0)
        damping = contacts.history_damping_force.values
        assert contacts.dissipative_normal_force.values == pytest.approx(damping, abs=bound * scale)
    if tracked:
        assert rows > READ // 3 and (sliding > 0 or "mindlin" in [e.name for e in sim.effects])
        check_patches(sim, contacts)
    return parted


def check_patches(sim, contacts):
    """The normal lies in the cone of the patch that is named."""
    found = 0
    for side, sign in (("first", 1.0), ("second", -1.0)):
        ids, patches = contacts[f"{side}_id"].values, contacts[f"{side}_patch"].values
        assert (patches[ids < 0] == -1).all()
        for row in np.flatnonzero(patches >= 0):
            shape = sim.scene.shapes[sim.scene.shape_index[ids[row]]]
            _, _, axis, angle = shape.patches()
            normal = sign * contacts.normal.values[row]
            if sim.spec.oriented:
                normal = in_body(sim.state.orientation.to_numpy()[ids[row]], normal)
            cosine = np.clip(axis[patches[row]] @ normal, -1.0, 1.0)
            assert np.arccos(cosine) <= angle[patches[row]] + scenes.tolerance(1e-6, 1e-2)
            found += 1
    assert found > 0


def in_body(orientation, vector):
    """A vector of the world frame in that of a grain."""
    if len(orientation) == 2:
        c, s = orientation
        return np.array([c * vector[0] + s * vector[1], c * vector[1] - s * vector[0]])
    return Rotation.from_quat(orientation, scalar_first=True).inv().apply(vector)
