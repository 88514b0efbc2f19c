"""Merging preset, TOML and options; messages; TOML text."""

import pickle
import string
from typing import Annotated, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, Field

from workflows.common.former_names import FORMER
from workflows.common.parameter_types import OtherNames
from workflows.common.parameters import ParameterError, Params, merge, to_toml
from workflows.common.refusals import check_idle


def problems(params_class, *args, **kwargs) -> list[str]:
    with pytest.raises(ParameterError) as caught:
        merge(params_class, *args, **kwargs)
    return caught.value.problems


def test_no_preset_is_standard(toy):
    params = merge(toy.Params)
    assert params.normal_stress == 1e6  # the class default is 5e6
    assert params.preset_name == "standard"


def test_option_wins_over_toml_and_toml_over_preset(toy, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text("normal_stress = 2e3\ndim = 3\n")
    params = merge(toy.Params, "smoke", scene, {"dim": "2"})
    assert (params.grains, params.normal_stress, params.dim) == (10, 2e3, 2)
    assert params.preset_name == "smoke"


def test_what_the_user_gives_in_another_way_replaces_that_of_a_preset(toy, tmp_path):
    class Machine(toy.Params):
        alternatives = (("stiffness", "compliance"),)
        stiffness: float | None = Field(default=None, description="of the machine [1]")
        compliance: float | None = Field(default=None, description="of the machine [1]")
        presets = {**toy.Params.presets, "smoke": {"stiffness": 2.0}}  # noqa: RUF012

    assert merge(Machine, "smoke").stiffness == 2.0
    scene = tmp_path / "scene.toml"
    scene.write_text("compliance = 3.0\n")
    for params in (merge(Machine, "smoke", options={"compliance": "3"}), merge(Machine, "smoke", scene)):
        assert (params.stiffness, params.compliance) == (None, 3.0)
    assert merge(Machine, "smoke").stiffness == 2.0  # the preset itself has not changed


def test_options_are_parsed_from_text(toy):
    options = {
        "grains": "12",
        "normal_stress": "5e6",
        "shapes": "sphere, angular",
        "seeds": "3,4",
        "time_step": "none",
        "rough": False,
    }
    params = merge(toy.Params, options=options)
    assert params.grains == 12 and params.normal_stress == 5e6 and params.rough is False
    assert params.shapes == ("sphere", "angular") and params.seeds == [3, 4]
    assert params.time_step is None


def test_every_mistake_of_every_source_is_one_message(toy, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text('grans = 5\nnormal_stress = -1.0\nseeds = [1, -2, -3]\neffects = [{name = "x", stifness = 2}]\n')
    found = problems(toy.Params, "smok", scene, {"dim": "4", "shape": "sphre", "threads": "two"})
    expected = [
        "--preset smok: unknown preset, must be one of smoke, demo, standard, reference. Did you mean smoke?",
        f"grans = 5 ({scene}): unknown parameter. Did you mean grains?",
        f"--normal-stress -1.0 ({scene}): must be a number, greater than 0.",
        f"--seeds [1, -2, -3] ({scene}): must be a list of integers, at least 0.",
        f"effects[0].stifness = 2 ({scene}): unknown key. Did you mean stiffness?",
        "--dim 4: must be an integer, from 2 to 3.",
        "--shape sphre: must be one of sphere, angular. Did you mean sphere?",
        "--threads two: must be an integer, from 1 to 1024.",
    ]
    assert sorted(found) == sorted(expected)


def test_mistakes_in_python_name_the_arguments_all_together(toy):
    with pytest.raises(ParameterError) as caught:
        toy.Params(dim=4, thread=2, normal_stress=-1.0, shape="sphre", effects=[{"name": "a", "stifness": 2}])
    assert sorted(caught.value.problems) == sorted(
        [
            "dim = 4: must be an integer, from 2 to 3.",
            "thread = 2: unknown parameter. Did you mean threads?",
            "normal_stress = -1.0: must be a number, greater than 0.",
            "shape = sphre: must be one of sphere, angular. Did you mean sphere?",
            "effects[0].stifness = 2: unknown key. Did you mean stiffness?",
        ]
    )


class Named(Params):
    """Texts that have other words."""

    shape: Annotated[Literal["round", "flat"], OtherNames("round", ("disc", "ball"))] = Field("flat", description="one")
    shapes: list[Annotated[Literal["round"], OtherNames("round", ("disc",))]] = Field([], description="some")
    size: int = Field(1, ge=0, description="size [1]")

    def read_as(self, name, word):
        return f"means grains of size {self.size}" if word == "ball" else None


def test_other_words_for_a_choice_are_understood_and_listed():
    params = merge(Named, options={"shape": "disc", "shapes": "disc,round"})
    assert (params.shape, params.shapes, params.notes) == ("round", ["round", "round"], ())
    assert problems(Named, options={"shape": "cube", "shapes": "bar"}) == [
        "--shape cube: must be one of round (also disc, ball), flat.",
        "--shapes bar: must be a list of any of round (also disc).",
    ]
    assert problems(Named, options={"shape": "discc"})[0].endswith(" Did you mean disc?")
    assert pickle.loads(pickle.dumps(params)) == params


def test_a_word_that_means_something_else_here_is_a_note(tmp_path):
    assert merge(Named, options={"shape": "ball", "size": "3"}).notes == ("--shape ball means grains of size 3",)
    (tmp_path / "a.toml").write_text('shape = "ball"\n')
    assert merge(Named, toml_path=tmp_path / "a.toml").notes == (
        f"--shape ball ({tmp_path / 'a.toml'}) means grains of size 1",
    )


def test_a_former_name_is_answered_with_the_present_one(tmp_path):
    assert FORMER["platen_diameter"] == "platen_roughness"

    class Renamed(Params):
        platen_roughness: Literal["platen_roughness"] = Field("platen_roughness", description="a choice")

    (tmp_path / "a.toml").write_text("platen_diameter = 1.0\n")
    assert problems(Renamed, toml_path=tmp_path / "a.toml", options={"platen_roughness": "platen_diameter"}) == [
        f"platen_diameter = 1.0 ({tmp_path / 'a.toml'}): unknown parameter."
        " platen_diameter is now called platen_roughness.",
        "--platen-roughness platen_diameter: must be platen_roughness. platen_diameter is now called platen_roughness.",
    ]


def test_bounds_keep_the_digits_of_integers_and_lists_may_have_to_hold_something():
    class Listed(Params):
        counts: list[int] = Field([1], min_length=1, description="counts [1]")

    assert problems(Listed, options={"seed": "-1", "counts": ""}) == [
        "--seed -1: must be an integer, from 0 to 2147483647.",
        "--counts []: must be a list of integers, not empty.",
    ]


def test_a_rule_between_fields_is_told_in_its_own_words(toy):
    found = problems(toy.Params, options={"dim": "3", "shape": "angular", "grains": "13"})
    assert found == ["13 angular grains do not fit in 3D."]


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_numbers_are_finite(toy, value):
    (found,) = problems(toy.Params, options={"normal_stress": value})
    assert found.startswith(f"--normal-stress {value}: must be")


def test_a_truth_value_is_no_number(toy, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text("threads = true\n")
    assert problems(toy.Params, None, scene) == [f"--threads True ({scene}): must be an integer, from 1 to 1024."]


def test_a_required_field_says_so():
    class Needy(Params):
        depth: float = Field(gt=0, description="depth [m]")

    assert problems(Needy) == ["--depth: is required, must be a number, greater than 0."]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda p: None, "there is no such file"),
        (lambda p: p.mkdir(), "is a directory"),
        (lambda p: p.write_text("grains = = 3"), "is not valid TOML"),
        (lambda p: p.write_bytes(b"note = '\xff'"), "is not UTF-8"),
    ],
)
def test_an_unreadable_toml_file_is_one_of_the_mistakes(toy, tmp_path, make, words):
    scene = tmp_path / "scene.toml"
    make(scene)
    config, grains = problems(toy.Params, None, scene, {"grains": "1"})
    assert config.startswith(f"--config {scene}: {words}")
    assert grains.startswith("--grains 1:")


