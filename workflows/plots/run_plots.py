"""Figures of runs and of comparisons; each reads the files of a folder and writes a picture beside them.

`kind` is the format of the picture, png, pdf or svg.
"""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

import taichi_lsm as lsm
from workflows.gouge.labels import shape_words, spring_words
from workflows.gouge.layer_metrics import sheared_rows
from workflows.plots.canvas import figure_at
from workflows.plots.comparison_panels import COLOUR, curves_of, draw_comparison, draw_published, draw_seeds
from workflows.plots.course import course_of
from workflows.plots.friction_axes import estimate_text
from workflows.plots.layer_pictures import (
    MIDDLE,
    bar_beside,
    draw_colour_bar,
    draw_packing,
    read_snapshot,
    section_words,
)
from workflows.plots.run_panels import draw_energy, draw_friction, draw_stages, draw_thickness
from workflows.plots.run_titles import conditions, params_of, title_of, wrapped
from workflows.plots.slip_and_breakage import draw_breakage, draw_spring

MOST_LISTED = 4  # grains that a title names


def plot_run(out: str | os.PathLike[str], kind: str = "png") -> Path:
    """Draw run.png of a run of shear-gouge: friction, layer, thickness and energy; returns its path.

    The curves of a run at one velocity are drawn against shear strain, those of stages against slip or time: `Course`.
    A layer on a spring has a panel of what the spring does, one of breakable grains a panel of their breakage.
    """
    out, path = Path(out), Path(out) / f"run.{kind}"
    dataset = lsm.open_run(out / "run.nc")
    params, sheared = params_of(dataset), sheared_rows(dataset)
    course = course_of(sheared, params)
    more = [draw_spring] * bool(spring_words(params)) + [draw_breakage] * ("bond_count" in sheared)
    places = "ab;cd" + ("", ";ee", ";ef")[len(more)]
    with figure_at(path, (11, 12 if more else 8)) as figure:
        panels = figure.subplot_mosaic(places)
        friction, packing, thickness, energy = (panels[letter] for letter in "abcd")
        if "cycle" in sheared:
            draw_stages(friction, sheared, params, course)
        else:
            draw_friction(friction, sheared, params)
        drawn = draw_packing(packing, read_snapshot(out / "grains.nc"))
        pieces = ", the pieces of its grains" if "bond_count" in sheared else ""
        # In two lines, since a 3D layer is narrow.
        title = f"layer at strain {float(sheared.shear_strain[-1]):.2g}{pieces}\n{section_words(params.dim)}"
        packing.set_title(title.rstrip())
        draw_colour_bar(figure, drawn, cax=bar_beside(packing))
        draw_thickness(thickness, sheared, course, COLOUR[params.shape])
        draw_energy(energy, sheared, course)
        for letter in "abcd":
            panels[letter].set_title(f"({letter}) {panels[letter].get_title(loc='left')}")
        for letter, draw in zip("ef", more):
            draw(panels[letter], sheared, letter, course)
        figure.suptitle(title_of(dataset))
        shown = [axes.get_title(loc="left").split("\n")[0] for axes in panels.values()]
        figure.set_label(f"Course of the run and its last state: {', '.join(shown)}.")
    return path


def plot_stopped(out: str | os.PathLike[str], error: lsm.SimulationError, kind: str = "png") -> Path:
    """Draw stopped.png: the layer when it was stopped, the grains of the error marked; returns its path."""
    out, path = Path(out), Path(out) / f"stopped.{kind}"
    # In 3D through the first of the grains at fault, which a section through the middle need not cut.
    snapshot = read_snapshot(out / "grains.nc", through=error.grains[0] if error.grains else None)
    cut = [k for k in error.grains if k in snapshot.number]
    with figure_at(path, (9, 7)) as figure:
        axes = figure.subplots()
        draw_colour_bar(figure, draw_packing(axes, snapshot, cut), ax=axes)
        height = dict(zip(snapshot.number.tolist(), snapshot.position[:, 1], strict=True))
        low, high = axes.get_ylim()
        marked = [k for k in cut if low < height[k] < high]
        unseen = [k for k in error.grains if k not in marked]
        words = ["last snapshot"]
        if snapshot.is_section:
            words += [section_words(3, f"through grain {cut[0]}" if cut and cut[0] == error.grains[0] else MIDDLE)]
        words += [f"edged in red: {_listed(marked)}"] * bool(marked) + [f"not in it: {_listed(unseen)}"] * bool(unseen)
        axes.set_title(wrapped("; ".join(words), 80))
        figure.suptitle(wrapped(str(error), 95))
    return path


