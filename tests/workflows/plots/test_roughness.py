"""The picture of shape-roughness: curves of its rows, and outlines of one grain."""

import numpy as np

from tests.helpers.pictures import curves
from workflows import shape_roughness
from workflows.plots.roughness import plot_roughness

FRICTION = {"friction_mean": 0.3, "friction_se": 0.01, "friction_ess": 20.0}
HALF_WIDTH = 2.7764451 * 0.01  # Student's t of the four degrees of freedom of 20 independent samples


def test_curves_are_the_rows_and_outlines_those_of_a_grain(tmp_path, pictures):
    rows = [
        {"kind": kind, "elements": n, "shape_error": scale / n, "cost": 1e-9, **FRICTION}
        for kind, scale in (("patches", 1.0), ("clump", 4.0))
        for n in (12, 30)
    ]
    discs, chain = shape_roughness.example_outlines(shape_roughness.Params())
    plot_roughness(tmp_path / "roughness.png", rows, discs, chain)
    drawn, error, friction, cost = pictures[0].get_axes()
    assert np.array_equal(np.transpose(curves(drawn)["30 patches"]), chain)
    assert np.allclose(curves(error)["clump"], [(12, 30), (4 / 12, 4 / 30)])
    assert np.allclose(curves(cost)["patches"][1], 1.0) and cost.get_ylabel() == "time per grain and step [ns]"
    (bar,) = friction.containers[0].lines[2]
    assert np.allclose(bar.get_segments()[0][:, 1], [0.3 - HALF_WIDTH, 0.3 + HALF_WIDTH])
    assert len(friction.containers) == 2 and friction.get_xlim() == (0.8 * 12, 1.25 * 30)
    for outline, extra in ((discs, 0.1), (chain, 0.01)):
        x, y = outline.T
        area = 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
        _, body = shape_roughness.polygons(shape_roughness.Params())[0]
        assert abs(area / body.area - 1.0) < extra


def test_metrics_hold_the_interval_of_the_friction_or_why_it_is_unknown():
    rows = [
        {"kind": kind, "elements": n, "shape_error": 1.0 / n, "roughness": 0.5 / n, "cost": 1e-9 * n, **FRICTION}
        for kind in ("patches", "clump")
        for n in shape_roughness.COUNTS
    ]
    rows[-1] |= {"friction_se": np.nan}
    metrics = shape_roughness.analyse(rows)
    last = shape_roughness.COUNTS[-1]
    known, unknown = (metrics[f"friction_{kind}_{last}"] for kind in ("patches", "clump"))
    assert np.allclose(known.interval or (), (0.3 - HALF_WIDTH, 0.3 + HALF_WIDTH)) and unknown.interval is None
    assert "shear it further" in (metrics[f"friction_clump_{last}_se"].note or "")


def rows_of(kinds=("patches", "clump"), counts=(12, 30), **changed):
    row = {"shape_error": 0.01, "cost": 1e-9, **FRICTION} | changed
    return [row | {"kind": kind, "elements": n} for kind in kinds for n in counts]


def drawn_axes(rows, path, pictures):
    outline = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    plot_roughness(path, rows, outline, outline)
    return pictures[-1].get_axes()


def test_the_title_of_friction_says_of_which_means_the_interval_is_known(tmp_path, pictures):
    unknown = {"friction_se": np.nan, "friction_ess": np.nan}
    none, some = rows_of(**unknown), rows_of(counts=(12,)) + rows_of(counts=(30,), **unknown)
    only_first = rows_of(counts=(12,)) + rows_of(counts=(30,), **dict.fromkeys([*FRICTION, "cost"], np.nan))
    titles = []
    for rows in (rows_of(), some, none, only_first):
        friction = drawn_axes(rows, tmp_path / "roughness.png", pictures)[2]
        titles.append(friction.get_title().removeprefix("Friction of the layer"))
        assert any(part.lines[2] for part in friction.containers) == (rows is not none)  # no bar, also in the legend
    assert titles == [", 95 % intervals", ", 95 % intervals where known", ", error unknown", ", 95 % intervals"]


def test_an_interrupted_comparison_has_legends_of_what_is_drawn(tmp_path, pictures):
    fitted = rows_of(("patches",), **dict.fromkeys([*FRICTION, "cost"], np.nan))
    _, error, friction, cost = drawn_axes(fitted, tmp_path / "roughness.png", pictures)
    assert [text.get_text() for text in error.get_legend().get_texts()] == ["patches"]
    for axes in (friction, cost):
        assert axes.get_legend() is None and [text.get_text() for text in axes.texts] == ["not measured"]


def test_intervals_below_zero_are_inside_the_panel(tmp_path, pictures):
    rows = rows_of(friction_mean=0.1, friction_se=0.1)
    friction = drawn_axes(rows, tmp_path / "roughness.png", pictures)[2]
    assert friction.get_ylim()[0] < 0.1 - 10 * HALF_WIDTH and friction.get_ylim()[1] > 0.1 + 10 * HALF_WIDTH


def test_an_error_that_clumps_do_not_reach_is_unknown_and_said_so():
    """Clumps whose error hardly falls would need more than ten times as many discs: no number is made up."""
    patches = rows_of(("patches",), shape_error=1e-6, roughness=1e-6)
    clumps = [row | {"shape_error": 1e-2 / row["elements"] ** 0.1} for row in rows_of(("clump",), roughness=1e-3)]
    metrics = shape_roughness.analyse(patches + clumps)
    for name in ("discs_at_equal_error", "cost_ratio_equal_error"):
        assert metrics[name].value is None and metrics[name].note.startswith("unknown: more than 10 times the ")


def test_every_metric_of_the_roughness_says_what_it_is():
    names = ("shape_error_clump_30", "roughness_patches_30", "discs_at_equal_error", "cost_ratio_equal_error")
    notes = [shape_roughness.note_of(name, np.array([12, 30])) for name in (*names, "friction_clump_12_se")]
    assert notes == [
        "greatest distance from the outline, in diameters, of grains of 30 discs",
        "root mean square distance from the outline, in diameters, of grains of 30 patches",
        "discs of a clump with the shape error of 30 patches; extrapolated from 12 to 30 discs, "
        "at most 10 times as many",
        "time per grain and step of such a clump over that of 30 patches; extrapolated from 12 to 30 discs, "
        "at most 10 times as many",
        "standard error of the friction of a layer of grains of 12 discs",
    ]
