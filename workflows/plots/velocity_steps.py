"""Figure of velocity steps: the stacks with both fits, the porosity, and where the work went."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import taichi_lsm as lsm
from workflows.gouge.step_cycles import DOWN, UP
from workflows.plots.canvas import BLUE, ORANGE, figure_at
from workflows.plots.friction_axes import DASHES
from workflows.plots.run_titles import title_of
from workflows.plots.step_panels import draw_stack, draw_work, mean_diameter

if TYPE_CHECKING:
    import xarray

    from taichi_lsm.statistics import LawComparison, StepFit

ROOM = 0.3  # for the legend, over the span of the friction
FINE = 400  # points of a curve
LINES = {"ageing": "-", "slip": DASHES}


def plot_velocity_steps(
    path: Path,
    dataset: xarray.Dataset,
    stacks: Mapping[str, xarray.Dataset],
    laws: LawComparison,
    velocities: Mapping[str, float],
    stiffness: float,
) -> None:
    """Draw steps.png of a run of velocity-steps.

    Parameters
    ----------
    path
        Of the picture.
    dataset
        run.nc.
    stacks, velocities
        Cycles and velocity [m s-1] of the stages UP and DOWN.
    laws, stiffness
        The fits; the spring over the normal force that they have [m-1], inf without one.
    """
    size, cycles = mean_diameter(dataset), stacks[UP].sizes["cycle"]
    with figure_at(path, (11, 8)) as figure:
        (up, down), (porosity, work) = figure.subplots(2, 2)
        ratio = velocities[UP] / velocities[DOWN]
        for axes, stage, colour, letter in ((up, UP, ORANGE, "a"), (down, DOWN, BLUE, "b")):
            draw_stack(axes, stacks[stage], "platen_friction", size, colour, f"mean of {cycles} cycles, standard error")
            for fit in (laws.ageing, laws.slip):
                slip, fitted = _fitted(fit, stacks[stage], velocities, stage, stiffness)
                axes.plot(slip / size, fitted, "k", ls=LINES[fit.law], lw=1.1, label=_words(fit))
            words = f"V to {ratio:.3g} V" if stage == UP else f"{ratio:.3g} V to V"
            axes.set(title=f"({letter}) friction after steps from {words}", ylabel="friction at the platen [1]")
            low, high = axes.get_ylim()
            room = ROOM * (high - low)
            axes.set_ylim(*((low, high + room) if stage == UP else (low - room, high)))  # beyond the transient
            axes.legend(loc="upper right" if stage == UP else "lower right", fontsize=8)
        for stage, colour, words in ((UP, ORANGE, "step up"), (DOWN, BLUE, "step down")):
            draw_stack(porosity, stacks[stage], "porosity", size, colour, words)
        porosity.set(title="(c) porosity", ylabel="porosity [1]")
        porosity.legend(loc="best")
        draw_work(work, dataset, (UP, DOWN), (f"{ratio:.3g} V", "V"))
        work.set_title("(d) where the work went", pad=32)
        figure.suptitle(title_of(dataset))
        figure.set_label(f"{laws.better} law: {_words(laws.ageing if laws.better == 'ageing' else laws.slip)}")


def _fitted(
    fit: StepFit, stack: xarray.Dataset, velocities: Mapping[str, float], stage: str, stiffness: float
) -> tuple[Any, Any]:
    """(slip [m], friction) of a fit: its response on the level that fits the stack best, by slip."""
    slip, mean = stack.slip_since_step.values, stack.platen_friction.values.mean(axis=0)
    v = (velocities[DOWN], velocities[UP]) if stage == UP else (velocities[UP], velocities[DOWN])
    numbers = (fit.a.value, fit.b.value, fit.slip_distance.value, fit.law)

    def response(x: Any) -> Any:
        if np.isfinite(stiffness):
            return lsm.statistics.spring_slider(x, *v, *numbers[:3], stiffness, fit.law)
        return np.where(x < 0.0, 0.0, lsm.statistics.friction_after_step(x, *v, *numbers))

    level = np.average(mean - response(slip), weights=np.gradient(slip))
    fine = np.concatenate([[slip[0], -1e-9 * slip[-1]], np.linspace(0.0, slip[-1], FINE)])
    return fine, level + response(fine)


def _words(fit: StepFit) -> str:
    """A fit in the legend: "ageing law: a 0.012 ± 0.003, b 0.015 ± 0.004, D_c 60 µm"."""
    a, b, distance = fit.a, fit.b, fit.slip_distance
    length = f"$D_c$ {1e6 * distance.value:.3g} µm" if not distance.unknown else "$D_c$ unknown"
    errors = f" ± {a.standard_error:.1g}", f" ± {b.standard_error:.1g}"
    known = ("", "") if a.unknown else errors
    return f"{fit.law} law: a {a.value:.2g}{known[0]}, b {b.value:.2g}{known[1]}, {length}"
