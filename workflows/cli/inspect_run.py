"""Output of `lsm list` and `lsm info`."""

import dataclasses
import inspect
import json
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError
from workflows.cli.effect_shapes import shapes_text
from workflows.cli.how_far import how_far
from workflows.common.metrics import FILE, failed_claims, print_summary
from workflows.common.parameter_files import CONFIG
from workflows.common.parameters import merge, nearest
from workflows.common.run_contents import attributes_of, contents_of, state_of
from workflows.report.figures import pictures_in

ATTRIBUTES = ("title", "run_status", "source", "date_created", "seed", "dt")

FORMER_KEY = "figures"  # of summary.json, in place of "metrics"


class NoRunError(InputError):
    """The folder is missing, or holds no file of a run."""


def first_line(thing: object) -> str:
    """The first line of a docstring, "" without one."""
    lines = (inspect.getdoc(thing) or "").strip().splitlines()
    return lines[0] if lines else ""


def print_list(workflows: dict[str, ModuleType]) -> int:
    """Print every workflow and every effect with its first docstring line."""
    from taichi_lsm.effects import find_effects  # here, since it imports Taichi

    for title, found in (("Workflows", workflows), ("Effects", find_effects())):
        width = max(map(len, found), default=0)
        print(f"{title}:")
        for name in sorted(found):
            print(f"  {name:{width}}  {first_line(found[name])}".rstrip())
    return 0


def print_effects() -> int:
    """Print equation, shapes, parameters with units, history per contact and measured cost of every effect."""
    saved = json.loads(lsm.data_path("effect_costs.json").read_text(encoding="utf-8"))
    for name, effect in lsm.effects.find_effects().items():
        case = effect.cases()[0]
        print(f"{name}: {first_line(effect)}")
        print(f"  equation    {effect.equation}")
        print(f"  phase       {effect.phase}")
        print(f"  shapes      {shapes_text(effect)}")
        for field in dataclasses.fields(cast(Any, effect)):
            given = "" if field.default is dataclasses.MISSING else f", default {field.default}"
            print(f"  parameter   {field.name} [{effect.units.get(field.name, '?')}]{given}")
        for value in case.history:
            sizes = " or ".join(f"{8 * value.size(dim)} bytes in {dim}D" for dim in (2, 3))
            print(f"  history     {value.name} [{value.units}], {value.long_name}: {sizes} per contact")
        print(f"  cost        {_cost_of(name, saved['effects'])}")
        print()
    print(f"Costs of scene {saved['about']['scene']}, on {saved['about']['machine']}: python -m benchmarks.effects")
    return 0


def _cost_of(name: str, saved: dict[str, dict]) -> str:
    """Measured cost of an effect.

    An effect cannot make a step faster: the most negative difference shows how small a one can be measured.
    """
    if name not in saved:
        return "not measured"
    cost, noise = saved[name], -min(0.0, *(other["added_ns"] for other in saved.values()))
    time = f"{cost['added_ns']:.1f} ns per grain and step"
    if cost["added_ns"] <= noise:
        time = f"less time than can be measured, {noise:.1f} ns per grain and step"
    memory = f"{cost['added_bytes_per_grain']} bytes per grain, {cost['added_bytes_per_pair']} bytes per listed pair"
    return f"{time}, {memory}"


def print_presets(workflows: dict[str, ModuleType]) -> int:
    """Print what every preset of every workflow is expected to take."""
    for name, module in sorted(workflows.items()):
        print(f"{name}:")
        for preset in module.Params.presets:
            print(f"  {preset:10}{module.estimate(merge(module.Params, preset))}")
    return 0


def print_info(folder: Path) -> int:
    """Print status and attributes of a run, its metrics, files with their dimensions, figures, and the runs within it.

    Only the files of the folder itself are opened, and one of each run in its folder `runs`.
    """
    files, runs = require_run(folder)
    for name, value in attributes_of(folder, ATTRIBUTES).items():
        print(f"{name}: {value}")
    state = state_of(folder, runs)
    if state.holder:
        print(f"in use: {state.holder} writes to it")
    elif state.stopped:
        print(f"stopped: {state.stopped}; to go on with it: lsm resume {folder}")
    if state.goes_on and (far := how_far(folder)):
        print(f"so far: {far}")
    if (folder / FILE).is_file():
        print()
        _print_metrics(folder / FILE)
    pictures = pictures_in(folder)
    _print_aligned("Files", [(path.name, contents_of(path)) for path in files if path not in pictures])
    _print_aligned("Figures", [(path.relative_to(folder).as_posix(), contents_of(path)) for path in pictures])
    of_runs = [(path, attributes_of(path, ("run_status",)).get("run_status", "unknown")) for path in runs]
    _print_aligned("Runs", [(f"runs/{path.name}", status) for path, status in of_runs])
    print(f"\n{what_next(folder, files, runs)}")
    return 0


def what_next(folder: Path, files: list[Path], runs: list[Path]) -> str:
    """The commands that show such a run, in one line."""
    names = {path.name for path in files}
    shown = [f"lsm plot {folder}"] if names & {"run.nc", "grains.nc"} or runs else []
    shown += [f"lsm sweep-plot {folder}"] if "sweep.nc" in names else []
    shown += [f"lsm report {folder}"]
    exported = f"; in other programs: lsm export {folder} --format vtk" if "grains.nc" in names else ""
    return f"to see it: {', '.join(shown)}{exported}"


def require_run(folder: Path) -> tuple[list[Path], list[Path]]:
    """The files in the folder of a run, and the folders of the runs that it consists of.

    Raises
    ------
    NoRunError
        If the folder is missing, or holds no file of a run.
    """
    if folder.is_file():
        above = folder.absolute().parent
        hint = f", such as {above}" if _holds_run(above.iterdir()) and folder.suffix != ".toml" else ""
        raise NoRunError(f"{folder}: is a file, must be the folder of a run{hint}.")
    if not folder.is_dir():
        siblings = [p.name for p in folder.parent.iterdir() if p.is_dir()] if folder.parent.is_dir() else []
        raise NoRunError(f"{folder}: there is no such folder.{nearest(folder.name, siblings)}")
    files = sorted(p for p in folder.iterdir() if p.is_file())
    runs = sorted(p for p in folder.glob("runs/*") if p.is_dir() and _holds_run(p.iterdir()))
    if not (runs or _holds_run(files)):
        raise NoRunError(f"{folder}: holds no run (no NetCDF file and no {FILE}).")
    return files, runs


def _holds_run(files: Iterable[Path]) -> bool:
    return any(p.suffix == ".nc" or p.name in (FILE, CONFIG) for p in files)


def _print_aligned(title: str, lines: list[tuple[str, str]]) -> None:
    """Print names and what they are, in two columns; nothing if there are none."""
    if lines:
        print(f"\n{title}:")
        width = max(len(name) for name, _ in lines)
        for name, text in lines:
            print(f"  {name:{width}}  {text}".rstrip())


def _print_metrics(path: Path) -> None:
    """Print the metrics of summary.json, or why they cannot be shown."""
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
        if "metrics" not in summary and FORMER_KEY in summary:
            print(f"{FILE}: made by an earlier version, which wrote `{FORMER_KEY}` for `metrics`; repeat the run")
        else:
            print_summary(summary)
            for line in failed_claims(summary):
                print(line)
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError):
        print(f"{FILE}: unreadable")
