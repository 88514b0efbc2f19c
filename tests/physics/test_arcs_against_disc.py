"""A disc cut into arcs shears as the plain disc: the dynamics are chaotic, so only the mean friction can agree."""

import numpy as np
import pytest

import taichi_lsm as lsm
from workflows import shear_gouge


@pytest.mark.validate
def test_friction_of_discs_cut_into_arcs(tmp_path):
    params = shear_gouge.Params(
        length=15.0, layer_thickness=12.0, inertial_number=5e-3, strain=3.0, steady_from=0.5, seed=3
    )
    means = {}
    for arcs in (1, 8, 30):
        scene = shear_gouge.build(params)
        scene.shapes = [lsm.disc() if arcs == 1 else lsm.shapes.regular_disc_of_arcs(arcs)]
        run = shear_gouge.simulate(scene, params, tmp_path / str(arcs))
        sheared = run.isel(time=run.stage.values == "shear")
        means[arcs] = lsm.statistics.steady_ratio(sheared.shear_stress, sheared.normal_stress, params.steady_from)
    for arcs in (8, 30):
        apart = lsm.statistics.difference(means[arcs], means[1])
        assert apart.standard_error < 0.05
        assert abs(apart.mean) < apart.half_width, (arcs, means)
    assert np.all([m.mean > 0.1 for m in means.values()])
