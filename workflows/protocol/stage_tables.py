"""Stages as a TOML file gives them, in units of a layer: `[[stages]]`, checked and with their repetitions written out.

Velocities are over the velocity of the inertial number, stresses over the normal stress P, slips in mean diameters d,
times in inertial times t_i = d sqrt(rho/P). A stage drives the platen at a velocity or by a shear stress.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, model_validator

MOST_STAGES = 20_000  # with all repetitions
RESERVED = ("generate", "consolidate")  # stages before the schedule
NAME = re.compile(r"[A-Za-z][\w-]{0,39}")
MOST_STRESS = 1e3  # over the normal stress
LEAST_VELOCITY = 1e-6  # over that of the inertial number
Positive = Annotated[float, Field(ge=1e-6, le=1e9)]
Driven = Literal["velocity", "shear_stress", "normal_stress"]  # what a stage may change


class Table(BaseModel):
    """A table of a stage."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Lengths(Table):
    """A shear strain [1], a slip [d] or a time [t_i]."""

    strain: Positive | None = None
    slip: Positive | None = None
    time: Positive | None = None

    @property
    def given(self) -> dict[str, float]:
        """Those that are given."""
        return {name: value for name in ("strain", "slip", "time") if (value := getattr(self, name)) is not None}


class Until(Lengths):
    """The end of a stage: the first of those that are given, counted from its begin."""


class Interval(Lengths):
    """A distance of rows."""

    @model_validator(mode="after")
    def _one(self) -> Self:
        if len(self.given) != 1:
            raise ValueError("must have one of strain, slip and time, such as {strain = 0.01}")
        return self


class Sample(Interval):
    """Distance of the rows of a stage, each `growth` times as far from the last as that was, up to `most`."""

    growth: float = Field(default=1.0, ge=1, le=2)
    most: Interval | None = None

    @model_validator(mode="after")
    def _bounded(self) -> Self:
        if (self.growth > 1.0) != (self.most is not None):
            raise ValueError("growth and most go together, such as {time = 0.5, growth = 1.05, most = {strain = 0.01}}")
        return self


class Oscillation(Table):
    """A sine about the value of the stage."""

    of: Driven
    amplitude: float = Field(gt=0, lt=1)  # over the value
    period: Positive  # [t_i]


class StageTable(Table):
    """One stage of a schedule; `problems_of_stages` tells what is wrong in it, beside values out of range."""

    name: str = ""
    until: Until = Until()
    velocity: float | None = Field(default=None, ge=-1e3, le=1e3)
    shear_stress: float | None = None
    normal_stress: float | None = None
    ramp: float = Field(default=0.0, ge=0, le=1e9)
    oscillate: Oscillation | None = None
    sample: Sample | None = None
    repeat: int = Field(default=1, ge=1, le=MOST_STAGES)
    repeat_from: str | None = None

    def problems(self) -> Iterator[str]:
        """What is wrong within the stage, one text for each mistake, which begins with a key."""
        if not NAME.fullmatch(self.name):
            yield "name: must be a letter, then up to 39 letters, digits, - and _"
        if self.name in RESERVED:
            yield f"name {self.name}: is that of a stage before the schedule, choose another"
        if not self.until.given:
            yield "until: must have strain, slip or time, such as until = {strain = 1.0}"
        for name, least in (("shear_stress", -MOST_STRESS), ("normal_stress", 1.0 / MOST_STRESS)):
            value = getattr(self, name)
            if value is not None and not least <= value <= MOST_STRESS:
                allowed = f"must be from {least:g} to {MOST_STRESS:g}: it is over --normal-stress, and not in Pa"
                yield f"{name} {value:g}: {allowed}"
        if self.velocity and abs(self.velocity) < LEAST_VELOCITY:
            yield f"velocity {self.velocity:g}: must be 0 or at least {LEAST_VELOCITY:g}, over the usual one"
        if self.velocity is not None and self.shear_stress is not None:
            yield (
                f"velocity {self.velocity:g}, shear_stress {self.shear_stress:g}: the platen can follow one of them; "
                "leave one out, or give them to two stages"
            )
        yield from self._problems_of_changes()
        if self.repeat_from is not None and self.repeat == 1:
            yield f"repeat_from {self.repeat_from}: has no effect without repeat"

    def _problems_of_changes(self) -> Iterator[str]:
        """A sine or a ramp of nothing."""
        if self.oscillate:
            of = self.oscillate.of
            if getattr(self, of) == 0.0:
                yield f"oscillate: has no effect at a {of} of 0, which it is a share of"
            if getattr(self, of) is None:
                yield f"oscillate.of {of}: the stage must give {of} as well"
        if self.ramp > 0.0 and not any(getattr(self, name) is not None for name in get_args(Driven)):
            yield f"ramp {self.ramp:g}: nothing changes in this stage; give velocity, shear_stress or normal_stress"


