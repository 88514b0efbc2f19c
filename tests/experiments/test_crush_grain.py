"""Crushing of single grains: how they stand, when they fail, Weibull's law, and a bonded pair with a closed form."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import gamma

import taichi_lsm as lsm
from workflows import crush_grain
from workflows.common.parameters import ParameterError
from workflows.crush.strengths import analyse, section_of, strengths_of, weibull_of, write_crushing
from workflows.plots.crush_grain import plot_crushing

SMALL = {"grains": 4, "pieces": 3}


def test_grains_stand_between_the_platens_and_touch_both():
    """To 1e-9 of their height, by the support of every piece; no grain is less wide in another direction."""
    params = crush_grain.Params(**SMALL)
    scene = crush_grain.build(params)
    top, bottom = np.full(4, -np.inf), np.full(4, np.inf)
    for k in range(len(scene)):
        turn = Rotation.from_quat(scene.orientation[k], scalar_first=True)
        shape, up = scene.shapes[scene.shape_index[k]], turn.inv().apply([0.0, 1.0, 0.0])
        reach = [scene.diameter[k] * shape.support(side * up[None])[0] for side in (1.0, -1.0)]
        top[k // 3] = max(top[k // 3], scene.position[k, 1] + reach[0])
        bottom[k // 3] = min(bottom[k // 3], scene.position[k, 1] - reach[1])
    assert bottom == pytest.approx(np.zeros(4), abs=1e-9 * params.height)
    assert top == pytest.approx(np.full(4, params.height), rel=1e-9)
    apart = np.linalg.norm(scene.position[::3] - scene.position[1::3], axis=1)
    assert (apart < params.height).all() and len(scene.bonds) >= 2 * 4
    n = np.random.default_rng(1).standard_normal((300, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    grain = lsm.shapes.polyhedral_aggregate(3, [1, 0], params.corner_radius)
    _, least = crush_grain.least_width(grain)
    assert (grain.support(n) + grain.support(-n)).min() > (1.0 - 1e-3) * least


def test_a_grain_fails_when_it_splits_at_the_greatest_force_until_then():
    force = np.array([[1.0, 1.0, 2.0], [4.0, 4.0, 0.5], [3.0, 3.0, 5.0], [9.0, 1.5, 6.0], [5.0, 5.0, 7.0]])
    share = np.array([[1.0, 1.0, 1.0], [1.0, 0.9, 1.0], [0.5, 0.9, 1.0], [0.5, 0.9, 1.0], [0.5, 0.9, 0.7]])
    strength, row = strengths_of(force, share)
    assert strength[[0, 2]].tolist() == [4.0, 7.0] and np.isnan(strength[1])  # the second has lost a corner
    assert row.tolist() == [1, -1, 4]


def test_the_weibull_modulus_of_drawn_strengths_is_found_as_often_as_its_interval_says():
    rng, hits = np.random.default_rng(0), 0
    for _ in range(300):
        found = weibull_of(5.0 * rng.weibull(4.0, 30)).modulus
        hits += abs(found.mean - 4.0) <= found.half_width
    assert 0.91 < hits / 300 < 0.985


@pytest.mark.validate
def test_grains_that_did_not_split_are_a_part_of_the_law():
    """40 grains, pressed to a stress at which about half of them split: without the others m is 7 and the mean 4."""
    rng, held, sets = np.random.default_rng(1), np.zeros(2), 150
    for _ in range(sets):
        s = 5.0 * rng.weibull(4.0, 40)
        found = weibull_of(s[s < 4.6], np.full(np.count_nonzero(s >= 4.6), 4.6))
        true = (4.0, 5.0 * gamma(1.25))
        held += [abs(each.mean - value) <= each.half_width for each, value in zip(found[:2], true)]
    assert (held > 0.9 * sets).all()


def test_few_or_equal_strengths_have_no_modulus():
    """Of three equal ones it was 1.5 million."""
    assert weibull_of(np.array([3.0, 4.0, 5.0, 6.0])) is None and weibull_of(np.full(6, 1e8)) is None


def rows_of(params, grains=12):
    """Columns of a run in which every grain breaks in two, the weaker ones first, at forces by Weibull's law."""
    rows, force = params.rows, np.zeros((params.rows, grains))
    at = 10 + (np.arange(grains) * (rows - 60)) // grains
    strength = section_of(params) * 2e8 * (-np.log1p(-(np.arange(grains) + 0.5) / grains)) ** (1.0 / 5.0)
    fragments = np.ones((rows, grains), int)
    for g in range(grains):
        force[: at[g], g] = strength[g] * np.arange(1, at[g] + 1) / at[g]
        force[at[g] :, g] = 0.1 * strength[g]
        fragments[at[g] :, g] = 2
    work = 1e-6 * np.arange(1.0, rows + 1)
    time = params.compression * params.height / crush_grain.velocity_of(params) * np.arange(1.0, rows + 1) / rows
    columns = {"time": time, "force": force, "fragments": fragments, "work": work}
    columns |= {"largest_share": 1.0 / fragments, "elastic_energy": 0.2 * work, "kinetic_energy": 0.0 * work}
    return columns | {"dissipated_energy": 0.8 * work, "fracture_energy": 0.3 * work, "energy_residual": 1e-4 * work}


