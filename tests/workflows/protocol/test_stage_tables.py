"""Stages as a file gives them: what is refused, and repetitions written out."""

import pytest

from workflows import shear_gouge
from workflows.common.parameters import ParameterError, merge, to_toml
from workflows.gouge.expected_shear import expected
from workflows.gouge.layer_drives import NORMAL_STIFFNESS, NORMAL_STRESS, SHEAR_RATE, SHEAR_STRESS
from workflows.gouge.shear_stages import shear_stages
from workflows.protocol.schedule import Change
from workflows.protocol.stage_tables import StageTable, continues, planned

RUN_IN = {"name": "run-in", "velocity": 1.0, "until": {"strain": 1.0}}
UP = {"name": "up", "velocity": 3.0, "until": {"slip": 2.0}}
DOWN = {"name": "down", "velocity": 1.0, "until": {"slip": 2.0}, "repeat": 3, "repeat_from": "up"}
HOLD = {"name": "hold", "velocity": 0.0, "until": {"time": 10.0}, "sample": {"time": 1.0}}
CREEP = {"name": "creep", "shear_stress": 0.2, "until": {"time": 50.0, "slip": 3.0}, "sample": {"time": 1.0}}


def tables(*given):
    return [StageTable(**table) for table in given]


def test_repetitions_are_written_out_in_their_order():
    found = planned(tables(RUN_IN, UP, DOWN, HOLD))
    assert [(stage.table.name, stage.cycle) for stage in found] == [
        ("run-in", 0),
        *[(name, cycle) for cycle in (1, 2, 3) for name in ("up", "down")],
        ("hold", 0),
    ]
    alone = planned(tables(RUN_IN, HOLD | {"repeat": 2}))
    assert [(stage.table.name, stage.cycle) for stage in alone] == [("run-in", 0), ("hold", 1), ("hold", 2)]


def test_a_stage_that_ends_before_its_first_row_is_remarked():
    short = [RUN_IN, UP | {"until": {"slip": 1e-5}}]
    (remark,) = shear_gouge.Params(stages=short).remarks()
    assert remark.startswith("stage up: it is to end after") and "a stage ends with a row" in remark
    assert not list(shear_gouge.Params(stages=[RUN_IN, UP]).remarks())


def test_a_stress_in_pascal_is_refused_with_its_unit():
    for name in ("shear_stress", "normal_stress"):
        with pytest.raises(ValueError, match=f"{name} 5e.06: must be from .*over normal_stress, and not in Pa"):
            shear_gouge.Params(stages=[RUN_IN, {"name": "a", "until": {"time": 1.0}, name: 5e6}])


def test_a_stage_without_a_velocity_keeps_that_before_it():
    still = {"name": "still", "until": {"time": 1.0}, "sample": {"time": 1.0}}
    assert [stage.velocity for stage in planned(tables(RUN_IN, UP, still, HOLD, still))] == [1.0, 3.0, 3.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("stages", "words"),
    [
        ([UP | {"velocty": 1.0}], r"stages\[0\]\.velocty = 1.0: unknown key\. Did you mean velocity\?"),
        ([RUN_IN | {"until": {}}], r"stages\[0\]\.until: must have strain, slip or time"),
        ([RUN_IN | {"sample": {"strain": 0.1, "time": 1.0}}], r"stages\[0\]\.sample.*must have one of strain, slip"),
        ([RUN_IN | {"sample": {"strain": 0.1, "growth": 1.1}}], "growth and most go together"),
        ([RUN_IN | {"name": "consolidate"}], "name consolidate: is that of a stage before the schedule"),
        ([{"name": "a", "until": {"time": 1.0}}], "velocity: the first stage, a, must give it"),
        (
            [RUN_IN, HOLD | {"sample": {"strain": 0.1}}],
            r"stages\[1\].sample: hold stands still, at velocity 0, must be a time",
        ),
        (
            [RUN_IN, HOLD | {"until": {"strain": 0.1}}],
            r"stages\[1\].until: hold stands still, at velocity 0, must have a time",
        ),
        ([RUN_IN, {"name": "h", "velocity": 0.0, "until": {"time": 1.0}}], r"stages\[1\].sample: h stands still, at"),
        ([RUN_IN, DOWN], r"stages\[1\].repeat_from up: must be the name of this stage or of one before it"),
        ([RUN_IN, UP, DOWN, HOLD | {"repeat": 2, "repeat_from": "up"}], "is repeated already, must come after down"),
        ([RUN_IN | {"repeat": 20_000}, HOLD], "20001 with their repetitions, must be at most 20000"),
        ([RUN_IN, UP | {"name": "run_in"}], "names run-in and run_in are one in the names of metrics"),
        ([RUN_IN | {"name": "1st"}], "name: must be a letter, then up to 39 letters"),
        ([RUN_IN | {"velocity": 1e-9}], "velocity 1e-09: must be 0 or at least 1e-06"),
        (
            [RUN_IN, HOLD | {"oscillate": {"of": "velocity", "amplitude": 0.5, "period": 1.0}}],
            "oscillate: has no effect at a velocity of 0",
        ),
        ([RUN_IN | {"ramp": 1.0, "velocity": None}], "ramp 1: nothing changes .*give velocity, shear_stress or normal"),
        ([RUN_IN, CREEP | {"velocity": 1.0}], r"velocity 1, shear_stress 0\.2: the platen can follow one of them"),
        (
            [RUN_IN, CREEP | {"until": {"slip": 3.0}}],
            r"stages\[1\]\.until: creep is under a shear_stress, at no velocity, must",
        ),
        (
            [RUN_IN, CREEP | {"sample": {"slip": 1.0}}],
            r"stages\[1\]\.sample: creep is under a shear_stress, at no velocity, ",
        ),
        (
            [CREEP, {"name": "on", "until": {"strain": 1.0}}],
            r"stages\[1\]\.until: on is under a shear_stress, at no velocity",
        ),
        (
            [CREEP | {"shear_stress": 0.0, "oscillate": {"of": "shear_stress", "amplitude": 0.5, "period": 1.0}}],
            "oscillate: has no effect at a shear_stress of 0",
        ),
        (
            [RUN_IN | {"oscillate": {"of": "normal_stress", "amplitude": 0.1, "period": 5.0}}],
            "must give normal_stress as well",
        ),
    ],
)
def test_mistakes_name_the_stage_and_the_key(stages, words):
    with pytest.raises(ParameterError, match=words):
        shear_gouge.Params(stages=stages)


