"""The picture of a sweep: a metric against a parameter, for one or two columns of a journal.

Points are means over the seeds with their 95 % intervals. Colours, of Okabe and Ito or of a scale that grows lighter,
come with markers of their own, so that they stay apart for colour-blind eyes and in grey.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import taichi_lsm as lsm
from workflows.plots.canvas import BLUE, GREEN, ORANGE, PRINT, PURPLE, YELLOW, figure_at
from workflows.sweep.estimates import SEED, Choice, Estimated, choose, error_of, estimates

if TYPE_CHECKING:
    import xarray

COLUMN, PAGE = 3.5, 7.1  # widths of one and of two columns [inch]
HEIGHT = 2.3  # of a panel [inch]
MOST_ACROSS = 4  # panels side by side
HUES, MARKERS = (BLUE, ORANGE, GREEN, PURPLE, YELLOW), "osD^v"
SIDEWAYS, APART = 0.02, 0.6  # by which colours stand aside, of the axis, and all together of the distance of points
MOST_TICKS = 7  # values of which each has a tick of its own
WORDS = {  # what axes call parameters and metrics whose names say too little, with their units
    "particle_friction": "Coulomb coefficient of the grains [1]",
    "friction_mean": "friction of the layer [1]",
    "target_inertial_number": "inertial number [1]",
    "target_normal_stress": "normal stress [Pa]",
    "target_thickness_in_diameters": "layer thickness [mean diameters]",
    "length": "length of the layer [mean diameters]",
    "width": "width of the layer [mean diameters]",
    "corner_radius": "corner radius [diameters]",
}


def plot_sweep(
    folder: Path,
    kind: str = "png",
    metric: str | None = None,
    against: str | None = None,
    colour: str | None = None,
    facet: str | None = None,
) -> Path:
    """Draw a metric of the sweep in a folder; returns the path of the picture in it.

    Parameters
    ----------
    folder
        Of the sweep, with its sweep.nc.
    kind
        Format of the picture: png, pdf or svg.
    metric, against, colour, facet
        What to draw, see `choose`; the picture is called sweep if nothing is given, else by the first two.

    Raises
    ------
    InputError
        If there is no such sweep, metric or parameter, or nothing to draw.
    """
    if not (folder / "sweep.nc").is_file():
        raise lsm.InputError(f"{folder}: no sweep.nc in it, must be the folder of a sweep (lsm sweep)")
    table = lsm.open_run(folder / "sweep.nc")
    choice = choose(table, metric, against, colour, facet)
    found = estimates(table, choice)
    if not found:
        raise lsm.InputError(f"--metric {choice.metric}: no run has a value of it, there is nothing to draw")
    usual = not any((metric, against, colour, facet))
    path = folder / (f"sweep.{kind}" if usual else f"{choice.metric}-{'-'.join(choice.against)}.{kind}")
    panels = _panels(choice, found)
    down = math.ceil(len(panels) / MOST_ACROSS)
    across = math.ceil(len(panels) / down)
    size = (COLUMN if across == 1 else PAGE, HEIGHT * down + 0.7)
    with figure_at(path, size, PRINT) as figure:
        grid: Any = figure.subplots(down, across, sharey=True, squeeze=False)
        for axes in grid.ravel()[len(panels) :]:
            axes.set_visible(False)
        styles = _styles(table, choice, found)
        for axes, (title, name, rows) in zip(grid.ravel(), panels, strict=False):
            _draw(axes, name, choice, rows, styles)
            axes.set_title(title, fontsize=8)
            axes.set_xlabel(label_of(table, name))
        grid[0, 0].set_ylabel(_of_metric(table, choice, found))
        if len(panels) > 1:  # one label for all
            figure.supylabel(grid[0, 0].get_ylabel(), fontsize=8, multialignment="center")
            grid[0, 0].set_ylabel("")
        if len(panels) > 1 and len(choice.against) == 1:
            figure.supxlabel(label_of(table, choice.against[0]), fontsize=8)
            for axes in grid.ravel():
                axes.set_xlabel("")
        _explain(figure, table, choice, styles)
        figure.set_label(_described(table, choice, found))
    return path


def _panels(choice: Choice, found: Sequence[Estimated]) -> list[tuple[str, str, list[Estimated]]]:
    """(title, parameter of the horizontal axis, points) of each panel."""
    against, *others = choice.against
    if others:
        return [("", name, list(found)) for name in choice.against]
    groups: dict[tuple, list[Estimated]] = {}
    for one in found:
        groups.setdefault(tuple(one.values[name] for name in choice.facets), []).append(one)
    named = [
        ("\n".join(f"{plain(name)} {_text(value)}" for name, value in zip(choice.facets, key, strict=True)), rows)
        for key, rows in groups.items()
    ]
    return [(title, against, rows) for title, rows in named]


def _styles(table: xarray.Dataset, choice: Choice, found: Sequence[Estimated]) -> dict[Any, tuple[Any, str, float]]:
    """{value of the coloured parameter: (colour, marker, place aside from the middle)}."""
    if choice.colour is None:
        return {None: (BLUE, "o", 0.0)}
    values = in_order(one.values[choice.colour] for one in found)
    places = np.arange(len(values)) - 0.5 * (len(values) - 1)
    if len(values) <= len(HUES):
        hues: list[Any] = list(HUES)
    else:
        from matplotlib import colormaps

        hues = [colormaps["viridis"](0.92 * i / (len(values) - 1)) for i in range(len(values))]
    return {
        value: (hues[i], MARKERS[i % len(MARKERS)], float(place))
        for i, (value, place) in enumerate(zip(values, places))
    }


def _draw(axes: Any, name: str, choice: Choice, rows: Sequence[Estimated], styles: dict[Any, tuple]) -> None:
    """The points of one panel, of each colour joined where each stands at a place of its own."""
    log, texts = name in choice.log, isinstance(rows[0].values[name], str)
    order = in_order(one.values[name] for one in rows)
    places = {value: float(i) if texts else float(value) for i, value in enumerate(order)}
    numbers = list(places.values())
    apart = np.diff(np.sort(np.log(numbers) if log else numbers), append=np.nan)[:-1]
    step = min(SIDEWAYS * apart.sum(), APART / len(styles) * apart.min()) if apart.size else 0.0
    step = APART / len(styles) if texts else step
    of_grid = len(choice.against) == 1
    for value, (hue, marker, aside) in styles.items():
        own = [one for one in rows if choice.colour is None or one.values[choice.colour] == value]
        own = sorted(
            (one for one in own if one.values[name] == one.values[name]), key=lambda one: places[one.values[name]]
        )
        shift = step * aside if of_grid else 0.0
        x = np.array([places[one.values[name]] for one in own])
        x = x * np.exp(shift) if log else x + shift
        y, half = (np.array(column) for column in _intervals(own))
        known = np.isfinite(half)
        style = {"color": hue, "fmt": marker, "ms": 4, "elinewidth": 0.9, "capsize": 2, "capthick": 0.9, "zorder": 3}
        if known.any():
            axes.errorbar(x[known], y[known], yerr=half[known], **style)
        axes.plot(x[~known], y[~known], marker, color=hue, ms=4, mfc="white", mew=0.9, zorder=3)
        if of_grid and len(set(x.tolist())) == len(x) and not texts:
            axes.plot(x, y, "-", color=hue, lw=0.8, alpha=0.6, zorder=2)
    if log:
        _log_axis(axes, numbers)
    if texts:
        axes.set_xticks(list(places.values()), [_text(value) for value in order])
        axes.set_xlim(-0.5, len(order) - 0.5)
    axes.grid(True, color="0.92", lw=0.6)
    axes.set_axisbelow(True)


def _intervals(rows: Sequence[Estimated]) -> tuple[list[float], list[float]]:
    """Means and half-widths of their 95 % intervals."""
    return [one.mean.mean for one in rows], [one.mean.half_width for one in rows]


def _log_axis(axes: Any, numbers: Sequence[float]) -> None:
    """A logarithmic axis with plain numbers where it spans less than two decades."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_xscale("log")
    if len(numbers) <= MOST_TICKS and max(numbers) < 100.0 * min(numbers):
        axes.set_xticks(numbers, [f"{value:g}" for value in numbers])
    elif max(numbers) < 100.0 * min(numbers):
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _explain(figure: Any, table: xarray.Dataset, choice: Choice, styles: dict[Any, tuple]) -> None:
    """A legend above the panels, where colours differ."""
    from matplotlib.lines import Line2D

    if len(styles) < 2 or choice.colour is None:
        return
    entries = [
        Line2D([], [], color=hue, marker=marker, ls="", ms=4, label=_text(value))
        for value, (hue, marker, _) in styles.items()
    ]
    width = figure.get_size_inches()[0]
    longest = max(len(_text(value)) for value in styles) + 3
    columns = max(1, min(len(entries), int(width * 13 / longest)))
    title = label_of(table, choice.colour)
    legend = {"loc": "outside upper center", "ncols": columns, "title_fontsize": 8, "handletextpad": 0.1}
    figure.legend(handles=entries, title=title, columnspacing=1.0, borderaxespad=0.2, **legend)


