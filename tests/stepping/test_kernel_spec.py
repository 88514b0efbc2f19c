"""A scene has the fields and bytes of the effects that it lists; decided on the host, before anything is compiled."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.contact.contact_block import contact_block_type
from taichi_lsm.contact.pair_storage import pair_variables
from taichi_lsm.core.fields import bytes_per_row, orientation_size, rotation_size
from taichi_lsm.effects import find_effects
from taichi_lsm.stepping.grain_state import grain_variables
from taichi_lsm.stepping.kernel_spec import KernelSpec
from tests.helpers import scenes

pytestmark = pytest.mark.usefixtures("runtime")

REAL = 8 if scenes.PRECISION == "f64" else 4
EFFECTS = find_effects()
ELASTIC = [lsm.LinearElastic(1e5)]
COMPANIONS = {
    "linear_elastic": [],
    "hertz": [],
    "mindlin": [lsm.effects.Hertz(1e5, 0.25)],
}  # others stand beside ELASTIC


def case(name, dim):
    """An effect of this name that makes sense in a scene of this dimension beside its companions."""
    if name == "gravity":
        return lsm.Gravity((0.0, -1.0, 0.0)[:dim])
    return lsm.effects.Mindlin(0.5, 1e5, 0.25) if name == "mindlin" else EFFECTS[name].cases()[0]


def rows(effects, dim, **more):
    """{(table, row): bytes} of a scene of two touching grains with these effects."""
    scene = scenes.scene([(0.0,) * dim, (0.95,) + (0.0,) * (dim - 1)], effects, **more)
    made = KernelSpec.of(scene)
    sizes = {"space": dim, "rotation": rotation_size(dim), "orientation": orientation_size(dim), "two": 2}
    sizes |= {"channel": made.channels, "history": made.history}
    tables = {"grain": grain_variables(made), "pair": pair_variables(made)}
    return {(table, row.name): bytes_per_row([row], sizes) for table, found in tables.items() for row in found}


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_adds_its_own_rows_and_bytes_and_takes_them_away_again(name, dim):
    effect, others = case(name, dim), COMPANIONS.get(name, ELASTIC)
    bonds = {"bonds": np.array([[0, 1]])} if effect.phase == "bond" else {}
    without, whole = rows(others, dim), rows([*others, effect], dim, **bonds)
    added = {key: size - without.get(key, 0) for key, size in whole.items() if size != without.get(key)}
    angular_velocity = rotation_size(dim)
    expected = {}
    if effect.dissipates:
        expected["grain", "dissipated"] = 8
    if effect.phase != "body" and effect.history_size(dim):
        expected["pair", "history"] = effect.history_size(dim) * REAL
    if effect.phase == "tangential" or effect.adds_moment or effect.phase == "bond":  # grains rotate
        expected |= {
            ("grain", "angular_velocity"): 8 * angular_velocity,
            ("grain", "inverse_inertia"): REAL * angular_velocity,
        }
        expected |= {("grain", "torque"): REAL * angular_velocity, ("pair", "pair_torque"): REAL * angular_velocity}
    if effect.phase == "bond":
        expected["grain", "orientation"] = 8 * orientation_size(dim)
        expected["pair", "rest_overlap"] = REAL
    if hasattr(effect, "onset_impulse"):
        expected |= {
            ("grain", "has_impulse"): 1,
            ("grain", "last_velocity"): 8 * dim,
            ("pair", "pair_impulse"): REAL * dim,
        }
    assert added == expected
    assert set(without) <= set(whole)


def test_frictionless_spheres_keep_neither_angular_velocities_nor_a_past():
    names = {name for _, name in rows(ELASTIC, 3)}
    assert not names & {
        "angular_velocity",
        "inverse_inertia",
        "torque",
        "pair_torque",
        "history",
        "orientation",
        "dissipated",
    }
    plain = {name for _, name in rows(ELASTIC, 3, integrator=lsm.VelocityVerlet)}
    assert names - plain == {"has_impulse", "last_velocity", "pair_impulse"}


def test_what_is_not_in_the_scene_is_not_in_the_simulation(runtime):
    sim = scenes.simulate(scenes.scene([(0.0, 0.0), (0.95, 0.0)], ELASTIC))
    assert not any((sim.walls, sim.bonds, sim.platens, sim.surfaces, sim.parts))
    assert not sim.spec.sheared and not sim.spec.reaches and not sim.forces.adds_moment and not sim.forces.needs
    assert not hasattr(sim.forces.geometry, "reach") and not sim.forces.body_effects and not sim.forces.motion_effects
    frictional = KernelSpec(dim=2, count=2, rotates=True, history=2)
    every = contact_block_type(frictional, {"reduced_radius"}, channels=1, crosses_seams=False).members.keys()
    extra = {"memory_0", "omega_k_0", "torque_k_0", "reduced_radius", "lost_0"}
    assert extra <= every and not sim.forces.block.members.keys() & extra