def test_a_misspelt_toml_file_gets_the_nearest_name(toy, tmp_path):
    (tmp_path / "scene.toml").write_text("")
    (found,) = problems(toy.Params, None, tmp_path / "scne.toml")
    assert found.endswith("Did you mean scene.toml?")


def test_toml_has_every_field_under_its_description(toy):
    text = to_toml(toy.Params(effects=[{"name": "a"}]))
    assert "# normal stress on the layer [Pa]\nnormal_stress = 5000000.0\n" in text
    for name in toy.Params.model_fields:
        assert f"\n{name} = " in f"\n{text}" or f"[[{name}]]" in text


def test_the_preset_is_a_label_and_no_parameter(toy, tmp_path):
    params = merge(toy.Params, "demo")
    assert params == toy.Params() and params.preset_name == "demo"
    assert pickle.loads(pickle.dumps(params)).preset_name == "demo"
    assert toy.Params().preset_name is None


class Item(BaseModel, extra="forbid"):
    name: str
    weight: float = 1.0
    tags: list[str] = []


class Everything(Params):
    count: int = Field(3, ge=-(2**40), description="a count [1]")
    length: float = Field(0.1, description="a length [m]")
    limit: float | None = Field(2.0, description="a limit\nover two lines [s]")
    mode: Literal["a", "b"] = Field("a", description="a mode")
    words: list[str] = Field([], description="words")
    flag: bool = False
    text: str = ""
    items: list[Item] = Field([], description="items")
    free: dict[str, float] = Field({}, description="free table")


texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
# Once another test has started Taichi, the processor takes subnormal numbers for zero.
numbers = st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=False)