@dataclass(frozen=True)
class Planned:
    """A stage of a schedule with all repetitions written out.

    Attributes
    ----------
    table
        As it was given.
    cycle
        Number of its repetition, from 1 on; 0 of a stage that is not repeated.
    velocity
        That holds in this stage, over that of the inertial number; None if a shear stress does, under which it is
        not known.
    """

    table: StageTable
    cycle: int
    velocity: float | None


def planned(tables: Sequence[StageTable]) -> list[Planned]:
    """All stages in the order in which they are gone through; those of `problems_of_stages` must be none."""
    found: list[Planned] = []
    for block, repeat in _blocks(tables):
        for cycle in range(1, repeat + 1):
            for table in block:
                before = found[-1].velocity if found else 0.0
                as_before = table.velocity is None and table.shear_stress is None
                velocity = before if as_before else table.velocity
                found.append(Planned(table, cycle if repeat > 1 else 0, velocity))
    return found


def continues(after: Sequence[Planned], before: Sequence[Planned]) -> bool:
    """Whether a schedule begins with all stages of another one, of which the last may have become longer."""
    if not before or len(after) < len(before):
        return False
    first = [_one_of(stage) for stage in after[: len(before)]]
    *others, last = map(_one_of, before)
    end, longer = last.table.until.given, first[-1].table.until.given
    if end.keys() != longer.keys() or any(longer[name] < value for name, value in end.items()):
        return False
    prolonged = replace(last, table=last.table.model_copy(update={"until": first[-1].table.until}))
    return first == [*others, prolonged]


def _one_of(stage: Planned) -> Planned:
    """A stage that does not tell how often it is gone through."""
    return replace(stage, table=stage.table.model_copy(update={"repeat": 1, "repeat_from": None}))


def problems_of_stages(tables: Sequence[StageTable]) -> Iterator[str]:
    """What is wrong in stages and between them, one text for each mistake.

    A text names every key that it rests on: one of which the value was wrong by itself says nothing.
    """
    for i, table in enumerate(tables):
        yield from (f"stages[{i}].{text}" for text in table.problems())
    names, free = [table.name for table in tables], 0
    for i, table in enumerate(tables):
        if table.repeat == 1:
            continue
        begin = i if table.repeat_from is None else _last(names[: i + 1], table.repeat_from)
        if begin is None:
            yield f"stages[{i}].repeat_from {table.repeat_from}: must be the name of this stage or of one before it"
        elif begin < free:
            yield f"stages[{i}].repeat_from {names[begin]}: is repeated already, must come after {names[free - 1]}"
        free = i + 1
    keys = {name: name.replace("-", "_") for name in names}
    for name, key in keys.items():
        alike = [other for other, same in keys.items() if same == key and other != name]
        if alike and name == min(name, *alike):
            yield f"stages: the names {name} and {', '.join(alike)} are one in the names of metrics; rename all but one"
    if tables and tables[0].velocity is None and tables[0].shear_stress is None:
        yield f"stages[0].velocity: the first stage, {names[0]}, must give it, such as velocity = 1.0, or shear_stress"
    count = sum(repeat * len(block) for block, repeat in _blocks(tables))
    if count > MOST_STAGES:
        yield f"stages: {count} with their repetitions, must be at most {MOST_STAGES}; lower repeat"
        return
    timed = {id(stage.table): stage.velocity for stage in planned(tables) if not stage.velocity}
    for i, table in enumerate(tables):
        if id(table) in timed:
            why = (
                "is under a shear_stress, at no velocity" if timed[id(table)] is None else "stands still, at velocity 0"
            )
            yield from _problems_of_times(f"stages[{i}]", table, f"{table.name} {why}")


def _problems_of_times(where: str, table: StageTable, why: str) -> Iterator[str]:
    """What cannot be of a stage whose strain and slip do not come, or come at an unknown time."""
    if table.until.given and table.until.time is None:
        yield f"{where}.until: {why}, must have a time, such as until = {{time = 100.0}}"
    for name, given in (("sample", table.sample), ("sample.most", table.sample and table.sample.most)):
        if given is not None and given.time is None:
            yield f"{where}.{name}: {why}, must be a time, such as {{time = 1.0}}"
    if table.sample is None:
        yield f"{where}.sample: {why}, must be given as a time, such as {{time = 1.0}}"


def _blocks(tables: Sequence[StageTable]) -> Iterator[tuple[Sequence[StageTable], int]]:
    """(stages, number of times that they are gone through together), in their order."""
    names, free = [table.name for table in tables], 0
    for i, table in enumerate(tables):
        if table.repeat > 1:
            begin = i if table.repeat_from is None else max(free, _last(names[: i + 1], table.repeat_from) or free)
            yield tables[free:begin], 1
            yield tables[begin : i + 1], table.repeat
            free = i + 1
    yield tables[free:], 1


def _last(names: Sequence[str], name: str) -> int | None:
    """Place of the last of equal names; None if it is not among them."""
    return len(names) - 1 - names[::-1].index(name) if name in names else None
