"""Titles of figures: what a layer consists of, how it is sheared and at which numbers, in lines of the right length."""

from __future__ import annotations

import textwrap
import tomllib
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from workflows.common.metrics import shown
from workflows.gouge.labels import friction_words, grains_of_run, other_effects, spring_words
from workflows.gouge.layer_metrics import sheared_rows
from workflows.plots.course import is_sheared

if TYPE_CHECKING:
    import xarray

TITLE_LINE = 130  # letters that a line of a figure's title has space for
NO_BREAK = "\N{NO-BREAK SPACE}"
KEPT_TOGETHER = 60  # letters between two commas of a title that stay in one line
CHANGED = 0.04  # relative span of the mean normal stress of stages that change it


def title_of(dataset: xarray.Dataset) -> str:
    """The title of a run, in lines that a figure has space for."""
    params = params_of(dataset)
    return wrapped(conditions(params, sheared_rows(dataset), grains_of_run(dataset, params)))


def params_of(dataset: xarray.Dataset) -> SimpleNamespace:
    """The parameters of a run, by their names, as stored in its file."""
    return SimpleNamespace(**tomllib.loads(dataset.config_toml))


def wrapped(text: str, width: int = TITLE_LINE) -> str:
    """A title in lines that the figure has space for, of about equal length, cut at commas where that can be done."""
    lines = -(-len(text) // width)
    # Letters that do not break hold together what stands between two commas, such as a number and its unit.
    clauses = [c.replace(" ", NO_BREAK) if len(c) <= KEPT_TOGETHER else c for c in text.split(", ")]
    kept, cut = ", ".join(clauses), []
    for length in range(min(width, len(text) // lines + 1), width + 1):
        cut = textwrap.wrap(kept, length, break_on_hyphens=False)
        if len(cut) <= lines:
            break
    return "\n".join(cut).replace(NO_BREAK, " ")


def conditions(params: Any, sheared: xarray.Dataset, grains: str) -> str:
    """A title: what the layer consists of, in words, how it is sheared, and at which numbers."""
    steady = sheared.inertial_number[(sheared.shear_strain >= getattr(params, "steady_from", 0.0)).values]
    rate = float((steady if steady.size else sheared.inertial_number).mean())
    sizes = dict.fromkeys(f"{1e6 * d:g}" for d in (params.smallest_diameter, params.largest_diameter))
    rates = shown(rate, ".2g")
    if "cycle" in sheared:
        means = sheared.inertial_number.groupby(sheared.stage).mean().values
        ends = dict.fromkeys(f"{mean:.2g}" for mean in (means.min(), means.max()))
        rates = " to ".join(ends)
    spring = spring_words(params)
    driven, speed = "sheared at constant velocity", f"inertial number {rates}, "
    if "cycle" in sheared:
        driven = "sheared in stages"
        if not is_sheared(sheared):
            driven, speed = "compressed in levels", ""
    return (
        f"{params.dim}D gouge of {grains}, {' to '.join(sizes)} µm across, "
        f"{f'pulled by a spring of {spring}' if spring else driven}, "
        f"{_stresses(params, sheared)}, {friction_words(sheared)}{other_effects(sheared)}, "
        f"{speed}stiffness number {shown(float(sheared.stiffness_number))}"
    )


def _stresses(params: Any, sheared: xarray.Dataset) -> str:
    """The normal stress in words, with the spring behind it; if stages change it, with the range of their means."""
    given = f"normal stress {params.normal_stress / 1e6:g} MPa"
    if "servo_stress" in sheared:
        stress = sheared.servo_stress.values / 1e6
        return (
            f"{given} at first and {stress.min():.3g} to {stress.max():.3g} MPa on a normal stiffness of "
            f"{params.normal_stiffness / 1e9:.3g} GPa/m"
        )
    if "cycle" not in sheared:
        return given
    means = sheared.platen_normal_stress.groupby(sheared.stage).mean().values / 1e6
    if np.ptp(means) < CHANGED * means.mean():
        return given
    return f"{given} at first and {means.min():.3g} to {means.max():.3g} MPa, means of the stages"
