"""Figure of fragments: their sizes at some strains with the power law, its dimension, their shapes, the energy."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import taichi_lsm as lsm
from workflows.common.effect_words import effect_words
from workflows.gouge.layer_metrics import sheared_rows
from workflows.plots.canvas import BLUE, GREEN, ORANGE, figure_at
from workflows.plots.course import Course, course_of, is_sheared
from workflows.plots.run_titles import params_of, title_of
from workflows.plots.step_panels import EFFECT_COLOURS, LEAST_SHARE, mean_diameter

if TYPE_CHECKING:
    import xarray

MOST_CURVES = 4  # snapshots whose sizes are drawn
UNLIKELY = 1.1  # Kolmogorov's distance to the fitted law times the root of the number: a true law exceeds it in 5 %
BONDS = "elastic_brittle_bond"  # the channel that is drawn however small it is
MOST_POINTS = 400  # fragments whose shapes are drawn


def plot_fragments(path: Path, dataset: xarray.Dataset, fragments: xarray.Dataset, ends: tuple[float, float]) -> None:
    """Draw fragments.png of a run of breakable grains.

    Parameters
    ----------
    path
        Of the picture.
    dataset, fragments
        run.nc and fragments.nc.
    ends
        Sizes [m] between which the power law is fitted.
    """
    with figure_at(path, (11, 7.4)) as figure:
        panels = figure.subplot_mosaic("ab;cd")
        sheared = sheared_rows(dataset)
        place = Place(dataset)
        _draw_sizes(panels["a"], fragments, ends, mean_diameter(dataset), place)
        _draw_dimension(panels["b"], fragments, ends, place)
        _draw_shapes(panels["c"], fragments)
        _draw_energy(panels["d"], sheared, place.course(sheared, params_of(dataset)))
        for letter, axes in panels.items():
            axes.set_title(f"({letter}) {axes.get_title(loc='left')}")
        figure.suptitle(title_of(dataset))
        figure.set_label(f"{fragments.sizes['fragment']} fragments in all snapshots")


def snapshots_of(fragments: xarray.Dataset) -> list[xarray.Dataset]:
    """The fragments of each snapshot after the first, in which all grains are whole."""
    numbers = fragments.snapshot.values
    return [fragments.isel(fragment=numbers == number) for number in np.unique(numbers)[1:]]


class Place:
    """Where in a run (run.nc) a snapshot lies: its strain, or the normal stress [MPa] if the layer is not sheared."""

    def __init__(self, run: xarray.Dataset) -> None:
        sheared = is_sheared(sheared_rows(run))
        self.stress = None if sheared else (run.time.values, 1e-6 * run.platen_normal_stress.values)
        self.label = "normal stress [MPa]" if self.stress else "shear strain [1]"

    def of(self, snapshot: xarray.Dataset) -> float:
        """The value of a snapshot of fragments.nc."""
        if self.stress:
            return float(np.interp(float(snapshot.time[0]), *self.stress))
        return float(snapshot.shear_strain[0])

    def course(self, sheared: xarray.Dataset, params: Any) -> Course:
        """What series are drawn against: the strain, or the time in a layer that is not sheared."""
        return course_of(sheared, params) if self.stress else Course(sheared.shear_strain.values, self.label)

    def words(self, snapshot: xarray.Dataset) -> str:
        """The same with its name or unit."""
        return f"{self.of(snapshot):.3g} MPa" if self.stress else f"strain {self.of(snapshot):.2g}"


def _draw_sizes(axes: Any, fragments: xarray.Dataset, ends: tuple[float, float], size: float, place: Place) -> None:
    """Number of fragments above each size at some places; that of the last one with its power law."""
    every = snapshots_of(fragments)
    shown = [every[i] for i in np.unique(np.linspace(0, len(every) - 1, MOST_CURVES).round().astype(int))]
    for shade, one in zip(np.linspace(0.75, 0.0, len(shown)), shown, strict=True):
        d = np.sort(one.diameter.values)[::-1]
        label = place.words(one)
        axes.loglog(d / size, np.arange(1, d.size + 1), color=str(shade), lw=1.3, drawstyle="steps-post", label=label)
    d = shown[-1].diameter.values
    try:
        found = lsm.statistics.fragment_dimension(d, *ends)
    except lsm.InputError:
        found = None
    if found is not None:
        x = np.geomspace(*ends, 100)
        share = lsm.statistics.share_below(x, found.dimension.mean, *ends)
        words = f"D = {found.dimension.mean:.2f} ± {found.dimension.standard_error:.2f}"
        above = np.count_nonzero(d > ends[1]) + found.fragments * (1.0 - share)
        axes.loglog(x[above > 0.5] / size, above[above > 0.5], color=ORANGE, lw=1.6, label=words)
    axes.set(xlabel="size d [mean diameters of the grains]", ylabel="number of fragments > d", title="sizes")
    for which in (axes.xaxis.set_major_formatter, axes.xaxis.set_minor_formatter):
        which("{x:.2g}")
    axes.legend(loc="lower left")


def _draw_dimension(axes: Any, fragments: xarray.Dataset, ends: tuple[float, float], place: Place) -> None:
    """Fractal dimension with its 95 % interval, open where no power law holds, and the number of fragments."""
    count = []
    for one in snapshots_of(fragments):
        at = place.of(one)
        count.append((at, one.sizes["fragment"]))
        try:
            found = lsm.statistics.fragment_dimension(one.diameter.values, *ends)
        except lsm.InputError:
            continue
        if np.isfinite(found.dimension.half_width):
            face = ORANGE if found.distance < UNLIKELY / np.sqrt(found.fragments) else "white"
            bar = {"yerr": found.dimension.half_width, "fmt": "o", "ms": 5, "capsize": 3}
            axes.errorbar(at, found.dimension.mean, color=ORANGE, markerfacecolor=face, **bar)
    axes.set(xlabel=place.label, title="dimension, 95 % interval (open: no power law)")
    axes.set_ylabel("fractal dimension D [1]", color=ORANGE)
    number = axes.twinx()
    number.plot(*np.transpose(count), color=BLUE, lw=1.2, ls="--")
    number.set_ylim(bottom=0)
    number.set_ylabel("number of fragments (dashed)", color=BLUE)
    number.spines["right"].set_visible(True)


def _draw_shapes(axes: Any, fragments: xarray.Dataset) -> None:
    """Shapes at the end: both ratios of axes in 3D (Zingg 1935), elongation against size in 2D."""
    last = snapshots_of(fragments)[-1].isel(fragment=slice(MOST_POINTS))
    broken = last.new_surface.values > 0.0
    flat = "flatness" in last
    x = last.flatness.values if flat else 1e6 * last.diameter.values
    for which, colour, label in ((~broken, "0.6", "no broken bond"), (broken, GREEN, "with broken bonds")):
        axes.plot(x[which], last.elongation.values[which], "o", ms=3.5, color=colour, alpha=0.6, label=label)
    if flat:
        axes.set(xlim=(0, 1), xlabel="shortest / intermediate axis [1]", ylabel="intermediate / longest axis [1]")
    else:
        axes.set(xlabel="size [µm]", ylabel="shortest / longest axis [1]")
    axes.set(ylim=(0, 1), title="shapes at the end")
    axes.legend(loc="lower left")


def _draw_energy(axes: Any, sheared: xarray.Dataset, course: Course) -> None:
    """Dissipated energy of each effect since shear began, and the residual of the budget, over the throughput."""
    work = max(float(sheared.work_throughput.values[-1]), 1e-300)
    lost = sheared.dissipated_energy.values
    names, colours = [str(name) for name in sheared.effect_name.values], iter(EFFECT_COLOURS)
    for name, values in zip(names, (lost - lost[0]).T, strict=True):
        if abs(values[-1]) > LEAST_SHARE * work or name == BONDS:
            axes.plot(
                course.values, 100.0 * values / work, color=next(colours, "0.4"), lw=1.4, label=effect_words(name)
            )
    residual = sheared.energy_residual.values - sheared.energy_residual.values[0]
    axes.plot(course.values, 100.0 * residual / work, color="0.5", lw=1.0, ls=":", label="residual")
    course.name_axis(axes)
    axes.set(ylabel="share of the throughput [%]", title="where the work went")
    axes.legend(loc="best")
