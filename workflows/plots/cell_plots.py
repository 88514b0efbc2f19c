"""The figure of a run of shear-cell: friction, the cell, its solid fraction and normal stress, the energy budget."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import taichi_lsm as lsm
from workflows.common.metrics import shown
from workflows.gouge.labels import friction_words, grains_of_run, other_effects
from workflows.gouge.layer_metrics import sheared_rows
from workflows.plots.canvas import ORANGE, figure_at
from workflows.plots.comparison_panels import COLOUR
from workflows.plots.course import course_of
from workflows.plots.layer_pictures import bar_beside, draw_colour_bar, draw_packing, read_snapshot, section_words
from workflows.plots.run_panels import draw_energy, draw_friction
from workflows.plots.run_titles import params_of, wrapped

BAR = "velocity along the shear /\nvelocity of the upper border [1]"


def plot_cell(out: str | os.PathLike[str], kind: str = "png") -> Path:
    """Draw run.png of a run of shear-cell in the folder `out`; returns its path. kind: png, pdf or svg."""
    out, path = Path(out), Path(out) / f"run.{kind}"
    dataset = lsm.open_run(out / "run.nc")
    params, sheared = params_of(dataset), sheared_rows(dataset)
    with figure_at(path, (11, 8)) as figure:
        panels = figure.subplot_mosaic("ab;cd")
        draw_friction(panels["a"], sheared, params)
        drawn = draw_packing(panels["b"], read_snapshot(out / "grains.nc"))
        title = f"cell at strain {float(sheared.shear_strain[-1]):.2g}\n{section_words(params.dim)}"
        panels["b"].set_title(title.rstrip())
        draw_colour_bar(figure, drawn, BAR, cax=bar_beside(panels["b"]))
        _draw_filling(panels["c"], sheared, params)
        draw_energy(panels["d"], sheared, course_of(sheared, params), "shear and of the normal stress")
        for letter, axes in panels.items():
            axes.set_title(f"({letter}) {axes.get_title(loc='left')}")
        figure.suptitle(wrapped(_conditions(dataset, params, sheared)))
        shown = [axes.get_title(loc="left").split("\n")[0] for axes in panels.values()]
        figure.set_label(f"Course of the run and its last state: {', '.join(shown)}.")
    return path


def _conditions(dataset: Any, params: Any, sheared: Any) -> str:
    """The title: what the cell consists of, how it is sheared, and at which numbers."""
    held = getattr(params, "solid_fraction", None)
    kept = (
        f"solid fraction {held:g}" if isinstance(held, float) else f"normal stress {params.normal_stress / 1e6:g} MPa"
    )
    steady = sheared.inertial_number[(sheared.shear_strain >= params.steady_from).values]
    sizes = dict.fromkeys(f"{1e6 * d:g}" for d in (params.smallest_diameter, params.largest_diameter))
    return (
        f"{params.dim}D cell of {grains_of_run(dataset, params)}, {' to '.join(sizes)} µm across, "
        f"sheared homogeneously without walls at constant {kept}, "
        f"{friction_words(sheared)}{other_effects(sheared)}, "
        f"inertial number {shown(float(steady.mean()), '.2g')}, stiffness number "
        f"{shown(float(sheared.stiffness_number))}"
    )


def _draw_filling(axes: Any, sheared: Any, params: Any) -> None:
    """Solid fraction, and the normal stress over that which was given on a second scale."""
    strain = sheared.shear_strain.values
    axes.plot(strain, 1.0 - sheared.porosity.values, color=COLOUR[params.shape], lw=1.3)
    axes.set(xlim=(0, strain[-1]), xlabel="shear strain [1]", ylabel="solid fraction [1]")
    second = axes.twinx()
    second.plot(strain, sheared.cell_normal_stress.values / params.normal_stress, color=ORANGE, lw=0.8, alpha=0.8)
    second.set_ylabel("normal stress / given one [1]", color=ORANGE)
    second.spines["right"].set_visible(True)
    axes.set_title("solid fraction and normal stress")
