"""Mass of dilated cells of balls against closed forms."""

import numpy as np
import pytest

from taichi_lsm.shapes import ball_of_faces, dilated_balls, regular_polyhedron
from taichi_lsm.shapes.ball_cells import cell_of_balls
from taichi_lsm.shapes.mass_properties import mass_of, volume_of


def test_lens_and_ball_in_closed_form():
    lens = cell_of_balls(np.array([[0, 0, 0.3], [0, 0, -0.3]]), np.ones(2))
    exact = 2 * np.pi * 0.7**2 * (3 - 0.7) / 3
    volume, centre, _ = mass_of(lens, 1e-12)
    assert volume == pytest.approx(exact, rel=1e-10) and np.abs(centre).max() < 1e-12
    areas = [(mass_of(lens, r)[0] - mass_of(lens, 1e-12)[0]) / r for r in (1e-4, 1e-5)]
    area = 2 * 2 * np.pi * 0.7
    assert (10 * areas[1] - areas[0]) / 9 == pytest.approx(area, rel=1e-6)
    ball = ball_of_faces(1)
    assert (ball.patch_count, ball.overlap_limit, ball.bounding_radius, ball.lever) == pytest.approx(
        (1, 0.5, 0.5, 0), abs=1e-9
    )
    assert ball.inertia == pytest.approx(np.full(3, np.pi / 60), rel=1e-12)


def test_volume_alone_is_that_of_the_complete_integrals():
    n = np.random.default_rng(3).normal(size=(9, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    even = cell_of_balls(-0.4 * n, np.full(9, 1.0))
    uneven = cell_of_balls(-0.4 * n, np.linspace(1.0, 1.2, 9))
    lens = cell_of_balls(np.array([[0, 0, 0.3], [0, 0, -0.3]]), np.ones(2))
    for cell in (even, uneven, lens, cell_of_balls(np.zeros((1, 3)), np.ones(1))):
        for dilation in (1e-3, 0.3):
            assert volume_of(cell, dilation) == pytest.approx(mass_of(cell, dilation)[0], rel=1e-12)


def test_search_of_the_corner_radius_integrates_the_inertia_once(monkeypatch):
    calls = []
    monkeypatch.setattr(dilated_balls, "mass_of", lambda *given: calls.append(given) or mass_of(*given))
    regular_polyhedron(12, 0.07)
    assert len(calls) == 1  # each of the radii tried on the way needs the volume alone
