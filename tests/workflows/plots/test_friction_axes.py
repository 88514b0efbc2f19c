"""What the pictures of friction share: means in words, running means, axes that hold all that is drawn."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import taichi_lsm as lsm
from workflows.plots.friction_axes import (
    axis_limits,
    draw_zero,
    estimate_text,
    mark_stages,
    running_mean,
    smoothing_width,
)


def test_a_mean_is_written_with_its_interval_or_with_the_word_unknown():
    estimate = lsm.statistics.Estimate(0.2612, 0.002, 3.0, 2.0)
    assert estimate_text(estimate) == "0.261, 95 % interval 0.253 to 0.270"
    assert estimate_text(estimate._replace(standard_error=np.nan)) == "0.261, error unknown"


def test_running_mean():
    assert np.allclose(running_mean(np.full(7, 3.0), 4), 3.0)
    assert np.allclose(running_mean(np.arange(5.0), 3), [0.5, 1, 2, 3, 3.5])
    assert running_mean(np.arange(3.0), 10).shape == (3,)


@pytest.mark.parametrize(("span", "width"), [(0.0, 0.05), (5.0, 0.05), (8.0, 0.1), (10.0, 0.1), (20.2, 0.5)])
def test_the_running_mean_of_a_long_run_is_wide(span, width):
    assert smoothing_width(span) == pytest.approx(width)


@pytest.mark.parametrize("values", [[0.3, 0.1], [0.3, -0.2, np.nan], [-0.4, -0.1], [0.0], [np.nan], []])
def test_an_axis_begins_at_zero_and_holds_what_is_below_it(values):
    low, high = axis_limits(values, space=1.5)
    known = [v for v in values if np.isfinite(v)]
    assert all(low <= v <= high for v in known) and low <= 0.0 < high
    assert (low < min(known)) if min(known, default=0.0) < 0.0 else low == 0.0
    if max(known, default=0.0) > 0.0:
        assert high - low == pytest.approx(1.5 * (max(known) - low))  # with space for the legend


def test_an_axis_holds_all_series_that_are_drawn_in_it():
    assert axis_limits([0.2, 0.3], (0.1, 0.9), 0.4, space=1.0) == (0.0, 0.9)


@pytest.mark.parametrize("low", [-0.1, 0.0])
def test_zero_is_a_line_where_the_axis_goes_below_it(low):
    axes = Figure().subplots()
    axes.set_ylim(low, 1.0)
    draw_zero(axes)
    assert [line.get_ydata()[0] for line in axes.lines] == ([0.0] if low < 0.0 else [])


@pytest.mark.parametrize(("stages", "lines"), [(20, 20), (60, 1)])
def test_very_many_stages_hide_no_curves(stages, lines):
    """Each stage but the first is too short for its name; the first takes half of the axes."""
    index = np.concatenate([np.zeros(stages), np.arange(stages)]).astype(int)
    sheared = xr.Dataset({"stage_index": ("time", index), "stage": ("time", [f"stage {i}" for i in index])})
    axes = Figure().subplots()
    along = np.arange(2.0 * stages)
    axes.set_xlim(0.0, along[-1])
    mark_stages(axes, along, sheared)
    assert len(axes.lines) == lines and len(axes.texts) == 1
