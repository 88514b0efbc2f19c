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