@given(
    st.builds(
        Everything,
        seed=st.integers(0, 2**31 - 1),
        count=st.integers(-(2**40), 2**40),
        length=numbers,
        limit=st.none() | numbers,
        mode=st.sampled_from("ab"),
        words=st.lists(texts, max_size=3),
        flag=st.booleans(),
        text=texts,
        items=st.lists(st.builds(Item, name=texts, weight=numbers, tags=st.lists(texts, max_size=2)), max_size=3),
        free=st.dictionaries(texts | st.text(string.ascii_letters), numbers, max_size=3),
    )
)
def test_toml_round_trip(tmp_path_factory, params):
    scene = tmp_path_factory.getbasetemp() / "round.toml"
    scene.write_text(to_toml(params), encoding="utf-8", newline="")
    assert merge(Everything, "demo", scene, {}) == params


def test_a_file_of_another_experiment_serves_with_what_both_have(toy, tmp_path):
    path = tmp_path / "a.toml"
    path.write_text("grains = 30\ntile = 1e-3\nreplicas = 2\ngap = 0.1\n")
    others = {"gas": ["tile", "gap", "grains"], "race": ["replicas"], "walk": ["replicas"]}
    params = merge(toy.Params, toml_path=path, experiment="toy-run", others=others)
    assert params.grains == 30 and params.given == {"grains"}
    assert params.notes == (
        f"{path}: gap and tile were not taken: toy-run has no such parameters, gas has",
        f"{path}: replicas was not taken: toy-run has no such parameter, race and walk have",
    )
    assert merge(toy.Params).notes == ()
    with pytest.raises(ParameterError, match=r"replicas = 2 .*: unknown parameter"):
        merge(toy.Params, toml_path=path, others={"gas": ["tile", "gap"]})


def test_a_table_of_an_experiment_is_for_that_one_alone(toy, tmp_path):
    path = tmp_path / "a.toml"
    path.write_text("grains = 30\ndim = 3\n[toy-run]\ngrains = 40\nshape = 'angular'\n[gas]\ntile = 1\n[race]\n")
    experiments = {"experiment": "toy-run", "others": {"gas": {"tile"}, "race": set()}}
    params = merge(toy.Params, "smoke", path, {"shape": "sphere"}, **experiments)
    assert (params.grains, params.dim, params.shape, params.normal_stress) == (40, 3, "sphere", 1e3)
    assert params.given == {"grains", "dim", "shape"}
    assert params.notes == tuple(
        f"{path}: the table [{name}] was not taken: it is for that experiment" for name in ("gas", "race")
    )
    path.write_text("[[toy-run.effects]]\nname = 'gravity'\nstiffness = 2.0\n")
    assert merge(toy.Params, None, path, **experiments).effects[0].stiffness == 2.0


def test_mistakes_in_the_tables_of_a_file_are_named(toy, tmp_path):
    path = tmp_path / "a.toml"
    path.write_text("gas = 3\n[toy-rum]\n[toy_run]\n[toy-run]\ntile = 1.0\ngrains = 1\n")
    assert problems(toy.Params, None, path, experiment="toy-run", others={"gas": {"tile"}}) == [
        f"gas = 3 ({path}): must be a table, [gas].",
        f"[toy-rum] ({path}): unknown table; a table is named after the experiment that it is for, one of gas, toy-run."
        " Did you mean toy-run?",
        f"[toy_run] ({path}): unknown table; a table is named after the experiment that it is for, one of gas, toy-run."
        " Did you mean toy-run?",
        f"tile = 1.0 ({path}, [toy-run]): unknown parameter.",
        f"--grains 1 ({path}, [toy-run]): must be an integer, at least 2.",
    ]


def test_what_a_file_of_another_experiment_sets_without_effect_is_left_out_of_it(toy, tmp_path, monkeypatch):
    monkeypatch.setattr(toy.Params, "idle", lambda self: {"note": "in a toy"})
    others = {"gas": ["tile"]}
    for shared in ("tile = 1e-3\n", "[gas]\n"):
        (tmp_path / "a.toml").write_text('note = "mine"\n' + shared)
        params = merge(toy.Params, toml_path=tmp_path / "a.toml", others=others)
        check_idle(params)
        assert params.notes[1:] == (f"{tmp_path / 'a.toml'}: note was not taken: it has no effect in a toy",)
    assert '# note = "mine"  # no effect in a toy' in to_toml(params).splitlines()
    (tmp_path / "a.toml").write_text('note = "mine"\n')
    with pytest.raises(ParameterError, match=r"--note mine \(.*a.toml\): has no effect in a toy; leave it out"):
        check_idle(merge(toy.Params, toml_path=tmp_path / "a.toml", others=others))
    (tmp_path / "a.toml").write_text('[gas]\n[toy-run]\nnote = "mine"\n')
    with pytest.raises(ParameterError, match=r"--note mine \(.*a.toml, \[toy-run\]\): has no effect in a toy"):
        check_idle(merge(toy.Params, toml_path=tmp_path / "a.toml", experiment="toy-run", others=others))
    with pytest.raises(ParameterError, match="--note mine: has no effect in a toy; leave it out"):
        check_idle(merge(toy.Params, options={"note": "mine"}))
