"""Figure of stick-slip: the stress with its events, one of them close up, their energies and their sizes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workflows.common.effect_words import effect_words
from workflows.gouge.layer_metrics import sheared_rows
from workflows.plots.canvas import BLUE, ORANGE, figure_at
from workflows.plots.run_titles import params_of, title_of
from workflows.plots.step_panels import EFFECT_COLOURS, LEAST_SHARE, mean_diameter

if TYPE_CHECKING:
    import xarray

AROUND = 12.0  # durations of an event that are shown of the largest one, at least
ROWS_AROUND = 60  # likewise
FEW = 5  # events, fewer of which show no distribution
FEW_DECADES = 100.0  # greatest over least value of an axis with numbers between its powers of ten


def plot_stick_slip(path: Path, dataset: xarray.Dataset, events: xarray.Dataset, spring: float, area: float) -> None:
    """Draw events.png of a run of stick-slip.

    Parameters
    ----------
    path
        Of the picture.
    dataset, events
        run.nc and events.nc.
    spring, area
        Stiffness of the spring [N m-1] and area of the layer [m2].
    """
    run, params = sheared_rows(dataset), params_of(dataset)
    load = (run.displacement + run.spring_stretch).values / mean_diameter(dataset)
    friction = spring * run.spring_stretch.values / area / params.normal_stress
    count = events.sizes["event"]
    layout = "aa" if not count else "aa;be" if count < FEW else "aa;bc;de"
    with figure_at(path, (11, 3.2 * len(layout.split(";")))) as figure:
        panels = figure.subplot_mosaic(layout)
        _draw_trace(panels["a"], run, load, friction, events)
        if count:
            _draw_largest(panels["b"], run, friction, events)
            _draw_budget(panels["e"], events)
        if count >= FEW:
            _draw_energies(panels["c"], events)
            _draw_sizes(panels["d"], events, params.normal_stress)
        for letter, axes in zip("abcde", panels.values()):  # in the order of the panels that there are
            axes.set_title(f"({letter}) {axes.get_title(loc='left')}")
        figure.suptitle(title_of(dataset))
        figure.set_label(f"{count} slip events")


def _draw_trace(axes: Any, run: Any, load: Any, friction: Any, events: Any) -> None:
    """Stress of the spring over the normal stress against its load point, with the onset and end of each event."""
    axes.plot(load, friction, color="black", lw=0.8)
    time = run.time.values
    for name, colour in (("start", ORANGE), ("end", BLUE)):
        at = np.searchsorted(time, events[name].values * (1.0 - 1e-12))
        axes.plot(load[at], friction[at], "o", ms=3.0, color=colour, label=f"{name} of an event")
    axes.set(xlim=(load[0], load[-1]), xlabel="displacement of the load point [mean diameters]")
    axes.set(ylabel="spring force / normal force [1]")
    axes.set_title(f"friction on the spring, {events.sizes['event']} slip events")
    axes.legend(loc="best", ncols=2)


def _draw_largest(axes: Any, run: Any, friction: Any, events: Any) -> None:
    """The event of the largest drop: friction, and velocity of the platen over that of the load point."""
    one = events.isel(event=int(np.argmax(events.stress_drop.values)))
    time = run.time.values
    first, last = (int(np.searchsorted(time, float(one[name]) * (1.0 - 1e-12))) for name in ("start", "end"))
    around = max(ROWS_AROUND, round(0.5 * AROUND * (last - first)))
    rows = slice(max(0, first - around), last + around)
    shown = 1e3 * (time[rows] - time[first])
    axes.plot(shown, friction[rows], color="black", lw=1.3)
    axes.set(
        xlabel="time since its onset [ms]", ylabel="friction on the spring [1]", title="found event of largest drop"
    )
    second = axes.twinx()
    ratio = run.plate_velocity.values[rows] / np.median(run.load_point_velocity.values)
    second.plot(shown, ratio, color=BLUE, lw=1.0, alpha=0.8)
    second.set_ylabel("platen / load point velocity [1]", color=BLUE)
    second.spines["right"].set_visible(True)
    axes.axvspan(0.0, 1e3 * (float(one.end) - float(one.start)), color=ORANGE, alpha=0.2, lw=0)


def _draw_energies(axes: Any, events: Any) -> None:
    """Greatest kinetic energy of each event against what the spring released; of those that moved more than before."""
    released, kinetic = events.released_energy.values, events.peak_kinetic_energy.values
    moved = kinetic > 0.0
    axes.loglog(released[moved], kinetic[moved], "o", ms=3.5, color=ORANGE, alpha=0.7)
    for axis in (axes.xaxis, axes.yaxis):
        _name_decades(axis)
    axes.set(xlabel="energy released by the spring [J]", ylabel="greatest kinetic energy [J]", title="motion")


def _draw_sizes(axes: Any, events: Any, pressure: float) -> None:
    """Number of events of at least a drop, against the drop."""
    drops = np.sort(events.stress_drop.values / pressure)[::-1]
    axes.loglog(drops, np.arange(1, drops.size + 1), drawstyle="steps-post", color=BLUE, lw=1.4)
    for axis in (axes.xaxis, axes.yaxis):
        _name_decades(axis, "{x:g}")
    axes.set(xlabel="stress drop / normal stress [1]", ylabel="number of events at least as large", title="sizes")


def _name_decades(axis: Any, form: str | None = None) -> None:
    """Numbers at a logarithmic axis, so few that none overlap.

    They are powers of ten, over few decades 2 and 5 times these too, and round numbers where these are too few.
    form: of a number; None: a factor times a power of ten.
    """
    from matplotlib.ticker import LogFormatterSciNotation, LogLocator, MaxNLocator, NullFormatter, StrMethodFormatter

    low, high = axis.get_view_interval()
    powers = LogLocator(subs=(1.0, 2.0, 5.0) if high < FEW_DECADES * low else (1.0,))
    axis.set_major_locator(powers if high > 5.0 * low else MaxNLocator(3))
    factors = LogFormatterSciNotation(labelOnlyBase=False, minor_thresholds=(np.inf, np.inf))
    axis.set_major_formatter(StrMethodFormatter(form) if form else factors)
    axis.set_minor_formatter(NullFormatter())


def _draw_budget(axes: Any, events: Any) -> None:
    """Where the work on the platens went in all events together."""
    lost = events.dissipated_energy.sum("event")
    total = float(events.external_work.sum())
    parts = {effect_words(str(e)): float(lost.sel(effect=e)) / total for e in lost.effect.values}
    parts["change of elastic energy"] = float(events.elastic_energy_change.sum()) / total
    parts["change of kinetic energy"] = float(events.kinetic_energy_change.sum()) / total
    kept = {name: value for name, value in parts.items() if abs(value) > LEAST_SHARE}
    colours = [*EFFECT_COLOURS, "0.5", "0.7"][: len(kept)]
    axes.barh(list(kept), [100.0 * value for value in kept.values()], color=colours, alpha=0.8)
    axes.axvline(0.0, color="0.5", lw=0.8)
    axes.invert_yaxis()
    axes.set(xlabel="share of the work on the platens [%]", title="where it went, all events")
