"""The picture of a sweep: means over the seeds with their intervals, and what they are drawn against by default."""

import re

import numpy as np
import pytest
from PIL import Image  # comes with matplotlib

import taichi_lsm as lsm
from tests.helpers.sweep_tables import ERROR, SAMPLES, friction_of, grid, write_sweep_table
from workflows.cli.main import main
from workflows.plots.sweep_figure import plot_sweep
from workflows.sweep.estimates import choose, estimates, spaced_by_a_factor

FRICTIONS, RATES = (0.1, 0.3, 0.5, 0.7), (1e-3, 3e-3, 1e-2)
SHAPE, FRICTION = grid("shape", "round", "angular"), grid("particle_friction", *FRICTIONS)
RATE, SEEDS = grid("target_inertial_number", *RATES), grid("seed", 1, 2, 3)
SAMPLE = "sample", [{"particle_friction": 0.1 * i, "stiffness_number": 300.0 * 2.0**i} for i in range(1, 5)]


def choice_of(folder, *factors, log=(), **given):
    write_sweep_table(folder, factors, log)
    return choose(lsm.open_run(folder / "sweep.nc"), **given)


def test_what_is_drawn_follows_from_the_factors(tmp_path):
    found = choice_of(tmp_path, SHAPE, FRICTION, RATE, SEEDS, log=("target_inertial_number",))
    assert found.metric == "friction_mean" and found.against == ("particle_friction",)
    assert found.colour == "target_inertial_number" and found.facets == ("shape",)
    assert found.log == {"target_inertial_number"}
    found = choice_of(tmp_path, SHAPE, SAMPLE, SEEDS, log=("stiffness_number",))
    assert found.against == ("particle_friction", "stiffness_number") and found.log == {"stiffness_number"}
    assert found.colour == "shape" and found.facets == ()
    found = choice_of(tmp_path, SHAPE, FRICTION, SEEDS, against="shape", facet="seed")
    assert (found.against, found.colour, found.facets) == (("shape",), "particle_friction", ("seed",))
    found = choice_of(tmp_path, SHAPE, FRICTION, against="friction")  # as the file of the sweep calls it
    assert (found.against, found.colour) == (("particle_friction",), "shape")


def test_points_are_means_over_the_seeds_of_the_runs_that_are_complete(tmp_path):
    """Errors of the runs and the scatter of the seeds, as `combine_replicas` has them; a failed run is not there."""
    write_sweep_table(tmp_path, [SHAPE, FRICTION, SEEDS], failed=[0, 3, 4, 5])
    table = lsm.open_run(tmp_path / "sweep.nc")
    found = estimates(table, choose(table))
    assert [one.runs for one in found] == [2, 3, 3, 3, 3, 3, 3] and found[1].values["particle_friction"] == 0.5
    first = [friction_of({"particle_friction": 0.1, "seed": seed}) for seed in (2, 3)]
    assert found[0].mean == lsm.statistics.combine_replicas(first, [ERROR] * 2, [SAMPLES] * 2)


def test_the_panels_have_the_points_their_intervals_and_a_colour_for_each_value(tmp_path, pictures):
    write_sweep_table(tmp_path, [SHAPE, FRICTION, RATE, SEEDS], unknown=[0])
    assert plot_sweep(tmp_path) == tmp_path / "sweep.png"
    panels = pictures[0].get_axes()
    assert [axes.get_title(loc="left") for axes in panels] == ["shape round", "shape angular"]
    assert pictures[0].get_supxlabel() == "Coulomb coefficient of the grains [1]"
    assert pictures[0].get_supylabel() == "friction of the layer [1],\n95 % intervals"
    bars = [container for container in panels[1].containers if container.lines[0] is not None]
    assert len(bars) == len(RATES)
    for rate, container in zip(RATES, bars, strict=True):
        row = {"shape": "angular", "target_inertial_number": rate}
        expected = [friction_of(row | {"particle_friction": friction}) for friction in FRICTIONS]
        half = lsm.statistics.combine_replicas([0.295, 0.3, 0.305], [ERROR] * 3, [SAMPLES] * 3).half_width
        assert np.allclose(container.lines[0].get_ydata(), expected)
        assert np.allclose(container.lines[0].get_xdata(), FRICTIONS, atol=0.05)
        segments = np.array(container.lines[2][0].get_segments())
        assert np.allclose(segments[:, 1, 1] - segments[:, 0, 1], 2.0 * half)
    (legend,) = pictures[0].legends
    assert legend.get_title().get_text() == "inertial number [1]"
    assert [text.get_text() for text in legend.get_texts()] == ["0.001", "0.003", "0.01"]


