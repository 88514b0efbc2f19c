"""Grains of general patches in free flight and in collisions, as `test_shaped_motion` for other shapes."""

import pytest

import taichi_lsm as lsm
from tests.helpers import scenes
from tests.physics.test_shaped_motion import check_conservation, cluster

pytestmark = pytest.mark.skipif(scenes.PRECISION == "f32", reason="conservation to f64 rounding")


@pytest.mark.validate  # compiles for half a minute; a gas of cones keeps its energy in test_energy_conservation.py
def test_an_isolated_cluster_of_cones_keeps_its_momenta_and_its_energy(runtime):
    check_conservation(cluster(2, [lsm.shapes.from_chain(s) for s in lsm.shapes.random_angular_shapes(3, 2)]))
