"""Effects from plain data, as a TOML file gives them."""

import pytest

import taichi_lsm as lsm
from workflows import shear_gouge


def test_effects_are_made_from_tables():
    made = lsm.effects.make_effects(
        [{"name": "gravity", "acceleration": [0.0, -9.81]}, {"name": "viscous_damping", "rate": 3.0}]
    )
    assert made == [lsm.Gravity((0.0, -9.81)), lsm.ViscousDamping(rate=3.0)]


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"name": "gravitty"}, "effect 'gravitty': unknown, must be one of .*Did you mean gravity?"),
        (
            {"acceleration": [0.0, 1.0]},
            r"effect {'acceleration': \[0.0, 1.0\]}: name is missing, must be one of .*hertz",
        ),
        ({"law": "hertz"}, "effect {'law': 'hertz'}: name, formerly called law, is missing, must be one of .*hertz"),
        ({"type": "hertz"}, "effect {'type': 'hertz'}: name, written as type, is missing, must be one of .*hertz"),
        ({"name": ["gravity"]}, r"effect \['gravity'\]: unknown"),
        ("gravity", "effect 'gravity': must be a table"),
        (
            {"name": "gravity", "acceleration": "down"},
            r"^gravity.acceleration = 'down': must be a number in m s-2, not",
        ),
        ({"name": "gravity", "acceleration": [1.0]}, r"^gravity.acceleration = .*: must be 2 or 3 numbers"),
        ({"name": "hertz", "youngs_modulus": "70 GPa", "poissons_ratio": 0.2}, "a number in Pa, not a text$"),
        ({"name": "hertz", "youngs_modulus": 7e10, "poissons_ratio": "1"}, "= '1': must be a number, not a text$"),
        ({"name": "cohesion", "pull_of_force": 1.0}, "cohesion.pull_of_force: unknown.*Did you mean pull_off_force?"),
        ({"name": "cohesion", "distance": 1.0}, "cohesion: pull_off_force must be given"),
        (
            {"name": "cohesion", "pull_off_force": -1.0, "distance": 1.0},
            "^cohesion.pull_off_force = -1.0: must be > 0 N",
        ),
    ],
)
def test_mistakes_are_named(table, words):
    with pytest.raises(lsm.InputError, match=words):
        lsm.effects.make_effects([table])


def test_all_mistakes_are_told_together():
    tables = [{"name": "gravitty"}, {"name": "cohesion", "distance": -1.0, "pull": 2}, {"name": "gravity"}]
    with pytest.raises(lsm.InputError) as caught:
        lsm.effects.make_effects(tables)
    told = str(caught.value).split("; ")
    assert [text.split(":")[0] for text in told] == ["effect 'gravitty'", "cohesion.pull", "cohesion", "gravity"]


def test_of_very_many_mistakes_the_first_are_told():
    with pytest.raises(lsm.InputError, match=r"; and 94 mistakes more$") as caught:
        lsm.effects.make_effects([{"name": "gravity", "acceleration": [0, 1], **{f"key_{i}": i for i in range(100)}}])
    assert len(str(caught.value)) < 1000


def test_a_parameter_below_the_effects_is_told_where_it_belongs():
    params = shear_gouge.Params(effects=[{"name": "hertz", "youngs_modulus": 7e10, "strain": 3, "restitution": 0.5}])
    with pytest.raises(lsm.InputError, match=r"; restitution and strain, of the experiment, must stand above"):
        params.given_effects()


def test_the_gouge_takes_effects_beside_its_own_and_in_place_of_them():
    usual = [type(effect).__name__ for effect in shear_gouge.effects_of(shear_gouge.Params())]
    assert usual == ["LinearElastic", "ViscousDamping", "CoulombFriction"]
    tables = [
        {"name": "coulomb_friction", "coefficient": 0.7, "tangential_stiffness": 1e3},
        {"name": "rolling_resistance", "coefficient": 0.1, "stiffness": 1e-3},
    ]
    given = shear_gouge.effects_of(shear_gouge.Params(effects=tables))
    assert [type(effect).__name__ for effect in given] == [*usual, "RollingResistance"]
    assert given[2].coefficient == 0.7
