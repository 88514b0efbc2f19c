"""Panels of experiments that step a drive: a stacked series with its band, and where the work went in each stage."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import taichi_lsm as lsm
from workflows.common.effect_words import effect_words
from workflows.gouge.layer_metrics import sheared_rows
from workflows.gouge.step_cycles import mean_and_error
from workflows.plots.canvas import BLUE, GREEN, ORANGE, PURPLE, YELLOW
from workflows.plots.run_titles import params_of

if TYPE_CHECKING:
    import xarray

EFFECT_COLOURS = (BLUE, YELLOW, GREEN, PURPLE, ORANGE)
LEAST_SHARE = 0.005  # of an effect that has a colour of its own


def draw_stack(axes: Any, stack: xarray.Dataset, name: str, size: float, colour: str, label: str) -> None:
    """The mean over the cycles of a series against slip in diameters `size` [m], with a band of one standard error."""
    mean, error = mean_and_error(stack, name)
    slip = stack.slip_since_step.values / size
    for side, named in ((slip < 0.0, None), (slip >= 0.0, label)):  # no line across the step
        axes.plot(slip[side], mean[side], color=colour, lw=1.6, label=named)
        if np.isfinite(error).all():
            low, high = mean[side] - error[side], mean[side] + error[side]
            axes.fill_between(slip[side], low, high, color=colour, alpha=0.25, lw=0)
    axes.axvline(0.0, color="0.6", lw=0.8, ls=":", zorder=1)
    axes.set(xlim=(slip[0], slip[-1]), xlabel="slip since the step [mean diameters]")


def draw_work(
    axes: Any,
    dataset: xarray.Dataset,
    stages: tuple[str, ...],
    names: tuple[str, ...],
    columns: int = 3,
    least: float = 8.0,
) -> None:
    """Shares of the dissipated energy by effect, one bar for each of these stages, which have these names.

    columns: of the legend; least: share whose number has room in its bar [%].
    """
    shares = lsm.statistics.work_by_stage(sheared_rows(dataset)).share.sel(stage=list(stages))
    left = np.zeros(len(stages))
    shown = [str(e) for e in shares.effect.values if float(np.abs(shares.sel(effect=e)).max()) > LEAST_SHARE]
    for effect, colour in zip(shown, EFFECT_COLOURS, strict=False):
        values = 100.0 * shares.sel(effect=effect).values
        axes.barh(names, values, left=left, color=colour, alpha=0.8, label=effect_words(effect))
        for row, (start, value) in enumerate(zip(left, values, strict=True)):
            if value > least:
                axes.text(start + 0.5 * value, row, f"{value:.0f} %", ha="center", va="center", fontsize=8.5)
        left = left + values
    axes.set(xlim=(0, 100), xlabel="share of the dissipated energy [%]")
    axes.invert_yaxis()
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns)


def mean_diameter(dataset: xarray.Dataset) -> float:
    """Mean diameter of the grains of a run [m], from its parameters."""
    params = params_of(dataset)
    return 0.5 * (params.smallest_diameter + params.largest_diameter)
