"""Makers of ball-polyhedra refuse what gives no grain."""

import numpy as np
import pytest

from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import ball_of_faces, ball_polyhedron, tangent_ball_polyhedron
from taichi_lsm.shapes.geometry import even_directions


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([[0, 0, 0]], [1.0], -0.1), "dilation"),
        (([[0, 0, 0], [3, 0, 0]], [1.0, 1.0], 0.1), "does not meet"),
        (([[0, 0, 0]], [1.0, 2.0], 0.1), "shapes"),
        (([[0, 0, np.nan]], [1.0], 0.1), "finite"),
    ],
)
def test_wrong_balls_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        ball_polyhedron(*arguments)


def test_faces_touch_their_target():
    n = even_directions(30)
    raw = tangent_ball_polyhedron(0.5 * n, n, 0.03, normalise=False)
    reach = np.linalg.norm(raw.support_points(even_directions(4000)), axis=1)
    assert reach.min() > 0.5 - 0.01  # no point lies below the tangent balls, but for the shift to the centre of mass
    assert ball_of_faces(30, 0.03).face_count == raw.face_count == 30


def test_wrong_targets_are_refused():
    n = even_directions(9)
    with pytest.raises(InputError, match="count = 3"):
        ball_of_faces(3)
    with pytest.raises(InputError, match="unit vectors"):
        tangent_ball_polyhedron(0.5 * n, 2.0 * n, 0.05)
    with pytest.raises(InputError, match="n >= 4"):
        tangent_ball_polyhedron(0.5 * n[:3], n[:3], 0.05)
