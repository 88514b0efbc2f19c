"""The pictures of a calibration and of a sensitivity show what they are given, with units, in every format."""

import numpy as np
import pytest

from workflows.plots.calibration import BINS, Axis, Compared, edges_of, plot_calibration
from workflows.plots.sensitivity import plot_sensitivity
from workflows.sweep.saltelli import Indices


def an_axis(label, log, rng):
    shares = np.linspace(0.0, 1.0, BINS + 1)
    edges = np.exp(np.log(0.02) + shares * np.log(10.0)) if log else 0.1 + 0.8 * shares
    values = np.clip(np.quantile(edges, 0.5) * np.exp(0.1 * rng.standard_normal(500)), edges[0], edges[-1])
    return Axis(label, log, edges, np.diff(shares), values, rng.choice(edges, 9))


def test_a_calibration_shows_parameters_and_targets(tmp_path, pictures):
    rng = np.random.default_rng(1)
    axes = [an_axis("particle friction [1]", False, rng), an_axis("corner radius [1]", True, rng)]
    targets = [
        Compared(f"{name} [{unit}]", 0.4, 0.01, 0.4 + 0.01 * rng.standard_normal(99), rng.random(99))
        for name, unit in (("friction mean", "1"), ("height", "m"))
    ]
    plot_calibration(tmp_path / "calibration.pdf", axes, np.full(500, 1 / 500), targets)
    (figure,) = pictures
    labels = {panel.get_xlabel() for panel in figure.axes} | {panel.get_ylabel() for panel in figure.axes}
    assert {"particle friction [1]", "corner radius [1]", "friction mean [1]", "height [m]"} <= labels
    two = next(panel for panel in figure.axes if panel.get_ylabel() == "corner radius [1]")
    assert two.get_yscale() == "log" and two.get_xscale() == "linear"
    assert len(two.lines[0].get_xdata()) == 9  # the runs
    band = next(panel for panel in figure.axes if panel.get_xlabel() == "height [m]").patches[0]
    assert band.get_x() == pytest.approx(0.38) and band.get_width() == pytest.approx(0.04)  # two errors on either side
    assert "particle friction [1] 0.5" in figure.get_label()
    assert (tmp_path / "calibration.pdf").read_bytes().startswith(b"%PDF")


def test_a_narrow_posterior_is_drawn_larger_and_a_wide_one_whole():
    rng, weights = np.random.default_rng(2), np.full(5000, 1 / 5000)
    wide = edges_of(rng.random(5000), weights)
    assert (wide[0], wide[-1]) == (0.0, 1.0)
    narrow = edges_of(0.5 + 0.001 * rng.standard_normal(5000), weights)
    assert 0.48 < narrow[0] < 0.497 and 0.503 < narrow[-1] < 0.52


def test_a_sensitivity_shows_both_indices_of_every_parameter(tmp_path, pictures):
    indices = Indices(*(np.array(v) for v in ([0.3, 0.4], [0.1, 0.1], [0.5, 0.6], [0.1, 0.2])), blocks=15, left_out=1)
    plot_sensitivity(tmp_path / "sensitivity.svg", ["particle_friction", "length"], {"friction_mean": indices})
    (axes,) = pictures[0].axes
    assert [bar.get_width() for bar in axes.patches] == [0.3, 0.4, 0.5, 0.6]
    assert [tick.get_text() for tick in axes.get_yticklabels()] == ["particle friction", "length"]
    assert axes.get_title(loc="left") == "friction mean: 15 blocks of runs, 1 left out"
