"""The experiment on one layer: refused inputs, the state it reaches, and how it fails."""

import contextlib
import itertools

import numpy as np
import pytest
import shapely

import taichi_lsm as lsm
from tests.helpers.output_files import check_described
from workflows import shear_gouge
from workflows.common.parameters import ParameterError, merge, to_toml
from workflows.common.refusals import in_terms_of
from workflows.gouge import initial_grains, layer_run, layer_scene

SHAPES = ("sphere", pytest.param("angular", marks=pytest.mark.validate))  # as `make demo` runs it


def test_every_wrong_value_is_reported():
    wrong = {"normal_stress": "-5e6", "shape": "anglar", "grains": "many", "strain": "0"}
    with pytest.raises(ParameterError) as caught:
        merge(shear_gouge.Params, options=wrong)
    text = "\n".join(caught.value.problems)
    assert "--normal-stress -5e6: must be a number, from 0.001 to 1e+12." in text
    assert (
        "--shape anglar: must be one of round (also disc, discs, sphere, spheres), angular. Did you mean angular?"
        in text
    )
    assert "--grains many" in text and "--strain 0" in text


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"smallest_diameter": 2e-4}, "above largest_diameter"),
        ({"strain": 1.0, "steady_from": 1.0}, "steady_from"),
        ({"strain": 1.05, "steady_from": 1.0}, "needs 12 rows"),
        ({"shape": "angular", "corner_radius": 0.01, "stiffness_number": 200.0}, "stiffness_number"),
        (
            {"shape": "angular", "precision": "f32", "side_half_width": 1e-3},
            "side_half_width = 0.001: must be >= 0.0021 ",
        ),
        (
            {"shape": "angular", "dim": 3, "precision": "f32", "face_flatness": 200},
            "face_flatness = 200: must be <= 167 ",
        ),
        ({"shape": "sphere", "breakable": True}, "breakable needs shape angular, not shape round"),
        ({"dim": 3, "platen_roughness": 1.5}, "platen_roughness 1.5 must be <= 1 in 3D"),
        ({"target_error": 0.01, "load_stiffness": 1e3}, "target_error is for layers of whole grains"),
        (
            {"load_stiffness": 1e3, "load_stiffness_ratio": 0.1},
            "load_stiffness and load_stiffness_ratio are ways to give",
        ),
        ({"shape": "angular", "breakable": True, "pieces": 16, "stiffness_number": 300.0}, "must be >= 400"),
        ({"shape": "angular", "dim": 3, "breakable": True, "pieces": 27, "stiffness_number": 299.0}, "must be >= 300"),
    ],
)
def test_values_that_contradict_each_other_are_refused(values, words):
    with pytest.raises(ParameterError, match=words):
        shear_gouge.Params(**values)


@pytest.mark.parametrize("name", ["round", "disc", "sphere"])
def test_discs_and_spheres_are_round(name):
    assert shear_gouge.Params(shape=name).shape == "round"


def test_contradictions_are_reported_together():
    values = {
        "smallest_diameter": 2e-4,
        "steady_from": 9.0,
        "shape": "angular",
        "stiffness_number": 100.0,
        "corner_radius": 0.02,
    }
    with pytest.raises(ParameterError) as caught:
        merge(shear_gouge.Params, options=values)
    text = "\n".join(caught.value.problems)
    assert all(words in text for words in ("--largest-diameter", "--steady-from", "--stiffness-number"))


HERTZ = {"name": "hertz", "youngs_modulus": 1e9, "poissons_ratio": 0.3}
GRAVITY = {"name": "gravity", "acceleration": [0.0, -9.81, 0.0]}
BOND = {"name": "elastic_brittle_bond", "youngs_modulus": 1e9, "poissons_ratio": 0.2, "cohesion": 1e6} | {
    "friction_angle": 0.6
}