def label_of(table: xarray.Dataset, name: str) -> str:
    """What an axis calls a variable of sweep.nc, with its unit."""
    if name in WORDS:
        return WORDS[name]
    unit = table[name].attrs.get("units", "")
    return plain(name) + (f" [{unit}]" if unit else "")


def plain(name: str) -> str:
    """A name in words, without its unit."""
    if name in WORDS:
        return WORDS[name].partition(" [")[0]
    if name.endswith("_mean"):
        return f"mean {plain(name.removesuffix('_mean'))}"
    return name.removeprefix("target_").replace("_", " ")


def _of_metric(table: xarray.Dataset, choice: Choice, found: Sequence[Estimated]) -> str:
    """Label of the vertical axis, which says what the bars are and that they are not known everywhere."""
    known = [math.isfinite(one.mean.half_width) for one in found]
    words = f"95 % intervals{'' if all(known) else ' where known'}" if any(known) else "error unknown"
    return f"{label_of(table, choice.metric)},\n{words}"


def _described(table: xarray.Dataset, choice: Choice, found: Sequence[Estimated]) -> str:
    """What the file says that it shows."""
    counts = sorted({one.runs for one in found})
    runs = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    pooled = "" if SEED in (*choice.against, choice.colour, *choice.facets) else f", means over {runs} seeds"
    own = "" if error_of(table, choice.metric) is None else " and the errors within the runs"
    return (
        f"{choice.metric} against {', '.join(choice.against)}, {len(found)} points{pooled}; intervals of 95 % from the "
        f"scatter of the seeds{own}"
    )


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def in_order(values: Iterable[Any]) -> list[Any]:
    """Different values: numbers by their size, texts as they come first."""
    found = list(dict.fromkeys(values))
    return found if any(isinstance(value, str) for value in found) else sorted(found)