def _listed(grains):
    """The numbers of the first grains, and how many more there are."""
    more = len(grains) - MOST_LISTED
    text = f"grain{'s' * (len(grains) > 1)} {', '.join(map(str, grains[:MOST_LISTED]))}"
    return text + (f" and {more} more" if more > 0 else "")


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
        of_shapes = {shape: curves_of([sheared_rows(run) for run in runs]) for shape, runs in series.items()}
        since = next((params_of(runs[0]).steady_from for runs in series.values()), 0.0)
        draw_comparison(curves, of_shapes, found, since, dim)
        draw_published(published, found, dim, {shape: _complete(table, shape).friction_mean.values for shape in series})
        figure.set_label("; ".join(f"{shape_words(shape, dim)}: {estimate_text(e)}" for shape, e in found.items()))
        drawn, layers = None, lower.subplots(1, 2)
        for axes, shape, letter in zip(layers, COLOUR, "cd", strict=True):
            if shape not in series:
                say_why_none(axes, table, shape, dim, letter)
                continue
            last = float(series[shape][0].shear_strain[-1])
            drawn = draw_packing(axes, read_snapshot(folders[shape][0] / "grains.nc"))
            # In two lines, since a 3D layer is narrow.
            title = f"({letter}) {shape_words(shape, dim)} at strain {last:.2g}\n{section_words(dim)}"
            axes.set_title(title.rstrip(), color=COLOUR[shape])
        if drawn:
            limits = [axes.get_ylim() for axes, shape in zip(layers, COLOUR, strict=True) if shape in series]
            for axes in layers:
                axes.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))
            draw_colour_bar(lower, drawn, ax=layers, aspect=30)
            one = next(iter(series.values()))[0]
            grains = " and of ".join(shape_words(shape, dim) for shape in series)
            figure.suptitle(wrapped(conditions(params_of(one), sheared_rows(one), grains)))
    return path


def plot_target(out: str | os.PathLike[str], error: float, kind: str = "png") -> Path:
    """Draw friction.png of the runs of target.nc, whose mean friction has a 95 % interval of half-width `error` [1]."""
    out, path = Path(out), Path(out) / f"friction.{kind}"
    table = lsm.open_run(out / "target.nc")
    runs = [lsm.open_run(out / folder / "run.nc") for folder in table.path.values]
    params, mean = params_of(runs[0]), float(table.friction_mean.mean())
    found = SimpleNamespace(mean=mean, half_width=error, interval=(mean - error, mean + error))
    with figure_at(path, (11, 4.6)) as figure:
        curves, seeds = figure.subplots(1, 2, width_ratios=(1.35, 1))
        of_shape = {params.shape: curves_of([sheared_rows(run) for run in runs])}
        draw_comparison(curves, of_shape, {params.shape: found}, params.steady_from, params.dim)
        draw_seeds(seeds, table, found, float(table.target_error[0]), COLOUR[params.shape])
        grains = shape_words(params.shape, params.dim)
        figure.suptitle(wrapped(conditions(params, sheared_rows(runs[0]), grains)))
    return path


def say_why_none(axes: Any, table: Any, shape: str, dim: int, letter: str) -> None:
    """In place of a layer: that no run of the shape is complete, and how each of them ended."""
    own = table.isel(run=(table["shape"] == shape).values)
    ends = [f"seed {seed}: {status}" for seed, status in zip(own.seed.values, own.status.values, strict=True)]
    text = "\n".join([f"({letter}) no complete run of {shape_words(shape, dim)}", *ends])
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", fontsize=10.5, color=COLOUR[shape])
    axes.set_axis_off()


def _complete(table, shape):
    """The complete runs of a shape."""
    return table.isel(run=((table["shape"] == shape) & (table.status == "complete")).values)


def _estimate(table, shape):
    own = _complete(table, shape)
    return lsm.statistics.combine_replicas(own.friction_mean.values, own.friction_se.values, own.friction_ess.values)