@pytest.mark.parametrize(
    ("values", "effect", "words"),
    [
        ({"shape": "angular", "dim": 3}, HERTZ | {"radius": "local"}, "not defined on edges"),
        ({"shape": "angular", "dim": 2}, HERTZ | {"radius": "local"}, "jumps at the seams"),
        ({}, GRAVITY, "must be 2 numbers"),
        ({}, BOND, "bond"),
    ],
)
def test_effects_that_do_not_suit_the_grains_are_refused_as_effects(values, effect, words):
    params = shear_gouge.Params(**values, effects=[effect])
    with pytest.raises(lsm.InputError, match=rf"^effects: refused, as .*{words}.*; lsm list --effects"):
        shear_gouge.check(params)


def test_a_modulus_in_round_numbers_may_be_the_least():
    """(E/P)^(2/3) is 100 but for rounding, and 100 the least stiffness number."""
    for modulus, refused in ((5e9, False), (4.99e9, True)):
        hertz = HERTZ | {"youngs_modulus": modulus}
        params = shear_gouge.Params(shape="angular", dim=3, normal_stress=5e6, effects=[hertz])
        with pytest.raises(lsm.InputError, match="stiffness number") if refused else contextlib.nullcontext():
            shear_gouge.layer_scene.check_stiffness(params)


def test_the_number_of_grains_sets_the_thickness_and_both_are_refused():
    for dim in (2, 3):
        by_thickness = shear_gouge.Params(dim=dim, layer_thickness=18.0)
        by_count = shear_gouge.Params(dim=dim, grains=shear_gouge.layer_scene.mobile_count(by_thickness))
        assert by_count.layer[0] == pytest.approx(by_thickness.layer[0], rel=1e-3)
        assert by_count.layer[1] == by_thickness.layer[1]
    both = shear_gouge.Params(grains=100, layer_thickness=8)
    with pytest.raises(lsm.InputError, match=r"^--layer-thickness 8.*: has no effect beside --grains 100, from which"):
        shear_gouge.check(both)
    assert "layer_thickness" not in merge(shear_gouge.Params, "smoke", options={"grains": "100"}).given
    assert "# layer_thickness = 10.0  # no effect beside --grains" in to_toml(
        merge(shear_gouge.Params, "smoke", options={"grains": "100"})
    )


def test_a_word_for_round_grains_has_the_same_note_in_python_as_on_the_command_line():
    told = merge(shear_gouge.Params, options={"shape": "sphere"}).notes
    assert shear_gouge.Params(shape="sphere").notes == told == ("--shape sphere in 2D means discs",)
    assert shear_gouge.Params(shape="disc").notes == shear_gouge.Params(shape="sphere", dim=3).notes == ()
    assert shear_gouge.Params(shape="sphere") == shear_gouge.Params(shape="round")


def test_a_layer_on_a_spring_is_told_why_it_needs_more_strain():
    with pytest.raises(ValueError, match=r"12 rows, which lie up to 4 times as far apart where a layer on a spring"):
        shear_gouge.Params(strain=1.2, load_stiffness=1e3)


def test_effects_that_are_no_tables_are_told_how_a_table_begins(tmp_path):
    for text in ('effects = ["gravity"]', '[effects]\nname = "gravity"\nacceleration = [0.0, -9.81]'):
        (tmp_path / "wrong.toml").write_text(text)
        with pytest.raises(lsm.InputError, match=r"must be tables, each below a line \[\[effects\]\].*name = "):
            merge(shear_gouge.Params, None, tmp_path / "wrong.toml")


def test_a_range_of_the_effects_beyond_half_of_the_cell_is_refused_with_the_length():
    wide = {"name": "cohesion", "pull_off_force": 1.0, "distance": 1e-3}
    params = shear_gouge.Params(grains=20, length=10, effects=[wide])
    shear_gouge.check(params)
    with pytest.raises(lsm.InputError, match=r"^--length 10: refused, as .*must be >= .*make the layer larger"):
        shear_gouge.build(params)


