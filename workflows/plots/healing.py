"""Figure of slide-hold-slide: reloading after each hold, healing against the time of the hold, and the holds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import taichi_lsm as lsm
from workflows.gouge.hold_response import HOLD, Healing, reload_curve
from workflows.gouge.layer_metrics import sheared_rows
from workflows.plots.canvas import BLUE, ORANGE, figure_at
from workflows.plots.run_titles import params_of, title_of
from workflows.plots.step_panels import mean_diameter

if TYPE_CHECKING:
    import xarray

MAP = "viridis"
FINE = 400  # points of a curve
FIRST = 0.5  # time after the begin of a hold that is shown [t_i]


def plot_healing(path: Path, out: Path, table: xarray.Dataset, found: Healing) -> None:
    """Draw healing.png; out: folder of the experiment, table: healing.nc, found: what `healing_of` gives of it."""
    import matplotlib

    complete = table.isel(run=(table.status == "complete").values)
    runs = {
        (int(s), float(h)): out / p
        for s, h, p in zip(complete.seed, complete.hold_inertial_times, complete.path.values, strict=True)
    }
    datasets = {key: lsm.open_run(folder / "run.nc") for key, folder in runs.items()}
    one = next(iter(datasets.values()))
    size, colours = mean_diameter(one), matplotlib.colormaps[MAP](np.linspace(0.9, 0.0, len(found.hold)))
    with figure_at(path, (11, 8)) as figure:
        (reload, healing), (relaxation, compaction) = figure.subplots(2, 2)
        _draw_reload(reload, datasets, found, colours, size)
        _draw_healing(healing, found)
        _draw_holds(relaxation, compaction, datasets, found, colours)
        figure.suptitle(title_of(one))
        figure.set_label(f"healing {found.line.per_decade} per decade")


def _draw_reload(axes: Any, datasets: Any, found: Healing, colours: Any, size: float) -> None:
    """Friction after each hold, mean over the seeds, and of the runs without one."""
    for hold, colour in zip((0.0, *found.hold), ("0.6", *colours), strict=True):
        own = [reload_curve(sheared_rows(run), size) for (_, h), run in datasets.items() if np.isclose(h, hold)]
        if not own:
            continue
        slip = np.linspace(0.0, min(s[-1] for s, _ in own), FINE)
        mean = np.mean([np.interp(slip, s, c) for s, c in own], axis=0)
        axes.plot(slip / size, mean, color=colour, lw=1.4, label="no hold" if hold == 0.0 else f"{hold:.0f} $t_i$")
    axes.set(xlim=(0, None), xlabel="slip after the hold [mean diameters]", ylabel="friction at the platen [1]")
    axes.set_title("(a) sliding again after a hold, mean over the seeds")
    low, high = axes.get_ylim()
    axes.set_ylim(low - 0.35 * (high - low), high)  # room for the legend
    axes.legend(loc="lower right", ncols=4, title="time of the hold")


def _draw_healing(axes: Any, found: Healing) -> None:
    """Healing against the time of the hold, with its line."""
    axes.errorbar(found.hold, found.mean, 2.0 * found.error, fmt="o", color=ORANGE, ms=5, capsize=3, label="holds")
    line = found.line
    ends = np.array([found.hold[0], found.hold[-1]])
    label = f"{line.per_decade.mean:.2g} ± {line.per_decade.standard_error:.1g} per decade"
    axes.plot(ends, line.at_unit_time.mean + line.per_e_fold.mean * np.log(ends), "k-", lw=1.2, label=label)
    axes.axhline(found.without_hold, color="0.5", ls=":", lw=1.2, label="without a hold: the peak of noise")
    axes.set_xscale("log")
    axes.set(xlabel="time of the hold [$t_i$]", ylabel="peak less steady friction [1]")
    axes.set_title("(b) healing; bars: two standard errors of the growth with the hold")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.35 * (high - low))
    axes.legend(loc="upper left")


def _draw_holds(relaxation: Any, compaction: Any, datasets: Any, found: Healing, colours: Any) -> None:
    """Friction and porosity during the holds, mean over the seeds: of the longest ones, which hold the shorter ones."""
    longest = found.hold[-1]
    own = [sheared_rows(run) for (_, h), run in datasets.items() if np.isclose(h, longest)]
    params = params_of(own[0])
    unit = 0.5 * (params.smallest_diameter + params.largest_diameter) * np.sqrt(params.density / params.normal_stress)
    time = np.geomspace(FIRST, longest, 80)
    series: dict[str, list] = {"friction": [], "porosity": []}
    before = {"friction": found.others["steady_friction"][0].mean, "porosity": 0.0}
    for run in own:
        rows = np.flatnonzero(run.stage.values == HOLD)
        begin = rows[0] - 1
        since = (run.time.values[rows] - run.time.values[begin]) / unit
        friction = (run.platen_shear_stress / run.platen_normal_stress).values
        series["friction"].append(np.interp(time, since, friction[rows]))
        series["porosity"].append(np.interp(time, since, run.porosity.values[rows] - run.porosity.values[begin]))
    for axes, name, words, letter in (
        (relaxation, "friction", "friction at the platen [1]", "c"),
        (compaction, "porosity", "change of porosity [1]", "d"),
    ):
        values = np.array(series[name])
        mean, error = values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(len(values))
        axes.semilogx(time, mean, color=BLUE, lw=1.5)
        axes.axhline(before[name], color="0.5", ls="--", lw=1.1, label="before the hold")
        axes.legend(loc="best")
        axes.fill_between(time, mean - error, mean + error, color=BLUE, alpha=0.25, lw=0)
        axes.set(xlabel="time since the hold began [$t_i$]", ylabel=words)
        axes.set_title(f"({letter}) {name} in the longest hold, mean and standard error")
