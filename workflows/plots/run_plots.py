"""Figures of runs and of comparisons; each reads the files of a folder and writes a picture beside them.

`kind` is the format of the picture, png, pdf or svg.
"""

from __future__ import annotations

import os
import textwrap
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from workflows.common.metrics import shown
from workflows.gouge.labels import ROUND, effect_words, friction_words
from workflows.gouge.parameters import SPRINGS
from workflows.plots.canvas import BLUE, GREEN, ORANGE, PURPLE, YELLOW, figure_at
from workflows.plots.layer_pictures import BAR, draw_packing, read_snapshot
from workflows.plots.slip_and_breakage import draw_breakage, draw_stick_slip

COLOUR = {"round": BLUE, "angular": ORANGE}
SMOOTH_STRAIN = 0.05  # width of the running mean of curves
SINGLE_BELOW = 0.3  # rows by which single runs are drawn below their mean


def plot_run(out: str | os.PathLike[str], kind: str = "png") -> Path:
    """Draw run.png of a run of shear-gouge: friction, layer, thickness and energy; returns its path.

    A layer on a spring has a panel of its stick-slip, one of breakable grains a panel of their breakage.
    """
    out, path = Path(out), Path(out) / f"run.{kind}"
    dataset = lsm.open_run(out / "run.nc")
    params, sheared = _params(dataset), _sheared(dataset)
    more = [draw_stick_slip] * on_a_spring(params) + [draw_breakage] * ("bond_count" in sheared)
    places = "ab;cd" + ("", ";ee", ";ef")[len(more)]
    with figure_at(path, (11, 12 if more else 8)) as figure:
        panels = figure.subplot_mosaic(places)
        friction, packing, thickness, energy = (panels[letter] for letter in "abcd")
        _draw_friction(friction, sheared, params)
        drawn = draw_packing(packing, read_snapshot(out / "grains.nc"))
        packing.set_title(f"(b) layer at strain {float(sheared.shear_strain[-1]):.2g}")
        beside = packing.inset_axes((1.05, 0.0, 0.05, 1.0))  # of the layer, whose width follows from its shape
        figure.colorbar(drawn, cax=beside, extend="both").set_label(BAR, fontsize=8.8)
        _draw_thickness(thickness, sheared, COLOUR[params.shape])
        _draw_energy(energy, sheared)
        for letter, draw in zip("ef", more):
            draw(panels[letter], sheared, letter)
        figure.suptitle(wrapped(_conditions(params, sheared)))
    return path


def on_a_spring(params: Any) -> bool:
    """Whether a spring pulls the top platen in a run with these parameters."""
    return any(isinstance(getattr(params, name, None), int | float) for name in SPRINGS)  # files have none as a word


def plot_stopped(out: str | os.PathLike[str], error: lsm.SimulationError, kind: str = "png") -> Path:
    """Draw stopped.png: the layer when it was stopped, the grains of the error marked; returns its path."""
    out = Path(out)
    snapshot = read_snapshot(out / "grains.nc")
    path = out / f"stopped.{kind}"
    with figure_at(path, (9, 7)) as figure:
        axes = figure.subplots()
        drawn = draw_packing(axes, snapshot, marked=error.grains)
        figure.colorbar(drawn, ax=axes, extend="both").set_label(BAR, fontsize=8.8)
        axes.set_title("last snapshot, the grains at fault edged in red" if error.grains else "last snapshot")
        figure.suptitle(wrapped(str(error), 95))
    return path