def test_a_programming_error_is_not_reported_as_a_mistake_of_the_user():
    with pytest.raises(TypeError, match=r"^no input$"), in_terms_of("--length 6", "make it longer"):
        raise TypeError("no input")


def test_equal_sizes_are_allowed():
    params = shear_gouge.Params(smallest_diameter=1e-4, largest_diameter=1e-4, layer_thickness=8, length=10)
    scene = shear_gouge.build(params)
    assert np.allclose(scene.diameter[scene.platen_index < 0], 1e-4)


def test_grains_sets_their_number_and_the_seed_the_packing():
    one, same, other = (shear_gouge.build(shear_gouge.Params(grains=50, length=10, seed=seed)) for seed in (1, 1, 2))
    assert np.sum(one.platen_index < 0) == 50
    assert np.array_equal(one.position, same.position)
    assert not np.array_equal(one.position[:50], other.position[:50])


def test_shapes_that_are_given_are_packed_as_they_are():
    """Bars, which would cut into one another in the places of other grains."""
    bar = lsm.shapes.from_polygon([(-1.0, -0.2), (1.0, -0.2), (1.0, 0.2), (-1.0, 0.2)], 0.1)
    params = shear_gouge.Params(shape="angular", grains=30, length=10)
    scene = shear_gouge.build(params, shapes=[bar])
    mobile = scene.platen_index < 0
    assert scene.shapes[1:] == [bar] and set(scene.shape_index[mobile]) == {1}
    outline = bar.outline(200)
    bars = []
    for angle, size, place in zip(scene.angle[mobile], scene.diameter[mobile], scene.position[mobile], strict=True):
        c, s = np.cos(angle), np.sin(angle)
        bars.append(shapely.Polygon(place + size * outline @ np.array([[c, s], [-s, c]])))
    pairs = itertools.combinations(bars, 2)
    cut = max(one.intersection(other).area for one, other in pairs)
    assert cut < 1e-6 * params.diameter**2


@pytest.mark.parametrize(
    ("values", "most"), [({"shape": "sphere"}, 1.25), ({"shape": "angular", "breakable": True, "pieces": 3}, 1.5)]
)
def test_a_layer_starts_dense_or_loose_with_the_same_grains(values, most, monkeypatch):
    monkeypatch.setattr(initial_grains, "AGGREGATES", 2)
    height, sizes = {}, []
    for start in ("dense", "loose"):
        params = shear_gouge.Params(layer_thickness=8, length=10, start=start, **values)
        scene = shear_gouge.build(params)
        glued = [scene.platen_index == platen for platen in (0, 1)]
        low, high = (
            np.mean(scene.position[own, 1] + side * 0.5 * scene.diameter[own]) for own, side in zip(glued, (1, -1))
        )
        height[start] = (high - low) / params.layer[0]
        mobile = scene.position[scene.platen_index < 0, 1]
        assert low - params.diameter < mobile.min() and mobile.max() < high + params.diameter
        sizes.append(scene.diameter)
    assert np.array_equal(*sizes)
    assert 0.95 < height["dense"] < most < 1.6 < height["loose"]  # of the thickness after consolidation


@pytest.mark.parametrize("shape", SHAPES)
def test_a_layer_is_sheared_at_its_normal_stress(sheared, shape):
    _, params, dataset = sheared(shape)
    assert dataset.run_status == "complete"
    assert params.strain <= float(dataset.shear_strain[-1]) < params.strain + 0.1
    metrics = shear_gouge.analyse(dataset, params)
    assert metrics["energy_residual"].value < 0.01
    assert abs(metrics["normal_stress_error"].value) < 0.05
    assert metrics["inertial_number"].value == pytest.approx(params.inertial_number, rel=0.1)
    assert 0.05 < metrics["friction_mean"].value < 1.0
    consolidated = metrics["consolidation_share"].value * float(dataset.time[-1]) / params.inertial_time
    assert 8.0 < consolidated < 40.0  # four checks of two inertial times each; a loose layer takes more than 60
    assert 0.0 < metrics["porosity"].value < 0.4
    assert 1.0 < metrics["coordination_number"].value < 6.0
    assert set(shear_gouge.BOUNDS) <= set(metrics)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_steps_of_a_run_are_foreseen(sheared, shape):
    """By a factor of 1.5: the fall of the platen and the step depend on grains that are not made yet."""
    _, params, run = sheared(shape)
    steps = float(run.time[-1]) / run.dt
    assert steps / 1.5 < shear_gouge.estimate(params).steps < steps * 1.5


