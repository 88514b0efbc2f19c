"""Panels of any sheared layer or cell: friction, thickness and porosity, the energy budget."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import taichi_lsm as lsm
from workflows.common.effect_words import effect_words
from workflows.plots.canvas import BLUE, GREEN, ORANGE, PURPLE, YELLOW
from workflows.plots.comparison_panels import COLOUR
from workflows.plots.course import Course, pushed, slip_of
from workflows.plots.friction_axes import (
    DASHES,
    axis_limits,
    draw_zero,
    estimate_text,
    mark_stages,
    smoothed,
    smoothing_width,
)

if TYPE_CHECKING:
    import xarray

SPACE = 1.5  # length of an axis over what its curves need, for the legend above them


def draw_friction(axes: Any, sheared: xarray.Dataset, params: Any) -> None:
    """Friction over strain in the bulk and at the top platen, if there is one, with the mean of the steady state."""
    strain, bulk = sheared.shear_strain.values, sheared.friction.values
    width = smoothing_width(strain[-1] - strain[0])
    colour, drawn = COLOUR[params.shape], [bulk, smoothed(strain, bulk, width)]
    of_all, mean = ("of a row", "mean") if not has_platens(sheared) else ("in the bulk", "bulk, mean")
    axes.plot(strain, bulk, color=colour, lw=0.8, alpha=0.4, label=of_all)
    axes.plot(strain, drawn[1], color=colour, lw=1.7, label=f"{mean} over strain {width:g}")
    if has_platens(sheared):
        drawn.append(smoothed(strain, (sheared.platen_shear_stress / sheared.platen_normal_stress).values, width))
        axes.plot(strain, drawn[2], "k:", lw=1.2, label="the same at the top platen")
    axes.set(xlim=(0, strain[-1]), xlabel="shear strain [1]", ylabel="friction [1]")
    axes.set_title("friction: shear stress / normal stress")
    drawn += _draw_steady(axes, sheared, params.steady_from)
    axes.set_ylim(axis_limits(*drawn, space=SPACE))
    draw_zero(axes)
    axes.legend(loc="upper left")


def _draw_steady(axes: Any, sheared: xarray.Dataset, since: float) -> list[tuple[float, float]]:
    """The mean friction from a strain on with its interval, which is returned; nothing before a run has come there."""
    try:
        steady = lsm.statistics.steady_ratio(sheared.shear_stress, sheared.normal_stress, since)
    except lsm.InputError:  # too few rows
        return []
    last = float(sheared.shear_strain[-1])
    axes.plot([since, last], [steady.mean] * 2, "k", ls=DASHES, lw=1.2, label=f"steady: {estimate_text(steady)}")
    if np.isfinite(steady.half_width):
        axes.fill_between([since, last], *steady.interval, color="black", alpha=0.2, lw=0, zorder=1.5)
    return [steady.interval]


def draw_stages(axes: Any, sheared: xarray.Dataset, params: Any, course: Course) -> None:
    """Friction through stages, at the platen as a laboratory measures it; against time with the slip of the platen."""
    platen, bulk = (sheared.platen_shear_stress / sheared.platen_normal_stress).values, sheared.friction.values
    colour, imposed = COLOUR[params.shape], pushed(sheared)
    axes.plot(course.values, bulk, color=colour, lw=0.8, alpha=0.4, label="in the bulk")
    axes.plot(course.values, platen, color=colour, lw=1.3, label="at the top platen")
    if imposed.any():
        ratio = sheared.imposed_shear_stress.values / params.normal_stress
        axes.plot(course.values, ratio, "k", ls=DASHES, lw=1.2, label="imposed, over --normal-stress")
    course.name_axis(axes)
    axes.set(ylabel="friction [1]")
    axes.set_title("friction: shear stress / normal stress")
    axes.set_ylim(axis_limits(bulk, platen, space=SPACE))
    if course.timed:
        slip = axes.twinx()
        diameters = 2.0 * slip_of(sheared) / (params.smallest_diameter + params.largest_diameter)
        slip.plot(course.values, diameters, color="0.35", lw=1.0, ls="-.")
        slip.set_ylabel("slip [mean diameters] (dash-dotted)")
        slip.set_ylim(0.0, SPACE * float(diameters[-1]) or 1.0)  # without slip in an oedometer
        slip.spines["right"].set_visible(True)
    mark_stages(axes, course.values, sheared)
    draw_zero(axes)
    axes.legend(loc="upper left", frameon=True, framealpha=0.85, edgecolor="none")  # over the lines between stages


def draw_thickness(axes: Any, sheared: xarray.Dataset, course: Course, colour: str) -> None:
    """Thickness, and porosity as a second scale of the same curve: the volume of the grains does not change."""
    from matplotlib.ticker import MaxNLocator

    thickness = 1e3 * sheared.layer_thickness.values
    axes.plot(course.values, thickness, color=colour, lw=1.3)
    volume = thickness * (1.0 - sheared.porosity.values)
    if not np.isfinite(volume).any():
        raise lsm.InputError("needs layer_thickness and porosity, and no row of run.nc has both")
    solid = float(np.mean(volume[np.isfinite(volume)]))
    scales = (lambda height: 1.0 - solid / height, lambda porosity: solid / (1.0 - porosity))
    second = axes.secondary_yaxis("right", functions=scales)
    second.set_ylabel("porosity [1]")
    second.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    second.spines["right"].set_visible(True)
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    course.name_axis(axes)
    axes.set(ylabel="layer thickness [mm]")
    axes.set_title("layer thickness and porosity")


def draw_energy(axes: Any, sheared: Any, course: Course, drives: str = "platens") -> None:
    """Work done by the `drives` and where it went, all since shear began; sheared: rows of run.nc since then."""
    since = sheared - sheared.isel(time=0)
    lost = since.dissipated_energy.values
    work, residual = since.external_work.values, np.abs(since.energy_residual.values).max()
    stored = (since.translational_energy + since.rotational_energy + since.elastic_energy).values
    unit, factor = prefixed(np.abs(work).max(), "J")
    kinds = [i for i in range(lost.shape[1]) if np.any(lost[:, i])]
    names = [f"dissipated: {effect_words(str(sheared.effect_name.values[i]))}" for i in kinds]
    axes.stackplot(
        course.values, factor * lost[:, kinds].T, labels=names, colors=[BLUE, YELLOW, GREEN, PURPLE, ORANGE], alpha=0.75
    )
    axes.plot(course.values, factor * work, "k", lw=1.5, label=f"work of the {drives}")
    axes.plot(course.values, factor * stored, "k:", lw=1.2, label="stored: kinetic and elastic")
    course.name_axis(axes)
    axes.set(ylabel=f"energy since shear began [{unit}]")
    if "cycle" in sheared:  # energy does not rise evenly, and would meet the legend
        axes.set_ylim(axis_limits(factor * work, factor * stored, factor * lost[:, kinds].sum(axis=1), space=SPACE))
    axes.legend(loc="upper left", reverse=True)
    share = residual / max(float(sheared.work_throughput[-1]), 1e-300)
    axes.set_title(f"energy budget; residual at most {100 * share:.1g} % of the work")


def has_platens(sheared: xarray.Dataset) -> bool:
    """Whether a run is one of a layer between platens, and not of a cell without walls."""
    return "platen_shear_stress" in sheared


def prefixed(greatest: float, unit: str) -> tuple[str, float]:
    """(unit with prefix, factor) that brings a value in this unit to between 1 and 1000, where that can be done."""
    for prefix, factor in (("M", 1e-6), ("k", 1e-3), ("", 1.0), ("m", 1e3), ("µ", 1e6), ("n", 1e9)):
        if abs(greatest) * factor >= 1.0:
            return prefix + unit, factor
    return f"p{unit}", 1e12
