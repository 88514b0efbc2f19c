"""Contacts of arc chains against a brute-force minimum of s(n) = h_A(n) + h_B(-n) - (c_B - c_A) . n."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes
from tests.helpers.contact_probe import ContactProbe
from tests.helpers.supports import support_of_arcs, unit

PAIRS = 1000
GRID = 512
STIFFNESS = 1e5


def separation(shapes, scale, rotation_angle, c, angle):
    """s at the directions `angle` (m,) [rad] for grains at 0 and c."""
    h_a = scale[0] * support_of_arcs(shapes[0], angle - rotation_angle[0])
    h_b = scale[1] * support_of_arcs(shapes[1], angle + np.pi - rotation_angle[1])
    return h_a + h_b - unit(angle) @ c


def least(shapes, scale, rotation_angle, c):
    """(depth, angle of n): the grid's minimum, refined by golden section to the rounding of s."""
    grid = 2 * np.pi / GRID * np.arange(GRID)
    best = grid[np.argmin(separation(shapes, scale, rotation_angle, c, grid))]
    low, high = best - 2 * np.pi / GRID, best + 2 * np.pi / GRID
    for _ in range(5):  # each pass of 65 points shrinks the bracket by 32
        points = np.linspace(low, high, 65)
        values = separation(shapes, scale, rotation_angle, c, points)
        best = points[np.argmin(values)]
        width = points[1] - points[0]
        low, high = best - width, best + width
    return values.min(), best


def overlapping_pairs(rng, table):
    """Arguments of a scene of far-apart pairs at random angles, and the exact depth and normal of each."""
    shape = np.concatenate([rng.integers(0, len(table), (PAIRS - 300, 2)), np.zeros((300, 2), int)])
    shape[-300:, 1] = rng.integers(1, len(table), 300)  # a plain disc against a chain
    scale = rng.uniform(0.7, 1.4, (PAIRS, 2))
    rotation_angle = rng.uniform(0, 2 * np.pi, (PAIRS, 2))
    wanted = 10 ** rng.uniform(-6, np.log10(0.06), PAIRS)
    towards = unit(rng.uniform(0, 2 * np.pi, PAIRS))
    c, depth, angle = np.zeros((PAIRS, 2)), np.zeros(PAIRS), np.zeros(PAIRS)
    for p in range(PAIRS):
        pair, reach = (table[shape[p, 0]], table[shape[p, 1]]), scale[p].sum()
        for _ in range(12):
            depth[p], angle[p] = least(pair, scale[p], rotation_angle[p], reach * towards[p])
            if abs(depth[p] - wanted[p]) < 1e-3 * wanted[p]:
                break
            reach += (depth[p] - wanted[p]) / (unit(angle[p]) @ towards[p])
        c[p] = reach * towards[p]
    centre = 6.0 * np.stack(np.divmod(np.arange(PAIRS), 40), axis=1)
    return (
        {
            "position": np.stack([centre, centre + c], axis=1).reshape(-1, 2),
            "shape_index": shape.ravel(),
            "diameter": scale.ravel(),
            "angle": rotation_angle.ravel(),
        },
        depth,
        angle,
        c,
    )


@pytest.fixture(scope="module")
def table():
    cut = [lsm.shapes.regular_disc_of_arcs(arcs) for arcs in (8, 30, 120)]
    return [lsm.disc(), *lsm.shapes.random_angular_shapes(24, 5), *cut]


@pytest.fixture(scope="module")
def pairs(runtime, table):
    arguments, depth, angle, c = overlapping_pairs(np.random.default_rng(11), table)
    sim = scenes.simulate(scenes.scene(effects=[lsm.LinearElastic(STIFFNESS)], shapes=table, **arguments))
    return sim, ContactProbe(sim), arguments, depth, angle, c


@scenes.both_precisions
def test_depth_and_normal_are_those_of_the_least_separation(pairs):
    sim, probe, arguments, expected, angle, c = pairs
    depth, n, arm_k, arm_l, _ = probe.rows()
    assert np.all(expected > 0)
    assert np.abs(depth - expected).max() < scenes.tolerance(1e-12, 1e-5)
    # s is stationary at the minimum, so the brute-force angle is good to sqrt(1e-15 d/curvature radius) only
    assert np.abs(n - unit(angle)).max() < scenes.tolerance(1e-6, 1e-3)
    assert np.linalg.norm(n, axis=1) == pytest.approx(1.0, abs=scenes.tolerance(1e-15, 1e-6))
    # the contact point lies in the middle of the overlap: depth/2 inside either surface along n
    for which, arm, side in ((0, arm_k, 1), (1, arm_l, -1)):
        outward = side * n
        on_surface = arm + 0.5 * depth[:, None] * outward
        for p in range(PAIRS):
            step = np.arctan2(*outward[p][::-1]) + np.array([-1e-5, 0.0, 1e-5])
            h = support_of(sim, arguments, 2 * p + which, step)
            slope = 0.5e5 * (h[2] - h[0])  # h'(angle) is the place of the surface point along the tangent
            along = outward[p, 0] * on_surface[p, 1] - outward[p, 1] * on_surface[p, 0]
            assert abs(on_surface[p] @ outward[p] - h[1]) < scenes.tolerance(1e-12, 1e-5) and abs(along - slope) < 1e-3
    assert np.abs(arm_k - arm_l - c).max() < scenes.tolerance(1e-12, 1e-5)