def plot_comparison(out: str | os.PathLike[str], kind: str = "png") -> Path:
    """Draw friction.png from compare.nc and the files of the complete runs it names; returns its path."""
    out, path = Path(out), Path(out) / f"friction.{kind}"
    table = lsm.open_run(out / "compare.nc")
    dim = int(table.dim[0])
    folders = {
        shape: [out / folder for folder in table.path.values[(table["shape"] == shape) & (table.status == "complete")]]
        for shape in COLOUR
    }
    series = {shape: [lsm.open_run(f / "run.nc") for f in of_shape] for shape, of_shape in folders.items() if of_shape}
    with figure_at(path, (11, 8.4)) as figure:
        upper, lower = np.array(figure.subfigures(2, 1, height_ratios=(1, 1.1), hspace=0.03), dtype=object)
        curves, published = upper.subplots(1, 2, width_ratios=(1.35, 1))
        found = {shape: _estimate(table, shape) for shape in series}
        _draw_comparison(curves, series, found, dim)
        _draw_published(
            published, found, dim, {shape: _complete(table, shape).friction_mean.values for shape in series}
        )
        figure.set_label("; ".join(f"{name_of(shape, dim)}: {estimate_text(e)}" for shape, e in found.items()))
        drawn, layers = None, lower.subplots(1, 2)
        for axes, shape, letter in zip(layers, COLOUR, "cd", strict=True):
            if shape not in series:
                say_why_none(axes, table, shape, dim, letter)
                continue
            last = float(series[shape][0].shear_strain[-1])
            drawn = draw_packing(axes, read_snapshot(folders[shape][0] / "grains.nc"))
            # In two lines, since a 3D layer is narrow.
            axes.set_title(f"({letter}) {name_of(shape, dim)}\nat strain {last:.2g}", color=COLOUR[shape])
        if drawn:
            limits = [axes.get_ylim() for axes, shape in zip(layers, COLOUR, strict=True) if shape in series]
            for axes in layers:
                axes.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))
            lower.colorbar(drawn, ax=layers, extend="both", aspect=30).set_label(BAR)
            one = next(iter(series.values()))[0]
            figure.suptitle(wrapped(_conditions(_params(one), _sheared(one))))
    return path


def say_why_none(axes: Any, table: Any, shape: str, dim: int, letter: str) -> None:
    """In place of a layer: that no run of the shape is complete, and how each of them ended."""
    own = table.isel(run=(table["shape"] == shape).values)
    ends = [f"seed {seed}: {status}" for seed, status in zip(own.seed.values, own.status.values, strict=True)]
    text = "\n".join([f"({letter}) no complete run of {name_of(shape, dim)}", *ends])
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", fontsize=10.5, color=COLOUR[shape])
    axes.set_axis_off()


def _params(dataset):
    """The parameters of a run of shear-gouge, as stored in its file."""
    return SimpleNamespace(**tomllib.loads(dataset.config_toml))


def _sheared(dataset):
    return dataset.isel(time=dataset.stage.values == "shear")


def _complete(table, shape):
    """The complete runs of a shape."""
    return table.isel(run=((table["shape"] == shape) & (table.status == "complete")).values)


def _estimate(table, shape):
    own = _complete(table, shape)
    return lsm.statistics.combine_replicas(own.friction_mean.values, own.friction_se.values, own.friction_ess.values)


def estimate_text(estimate: lsm.statistics.Estimate) -> str:
    """A mean as legends show it, such as "0.261, 95 % interval 0.252 to 0.270"."""
    low, high = estimate.interval
    known = f"95 % interval {low:.3f} to {high:.3f}" if np.isfinite(low) else "error unknown"
    return f"{estimate.mean:.3f}, {known}"


def _draw_mean(axes, since, last, estimate, **line):
    """A mean as a dashed line and its 95 % interval, if it is known, as a band behind everything."""
    axes.plot([since, last], [estimate.mean] * 2, color="black", ls=(0, (5, 3)), **line)
    if np.isfinite(estimate.half_width):
        axes.fill_between([since, last], *estimate.interval, color="black", alpha=0.2, lw=0, zorder=1.5)


def name_of(shape: str, dim: int) -> str:
    """Grains of a shape, by its option, in words."""
    return ROUND[dim] if shape == "round" else "angular grains"