@pytest.mark.parametrize("dim", [2, 3])
def test_metrics_and_files_of_known_strengths(tmp_path, dim):
    params = crush_grain.Params(dim=dim, grains=12, rows=200)
    dataset = write_crushing(tmp_path, rows_of(params), params, 1e-9)
    metrics = analyse(dataset, params)
    assert metrics["grains_split"].value == 12
    assert metrics["strength"].value == pytest.approx(2e8 * 0.918, rel=0.02)  # Gamma(1 + 1/5) = 0.918
    assert metrics["strength_ratio"].value == pytest.approx(metrics["strength"].value / params.tensile_strength)
    assert 3.0 < metrics["weibull_modulus"].value < 7.0
    assert metrics["fragments"].value == 2.0 and metrics["fracture_share"].value == pytest.approx(0.3)
    assert metrics["energy_residual"].holds and metrics["energy_residual"].value == pytest.approx(1e-4)
    one = analyse(dataset.assign(strength=dataset.strength.where(dataset.strength == dataset.strength.min())), params)
    for name in ("strength", "strength_ratio", "weibull_modulus"):
        assert one[name].value is None and "unknown: 1 split" in one[name].note
    plot_crushing(tmp_path / "crush.png", dataset, params)
    assert (tmp_path / "crush.png").stat().st_size > 10_000
    assert float(dataset.compression[-1]) == pytest.approx(params.compression)
    half = write_crushing(tmp_path, {n: c[:70] for n, c in rows_of(params).items()}, params, 1e-9)
    assert float(half.compression[-1]) == pytest.approx(0.35 * params.compression)
    metrics = analyse(half, params)
    assert metrics["grains_split"].value == 6 and "6 grains that did not split" in metrics["strength"].note
    assert metrics["strength"].value == pytest.approx(2e8 * 0.918, rel=0.15)
    plot_crushing(tmp_path / "half.png", half, params)
    metrics = analyse(write_crushing(tmp_path, {n: c[:30] for n, c in rows_of(params).items()}, params, 1e-9), params)
    assert metrics["strength"].value is None and "split, at least 5 of" in metrics["strength"].note


@pytest.mark.parametrize(("steps", "rows"), [(3.0, 3), (70.4, 50), (1000.0, 50)])
def test_the_platen_goes_its_way_whatever_the_number_of_rows(steps, rows):
    """A row had one number of steps: of 70 in 50 rows one, so that the platen went 0.7 of its way."""
    params = crush_grain.Params(rows=50)
    dt = params.compression * params.height / crush_grain.velocity_of(params) / steps
    every = crush_grain.steps_of_rows(params, dt)
    assert len(every) == rows and min(every) >= 1 and sum(every) == round(steps)


def test_fragments_cannot_reach_another_grain():
    """Slow and long pressing lets them fly far: at up to sqrt(strength^2/(E density))."""
    params = crush_grain.Params(grains=2, pieces=3, compression=0.1)
    speed = params.tensile_strength / np.sqrt(params.youngs_modulus * params.density)
    far = speed * params.compression * params.height / crush_grain.velocity_of(params)
    scene = crush_grain.build(params)
    gap = scene.position[3:, 0].min() - scene.position[:3, 0].max() - params.height
    assert far > 6.0 * params.height and gap > 2.0 * far


def test_soft_bonds_are_refused():
    with pytest.raises(ParameterError, match=r"youngs_modulus = 1e\+10 Pa: must be >= 4.19e\+10 Pa"):
        crush_grain.Params(youngs_modulus=1e10)


@pytest.mark.validate
@pytest.mark.parametrize("dim", [2, 3])
def test_grains_break_between_platens_and_the_budget_closes(runtime, tmp_path, dim):
    params = crush_grain.Params(
        dim=dim, grains=4, pieces=5, speed=3e-4, rows=100, weibull_modulus=6, precision=runtime.precision
    )
    dataset = crush_grain.run(params, tmp_path)
    metrics = analyse(dataset, params)
    assert metrics["grains_split"].value >= 3 and metrics["energy_residual"].value < 1e-3
    assert 0.05 < metrics["strength_ratio"].value < 5.0
    share = dataset.largest_share.values
    assert (share[0] == 1.0).all() and (np.diff(share, axis=0) <= 1e-12).all() and share[-1].max() < 1.0
    assert (dataset.fragments.values[-1] > 1).all()
    assert (np.diff(dataset.fracture_energy.values) >= 0.0).all()  # no break creates energy