def support_of(sim, arguments, grain, angle):
    """h of a grain of the scene at world directions [m]."""
    shape = sim.scene.shapes[arguments["shape_index"][grain]]
    return arguments["diameter"][grain] * support_of_arcs(shape, angle - arguments["angle"][grain])


def test_forces_torques_and_energy_of_the_contacts(pairs):
    sim, probe, arguments, depth, angle, c = pairs
    _, n, arm_k, arm_l, _ = probe.rows()
    sums = sim.measure.sums()
    assert sums["contact_count"] == PAIRS
    assert sums["elastic_energy"] == pytest.approx(0.5 * STIFFNESS * np.sum(depth**2), rel=1e-11)
    used = sim.pairs.row_start.to_numpy().max()
    first = np.searchsorted(sim.pairs.row_start.to_numpy()[: 2 * PAIRS + 1], np.arange(used), side="right") - 1
    row = sim.grains.id.to_numpy()[first] // 2
    force = STIFFNESS * (depth[:, None] * n)[row]
    assert sim.pairs.pair_force.to_numpy()[:used] == pytest.approx(force, abs=1e-11 * STIFFNESS)
    moment = arm_l[row, 0] * force[:, 1] - arm_l[row, 1] * force[:, 0]
    assert sim.pairs.pair_torque.to_numpy()[:used, 0] == pytest.approx(moment, abs=1e-11 * STIFFNESS)


@pytest.mark.parametrize("arcs", [8, 30, 120])
def test_disc_cut_into_arcs_has_the_contacts_of_the_disc(pairs, table, arcs):
    """Same places and angles as the random pairs, but every grain a disc of arcs, or one of each."""
    sim, probe, arguments, *_ = pairs
    rng = np.random.default_rng(arcs)
    cut, scale = len(table) - 3 + [8, 30, 120].index(arcs), arguments["diameter"].reshape(-1, 2)
    kind = np.where(rng.random((PAIRS, 2)) < 0.7, cut, 0)
    depth = 10 ** rng.uniform(-6, -1, PAIRS)
    towards = unit(rng.integers(0, 60, PAIRS) * np.pi / 30 + rng.choice([0, 1e-9, 0.01], PAIRS))  # on seams too
    place = arguments["position"].reshape(-1, 2, 2).copy()
    place[:, 1] = place[:, 0] + (0.5 * scale.sum(axis=1) - depth)[:, None] * towards
    rest = np.zeros((2 * PAIRS, 2))
    rotation_angle = np.where(rng.random(2 * PAIRS) < 0.5, 0.0, arguments["angle"])
    before = {name: getattr(sim.state, name).to_numpy() for name in ("shape_index", "radius", "overlap_limit")}
    before |= {"orientation": unit(arguments["angle"]), "position": arguments["position"]}
    half = {"radius": 0.5 * scale.ravel(), "overlap_limit": 0.5 * scale.ravel()}
    try:
        scenes.reload(
            sim,
            position=place.reshape(-1, 2),
            shape_index=kind.ravel(),
            orientation=unit(rotation_angle),
            velocity=rest,
            **half,
        )
        found, n, arm_k, _, _ = probe.rows()
        apart = place[:, 1] - place[:, 0]
        distance = np.linalg.norm(apart, axis=1)
        assert np.abs(found - (0.5 * scale.sum(axis=1) - distance)).max() < 1e-12
        assert np.abs(n - apart / distance[:, None]).max() < 1e-12
        middle = (0.5 * scale[:, 0] - 0.5 * found)[:, None] * n
        assert np.abs(arm_k - middle).max() < 1e-12
    finally:
        scenes.reload(sim, velocity=rest, **before)


def test_depth_beyond_the_overlap_limit_names_the_grains(pairs, table):
    sim, probe, arguments, *_ = pairs
    limits = sim.state.overlap_limit.to_numpy().reshape(-1, 2).sum(axis=1)
    victim = int(np.argmax((limits < 0.12) & (np.arange(PAIRS) > 100)))
    place = arguments["position"].reshape(-1, 2, 2).copy()
    inwards = place[victim, 0] - place[victim, 1]
    place[victim, 1] += 0.4 * inwards
    rest = np.zeros((2 * PAIRS, 2))
    with pytest.raises(
        lsm.SimulationError, match=f"grains {2 * victim} and {2 * victim + 1}.*overlap reached the limit"
    ):
        scenes.reload(sim, position=place.reshape(-1, 2), velocity=rest)
    scenes.reload(sim, position=arguments["position"], velocity=rest)
