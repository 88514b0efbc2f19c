"""Layers of breakable grains: pieces of their area or volume with bonds between them, and what breaks in shear."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm
from tests.helpers.output_files import check_described
from workflows import shear_gouge
from workflows.gouge import initial_grains


def test_breakable_grains_are_bonded_pieces_of_their_area(monkeypatch):
    monkeypatch.setattr(initial_grains, "AGGREGATES", 3)
    params = shear_gouge.Params(shape="angular", breakable=True, pieces=8, grains=30, length=10)
    scene = shear_gouge.build(params)
    mobile = scene.platen_index < 0
    assert mobile.sum() == 8 * 30 and scene.bonds.max() < 8 * 30
    assert (scene.bonds[:, 0] // 8 == scene.bonds[:, 1] // 8).all()
    assert len(np.unique(scene.bonds // 8)) == 30
    area = (scene.diameter[mobile].reshape(30, 8) ** 2).sum(axis=1)
    assert (area >= params.smallest_diameter**2).all() and (area <= params.largest_diameter**2).all()
    apart = np.linalg.norm(np.subtract(*scene.position[scene.bonds.T]), axis=1)
    assert (apart < 0.75 * scene.diameter[scene.bonds].sum(axis=1)).all()  # as tiles lie that share a side


def test_breakable_grains_in_3d_are_bonded_pieces_of_their_volume(monkeypatch):
    monkeypatch.setattr(initial_grains, "AGGREGATES", 2)
    values = {"shape": "angular", "breakable": True, "dim": 3, "pieces": 5, "grains": 20, "length": 6, "width": 4}
    params = shear_gouge.Params(start="loose", **values)
    scene = shear_gouge.build(params)
    mobile = scene.platen_index < 0
    assert mobile.sum() == 5 * 20 and (scene.bonds[:, 0] // 5 == scene.bonds[:, 1] // 5).all()
    mass = scene.masses()[0][mobile].reshape(20, 5).sum(axis=1)
    diameter = np.cbrt(6.0 / np.pi * mass / params.density)
    assert (diameter >= params.smallest_diameter).all() and (diameter <= params.largest_diameter).all()
    # Bonded pieces have a plane between them: the line of their centres goes through it where their hulls touch.
    frames = Rotation.from_quat(scene.orientation, scalar_first=True)
    for (i, j), area in zip(scene.bonds[:40], scene.bond_area[:40], strict=True):
        branch = scene.position[j] - scene.position[i]
        n = branch / np.linalg.norm(branch)
        reach = [
            scene.diameter[k] * scene.shapes[scene.shape_index[k]].support(frames[k].inv().apply(side)[None])[0]
            for k, side in ((i, n), (j, -n))
        ]
        assert abs(n @ branch - sum(reach)) < 0.2 * scene.diameter[i]
        assert 0.0 < area < scene.diameter[i] ** 2


SMALL_LAYERS = {2: {"grains": 40}, 3: {"grains": 24, "width": 4, "pieces": 4, "weibull_modulus": 5}}


@pytest.mark.validate
@pytest.mark.parametrize("dim", [2, 3])
def test_grains_break_as_a_layer_is_sheared(runtime, tmp_path, monkeypatch, dim):
    monkeypatch.setattr(initial_grains, "AGGREGATES", 4)
    params = shear_gouge.Params(
        shape="angular",
        breakable=True,
        dim=dim,
        length=6,
        inertial_number=2e-2,
        strain=0.3,
        steady_from=0.1,
        precision=runtime.precision,
        **SMALL_LAYERS[dim],
    )
    dataset = shear_gouge.run(params, tmp_path)
    bonds, count = dataset.bond_count.values, dataset.fragment_count.values
    assert count[0] == params.grains < count[-1] <= params.grains * params.pieces
    assert (np.diff(bonds) <= 0).all() and (np.diff(count) >= 0).all()
    assert shear_gouge.analyse(dataset, params)["energy_residual"].value < 1e-3
    lost = dataset.dissipated_energy.values[:, list(dataset.effect_name.values).index("elastic_brittle_bond")]
    assert lost[-1] > 0.0  # bonds as stiff as contacts: a break takes energy
    grains = lsm.open_run(tmp_path / "grains.nc")
    assert grains.sizes["bond"] == bonds[0] == grains.bond_intact.values[0].sum()
    assert grains.bond_intact.values[-1].sum() == bonds[-1]
    assert (grains.bond_first < grains.bond_second).all()
    fragments = lsm.open_run(tmp_path / "fragments.nc")
    mass = fragments.mass.groupby(fragments.snapshot).sum().values
    assert mass == pytest.approx(grains.mass.values[grains.kind.values == 0].sum(), rel=1e-12)
    assert np.bincount(fragments.snapshot)[[0, -1]].tolist() == count[[0, -1]].tolist()
    surface = fragments.new_surface.groupby(fragments.snapshot).sum().values
    assert surface[[0, -1]] == pytest.approx(2.0 * dataset.fracture_area.values[[0, -1]], rel=1e-12)
    assert fragments.elongation.min() > 0.0 and fragments.elongation.max() <= 1.0
    check_described(tmp_path / "fragments.nc")
