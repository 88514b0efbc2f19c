"""The stages of the shear of a layer that `[[stages]]` give, in SI units, and what they are expected to take."""

from __future__ import annotations

from workflows.gouge.layer_drives import NORMAL_STRESS, SHEAR_RATE
from workflows.gouge.parameters import Params
from workflows.protocol.conditions import Reached
from workflows.protocol.schedule import Change, Spacing, Stage
from workflows.protocol.stage_tables import Interval, Planned, Sample, StageTable, Until, planned

TOML_NAME = {SHEAR_RATE: "velocity", NORMAL_STRESS: "normal_stress"}
SHEAR = "shear"  # the stage in which friction is measured, where no stages are given
SNAPSHOT_STRAIN = 1.0  # shear strain from snapshot to snapshot of a stage
SAMPLES_PER_ROW = 5  # with more, diagnostics would not stay below 3 % of a run: benchmarks/output_cost.py


def stages_of(params: Params) -> list[Planned]:
    """The stages after the consolidation: those that are given, or one at the velocity of the inertial number."""
    return planned(params.stages or [StageTable(name=SHEAR, velocity=1.0, until=Until(strain=params.strain))])


def shear_stages(params: Params, dt: float) -> list[Stage]:
    """All stages after the consolidation; dt: time step [s]."""
    all_stages = stages_of(params)
    last = max((stage.cycle for stage in all_stages), default=0)
    return [_stage(params, dt, stage, kept=stage.cycle in (0, 1, last)) for stage in all_stages]


def expected(params: Params) -> tuple[float, float]:
    """(shear strain [1], time [t_i]) of the shear."""
    p, strain, time = params, 0.0, 0.0
    for stage in stages_of(p):
        rate = abs(stage.velocity) * p.inertial_number  # [1/t_i]
        takes = min(_duration(p, name, value, rate) for name, value in stage.table.until.given.items())
        strain, time = strain + rate * takes, time + takes
    return strain, time


def _duration(params: Params, name: str, value: float, rate: float) -> float:
    """Time [t_i] that a strain [1], a slip [d] or a time [t_i] takes at a shear rate [1/t_i]."""
    if name == "time":
        return value
    if rate == 0.0:
        return float("inf")
    return value / (rate * (params.layer[0] / params.diameter if name == "slip" else 1.0))


def _stage(params: Params, dt: float, stage: Planned, kept: bool) -> Stage:
    p, table = params, stage.table
    within = table.ramp * p.inertial_time
    drives = {}
    for name, given, scale in (
        (SHEAR_RATE, table.velocity, p.inertial_number / p.inertial_time),
        (NORMAL_STRESS, table.normal_stress, p.normal_stress),
    ):
        if given is not None:
            wave = table.oscillate if table.oscillate and table.oscillate.of == TOML_NAME[name] else None
            sine = (wave.amplitude, wave.period * p.inertial_time) if wave else ()
            drives[name] = Change(given * scale, within, *sine)
    until = table.until
    return Stage(
        table.name,
        until=Reached(
            until.strain or float("inf"),
            (until.slip or float("inf")) * p.diameter,
            (until.time or float("inf")) * p.inertial_time,
        ),
        spacing=_spacing(p, dt, table.sample or Sample(strain=1.0 / p.rows_per_strain), stage.velocity),
        drives=drives,
        cycle=stage.cycle,
        kept=kept,
        snapshot_strain=SNAPSHOT_STRAIN,
    )


def _spacing(params: Params, dt: float, sample: Sample, velocity: float) -> Spacing:
    """Steps and samples of rows; of a velocity over that of the inertial number."""

    def steps(interval: Interval) -> float:
        ((name, value),) = interval.given.items()
        rate = abs(velocity) * params.inertial_number
        return _duration(params, name, value, rate) * params.inertial_time / dt

    first = steps(sample)
    samples = max(1, min(SAMPLES_PER_ROW, round(first)))
    return Spacing(first, samples, sample.growth, max(first, steps(sample.most)) if sample.most else first)
