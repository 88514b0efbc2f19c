"""The picture of shape-roughness: curves of its rows, and outlines of one grain."""

import numpy as np

from tests.helpers.pictures import curves
from workflows import shape_roughness
from workflows.plots.roughness import plot_roughness


def test_curves_are_the_rows_and_outlines_those_of_a_grain(tmp_path, pictures):
    rows = [
        {"kind": kind, "elements": n, "shape_error": scale / n, "friction_mean": 0.3, "friction_se": 0.01, "cost": 1e-9}
        for kind, scale in (("patches", 1.0), ("clump", 4.0))
        for n in (12, 30)
    ]
    discs, chain = shape_roughness.example_outlines(shape_roughness.Params())
    plot_roughness(tmp_path / "roughness.png", rows, discs, chain)
    drawn, error, friction, cost = pictures[0].get_axes()
    assert np.array_equal(np.transpose(curves(drawn)["30 patches"]), chain)
    assert np.allclose(curves(error)["clump"], [(12, 30), (4 / 12, 4 / 30)])
    assert np.allclose(curves(cost)["patches"][1], 1.0) and cost.get_ylabel() == "time per grain and step [ns]"
    assert len(friction.containers) == 2 and friction.get_xlim() == (0.8 * 12, 1.25 * 30)
    for outline, extra in ((discs, 0.1), (chain, 0.01)):
        x, y = outline.T
        area = 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
        _, body = shape_roughness.polygons(shape_roughness.Params())[0]
        assert abs(area / body.area - 1.0) < extra
