"""Expected errors and times of the presets of shear-gouge: `python -m workflows.accuracy.presets` prints them."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence

from workflows import shear_gouge
from workflows.accuracy.commands import as_command
from workflows.common.parameters import merge
from workflows.common.run_cost import duration
from workflows.gouge import target_error

TARGETS = (0.03, 0.02, 0.01, 0.007)


def preset_rows() -> Iterator[tuple[str, str, float, float, float]]:
    """(preset, shape, strain, half-width of the 95 % interval, seconds) of one run of each preset in 2D."""
    for preset in shear_gouge.Params.presets:
        for shape in ("round", "angular"):
            params = merge(shear_gouge.Params, preset, options={"shape": shape})
            yield preset, shape, params.strain, *target_error.expected(params)


def target_rows() -> Iterator[tuple[float, str, float, float, int, float]]:
    """(target error, shape, step, strain, seeds, seconds) of the plans for the standard layer in 2D."""
    for target in TARGETS:
        for shape in ("round", "angular"):
            plan = target_error.plan(shear_gouge.Params(shape=shape), target)
            yield target, shape, plan.step_safety, plan.strain, plan.seeds, plan.expected_seconds


def main(argv: Sequence[str] | None = None) -> None:
    """Print both tables."""
    argparse.ArgumentParser(
        prog="python -m workflows.accuracy.presets",
        description="Prints, as Markdown, the error and the time that one run of each preset of lsm shear-gouge is "
        "expected to have in 2D, and the plans for a few target errors. Nothing is run; there are no options.",
    ).parse_args(argv)
    print("| preset | shape | strain | expected error, 95 % | expected time |\n|---|---|---|---|---|")
    for preset, shape, strain, error, seconds in preset_rows():
        print(f"| {preset} | {shape} | {strain:g} | {error:.4f} | {duration(seconds)} |")
    print("\n| target error | shape | step | strain | runs | expected time |\n|---|---|---|---|---|---|")
    for target, shape, step, strain, seeds, seconds in target_rows():
        print(f"| {target:g} | {shape} | {step:g} | {strain:g} | {seeds} | {duration(seconds)} |")


if __name__ == "__main__":
    as_command(main)
