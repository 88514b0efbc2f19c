"""When a run writes the state of its grains: at shear strains, at events, at the ends of stages.

Moments are looked for at rows of run.nc, so that each has a row of the same time. What they remember is plain, for
checkpoints keep it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

FAST = 10.0  # velocity of the platen over that of its load point, beyond which it slips in an event
EVERY, WORDS = "every=", ("events", "stages", "end")
LEAST, MOST = 1e-6, 1e3  # shear strain from moment to moment
NONE = "none"
ALLOWED = "every=STRAIN such as every=0.01, events, stages, end or none"
Marks = dict[str, Any]  # by name: numbers and truth values


@dataclass(frozen=True)
class Moments:
    """Which moments of a stage are written.

    Attributes
    ----------
    every
        Shear strain [1] at whose multiples there is one; None: at none.
    events
        Whether there is one where an event begins or ends, see `Events`.
    at_end
        Whether there is one at the end of the stage.
    """

    every: float | None = None
    events: bool = False
    at_end: bool = False

    def due(self, name: str, row: Mapping[str, Any], event: bool, marks: Marks) -> bool:
        """Whether there is one at this row.

        Parameters
        ----------
        name
            Of what is written, under which `marks` remembers the last multiple of the strain; 0 as shear begins.
        row
            Of run.nc.
        event
            Whether an event began or ended in it.
        marks
            Changed.

        Notes
        -----
        The next moment is at a strain that differs from the last multiple by at least one: noise about a multiple, or a
        layer at rest on it, gives none.
        """
        if self.every:
            passed, last = row["shear_strain"] / self.every, marks.get(name, 0)
            if abs(passed - last) >= 1.0:
                marks[name] = math.floor(passed) if passed > last else math.ceil(passed)
                return True
        return self.events and event


@dataclass(frozen=True)
class Events:
    """Slip events and breaking bonds, as a run sees them while it goes on.

    The platen begins to slip in the row in which its velocity exceeds FAST times that of its load point, and has ended
    in the first row in which it is slower than the load point. Where none pulls it, under an imposed shear stress or
    while the load point rests, `rate` times the thickness of the layer stands for the velocity of the load point. A
    platen whose velocity is imposed has no slip events. Every row in which bonds broke is an event.

    Attributes
    ----------
    rate
        Shear rate [s-1] of the inertial number.
    """

    rate: float

    def changed(self, row: Mapping[str, Any], marks: Marks) -> bool:
        """Whether an event began or ended in this row of run.nc, or bonds broke; changes `marks`."""
        broke = row.get("bond_count", 0) < marks.get("bonds", 0)
        if "bond_count" in row:
            marks["bonds"] = int(row["bond_count"])
        slipped = marks.get("slips", False)
        marks["slips"] = self._slips(row, slipped)
        return broke or marks["slips"] != slipped

    def _slips(self, row: Mapping[str, Any], slipped: bool) -> bool:
        pushed = math.isfinite(row.get("imposed_shear_stress", math.nan))
        if not (pushed or "spring_stretch" in row):
            return False
        load = 0.0 if pushed else abs(row["load_point_velocity"])
        slow = load or self.rate * row["layer_thickness"]
        return bool(abs(row["plate_velocity"]) > (slow if slipped else FAST * slow))


def checked_words(words: Sequence[str]) -> list[str]:
    """Words such as ["every=0.01", "events"] as they are, [] of "none"; ValueError if one means nothing or is twice."""
    if [word.lower() for word in words] == [NONE]:
        return []
    kinds = []
    for word in words:
        kinds.append(EVERY if word.startswith(EVERY) else word)
        if kinds[-1] == EVERY:
            strain_of(word)
        elif word not in WORDS:
            raise ValueError(f"must be {ALLOWED}, or several of these with commas between them")
    if len(set(kinds)) < len(kinds):
        raise ValueError("must name each only once")
    return list(words)


def strain_of(word: str) -> float:
    """The strain [1] of every=STRAIN; ValueError if it is no number or out of its range."""
    try:
        value = float(word.removeprefix(EVERY))
    except ValueError:
        value = math.nan
    if not LEAST <= value <= MOST:
        raise ValueError(f"must be every=STRAIN with a shear strain from {LEAST:g} to {MOST:g}, such as every=0.01")
    return value


def interval(words: Iterable[str]) -> float | None:
    """The shear strain [1] from moment to moment that these words ask for; None if they do not."""
    return next((strain_of(word) for word in words if word.startswith(EVERY)), None)
