"""All curves of a file accuracy.nc as text: `python -m workflows.accuracy.table out/accuracy.nc` prints them."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

from workflows.accuracy import Trial
from workflows.accuracy.commands import as_command
from workflows.accuracy.curves import curves
from workflows.accuracy.trials_file import read_trials


def lines_of(trials: Sequence[Trial]) -> Iterator[str]:
    """For each quantity [1] and parameter the order in the value of the parameter, then a line for each setting."""
    for curve in curves(trials).values():
        yield f"{curve.quantity}; {curve.parameter}: order {curve.order():.2f}"
        rows = zip(curve.setting, curve.error, curve.error_se, curve.relative)
        yield from (f"  {s:22s} error {e:.3g} +- {se:.1g}, time {cost:.3g}" for s, e, se, cost in rows)


def main(argv: Sequence[str] | None = None) -> None:
    """Print the curves of a file."""
    parser = argparse.ArgumentParser(
        prog="python -m workflows.accuracy.table",
        description="Prints every error and cost in a file accuracy.nc, and the order of each error.",
    )
    parser.add_argument("file", type=Path, metavar="FILE", help="accuracy.nc, as lsm accuracy-cost writes it")
    print("\n".join(lines_of(read_trials(parser.parse_args(argv).file))))


if __name__ == "__main__":
    as_command(main)
