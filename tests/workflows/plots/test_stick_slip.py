"""The axes of the figure of slip events."""

import itertools

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from workflows.plots.stick_slip import _name_decades


@pytest.mark.parametrize("form", [None, "{x:g}"])
@pytest.mark.parametrize(("low", "high"), [(0.11, 0.13), (0.013, 0.31), (2e-6, 4e-5), (1e-4, 0.9), (1e-9, 1e-2)])
def test_numbers_of_a_logarithmic_axis_do_not_overlap(low, high, form):
    figure = Figure(figsize=(4.5, 3.0), layout="constrained")
    canvas = FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.loglog([low, high], [1.0, 6.0])
    for axis in (axes.xaxis, axes.yaxis):
        _name_decades(axis, form)
    canvas.draw()
    labels = [label for label in axes.get_xticklabels(which="both") if label.get_text()]
    boxes = sorted((label.get_window_extent().x0, label.get_window_extent().x1) for label in labels)
    inside = [box for box in boxes if axes.bbox.x0 - 30 < np.mean(box) < axes.bbox.x1 + 30]
    assert len(inside) >= 2 and all(end < begin for (_, end), (begin, _) in itertools.pairwise(inside))