def test_all_mistakes_in_stages_are_told_at_once():
    """Of keys, within stages and between them; but not what only a mistake in another key makes look wrong."""
    wrong = [
        {"name": "1st", "velocty": 1.0, "until": {"strain": 1.0}},
        HOLD | {"until": {"strain": "far"}, "ramp": 1.0, "velocity": 1e-9},
        {"name": "a", "velocity": "fast", "until": {}, "repeat_from": "nowhere"},
        {"name": "b", "shear_stress": 5e6, "until": {"time": 1.0}, "repeat": 2, "repeat_from": "c"},
    ]
    with pytest.raises(ParameterError) as caught:
        shear_gouge.Params(stages=wrong)
    problems = caught.value.problems
    for words in (
        "stages[0].velocty = 1.0: unknown key. Did you mean velocity?",
        "stages[1].until.strain = far: ",
        "stages[2].velocity = fast: ",
        "stages[0].name: must be a letter",
        "stages[2].repeat_from nowhere: has no effect without repeat",
        "stages[3].shear_stress 5e+06: must be from -1000 to 1000",
        "stages[3].repeat_from c: must be the name of this stage or of one before it",
    ):
        assert sum(text.startswith(words) for text in problems) == 1, (words, problems)
    # The first stage may have given the misspelt velocity, and the second one's end is wrong already.
    assert not any("must give it" in text or "stages[1].until:" in text for text in problems), problems
    assert len(problems) == 7, problems


def test_stages_survive_the_file_of_a_run(tmp_path):
    params = shear_gouge.Params(stages=[RUN_IN, UP, DOWN, HOLD])
    (tmp_path / "config.toml").write_text(to_toml(params, "shear-gouge"))
    assert merge(shear_gouge.Params, toml_path=tmp_path / "config.toml") == params


def test_the_units_are_those_of_the_layer():
    stage = {"name": "a", "velocity": 2.0, "normal_stress": 1.5, "ramp": 3.0, "until": {"slip": 4.0, "time": 1e6}}
    stage |= {"sample": {"time": 0.5, "growth": 1.5, "most": {"strain": 0.02}}}
    stage |= {"oscillate": {"of": "normal_stress", "amplitude": 0.1, "period": 20.0}}
    params = shear_gouge.Params(stages=[stage], inertial_number=0.01, layer_thickness=20, normal_stress=1e6)
    unit, dt = params.inertial_time, 0.01 * params.inertial_time
    (made,) = shear_stages(params, dt)
    assert made.drives == {
        SHEAR_RATE: Change(2.0 * 0.01 / unit, 3.0 * unit),
        NORMAL_STRESS: Change(1.5e6, 3.0 * unit, 0.1, 20.0 * unit),
    }
    assert (made.until.slip, made.until.time) == (4.0 * params.diameter, 1e6 * unit)
    assert made.spacing.steps == pytest.approx(50.0) and made.spacing.most == pytest.approx(100.0)  # 0.02/(2 I) = 1 t_i
    assert expected(params) == pytest.approx((0.2, 10.0))  # 4 d at 0.4 d per t_i, 20 d thick


