"""What the pictures of energy, accuracy and hard cases do with values beyond their axes, and with none."""

import math

import numpy as np
import pytest

from workflows.accuracy.curves import Curve
from workflows.plots import tenfold
from workflows.plots.energy_figure import plot_energy
from workflows.plots.hard_cases import plot_cases
from workflows.plots.work_precision import PANELS, plot_work_precision

TIME = np.linspace(0.0, 1e-4, 5)
TITLES = {title: quantities[0] for title, quantities in PANELS}


def case(name, used, precision="f64"):
    """A row of `hard_cases.measure` that uses this share of its bound."""
    row = {"case": name, "title": name, "kind": "steps", "precision": precision, "status": int(used > 1.0)}
    return row | {"value": used, "margin": 1.0 / used if used else math.inf}


@pytest.mark.parametrize(("used", "explained"), [(3.0, False), (1e4, True), (math.inf, True)])
def test_cases_beyond_the_border_are_explained_and_under_no_legend(tmp_path, pictures, used, explained):
    plot_cases(tmp_path / "cases.png", [case("first", used), case("second", 0.0)])
    (axes,) = pictures[0].get_axes()
    assert ("at the right border: 100 or more, or no result" in axes.get_xlabel()) == explained
    assert axes.get_legend().get_window_extent().y0 >= axes.get_window_extent().y1 - 1.0  # above the frame
    (x, _), _ = axes.collections[0].get_offsets()
    assert x == min(used, 100.0) and axes.get_xlim()[0] < x < axes.get_xlim()[1]


def gas(error):
    """Energies of a gas whose total is off by these relative errors."""
    total = 1.0 + np.asarray(error)
    return {
        "time": TIME,
        "translational_energy": 0.8 * total,
        "rotational_energy": 0.2 * total,
        "elastic_energy": 0 * total,
    }


def drift_row(scheme, drift):
    return {"scheme": scheme, "purpose": "order", "steps_per_contact": 50, "drift": drift, "shadow_drift": drift}


def test_errors_below_the_least_one_drawn_are_explained_and_none_is_above_the_frame(tmp_path, pictures):
    rows = [drift_row("onset_verlet", 1e-5), drift_row("explicit_euler", math.nan)]
    for errors in ([0.0, 1e-12, 1e-5, 1e-5, 0.3], [0.0, 1e-6, 1e-5, 1e-5, 1e-5]):
        plot_energy(tmp_path / "energy.png", rows, {"onset_verlet": gas(errors)}, 0.025)
    (energy, error, drift), (_, all_known, _) = (picture.get_axes() for picture in pictures)
    assert energy.get_ylim()[1] > 1.3
    assert "(1e-09: that or less)" in error.get_ylabel() and "less" not in all_known.get_ylabel()
    labels = [text.get_text() for text in drift.get_legend().get_texts()]
    assert labels == ["Verlet with onset correction", "Verlet with onset correction, shadow energy"]


def curve(quantity, errors_known=True):
    value = np.array([1.0, 2.0, 4.0])
    error_se = 0.1 / value if errors_known else np.full(3, np.nan)
    return Curve("step_safety", quantity, value, ["a", "b", "c"], 1.0 / value, error_se, value)


@pytest.mark.parametrize("known", [True, False])
def test_bars_are_explained_where_there_are_any_and_an_empty_panel_says_so(tmp_path, pictures, known):
    plot_work_precision(tmp_path / "work.png", {("step_safety", "friction"): curve("friction", known)})
    assert ("bars: standard errors" in pictures[0].get_suptitle()) == known
    for axes in pictures[0].get_axes():
        empty = TITLES[axes.get_title()] != "friction"
        assert ("no error known" in [text.get_text() for text in axes.texts]) == empty
        if not empty:
            assert bool(axes.containers[0].lines[2]) == known  # also in the legend


def test_a_parameter_that_needs_far_less_time_is_inside_the_frame(tmp_path, pictures, monkeypatch):
    bars = [tenfold.Bar("shape error", "patches", 0.01, 0.2), tenfold.Bar("friction", "length", note=tenfold.NEVER)]
    monkeypatch.setattr(tenfold, "bars_of", lambda found: bars)
    tenfold.plot_summary(tmp_path / "tenfold.png", {})
    (axes,) = pictures[0].get_axes()
    assert axes.get_xlim()[0] < 0.01 and [0.01] in [list(line.get_xdata()) for line in axes.lines]