@pytest.mark.parametrize("shape", SHAPES)
def test_the_files_tell_how_they_were_made(sheared, shape):
    folder, params, dataset = sheared(shape)
    assert merge(shear_gouge.Params, toml_path=folder / "config.toml") == params
    assert dataset.config_toml == (folder / "config.toml").read_text()
    grains = {"sphere": "discs", "angular": "angular grains"}[shape]
    assert dataset.title == f"Shear of a layer of {grains} in 2D"
    assert float(dataset.stiffness_number) == pytest.approx(1000.0) and float(dataset.particle_friction) == 0.5
    assert dataset["run"] == folder.name and dataset["shape"] == params.shape and int(dataset.seed) == params.seed
    assert np.isnan(dataset.width) and np.isnan(dataset.corner_radius) == (shape == "sphere")
    acted = {(row.effect, row.name): row.value for row in lsm.read_effects(dataset)}
    assert acted["coulomb_friction", "coefficient"] == 0.5 and acted["viscous_damping", "restitution"] == 0.5
    grains = lsm.open_run(folder / "grains.nc")
    assert grains.run_status == "complete"
    assert float(grains.time[-1]) == float(dataset.time[-1])
    assert {"run.nc", "grains.nc", "summary.json", "config.toml"} <= {p.name for p in folder.iterdir()}
    for path in folder.rglob("*.nc"):
        check_described(path)


def test_friction_is_the_ratio_of_the_stresses_and_strain_the_integral_of_the_rate(sheared):
    _, params, dataset = sheared("sphere")
    steady = dataset.isel(time=dataset.stage.values == "shear")
    assert np.allclose(steady.friction, steady.shear_stress / steady.normal_stress)
    mean = float(steady.shear_stress.mean() / steady.normal_stress.mean())
    assert shear_gouge.analyse(dataset, params.model_copy(update={"steady_from": 0.0}))[
        "friction_mean"
    ].value == pytest.approx(mean)
    expected = float(steady.displacement[-1] - steady.displacement[0]) / float(steady.layer_thickness.mean())
    assert float(steady.shear_strain[-1] - steady.shear_strain[0]) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_spring_is_the_same_in_each_of_its_units(dim):
    """Beside a layer of 10 x 8 (x 5) diameters, whose columns of 8 contacts have k_t/8 each."""
    params = shear_gouge.Params(dim=dim, length=10, layer_thickness=8, width=5, load_stiffness_ratio=0.25)
    columns = 10 if dim == 2 else 10 * 5
    spring = 0.25 * columns * 0.5 * params.stiffness / 8
    area = 10 * (params.diameter if dim == 2 else 5 * params.diameter) * params.diameter
    assert params.spring == pytest.approx(spring) and params.area == pytest.approx(area)
    for given in ({"load_stiffness": spring}, {"load_stiffness_area": spring / area}):
        assert shear_gouge.Params(dim=dim, length=10, layer_thickness=8, width=5, **given).spring == pytest.approx(
            spring
        )
    assert layer_scene.shear_drive(params, 1.0, 1.0).stiffness == pytest.approx(spring)
    assert shear_gouge.Params().spring is None


