"""Names and numbers that files and pictures show are those of the effects and grains that ran."""

import numpy as np
import pytest
import xarray as xr

import taichi_lsm as lsm
from taichi_lsm.io.run_file import RunWriter
from tests.helpers.output_files import LABELS, RUN, attributes
from workflows import shear_gouge
from workflows.common.small_scenes import scene_of
from workflows.gouge.labels import (
    SPRING_WORDS,
    friction_words,
    grain_words,
    grains_of_run,
    other_effects,
    shape_words,
    spring_words,
)
from workflows.gouge.layer_parameters import SPRINGS

HERTZ = {"name": "hertz", "youngs_modulus": 70e9, "poissons_ratio": 0.3}
GLASS = (70e9 / 5e6) ** (2.0 / 3.0)  # stiffness number of glass at 5 MPa, 580.9


def test_the_stiffness_of_contacts_follows_from_their_effects():
    """A spring has its own; that of Hertz gives the stiffness number (E/P)^(2/3); other effects have none."""
    stress, width = 5e6, 1e-4
    assert lsm.contact_stiffness([lsm.LinearElastic(1e5), lsm.CoulombFriction(0.5, 1e4)], stress, width) == 1e5
    hertz = lsm.contact_stiffness([lsm.effects.Hertz(70e9, 0.3)], stress, width)
    assert hertz / (stress * width) == pytest.approx(580.9, abs=0.1)
    assert np.isnan(lsm.contact_stiffness([lsm.CoulombFriction(0.5, 1e4)], stress, width))


@pytest.mark.parametrize(("given", "number"), [([], 1000.0), ([HERTZ], GLASS)])
def test_the_default_effects_follow_the_elasticity_that_replaces_theirs(given, number):
    params = shear_gouge.Params(effects=given)
    stiffness = number * params.normal_stress * params.diameter
    assert params.stiffness == pytest.approx(stiffness, rel=1e-12)
    (friction,) = (e for e in shear_gouge.effects_of(params) if e.name == "coulomb_friction")
    assert friction.tangential_stiffness == pytest.approx(0.5 * stiffness, rel=1e-12)


def test_soft_effects_for_angular_grains_are_refused_by_their_own_stiffness_number():
    soft = {"name": "linear_elastic", "stiffness": 5e3}
    with pytest.raises(lsm.InputError, match=r"effects: stiffness number 7.87 of the contacts, must be >= 100"):
        shear_gouge.check(shear_gouge.Params(shape="angular", effects=[soft]))


def test_friction_is_named_by_the_effect_in_the_file(tmp_path):
    rates = lsm.effects.RateAndStateFriction(0.1, 0.01, 0.02, 1e-6, 1e-3, 1e5)
    glass = [lsm.effects.Hertz(70e9, 0.3), lsm.effects.Mindlin(0.5, 70e9, 0.3)]
    found = {}
    for name, effects in (
        ("one", [lsm.CoulombFriction(0.4, 1e5)]),
        ("two", [rates]),
        ("glass", glass),
        ("none", [lsm.LinearElastic(1e5)]),
    ):
        RunWriter(tmp_path / f"{name}.nc", RUN, attributes(), LABELS, effects=effects).close("complete")
        found[name] = friction_words(lsm.open_run(tmp_path / f"{name}.nc"))
    assert found == {
        "one": "Coulomb friction (coefficient 0.4)",
        "two": "rate and state friction (reference coefficient 0.1, direct effect 0.01, evolution effect 0.02)",
        "glass": "Mindlin (coefficient 0.5, Young's modulus 7e+10 Pa, Poisson's ratio 0.3)",
        "none": "no friction",
    }


def test_grains_are_named_by_their_shapes():
    square = lsm.shapes.from_polygon([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)], 0.1)
    elastic = [lsm.LinearElastic(1e5)]

    def words(shape, dim=2):
        return grain_words(scene_of(2.0 * np.eye(2, dim), elastic, shapes=[shape]))

    assert words(lsm.disc()) == "discs" and words(lsm.sphere(), 3) == "spheres"
    assert words(square) == "angular grains"
    assert words(lsm.shapes.equal_clump(square, 6)) == "clumps"


@pytest.mark.parametrize(("shape", "dim", "words"), [("round", 2, "discs"), ("round", 3, "spheres")])
def test_round_grains_are_named_by_their_dimension(shape, dim, words):
    assert shape_words(shape, dim) == words and shape_words("angular", dim) == "angular grains"


def test_a_spring_is_named_in_the_unit_in_which_it_was_given():
    assert set(SPRING_WORDS) == set(SPRINGS)
    given = {"load_stiffness": 2e6, "load_stiffness_area": 1e12, "load_stiffness_ratio": 0.01}
    words = {name: spring_words(shear_gouge.Params(**{name: value})) for name, value in given.items()}
    assert words == {
        "load_stiffness": "2e+06 N/m",
        "load_stiffness_area": "1e+12 Pa/m",
        "load_stiffness_ratio": "0.01 times the shear stiffness of the layer",
    }
    assert spring_words(shear_gouge.Params()) is None


@pytest.mark.parametrize(
    ("title", "words"),
    [
        ("Shear of a layer of clumps in 2D", "clumps"),  # what ran, whatever the option says
        (
            "Shear of a layer of breakable grains in 2D",
            "breakable angular grains (7 pieces each, bond strength 20 times",
        ),
        ("", "angular grains"),
    ],
)
def test_the_grains_of_a_run_are_those_that_its_file_names(title, words):
    params = shear_gouge.Params(shape="angular", breakable=True)
    assert grains_of_run(xr.Dataset(attrs={"title": title}), params).startswith(words)


def test_the_scatter_of_bonds_is_named_where_there_is_one():
    run = xr.Dataset(attrs={"title": "Shear of a layer of breakable grains in 3D"})
    given = {"shape": "angular", "breakable": True, "dim": 3}
    assert grains_of_run(run, shear_gouge.Params(weibull_modulus=5, **given)).endswith("Weibull modulus 5)")
    assert grains_of_run(run, shear_gouge.Params(**given)).endswith("times the normal stress)")


def test_effects_beside_the_usual_ones_are_in_the_title(sheared):
    _, _, run = sheared("sphere")
    assert other_effects(run) == ""
    more = run.assign_coords(effect_name=("effect", ["hertz", *run.effect_name.values[1:]]))
    assert other_effects(more) == ", with Hertz"
    twice = run.assign_coords(effect_name=("effect", ["hertz", "hertz", *run.effect_name.values[2:]]))
    assert other_effects(twice) == ", with Hertz"


def test_a_number_of_grains_that_gives_no_bulk_is_remarked():
    assert shear_gouge.Params(grains=600).notes == ()
    (note,) = shear_gouge.Params(grains=40).notes
    assert note.startswith("--grains 40: the layer is 1.3 mean diameters thick, less than the 8 that --layer-thickness")
