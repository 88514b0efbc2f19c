"""Figure of crushed grains: their forces, their strengths with Weibull's law, their fragments, the energy."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workflows.crush.strengths import section_of, split_and_borne, weibull_of
from workflows.plots.canvas import BLUE, GREEN, ORANGE, PURPLE, YELLOW, figure_at

if TYPE_CHECKING:
    import xarray

    from workflows.crush_grain import Params

MOST_CURVES = 8
ENERGIES = {  # name: (words, colour)
    "elastic_energy": ("elastic", BLUE),
    "fracture_energy": ("broken bonds", GREEN),
    "dissipated_energy": ("all dissipated", ORANGE),
    "kinetic_energy": ("kinetic", PURPLE),
}


def plot_crushing(path: Path, dataset: xarray.Dataset, params: Params) -> None:
    """Draw crush.png of crush.nc."""
    p, shapes = params, "disc-like" if params.dim == 2 else "angular"
    with figure_at(path, (11, 7.2)) as figure:
        panels = figure.subplot_mosaic("ab;cd")
        _draw_forces(panels["a"], dataset, p)
        _draw_strengths(panels["b"], dataset, p)
        _draw_fragments(panels["c"], dataset)
        _draw_energies(panels["d"], dataset)
        for letter, axes in panels.items():
            axes.set_title(f"({letter}) {axes.get_title(loc='left')}")
        scatter = "" if p.weibull_modulus is None else f", Weibull modulus {p.weibull_modulus:g}"
        figure.suptitle(
            f"{p.grains} {shapes} grains of {p.pieces} pieces in {p.dim}D, {1e6 * p.height:g} µm high, bonds of "
            f"{p.tensile_strength / 1e6:g} MPa{scatter}, E = {p.youngs_modulus / 1e9:g} GPa"
        )
        figure.set_label(f"crushing of {p.grains} grains")


def _draw_forces(axes: Any, dataset: xarray.Dataset, params: Params) -> None:
    """Force over the section of some grains against compression, with the strength of each."""
    way, stress = 100.0 * dataset.compression.values, dataset.force.values / section_of(params) / 1e6
    for k in range(min(MOST_CURVES, dataset.sizes["grain"])):
        (line,) = axes.plot(way, stress[:, k], lw=0.9, alpha=0.8)
        row = int(dataset.peak_row[k])
        if row >= 0:
            axes.plot(way[row], stress[row, k], "o", ms=5, color=line.get_color())
    axes.set(xlim=(0, way[-1]), xlabel="compression [%]", ylabel="force / section [MPa]")
    axes.set_ylim(bottom=0)
    axes.set_title("force on some grains, o: strength")


def _draw_strengths(axes: Any, dataset: xarray.Dataset, params: Params) -> None:
    """Share of all grains that split up to a stress, on scales on which Weibull's law is a straight line."""
    split, borne = split_and_borne(dataset, params)
    s = np.sort(split) / 1e6
    axes.set(xlabel="strength of a grain [MPa]", ylabel="ln(1/(1 - share split)) [1]", title="strengths")
    if s.size < 2:
        axes.text(0.5, 0.5, "fewer than two grains split", ha="center", transform=axes.transAxes)
        return
    share = (np.arange(s.size) + 0.5) / (s.size + borne.size)
    axes.loglog(s, -np.log1p(-share), "o", ms=4, color=BLUE)
    axes.xaxis.set_minor_formatter("{x:.3g}")
    axes.xaxis.set_major_formatter("{x:.3g}")
    law = weibull_of(split, borne)
    if law is None:
        return
    m, x = law.modulus.mean, np.geomspace(0.9 * s[0], 1.1 * s[-1], 50)
    label = f"m = {m:.2g} ± {law.modulus.standard_error:.2g}"
    axes.loglog(x, (1e6 * x / law.scale) ** m, color=ORANGE, lw=1.5, label=label)
    axes.legend(loc="upper left")


def _draw_fragments(axes: Any, dataset: xarray.Dataset) -> None:
    """Share of the mass in the largest fragment, mean and range of most grains; number of fragments."""
    way, share = 100.0 * dataset.compression.values, 100.0 * dataset.largest_share.values
    low, high = np.percentile(share, [10, 90], axis=1)
    axes.fill_between(way, low, high, color=ORANGE, alpha=0.2, lw=0)
    axes.plot(way, share.mean(axis=1), color=ORANGE, lw=1.5)
    axes.set(
        xlim=(0, way[-1]), ylim=(0, 102), xlabel="compression [%]", title="fragments: mean, band of 80 % of grains"
    )
    axes.set_ylabel("mass in the largest fragment [%]", color=ORANGE)
    number = axes.twinx()
    number.plot(way, dataset.fragments.values.mean(axis=1), color=BLUE, lw=1.3, ls="--")
    number.set_ylim(bottom=1)
    number.set_ylabel("fragments of a grain (dashed)", color=BLUE)
    number.spines["right"].set_visible(True)


def _draw_energies(axes: Any, dataset: xarray.Dataset) -> None:
    """Where the work of the platen is, and what the budget leaves open."""
    way, work = 100.0 * dataset.compression.values, dataset.work.values
    axes.plot(way, 1e6 * work, color="black", lw=1.6, label="work of the platen")
    for name, (words, colour) in ENERGIES.items():
        axes.plot(way, 1e6 * dataset[name].values, color=colour, lw=1.3, label=words)
    axes.plot(way, 1e6 * dataset.energy_residual.values, color=YELLOW, lw=1.0, ls=":", label="residual")
    axes.set(xlim=(0, way[-1]), xlabel="compression [%]", ylabel="energy [µJ]", title="energy of all grains")
    axes.legend(loc="upper left")
