"""The friction panels of a comparison, of drawn data: what can be told apart, and what the legend says."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

import taichi_lsm as lsm
from tests.helpers.pictures import curves
from workflows.plots.comparison_panels import (
    COLOUR,
    Curves,
    draw_comparison,
    draw_published,
    draw_seeds,
    published_rows,
)


def test_only_checked_references_are_drawn():
    rows = published_rows()
    assert sum(len(row[-1]) for row in rows) == sum(r["note"] != "unchecked" for r in lsm.published_friction())
    assert {row[3] for row in rows} == {"laboratory", "simulation"}
    assert [row[2] for row in rows if row[5]] == [
        "discs 2D, no rotation, Latham 2005",
        "spheres 3D, no rotation, Latham 2005",
    ]
    assert len({row[2:4] for row in rows}) == len(rows)  # no two rows have the same words


KNOWN = {
    "round": lsm.statistics.Estimate(0.3, 0.01, 3.0, 2.0),
    "angular": lsm.statistics.Estimate(0.33, 0.02, 3.0, 2.0),
}
STRAIN = np.linspace(0.0, 3.0, 31)
WAVE = 0.05 * np.sin(6.0 * STRAIN)


def unknown(estimate):
    return estimate._replace(standard_error=np.nan)


def compared(found=KNOWN, runs=3, shift=0.0):
    """The panel of curves about the means of shapes."""
    axes = Figure(figsize=(6, 4)).subplots()
    made = {
        shape: Curves(STRAIN, np.array([e.mean + shift + WAVE + 0.01 * i for i in range(runs)]))
        for shape, e in found.items()
    }
    draw_comparison(axes, made, found, 1.0, 2)
    return axes


def legend_of(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def upright_bars(axes):
    """{colour: (x, low, high)} of the error bars of some axes."""
    bars = {}
    for container in axes.containers:
        for lines in (part for part in container.lines[2] if isinstance(part, LineCollection)):
            for (x, low), (_, high) in lines.get_segments():
                bars[tuple(lines.get_color()[0][:3])] = (x, low, high)
    return bars


def test_the_intervals_of_two_shapes_are_bars_side_by_side_in_the_colours_of_the_shapes():
    """As bands they would lie over each other, and over the span of the runs."""
    axes = compared()
    bars = upright_bars(axes)
    for shape, estimate in KNOWN.items():
        x, low, high = bars[to_rgb(COLOUR[shape])]
        assert (low, high) == pytest.approx(estimate.interval) and STRAIN[-1] < x < axes.get_xlim()[1]
        dashed = [line for line in axes.lines if line.is_dashed() and line.get_color() == COLOUR[shape]]
        assert [line.get_ydata().tolist() for line in dashed] == [[estimate.mean] * 2]
    assert len({x for x, *_ in bars.values()}) == 2
    spans = {
        tuple(c.get_facecolor()[0][:3]) for c in axes.collections if isinstance(c, PolyCollection) and c.get_paths()
    }
    assert spans >= {to_rgb(COLOUR[shape]) for shape in KNOWN}


def test_the_legend_of_a_comparison_names_what_is_drawn():
    both = legend_of(compared())
    assert "mean from strain 1 on; bar: 95 % interval" in both and "least to greatest run; line: their mean" in both
    assert "discs: 0.300, 95 % interval 0.257 to 0.343 (3 runs)" in both
    alone = legend_of(compared({shape: unknown(e) for shape, e in KNOWN.items()}, runs=1))
    assert "mean from strain 1 on" in alone and not any("least" in text or "95 %" in text for text in alone)
    assert "discs: 0.300, error unknown (1 run)" in alone


@pytest.mark.parametrize("shift", [-0.5, 0.0])
def test_all_friction_and_all_intervals_are_inside_the_axes(shift):
    wide = {"round": KNOWN["round"]._replace(standard_error=0.1), "angular": KNOWN["angular"]}
    axes = compared(wide, shift=shift)
    low, high = axes.get_ylim()
    drawn = np.concatenate([line.get_ydata() for line in axes.lines if len(line.get_xdata()) > 2])
    ends = np.array([e.interval for e in wide.values()])
    assert low < min(drawn.min(), ends.min()) and max(drawn.max(), ends.max()) < high
    zero = [line for line in axes.lines if np.array_equal(line.get_ydata(), [0.0, 0.0])]
    assert len(zero) == 1  # as part of an interval is below it


@pytest.mark.parametrize(("error", "of_runs", "target"), [(0.01, 0.02, 0.05), (np.nan, np.nan, 0.05), (0.2, 0.1, 0.01)])
def test_the_runs_to_a_target_are_inside_the_axes_with_the_wanted_error(error, of_runs, target):
    axes, means = Figure().subplots(), np.array([0.28, 0.33])
    columns = {"seed": [4, 5], "friction_mean": means, "friction_se": [of_runs, of_runs]}
    found = SimpleNamespace(mean=0.3, half_width=error, interval=(0.3 - error, 0.3 + error))
    draw_seeds(axes, xarray.Dataset({name: ("run", values) for name, values in columns.items()}), found, target, "k")
    low, high = axes.get_ylim()
    drawn = [*(means - np.nan_to_num(of_runs)), *(means + np.nan_to_num(of_runs)), 0.3 - target, 0.3 + target]
    drawn += [] if np.isnan(error) else [0.3 - error, 0.3 + error]
    assert low < min(drawn) and max(drawn) < high
    told = " ".join(legend_of(axes))
    assert f"±{target:g}" in told and "mean of the runs, 0.300" in told
    assert ("its error is unknown" in told, "reached" in told) == (bool(np.isnan(of_runs)), not np.isnan(error))


def published(found, singles=(0.3, 0.31)):
    axes = Figure(figsize=(5, 4)).subplots()
    draw_published(axes, found, 2, {shape: np.array(singles) for shape in found})
    return axes


@pytest.mark.parametrize("single", [-0.2, 1.3])
def test_the_axis_of_published_values_holds_intervals_and_single_runs(single):
    wide = {"angular": KNOWN["angular"]._replace(standard_error=0.12)}
    axes = published(wide, singles=(0.3, single))
    low, high = axes.get_xlim()
    ends = [*wide["angular"].interval, single]
    assert low < min(ends) and max(ends) < high
    assert published(KNOWN).get_xlim() == (0.0, 0.7)  # what has space there needs no more


def test_the_legend_of_published_values_names_what_is_drawn():
    half = KNOWN | {"round": unknown(KNOWN["round"])}
    none = {shape: unknown(e) for shape, e in KNOWN.items()}
    words = {name: legend_of(published(found)) for name, found in (("all", KNOWN), ("half", half), ("none", none))}
    assert "here, 95 % interval" in words["all"] and "here, 95 % interval if known" in words["half"]
    assert "here, error unknown" in words["none"]
    assert legend_of(published({})) == ["laboratory", "simulation"]


def test_no_value_is_under_the_legend_of_published_values():
    axes = published(KNOWN)
    axes.figure.set_layout_engine("constrained")
    axes.figure.draw_without_rendering()
    assert axes.get_legend().get_window_extent().y1 < axes.get_window_extent().y0  # below the axis
    assert set(curves(axes)) >= {"laboratory", "simulation", "single runs"}
