"""What a scene takes, fills in and refuses; nothing is compiled."""

import dataclasses
import re

import numpy as np
import pytest

import taichi_lsm as lsm

SPRING = [lsm.LinearElastic(1e5)]


def two(**more):
    """Two grains, with whatever else is to be tried."""
    return lsm.Scene(**{"position": [(0.0, 0.0), (2.0, 0.0)], "density": 1000.0, "effects": SPRING} | more)


def test_the_least_scene_is_two_discs_in_open_space():
    scene = two()
    assert scene.dim == 2 and scene.lengths == (np.inf, np.inf) and scene.periodic == (False, False)
    assert [shape.name for shape in scene.shapes] == ["disc"]
    assert scene.shape_index.tolist() == [0, 0] and scene.platen_index.tolist() == [-1, -1]
    assert scene.diameter.tolist() == [1.0, 1.0] and scene.thickness == 1.0 and scene.skin == pytest.approx(0.07)
    assert scene.velocity.shape == (2, 2) and scene.angular_velocity.shape == (2, 1) and not scene.angle.any()
    mass, inertia = scene.masses()
    assert mass == pytest.approx([1000.0 * np.pi / 4] * 2) and inertia == pytest.approx(mass[:, None] / 8)


def test_three_columns_make_a_scene_of_spheres():
    scene = two(position=np.zeros((1, 3)), diameter=2.0)
    assert scene.dim == 3 and scene.shapes[0].name == "sphere" and scene.orientation.tolist() == [[1.0, 0.0, 0.0, 0.0]]
    assert scene.masses()[0] == pytest.approx([1000.0 * np.pi / 6 * 8.0])


def test_one_number_holds_for_all_grains():
    scene = two(diameter=0.5, shapes=[lsm.disc(), lsm.disc()], shape_index=1)
    assert scene.diameter.tolist() == [0.5, 0.5] and scene.shape_index.tolist() == [1, 1]


def test_every_parameter_is_a_keyword():
    with pytest.raises(TypeError, match="positional"):
        lsm.Scene(2)
    for old in ("scale", "shape", "platen"):
        with pytest.raises(TypeError, match=f"unexpected keyword argument '{old}'"):
            two(**{old: 1})


