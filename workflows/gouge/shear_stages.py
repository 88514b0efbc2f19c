"""The stages of the shear of a layer in SI units, from those that its parameters give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from workflows.gouge.expected_shear import duration
from workflows.gouge.grain_parameters import GrainParams
from workflows.gouge.layer_drives import NORMAL_STIFFNESS, NORMAL_STRESS, SHEAR_RATE, SHEAR_STRESS
from workflows.gouge.layer_parameters import LayerParams
from workflows.protocol.conditions import Reached
from workflows.protocol.moments import Events, Moments, interval
from workflows.protocol.schedule import Change, Spacing, Stage
from workflows.protocol.stage_tables import Interval, Planned, Sample, planned

TOML_NAME = {SHEAR_RATE: "velocity", SHEAR_STRESS: "shear_stress", NORMAL_STRESS: "normal_stress"}
SNAPSHOT_STRAIN = 1.0  # shear strain from snapshot to snapshot of a stage
BREAKING_STRAIN = 0.25  # likewise of grains that break, whose fragments are those of the snapshots
SAMPLES_PER_ROW = 5  # with more, diagnostics would not stay below 3 % of a run: benchmarks/output_cost.py


def shear_stages(params: GrainParams, dt: float) -> list[Stage]:
    """All stages after the consolidation; dt: time step [s]. The first puts the spring behind the servo, if any."""
    all_stages = planned(params.shear_tables())
    stiffness = params.normal_stiffness if isinstance(params, LayerParams) else None
    spring = {NORMAL_STIFFNESS: Change(stiffness)} if stiffness else {}
    stages = [
        _stage(params, dt, stage, {} if i else spring, kept)
        for i, (stage, kept) in enumerate(zip(all_stages, _kept(all_stages), strict=True))
    ]
    if "end" in params.contacts:
        stages[-1] = replace(stages[-1], contacts=replace(stages[-1].contacts, at_end=True))
    return stages


def _kept(stages: Sequence[Planned]) -> list[bool]:
    """Whether the end of each stage is kept: of repeated ones in the first and in the last repetition."""
    kept, after, last = [], 0, 0
    for stage in reversed(stages):
        if stage.cycle > after:  # the last stage of those that are repeated together
            last = stage.cycle
        kept.append(stage.cycle in (0, 1, last))
        after = stage.cycle
    return kept[::-1]


def _stage(params: GrainParams, dt: float, stage: Planned, first: dict[str, Change], kept: bool) -> Stage:
    """One stage; first: what changes in it beside what its table gives."""
    p, table = params, stage.table
    within = table.ramp * p.inertial_time
    drives = dict(first)
    for name, given, scale in (
        (SHEAR_RATE, table.velocity, p.inertial_number / p.inertial_time),
        (SHEAR_STRESS, table.shear_stress, p.normal_stress),
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
        snapshots=snapshots_of(p),
        contacts=Moments(interval(p.contacts), "events" in p.contacts, "stages" in p.contacts),
        events=Events(p.inertial_number / p.inertial_time),
    )


def snapshots_of(params: GrainParams) -> Moments:
    """Moments of grains.nc in a stage of shear, besides the ends of stages that are kept."""
    words = params.snapshots
    if not words:
        return Moments(SNAPSHOT_STRAIN if params.pieces_of_one == 1 else BREAKING_STRAIN)
    return Moments(interval(words), "events" in words, "stages" in words)


def _spacing(params: GrainParams, dt: float, sample: Sample, velocity: float | None) -> Spacing:
    """Steps and samples of rows; of a velocity over that of the inertial number, None under a shear stress."""

    def steps(interval: Interval) -> float:
        ((name, value),) = interval.given.items()
        rate = abs(velocity or 0.0) * params.inertial_number
        return duration(params, name, value, rate) * params.inertial_time / dt

    first = steps(sample)
    samples = max(1, min(SAMPLES_PER_ROW, round(first)))
    return Spacing(first, samples, sample.growth, max(first, steps(sample.most)) if sample.most else first)
