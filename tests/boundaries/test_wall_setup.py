"""Plane walls before anything is compiled: what is refused, and their unit normals."""

from dataclasses import replace

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.boundaries.wall_setup import unit_normal
from tests.boundaries.test_plane_walls import BOX, FLOOR, SERVO, G, K, effects_of
from tests.helpers import scenes


def test_walls_that_make_no_sense_are_refused():
    def walls(*given, **more):
        effects = more.pop("effects", effects_of((0.0, -G)))
        return scenes.scene([(1.0, 1.0), (3.0, 0.2)], effects, walls=list(given), **more)

    with pytest.raises(lsm.InputError, match="wall 'floor': the centre of grain 1 starts beyond it"):
        walls(lsm.PlaneWall("floor", (0.0, 0.5), (0.0, 1.0)))
    with pytest.raises(lsm.InputError, match="all different"):
        walls(FLOOR, FLOOR)
    with pytest.raises(lsm.InputError, match=r"wall 'a': normal = .*, must not be zero"):
        walls(lsm.PlaneWall("a", (0.0, 0.0), (0.0, 0.0)))
    for length in (1e-200, 1e200):
        walls(lsm.PlaneWall("a", (0.0, 0.0), (0.0, length)))
        assert unit_normal((3.0 * length, 4.0 * length), (False, False)) == pytest.approx([0.6, 0.8], rel=1e-14)
    with pytest.raises(lsm.InputError, match=r"wall 'a': velocity = .*, must be 2 finite numbers"):
        walls(lsm.PlaneWall("a", (0.0, 0.0), (0.0, 1.0), 3.0))
    for given, words in (
        ({"servo": 1e4}, r"servo = 10000.0, must be WallServo\(...\), or None"),
        ({"servo": SERVO, "velocity": (1.0, 1e-3)}, "velocity = .*, must lie along the wall, whose servo moves it"),
    ):
        with pytest.raises(lsm.InputError, match=f"wall 'a': {words}"):
            walls(lsm.PlaneWall("a", (0.0, 0.0), (0.0, 1.0), **given))
    uneven = {"effects": [lsm.LinearElastic(K)], "integrator": lsm.ForestRuth}
    with pytest.raises(lsm.InputError, match="wall 'a': servo with ForestRuth, whose steps differ in length"):
        walls(replace(FLOOR, name="a", servo=SERVO), **uneven)
    with pytest.raises(lsm.InputError, match=r"WallServo.force = -1.0: must be > 0 N"):
        replace(SERVO, force=-1.0)
    walls(lsm.PlaneWall("a", (0.0, 0.0), (0.0, 1.0), (3.0, 0.0), servo=SERVO))
    with pytest.raises(lsm.InputError, match="wall 'a': point = 'origin', must be 2 finite numbers"):
        walls(lsm.PlaneWall("a", "origin", (0.0, 1.0)))
    with pytest.raises(lsm.InputError, match=r"wall 'left': normal = .*, must be zero along the periodic axis x"):
        walls(BOX[1], lengths=(9.0, np.inf), periodic=(True, False))
    clump = lsm.shapes.clump([(0.0, -0.2), (0.0, 0.2)], [0.4, 0.4])
    with pytest.raises(lsm.InputError, match="no single deepest point"):
        walls(FLOOR, shapes=[clump], effects=[lsm.LinearElastic(K)])
    walls(FLOOR, lengths=(9.0, np.inf), periodic=(True, False))


def test_a_normal_of_sine_and_cosine_stands_square_to_periodic_axes():
    """sin(pi) is 1e-16 and not 0: rounding, in relation to the length that was given, but not more than that."""
    angle, cell = np.pi, {"lengths": (9.0, np.inf), "periodic": (True, False)}
    lid = lsm.PlaneWall("lid", (0.0, 5.0), (3.0 * np.sin(angle), 3.0 * np.cos(angle)))
    assert lid.normal[0] != 0.0
    scenes.scene([(1.0, 1.0)], effects_of((0.0, -G)), walls=[lid], **cell)
    assert np.array_equal(unit_normal(lid.normal, cell["periodic"]), [0.0, -1.0])
    assert unit_normal(lid.normal, (False, False))[0] != 0.0
    lid.normal = (3e-11, -3.0)
    with pytest.raises(lsm.InputError, match=r"wall 'lid': .*periodic axis x to 1e-12 of its length; incline"):
        scenes.scene([(1.0, 1.0)], effects_of((0.0, -G)), walls=[lid], **cell)
