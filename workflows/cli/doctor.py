"""`lsm doctor`: what this machine and this installation have, what is missing, and what to do."""

from __future__ import annotations

import sys
import textwrap
from itertools import chain

from workflows.common.exit_codes import COMPLETE, FAILED

NAME, WIDTH = 18, 118  # letters of the names, and of a line


def doctor() -> int:
    """Check the installation and the machine: Taichi, devices, memory, caches, libraries, rendering.

    Each line is ok, missing (some commands need it) or a problem, with what to do. Exit code 0 if a run can be made,
    1 if not.
    """
    from workflows.doctor.machine import machine
    from workflows.doctor.packages import packages
    from workflows.doctor.trials import trials

    stopping = []
    for finding in chain(packages(), machine(), trials()):
        head = f"{finding.state:8} {finding.name:{NAME}} "
        lines = textwrap.wrap(finding.text, WIDTH - len(head), break_long_words=False, break_on_hyphens=False)
        _say(head + f"\n{' ' * len(head)}".join(lines))
        if finding.prevents_runs:
            stopping.append(finding.name)
    print(f"\nNo run can be made: {', '.join(stopping)}." if stopping else "\nA run can be made.")
    return FAILED if stopping else COMPLETE


def _say(text: str) -> None:
    """Print at once; letters that the output has not, as in the names of folders, by their numbers."""
    encoding = sys.stdout.encoding or "ascii"
    print(text.encode(encoding, "backslashreplace").decode(encoding), flush=True)
