"""Every input of a scene is either the same in a restored run, or documented as taken from one side."""

from dataclasses import fields, replace

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.io.scene_identity import FREE, WITH_BONDS, scene_identity
from tests.helpers import scenes

DAMPING = lsm.ViscousDamping(restitution=0.6)
BOND = lsm.effects.ElasticBrittleBond(
    youngs_modulus=1e6, poissons_ratio=0.25, cohesion=1e5, friction_angle=0.6, radius_ratio=0.5
)
DRIVES = [[lsm.Fixed(), lsm.Fixed()], [lsm.ConstantVelocity(0.5), lsm.ServoStress(100.0, 1, 1e5, 1e4, 1.0)]]
CHANGES = {  # of each input that must be the same, one that no other check of the scene or the checkpoint finds
    "density": 2000.0,
    "effects": [lsm.LinearElastic(2e5), DAMPING],
    "lengths": (9.0, np.inf),
    "periodic": (False, False),
    "shapes": [lsm.disc(), lsm.shapes.regular_disc_of_arcs(9)],
    "shape_index": [1, 0, 0, 1],
    "diameter": [1.0, 1.0, 1.0, 1.1],
    "platen_index": [0, 1, 1, -1],
    "platens": [lsm.Platen("low", DRIVES[0]), lsm.Platen("high", [lsm.ConstantVelocity(0.7), DRIVES[1][1]])],
    "walls": [lsm.PlaneWall("floor", (0.0, -2.0), (0.0, 1.0))],
    "shear_rate": 0.1,
    "cell_servo": lsm.CellServo(100.0, 1e5, 1e4, 1.0),
    "thickness": 2.0,
    "area": 3.0,
    "bonds": [(2, 3)],
    "bond_area": [0.7],
    "integrator": lsm.VelocityVerlet,
    "track_dissipation": False,
    "track_contacts": True,
    "dim": 3,
}


def base():
    """Inputs of a scene with two platens, a wall, two shapes and a bond."""
    return {
        "position": [(1.0, 0.0), (1.0, 3.0), (1.0, 1.0), (1.0, 2.0)],
        "density": 1000.0,
        "effects": [lsm.LinearElastic(1e5), DAMPING, BOND],
        "lengths": (8.0, np.inf),
        "periodic": (True, False),
        "shapes": [lsm.disc(), lsm.shapes.regular_disc_of_arcs(8)],
        "shape_index": [0, 0, 0, 1],
        "platen_index": [0, 1, -1, -1],
        "platens": [lsm.Platen("low", DRIVES[0]), lsm.Platen("high", DRIVES[1])],
        "walls": [lsm.PlaneWall("floor", (0.0, -1.0), (0.0, 1.0))],
        "bonds": [(0, 2)],
        "thickness": 1.0,
        "dt": 1e-4,
    }


def test_every_input_of_a_scene_is_compared_or_free():
    assert {f.name for f in fields(lsm.Scene)} == set(FREE) | set(CHANGES)
    assert not set(FREE) & set(CHANGES) and set(WITH_BONDS) < set(FREE)


@pytest.mark.parametrize("name", CHANGES)
def test_a_changed_input_is_seen_by_its_name(name):
    scene, other = lsm.Scene(**base()), lsm.Scene(**base())
    assert scene_identity(scene) == scene_identity(other)
    setattr(other, name, CHANGES[name] if name in ("effects", "platens", "walls") else np_like(scene, name))
    changed = {key for key, text in scene_identity(other).items() if text != scene_identity(scene)[key]}
    assert changed == {name}


def np_like(scene, name):
    """The changed value in the form in which a scene keeps it."""
    former = getattr(scene, name)
    return np.asarray(CHANGES[name], former.dtype) if isinstance(former, np.ndarray) else CHANGES[name]


def test_placement_counts_where_bonds_refer_to_it():
    bonded, free = lsm.Scene(**base()), lsm.Scene(**base() | {"bonds": None, "effects": [lsm.LinearElastic(1e5)]})
    assert {"position", "angle"} <= set(scene_identity(bonded))
    assert not {"position", "angle", "velocity"} & set(scene_identity(free))


def test_the_name_of_a_shape_does_not_count_but_its_content_does():
    one, other = lsm.Scene(**base()), lsm.Scene(**base())
    other.shapes = [replace(shape, name="another") for shape in one.shapes]
    assert scene_identity(one) == scene_identity(other)
    other.shapes = [one.shapes[0], replace(one.shapes[1], radius=one.shapes[1].radius * (1.0 + 2.0**-52))]
    assert scene_identity(one)["shapes"] != scene_identity(other)["shapes"]


GRAINS = {"position": [(0.0, 0.0), (0.99, 0.0)], "effects": scenes.frictional(), "dt": 1e-4}


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"density": 2000.0}, "Scene.density is 2000.0, but the scene has 1000.0"),
        ({"effects": scenes.frictional(2e5)}, r"Scene.effects is LinearElastic\(stiffness=200000.0\)"),
        ({"thickness": 2.0}, "Scene.thickness is 2.0, but the scene has 1.0"),
        ({"diameter": [1.0, 1.01]}, "Scene.diameter is 1.0, 1.01, but the scene has 1.0, 1.0"),
    ],
)
def test_a_checkpoint_of_another_scene_of_the_same_kernels_is_refused(loaded, tmp_path, changes, reason):
    file = tmp_path / "other.nc"
    loaded.reset(scenes.scene(**GRAINS | changes))
    lsm.save_checkpoint(loaded, file)
    loaded.reset(scenes.scene(**GRAINS))
    before = loaded.positions.copy()
    with pytest.raises(lsm.InputError, match=reason):
        lsm.restore_checkpoint(loaded, file)
    assert np.array_equal(loaded.positions, before)


def test_time_step_and_margin_are_those_of_the_file_and_guards_those_of_the_scene(loaded, tmp_path):
    file = tmp_path / "other.nc"
    loaded.reset(scenes.scene(**GRAINS | {"dt": 5e-5, "skin": 0.3}))
    loaded.run(4)
    lsm.save_checkpoint(loaded, file)
    loaded.reset(scenes.scene(**GRAINS | {"skin": 0.1, "guards": lsm.Guards(energy=0.5)}))
    lsm.restore_checkpoint(loaded, file)
    assert (loaded.dt, loaded.skin, loaded.step, loaded.scene.guards.energy) == (5e-5, 0.3, 4, 0.5)
    assert loaded.validity.half_skin[None] == 0.15 and loaded.search.skin[None] == 0.3


@pytest.fixture(scope="module")
def loaded(runtime):
    """A simulation of two grains, which the tests reset."""
    return scenes.simulate(scenes.scene(**GRAINS))