def wrapped(text: str, width: int = 130) -> str:
    """A title in lines that the figure has space for, of about equal length."""
    lines = -(-len(text) // width)
    return "\n".join(textwrap.wrap(text, min(width, len(text) // lines + 15)))


def _conditions(params, sheared):
    rate = float(sheared.inertial_number[len(sheared.time) // 2 :].mean())
    size = f"{1e6 * params.smallest_diameter:g} to {1e6 * params.largest_diameter:g} µm"
    return (
        f"{params.dim}D gouge, grains {size}, normal stress {params.normal_stress / 1e6:g} MPa, "
        f"{friction_words(sheared)}, inertial number {shown(rate, '.2g')}, "
        f"stiffness number {shown(float(sheared.stiffness_number))}"
    )


def running_mean(values: NDArray, width: int) -> NDArray:
    """Mean over `width` samples about each, fewer at the ends; same length as `values`."""
    kernel = np.ones(min(max(1, width), len(values)))
    return np.convolve(values, kernel, "same") / np.convolve(np.ones(len(values)), kernel, "same")


def _smooth(strain, values):
    step = (strain[-1] - strain[0]) / max(1, len(strain) - 1)
    return running_mean(values, round(SMOOTH_STRAIN / step) if step > 0 else 1)


def _draw_comparison(axes, series, found, dim):
    """Friction against strain: a line for the mean over the runs of a shape, a band from the least to the greatest."""
    top, last, since = 0.5, 0.0, 0.0
    for shape, runs in series.items():
        sheared = [_sheared(run) for run in runs]
        begin, end = max(s.shear_strain[0] for s in sheared), min(s.shear_strain[-1] for s in sheared)
        strain = np.linspace(float(begin), float(end), len(sheared[0].time))
        curves = [np.interp(strain, s.shear_strain, _smooth(s.shear_strain.values, s.friction.values)) for s in sheared]
        since, estimate = _params(runs[0]).steady_from, found[shape]
        axes.fill_between(strain, np.min(curves, axis=0), np.max(curves, axis=0), color=COLOUR[shape], alpha=0.22, lw=0)
        label = f"{name_of(shape, dim)}: {estimate_text(estimate)} ({len(runs)} run{'s' * (len(runs) > 1)})"
        axes.plot(strain, np.mean(curves, axis=0), color=COLOUR[shape], lw=1.4, label=label)
        _draw_mean(axes, since, strain[-1], estimate, lw=1.1)
        top, last = max(top, np.max(curves)), max(last, strain[-1])
    if series:
        axes.plot([], [], color="black", lw=1.1, ls=(0, (5, 3)), label=f"mean from strain {since:g} on")
        axes.fill_between([], [], color="black", alpha=0.2, lw=0, label="its 95 % interval")
        axes.axvline(since, 0.06, 0.72, color="0.6", lw=1, ls=":")
        axes.set_xlim(0, last)
        axes.legend(loc="upper left", fontsize=9.2)
    axes.set(ylim=(0, 1.42 * top), xlabel="shear strain [1]", ylabel="friction: shear stress / normal stress [1]")
    note = f"line: mean of the runs over strain {SMOOTH_STRAIN:g}; in colour: least to greatest run"
    axes.text(0.02, 0.02, note, transform=axes.transAxes, fontsize=8.5, color="0.3")
    axes.set_title("(a) friction of the sheared layer")


def published_rows() -> list[tuple]:
    """(dimension, friction, label, kind, round or angular, remark, values) of the checked references, unsorted.

    Values of one source and condition share a row; the friction is their mean.
    """
    rows = {}
    for r in lsm.published_friction():
        if r["note"] == "unchecked":
            continue
        still = "rotation suppressed" in r["conditions"]
        what = r["shape"].removeprefix("smooth ") + ("" if r["shape"] == "angular" else "s")
        label = f"{what} {r['dimension']}D{', no rotation' * still}, {r['source']}"
        rows.setdefault((r["dimension"], label, r["kind"], still), []).append(r["mu"])
    return [
        (d, float(np.mean(mu)), label, kind, "angular" if "angular" in label else "round", still, mu)
        for (d, label, kind, still), mu in rows.items()
    ]


def _draw_published(axes, found, dim, singles):
    """Steady friction of this run, with its 95 % interval and the means of the single runs, beside published values.

    Rows are sorted by dimension, then by friction.
    """
    rows = published_rows()
    rows += [
        (dim, e.mean, f"{name_of(s, dim).removesuffix(' grains')} {dim}D, this run", "this run", s, False, e)
        for s, e in found.items()
    ]
    rows.sort(key=lambda row: row[:3], reverse=True)
    for y, (_, mean, _, kind, shape, _, values) in enumerate(rows):
        colour = COLOUR[shape]
        if kind == "this run":
            axes.axhspan(y - 0.5, y + 0.5, color=colour, alpha=0.14, lw=0)
            width = np.nan_to_num(values.half_width)  # no bar if it is unknown
            axes.errorbar(mean, y, xerr=width, fmt="o", color=colour, ms=5.5, capsize=5, elinewidth=2)
            axes.plot(singles[shape], [y - SINGLE_BELOW] * len(singles[shape]), "o", color=colour, ms=3, mfc="white")
            continue
        face = colour if kind == "laboratory" else "white"
        axes.plot(values, [y] * len(values), "s" if face == colour else "D", color=colour, ms=6, mfc=face, mew=1.5)
    axes.set_yticks(range(len(rows)), [row[2] for row in rows], fontsize=9)
    for tick, row in zip(axes.get_yticklabels(), rows, strict=True):
        tick.set_fontweight("bold" if row[3] == "this run" else "normal")
    for y in range(1, len(rows)):
        if rows[y][0] != rows[y - 1][0]:  # a line between the dimensions
            axes.axhline(y - 0.5, color="0.6", lw=0.8)
    axes.plot([], [], "s", color="0.3", ms=6, label="laboratory")
    axes.plot([], [], "D", color="0.3", ms=6, mfc="white", mew=1.5, label="simulation")
    axes.errorbar([], [], xerr=[], fmt="o", color="0.3", ms=5.5, capsize=5, elinewidth=2, label="this run, 95 %")
    axes.plot([], [], "o", color="0.3", ms=3, mfc="white", label="single runs")
    axes.legend(loc="lower left", handletextpad=0.4, borderaxespad=0.2)
    axes.grid(axis="x", color="0.9")
    axes.set_axisbelow(True)
    axes.tick_params(axis="y", length=0)
    axes.set(xlim=(0, 0.7), ylim=(-0.6, len(rows) - 0.4), xlabel="friction [1]")
    axes.set_title("(b) steady friction beside published values")


def _draw_friction(axes, sheared, params):
    strain, bulk = sheared.shear_strain.values, sheared.friction.values
    platen = (sheared.platen_shear_stress / sheared.platen_normal_stress).values
    colour = COLOUR[params.shape]
    axes.plot(strain, bulk, color=colour, lw=0.8, alpha=0.4, label="in the bulk")
    axes.plot(strain, _smooth(strain, bulk), color=colour, lw=1.7, label=f"bulk, mean over strain {SMOOTH_STRAIN:g}")
    axes.plot(strain, _smooth(strain, platen), "k:", lw=1.2, label="the same at the top platen")
    steady = lsm.statistics.steady_ratio(sheared.shear_stress, sheared.normal_stress, params.steady_from)
    _draw_mean(axes, params.steady_from, strain[-1], steady, lw=1.2, label=f"steady: {estimate_text(steady)}")
    axes.set(xlim=(0, strain[-1]), ylim=(0, 1.5 * np.nanmax(bulk)), xlabel="shear strain [1]", ylabel="friction [1]")
    axes.legend(loc="upper left")
    axes.set_title("(a) friction: shear stress / normal stress")


def _draw_thickness(axes, sheared, colour):
    """Thickness, and porosity as a second scale of the same curve: the volume of the grains does not change."""
    from matplotlib.ticker import MaxNLocator

    thickness = 1e3 * sheared.layer_thickness.values
    axes.plot(sheared.shear_strain, thickness, color=colour, lw=1.3)
    solid = float(np.mean(thickness * (1.0 - sheared.porosity.values)))
    scales = (lambda height: 1.0 - solid / height, lambda porosity: solid / (1.0 - porosity))
    second = axes.secondary_yaxis("right", functions=scales)
    second.set_ylabel("porosity [1]")
    second.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    second.spines["right"].set_visible(True)
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    axes.set(xlim=(0, float(sheared.shear_strain[-1])), xlabel="shear strain [1]", ylabel="layer thickness [mm]")
    axes.set_title("(c) layer thickness and porosity")


def _draw_energy(axes, sheared):
    """Work done and where it went, all since shear began."""
    since = sheared - sheared.isel(time=0)
    strain, lost = sheared.shear_strain.values, since.dissipated_energy.values
    work, residual = since.external_work.values, np.abs(since.energy_residual.values).max()
    stored = (since.translational_energy + since.rotational_energy + since.elastic_energy).values
    unit, factor = _unit(np.abs(work).max())
    kinds = [i for i in range(lost.shape[1]) if np.any(lost[:, i])]
    names = [f"dissipated: {effect_words(str(sheared.effect_name.values[i]))}" for i in kinds]
    axes.stackplot(
        strain, factor * lost[:, kinds].T, labels=names, colors=[BLUE, YELLOW, GREEN, PURPLE, ORANGE], alpha=0.75
    )
    axes.plot(strain, factor * work, "k", lw=1.5, label="work of the platens")
    axes.plot(strain, factor * stored, "k:", lw=1.2, label="stored: kinetic and elastic")
    axes.set(xlim=(0, strain[-1]), xlabel="shear strain [1]", ylabel=f"energy since shear began [{unit}]")
    axes.legend(loc="upper left", reverse=True)
    share = residual / max(float(sheared.work_throughput[-1]), 1e-300)
    axes.set_title(f"(d) energy budget; residual at most {100 * share:.1g} % of the work")


def _unit(greatest):
    """(unit with prefix, factor) that brings an energy [J] to between 1 and 1000."""
    for prefix, factor in (("", 1.0), ("m", 1e3), ("µ", 1e6), ("n", 1e9)):
        if greatest * factor >= 1.0:
            return prefix + "J", factor
    return "pJ", 1e12
