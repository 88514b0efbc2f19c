"""What `lsm list --effects` says of shapes and costs."""

import re

import numpy as np
import pytest

import taichi_lsm as lsm
from workflows.cli import inspect_run
from workflows.common.small_scenes import scene_of

CUBE = lsm.shapes.from_planes(np.concatenate([np.eye(3), -np.eye(3)]), np.full(6, 0.5), 0.1)
SQUARE = lsm.shapes.from_polygon([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)], 0.1)


@pytest.fixture
def listed(capsys):
    """{effect: what is listed of it}."""
    assert inspect_run.print_effects() == 0
    blocks = capsys.readouterr().out.split("\n\n")
    return {block.split(":")[0].strip(): block for block in blocks if "equation" in block}


def refuses(effect, shape):
    """Whether a scene refuses an effect for the surfaces of this shape, and not for what else it lacks."""
    try:
        scene_of(2.0 * np.eye(2, shape.dim), [effect], shapes=[shape])
    except lsm.InputError as error:
        return "one radius of curvature" in str(error) or "jumps at the seams" in str(error)
    return False


@pytest.mark.parametrize("name", ["linear_elastic", "hertz", "rolling_resistance", "global_damping", "cohesion"])
def test_the_shapes_of_an_effect_are_those_that_scenes_accept(listed, name):
    effect = lsm.effects.find_effects()[name].cases()[0]
    shapes = re.search(r"shapes +(.*)", listed[name])[1]
    assert refuses(effect, CUBE) == (not shapes.startswith("all"))
    assert refuses(effect, SQUARE) == ("chains of equal arcs" in shapes)
    assert not refuses(effect, lsm.sphere())


def test_costs_below_the_scatter_are_called_that(listed):
    assert not any(re.search(r"cost +-", text) for text in listed.values())
    assert "time below what can be measured, 4.5 ns" in listed["gravity"]
    assert re.search(r"cost +37.7 ns per grain and step, 145 bytes", listed["linear_elastic"])