@pytest.mark.validate
def test_the_summary_of_a_spring_and_of_broken_bonds(sheared):
    _, params, dataset = sheared("round")
    soft = params.model_copy(update={"load_stiffness_area": 2e9})
    broken = dataset.assign(bond_count=("time", np.linspace(90, 60, dataset.sizes["time"]).astype(int)))
    broken = broken.assign(fragment_count=("time", np.linspace(10, 25, dataset.sizes["time"]).astype(int)))
    metrics = shear_gouge.analyse(broken, soft)
    first = broken.bond_count.values[dataset.stage.values == "shear"][0]
    found = {name: metrics[name].value for name in ("bonds", "fragments", "bonds_broken", "load_stiffness")}
    assert found == {"bonds": 60, "fragments": 25, "bonds_broken": 1 - 60 / first, "load_stiffness": 2e9 * params.area}
    assert metrics["contact_stiffness"].value == params.stiffness and metrics["layer_area"].value == params.area
    assert not {"bonds", "load_stiffness"} & set(shear_gouge.analyse(dataset, params))


@pytest.mark.validate
def test_a_layer_on_a_soft_spring_sticks_and_slips(tmp_path):
    params = shear_gouge.Params(length=10, layer_thickness=8, inertial_number=5e-3, strain=1.6)
    thickness, (length,) = params.layer
    soft = params.normal_stress * length * params.diameter / thickness  # the whole normal load over one thickness
    dataset = shear_gouge.run(params.model_copy(update={"load_stiffness": soft}), tmp_path)
    rows = dataset.isel(time=dataset.stage.values == "shear")
    load, plate = rows.load_point_velocity.values, rows.instantaneous_plate_velocity.values
    assert np.all(load == load[0]) and load[0] > 0
    assert np.mean(plate < 0.3 * load) > 0.1 and plate.max() > 2 * load[0]
    assert shear_gouge.analyse(dataset, params)["energy_residual"].value < 0.005


def test_a_run_that_diverges_leaves_files_that_say_so(sheared, tmp_path, monkeypatch):
    _, params, complete = sheared("sphere")

    class Diverging(layer_run.RunLoop):
        def _begin(self, stage):
            super()._begin(stage)
            if stage.name == "shear":
                velocity = self.sim.state.velocity.to_numpy()
                velocity[3] = 1e4 * params.diameter / params.inertial_time
                self.sim.state.velocity.from_numpy(velocity)

    monkeypatch.setattr(layer_run, "RunLoop", Diverging)
    with pytest.raises(lsm.SimulationError, match=r"grain 3 moves by .* use dt <=") as stopped:
        shear_gouge.run(params, tmp_path)
    assert stopped.value.grains == (3,) and [p.name for p in stopped.value.saved] == ["stopped.nc", "checkpoint.nc"]
    assert {"stopped.nc", "stopped.png"} <= {path.name for path in tmp_path.iterdir()}
    assert lsm.open_run(tmp_path / "grains.nc").sizes["time"] == 3  # of three stages, the last the one of the stop
    for name in ("run.nc", "grains.nc"):
        assert lsm.open_run(tmp_path / name).run_status == "failed"
    left = lsm.open_run(tmp_path / "run.nc")
    before = complete.isel(time=complete.stage.values != "shear")
    assert left.sizes["time"] == before.sizes["time"]  # nothing of what was computed is lost,
    assert np.array_equal(left.layer_thickness, before.layer_thickness)  # and a seed gives the same bits again
    assert (tmp_path / "config.toml").exists()
    assert not (tmp_path / "summary.json").exists()


def test_a_broken_rule_between_fields_is_reported_beside_a_wrong_field():
    with pytest.raises(ParameterError) as raised:
        merge(shear_gouge.Params, options={"shape": "cubes", "smallest_diameter": "2e-4"})
    assert len(raised.value.problems) == 2
    assert "cubes" in raised.value.problems[0] and "no size is left" in raised.value.problems[1]