def test_drawn_points_stand_in_a_panel_for_each_parameter(tmp_path, pictures):
    write_sweep_table(tmp_path, [SAMPLE, SEEDS], log=("stiffness_number",))
    plot_sweep(tmp_path)
    panels = pictures[0].get_axes()
    assert [axes.get_xlabel() for axes in panels] == ["Coulomb coefficient of the grains [1]", "stiffness number [1]"]
    assert [axes.get_xscale() for axes in panels] == ["linear", "log"] and not pictures[0].legends
    assert [len(axes.containers[0].lines[0].get_xdata()) for axes in panels] == [4, 4]


def test_points_of_unknown_error_are_open_and_the_axis_says_so(tmp_path, pictures):
    write_sweep_table(tmp_path, [FRICTION], unknown=[1, 2])
    plot_sweep(tmp_path)
    (axes,) = pictures[0].get_axes()
    opened = [line for line in axes.lines if line.get_marker() == "o" and line.get_markerfacecolor() == "white"]
    assert np.allclose(opened[0].get_xdata(), FRICTIONS[1:3])
    assert axes.get_ylabel().endswith("95 % intervals where known")


def test_a_file_is_as_asked_for_and_says_what_it_shows(tmp_path, capsys):
    write_sweep_table(tmp_path, [SHAPE, FRICTION, SEEDS])
    command = ["sweep-plot", str(tmp_path), "--metric", "friction_mean", "--against", "friction", "--facet", "seed"]
    assert main([*command, "--format", "png"]) == 0
    path = tmp_path / "friction_mean-particle_friction.png"
    assert capsys.readouterr().out.strip() == str(path)
    with Image.open(path) as picture:
        assert picture.text["Description"].startswith("friction_mean against particle_friction, 24 points; intervals")
        assert picture.width == pytest.approx(7.1 * 300, abs=2)  # two columns of a journal
    assert main([*command, "--format", "pdf"]) == 0 and path.with_suffix(".pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["--metric", "friction_men"], r"--metric friction_men: unknown, must be one of .*Did you mean friction_mean"),
        (["--against", "shap"], r"--against shap: unknown, must be one of .*Did you mean shape"),
        (["--colour", "label"], r"--colour label: unknown"),
    ],
)
def test_mistakes_are_named(tmp_path, capsys, given, message):
    write_sweep_table(tmp_path, [SHAPE, FRICTION])
    assert main(["sweep-plot", str(tmp_path), *given]) == 2
    assert re.search(message, capsys.readouterr().err)


def test_what_is_no_sweep_or_has_no_result_is_refused(tmp_path):
    with pytest.raises(lsm.InputError, match=r"no sweep\.nc in it, must be the folder of a sweep"):
        plot_sweep(tmp_path)
    write_sweep_table(tmp_path, [FRICTION], failed=range(4))
    with pytest.raises(lsm.InputError, match="no run has a value of it"):
        plot_sweep(tmp_path)


def test_values_that_follow_by_a_factor_are_told_apart_from_even_ones():
    assert spaced_by_a_factor([1e-3, 3e-3, 1e-2, 3e-2]) is False  # not quite
    assert spaced_by_a_factor([20, 40, 80]) and spaced_by_a_factor([0.001, 0.00316, 0.01])
    assert not spaced_by_a_factor([1, 2, 3]) and not spaced_by_a_factor([1, 10]) and not spaced_by_a_factor([0, 1, 9])
    assert not spaced_by_a_factor(["a", "b", "c"])
