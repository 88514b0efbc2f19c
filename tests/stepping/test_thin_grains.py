"""No phase of the step lets thin grains pass through each other unseen."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes

STEP, THICKNESS = 1e-4, (20, 30)
PHASES = np.arange(20) / 20


def flake(dim, aspect):
    """A box whose last axis is the shortest by `aspect`, with the roundest rim."""
    half = 0.5 * np.array([aspect] * (dim - 1) + [1.0])
    if dim == 2:
        x, y = half
        return lsm.shapes.from_polygon([(-x, -y), (x, -y), (x, y), (-x, y)], 0.3)
    return lsm.shapes.from_planes(np.concatenate([np.eye(3), -np.eye(3)]), np.tile(half, 2), 0.3)


def face_on_face(shape, displacement, phase):
    """Two flakes that fly at each other along the last axis by `displacement` each in a step."""
    position, velocity = np.zeros((2, shape.dim)), np.zeros((2, shape.dim))
    position[1, -1] = 2.0 * shape.half_width + (4.0 + 2.0 * phase) * displacement
    velocity[:, -1] = displacement / STEP * np.array([1.0, -1.0])
    return scenes.scene(position, [lsm.LinearElastic(1e6)], shapes=[shape], velocity=velocity, dt=STEP, skin=0.5)


def fly(sim, scene):
    """Run the scene for longer than the flakes need to fly past each other."""
    sim.reset(scene)
    sim.run(40)


@pytest.mark.validate
@pytest.mark.parametrize("dim", [2, 3])
def test_flakes_never_pass_through_each_other_unseen(runtime, dim):
    shapes = [flake(dim, aspect) for aspect in THICKNESS]
    sim = scenes.simulate(face_on_face(shapes[0], 0.0, 0.0))
    for shape in shapes:
        # As fast as 0.1 of the bounding radius would allow, and as 0.1 of half the width does.
        for size, message in ((shape.bounding_radius, "of half its least width"), (shape.half_width, "overlap")):
            for phase in PHASES:
                with pytest.raises(lsm.SimulationError, match=message):
                    fly(sim, face_on_face(shape, 0.095 * size, phase))