def test_the_first_and_the_last_repetition_of_all_stages_are_kept():
    """Also of those that are repeated less often than others."""
    again = [UP | {"name": "fast"}, DOWN | {"name": "slow", "repeat": 5, "repeat_from": "fast"}]
    made = shear_stages(shear_gouge.Params(stages=[RUN_IN, UP, DOWN, HOLD, *again]), 1e-8)
    kept = [(stage.name, stage.cycle) for stage in made if stage.kept]
    assert kept == [
        ("run-in", 0),
        *[(name, cycle) for cycle in (1, 3) for name in ("up", "down")],
        ("hold", 0),
        *[(name, cycle) for cycle in (1, 5) for name in ("fast", "slow")],
    ]
    two = shear_stages(shear_gouge.Params(stages=[RUN_IN, HOLD | {"repeat": 2}, UP | {"repeat": 3}]), 1e-8)
    assert [(stage.name, stage.cycle) for stage in two if not stage.kept] == [("up", 2)]


def test_a_shear_stress_is_over_the_normal_stress_and_lasts_until_a_velocity():
    """And nobody knows how far it shears the layer."""
    wave = {"ramp": 3.0, "oscillate": {"of": "shear_stress", "amplitude": 0.1, "period": 20.0}}
    after = {"name": "after", "until": {"time": 7.0}, "sample": {"time": 1.0}}
    params = shear_gouge.Params(stages=[RUN_IN, CREEP | wave, after, UP], normal_stress=2e6, normal_stiffness=1e9)
    assert params.pushed and not shear_gouge.Params(stages=[RUN_IN, HOLD]).pushed
    assert [stage.velocity for stage in planned(params.stages)] == [1.0, None, None, 3.0]
    unit = params.inertial_time
    run_in, creep, after, up = shear_stages(params, 0.01 * unit)
    assert creep.drives == {SHEAR_STRESS: Change(0.4e6, 3.0 * unit, 0.1, 20.0 * unit)}
    assert after.drives == {} and set(up.drives) == {SHEAR_RATE}
    assert run_in.drives[NORMAL_STIFFNESS] == Change(1e9)  # the spring is put in as shear begins
    assert creep.spacing.steps == pytest.approx(100.0)
    strain, time = expected(params)
    in_up = 2.0 * params.diameter / params.layer[0]
    assert (strain, time) == pytest.approx((1.0 + in_up, 1e3 + 57.0 + in_up / 3e-3))


def test_a_layer_on_a_load_spring_takes_no_shear_stress():
    with pytest.raises(ParameterError, match=r"not for a layer on a load spring, .*leave out the stiff"):
        shear_gouge.Params(stages=[RUN_IN, CREEP], load_stiffness_ratio=0.1)


LONGER_UP = UP | {"until": {"slip": 3.0}}


@pytest.mark.parametrize(
    ("before", "after", "goes_on"),
    [
        ([RUN_IN, UP], [RUN_IN, UP], True),
        ([RUN_IN, UP], [RUN_IN, UP, HOLD], True),
        ([RUN_IN, UP], [RUN_IN, LONGER_UP, HOLD], True),
        ([RUN_IN, UP, DOWN], [RUN_IN, UP, DOWN | {"repeat": 5}], True),
        ([RUN_IN, UP, DOWN], [RUN_IN, UP, DOWN | {"repeat": 5}, HOLD], True),
        ([RUN_IN, UP], [RUN_IN], False),
        ([RUN_IN, LONGER_UP], [RUN_IN, UP], False),
        ([RUN_IN, UP], [RUN_IN, UP | {"until": {"strain": 3.0}}], False),
        ([RUN_IN, UP], [RUN_IN, UP | {"velocity": 2.0}, HOLD], False),
        ([RUN_IN, UP], [RUN_IN | {"until": {"strain": 2.0}}, UP], False),
        ([RUN_IN, UP, DOWN], [RUN_IN, UP, DOWN | {"repeat": 2}], False),
        ([RUN_IN, UP, DOWN], [RUN_IN, LONGER_UP, DOWN], False),
        ([RUN_IN, UP], [RUN_IN, UP | {"repeat": 2}], False),  # whose rows have other numbers of their repetition
        ([], [RUN_IN], False),
    ],
)
def test_stages_go_on_with_others_that_they_begin_with(before, after, goes_on):
    assert continues(planned(tables(*after)), planned(tables(*before))) == goes_on
