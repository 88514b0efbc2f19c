"""What `lsm doctor` finds."""

from __future__ import annotations

from typing import Literal, NamedTuple

State = Literal["ok", "missing", "problem"]


class Finding(NamedTuple):
    """One thing that was looked at.

    Attributes
    ----------
    name
        What it is.
    state
        "ok"; "missing", of what some commands need; "problem", of what does not work.
    text
        What was found, and what to do.
    needed
        Whether no run can be made without it.
    """

    name: str
    state: State
    text: str
    needed: bool = False

    @property
    def prevents_runs(self) -> bool:
        """Whether no run can be made."""
        return self.needed and self.state != "ok"
