"""Draws the figures of a run, one file each: all that its files allow, or those that are asked for."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import ModuleType

import taichi_lsm as lsm
from workflows.common.parameters import nearest
from workflows.common.run_folder import PLOTS
from workflows.plots import figures
from workflows.plots.canvas import PRINT, figure_at
from workflows.plots.run_files import Moments, RunFiles


def figure_names() -> list[str]:
    """Names of all figures, in alphabetical order."""
    return sorted(module.name for module in pkgutil.iter_modules(figures.__path__))


def figure_module(name: str) -> ModuleType:
    """The module of a figure; InputError with the names that there are."""
    if name not in figure_names():
        raise lsm.InputError(
            f"--what {name}: unknown figure, must be one of {', '.join(figure_names())}.{nearest(name, figure_names())}"
        )
    return importlib.import_module(f"workflows.plots.figures.{name}")


def is_of_moment(module: ModuleType) -> bool:
    """Whether a figure shows one moment of a run, and not its course."""
    return hasattr(module, "draw_moment")


def figures_of_moments() -> list[str]:
    """Names of the figures that show one moment, of which films are made."""
    return [name for name in figure_names() if is_of_moment(figure_module(name))]


def draw_figures(
    folder: Path,
    out: Path,
    names: Sequence[str] = (),
    times: str = "last",
    kind: str = "png",
    told: Callable[[Path], None] | None = None,
) -> tuple[list[Path], dict[str, str]]:
    """Draw figures of a run, from its files alone.

    Parameters
    ----------
    folder
        Of the run.
    out
        Folder to write to, which is there.
    names
        Of the figures; none: all that can be drawn.
    times
        Moments of the figures that show one, see `selection.chosen`; of more than one each has a file.
    kind
        "png", "pdf" or "svg".
    told
        Called with the path of each picture when it is written.

    Returns
    -------
    paths : list of Path
        The pictures.
    missing : dict
        {name: why it was not drawn}, of figures that nobody asked for.

    Raises
    ------
    InputError
        If a figure that was asked for cannot be drawn, or a name or a time is wrong.
    """
    paths: list[Path] = []
    missing: dict[str, str] = {}
    modules = {name: figure_module(name) for name in names or figure_names()}
    with RunFiles(folder) as run:
        for name, module in modules.items():
            try:
                for path in _draw(run, module, out / f"{name}.{kind}", times):
                    paths.append(path)
                    if told:
                        told(path)
            except lsm.InputError as error:
                if str(error).startswith("--times"):
                    raise
                if names:
                    raise lsm.InputError(f"{name}: {error}") from None
                missing[name] = str(error)
    return paths, missing


def _draw(run: RunFiles, module: ModuleType, path: Path, times: str) -> Iterator[Path]:
    """Write the picture of the run, or one of each of these moments; the path of each when it is there."""
    for stem in module.NEEDS:
        run.path(stem)
    if not is_of_moment(module):
        with figure_at(path, module.SIZE, PRINT) as figure:
            module.draw_run(figure, run)
            figure.set_label(f"{first_line(module)} {run.title}")
        yield path
        return
    moments = Moments(run, module.NEEDS, times)
    for place, moment in zip(moments.places, moments, strict=True):
        own = path.with_stem(f"{path.stem}_{place:0{moments.digits}d}") if len(moments) > 1 else path
        scale = module.scale_of(moment)
        with figure_at(own, module.SIZE, PRINT) as figure:
            module.draw_moment(figure, moment, scale)
            when = moment.words[:1].upper() + moment.words[1:]
            figure.set_label(f"{first_line(module)} {when}. {run.title}")
        yield own


def first_line(module: ModuleType) -> str:
    """What a figure shows, by the first line of its docstring."""
    return (module.__doc__ or "").strip().splitlines()[0]


def runs_to_draw(folder: Path, out: Path) -> list[tuple[Path, Path]]:
    """(folder, folder for its pictures) of the run in a folder, or of those of a comparison.

    Raises
    ------
    InputError
        If the folder is one of a sweep, or holds no run of a layer or a cell.
    """
    if any((folder / f"{stem}.nc").is_file() for stem in ("run", "grains")):
        return [(folder, out)]
    if (folder / "sweep.nc").is_file() or (folder / "sweep.toml").is_file():
        raise lsm.InputError(f"{folder}: is a sweep; lsm sweep-plot {folder} draws it, and lsm plot one of its runs/*")
    runs = sorted(path.parent for path in folder.glob("runs/*/run.nc"))
    if not runs:
        raise lsm.InputError(f"{folder}: holds no run.nc and no grains.nc, of which figures are made")
    own = out == folder / PLOTS
    return [(run, run / PLOTS if own else out / run.name) for run in runs]