def test_scenes_compare_by_identity():
    scene = two()
    assert scene == scene and scene != two()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"position": []}, "Scene.position: no grains"),
        ({"position": [(0.0,) * 4]}, "Scene.dim: 4, must be 2 or 3"),
        ({"dim": 3}, r"Scene.position: array of shape \(2, 2\), must be \(2, 3\)"),
        ({"diameter": np.ones(3)}, r"Scene.diameter: array of shape \(3,\), must be \(2,\)"),
        ({"diameter": 0.0}, "Scene.diameter: least value 0 m, must be > 0"),
        ({"density": -1.0}, "Scene.density: -1.0 kg/m3, must be > 0"),
        ({"shape_index": [0, 1]}, r"Scene.shape_index: 0..1, must be 0..0"),
        ({"platen_index": [0, -1]}, r"Scene.platen_index: -1..0, .*which has 0"),
        ({"orientation": np.ones((2, 4))}, "Scene.orientation: given in 2D, where `angle`"),
        ({"velocity": [(0.0, np.inf), (0.0, 0.0)]}, "Scene.velocity: grain 0 is not finite"),
        ({"periodic": (True,)}, r"Scene.periodic: 1 values, must be one per axis \(2\)"),
        ({"periodic": (True, False)}, "length inf m is periodic"),
        ({"skin": 0.0}, "Scene.skin: 0.0 m, must be > 0"),
        ({"effects": SPRING * 2}, "each effect may be listed once"),
        ({"effects": [3]}, r"Scene.effects: \[3\], must be instances of Effect, in a list"),
        (
            {"effects": lsm.LinearElastic(1e5)},
            "Scene.effects: .*LinearElastic.*, must be instances",
        ),
        ({"bonds": [(0, 1)]}, "Scene.bonds"),
        ({"shapes": [lsm.sphere()]}, "'sphere' is not a shape in 2D"),
    ],
)
def test_what_makes_no_sense_is_named_with_its_bound(changes, message):
    with pytest.raises(lsm.InputError, match=message):
        two(**changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"position": [(0.0, 0.0), (1.0,)]},
            r"Scene.position: \[\(0.0, 0.0\), \(1.0,\)\], must be numbers",
        ),
        ({"position": "abc"}, "Scene.position: 'abc', must be numbers"),
        ({"position": [0.0, 1.0]}, r"Scene.position: array of shape \(2,\), must be \(n, 2\) or \(n, 3\)"),
        ({"diameter": "x"}, "Scene.diameter: 'x', must be numbers"),
        ({"diameter": None}, "Scene.diameter: grain 0 is not finite"),
        ({"angle": "x"}, "Scene.angle: 'x', must be numbers"),
        ({"velocity": [(0.0, 0.0), (1.0,)]}, "Scene.velocity: .*, must be numbers, equally many in each row"),
        ({"angular_velocity": "x"}, "Scene.angular_velocity: 'x', must be numbers"),
        ({"shape_index": [0.7, 0]}, "Scene.shape_index: 0.7, must be whole numbers, rows of a table"),
        ({"shape_index": "x"}, "Scene.shape_index: 'x', must be numbers"),
        ({"platen_index": [-1.0, np.nan]}, "Scene.platen_index: nan, must be whole numbers"),
        ({"platen_index": [2**40, -1]}, r"Scene.platen_index: 1.09951e\+12, must be whole numbers"),
        ({"lengths": 5.0}, r"Scene.lengths: 5.0, must be a number per axis \(2\)"),
        ({"lengths": ("a", "b")}, "Scene.lengths: 'a', must be a number per axis"),
        ({"lengths": (5.0, np.nan)}, "Scene.lengths: nan, must be a number per axis"),
        ({"periodic": True}, r"Scene.periodic: True, must be True or False per axis \(2\)"),
        ({"periodic": ("x", "y")}, "Scene.periodic: 'x', must be True or False per axis"),
        ({"periodic": (2, 0)}, "Scene.periodic: 2, must be True or False per axis"),
        ({"density": "heavy"}, "Scene.density: 'heavy' kg/m3, must be > 0"),
        ({"skin": "a"}, "Scene.skin: 'a' m, must be > 0"),
        ({"thickness": -1.0}, "Scene.thickness: -1.0 m, must be > 0"),
        ({"area": 0.0}, "Scene.area: 0.0 m2, must be > 0"),
        ({"safety": -1.0}, "Scene.safety: -1.0, must be > 0"),
        ({"shear_rate": "fast"}, "Scene.shear_rate: 'fast' s-1, must be a finite number"),
        ({"integrator": "verlet"}, "Scene.integrator: 'verlet', must be a class such as OnsetVerlet"),
        ({"integrator": dict}, "Scene.integrator: .*dict.*, must be a class such as OnsetVerlet"),
        ({"guards": None}, r"Scene.guards: None, must be Guards\(...\)"),
        ({"track_dissipation": "no"}, "Scene.track_dissipation: 'no', must be True or False"),
        ({"parallel": 2}, "Scene.parallel: 2, must be True, False or None"),
        ({"shapes": [1]}, r"Scene.shapes: \[1\], must be instances of GrainShape, in a list"),
        ({"shapes": []}, "Scene.shapes: none, must be at least one"),
        ({"platens": ["a"]}, r"Scene.platens: \['a'\], must be instances of Platen"),
        ({"walls": ["floor"]}, r"Scene.walls: \['floor'\], must be instances of PlaneWall"),
    ],
)
def test_what_has_the_wrong_type_is_refused_by_its_name(changes, message):
    with pytest.raises(lsm.InputError, match=message):
        two(**changes)


def test_a_step_that_is_no_number_is_refused():
    with pytest.raises(lsm.InputError, match=r"Scene\.dt: 'x' s, must be > 0"):
        two(dt="x").chosen_dt()


def test_whole_numbers_and_truth_values_of_any_type_are_taken():
    scene = two(
        shape_index=np.zeros(2), platen_index=np.int64(-1), lengths=np.array([5.0, 5.0]), periodic=np.array([1, 0])
    )
    assert scene.shape_index.dtype == scene.platen_index.dtype == np.int32
    assert scene.shape_index.tolist() == [0, 0] and scene.platen_index.tolist() == [-1, -1]


def test_three_dimensions_take_unit_quaternions():
    with pytest.raises(lsm.InputError, match="must be unit quaternions"):
        two(position=np.zeros((1, 3)), orientation=[(1.0, 1.0, 0.0, 0.0)])
    with pytest.raises(lsm.InputError, match=r"Scene.angle: given in 3D, where `orientation`"):
        two(position=np.zeros((1, 3)), angle=[0.0])


def test_the_docstring_lists_every_parameter_once():
    parameters = lsm.Scene.__doc__.split("----------\n")[1].split("Raises")[0]
    listed = re.findall(r"^ {4}(\w+) : ", parameters, re.MULTILINE)
    assert sorted(listed) == sorted(field.name for field in dataclasses.fields(lsm.Scene))
    optional = {f.name for f in dataclasses.fields(lsm.Scene)} - {"position", "density", "effects"}
    for name in optional:
        text = re.search(rf"^ {{4}}{name} : .*\n((?: {{8}}.*\n)+)", parameters, re.MULTILINE)[1]
        assert "efault" in text, f"{name}: no default in the docstring"
