"""All curves of a file accuracy.nc as text: `python -m workflows.accuracy.table out/accuracy.nc` prints them."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from workflows.accuracy import Trial
from workflows.accuracy.curves import curves
from workflows.accuracy.trials_file import read_trials


def lines_of(trials: Sequence[Trial]) -> Iterator[str]:
    """For each quantity [1] and parameter the order in the value of the parameter, then a line for each setting."""
    for curve in curves(trials).values():
        yield f"{curve.quantity}; {curve.parameter}: order {curve.order():.2f}"
        rows = zip(curve.setting, curve.error, curve.error_se, curve.relative)
        yield from (f"  {s:22s} error {e:.3g} +- {se:.1g}, time {cost:.3g}" for s, e, se, cost in rows)


if __name__ == "__main__":
    print("\n".join(lines_of(read_trials(Path(sys.argv[1])))))
