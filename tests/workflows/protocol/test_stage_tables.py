"""Stages as a file gives them: what is refused, and repetitions written out."""

import pytest

from workflows import shear_gouge
from workflows.common.parameters import ParameterError, merge, to_toml
from workflows.gouge.expected_shear import expected
from workflows.gouge.layer_drives import NORMAL_STRESS, SHEAR_RATE
from workflows.gouge.shear_stages import shear_stages
from workflows.protocol.schedule import Change
from workflows.protocol.stage_tables import StageTable, planned

RUN_IN = {"name": "run-in", "velocity": 1.0, "until": {"strain": 1.0}}
UP = {"name": "up", "velocity": 3.0, "until": {"slip": 2.0}}
DOWN = {"name": "down", "velocity": 1.0, "until": {"slip": 2.0}, "repeat": 3, "repeat_from": "up"}
HOLD = {"name": "hold", "velocity": 0.0, "until": {"time": 10.0}, "sample": {"time": 1.0}}


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


def test_a_stage_without_a_velocity_keeps_that_before_it():
    still = {"name": "still", "until": {"time": 1.0}, "sample": {"time": 1.0}}
    assert [stage.velocity for stage in planned(tables(RUN_IN, UP, still, HOLD, still))] == [1.0, 3.0, 3.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("stages", "words"),
    [
        ([UP | {"velocty": 1.0}], r"stages\[0\]\.velocty = 1.0: unknown key\. Did you mean velocity\?"),
        ([RUN_IN | {"until": {}}], r"stages\[0\]\.until = {}: .*must have strain, slip or time"),
        ([RUN_IN | {"sample": {"strain": 0.1, "time": 1.0}}], r"stages\[0\]\.sample.*must have one of strain, slip"),
        ([RUN_IN | {"sample": {"strain": 0.1, "growth": 1.1}}], "growth and most go together"),
        ([RUN_IN | {"name": "consolidate"}], "name consolidate: is that of a stage before the schedule"),
        ([{"name": "a", "until": {"time": 1.0}}], "velocity: the first stage, a, must give it"),
        ([RUN_IN, HOLD | {"sample": {"strain": 0.1}}], r"stages\[1\].sample: hold stands still, must be a time"),
        ([RUN_IN, HOLD | {"until": {"strain": 0.1}}], r"stages\[1\].until: hold stands still, must have a time"),
        ([RUN_IN, {"name": "h", "velocity": 0.0, "until": {"time": 1.0}}], r"stages\[1\].sample: h stands still"),
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
        ([RUN_IN | {"ramp": 1.0, "velocity": None}], "ramp 1: nothing changes in this stage"),
        (
            [RUN_IN | {"oscillate": {"of": "normal_stress", "amplitude": 0.1, "period": 5.0}}],
            "must give normal_stress as well",
        ),
    ],
)
def test_mistakes_name_the_stage_and_the_key(stages, words):
    with pytest.raises(ParameterError, match=words):
        shear_gouge.Params(stages=stages)


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
