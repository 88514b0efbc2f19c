"""Hard cases of grains of arcs in 2D: seams, flat sides, corners, notches, needles, stacks and crowds of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import taichi_lsm as lsm
from workflows.common.small_scenes import scene_of
from workflows.hard import Bench, error_of_impact, hard

STIFFNESS = 1e8  # [N m-1]: overlaps of a thousandth of a diameter at 1 m/s
CROWD = 30  # grains
FLAT = 2e-3  # bound in f32 where faces touch: 1e-6 m, the rounding of radii of 10 m, is 6e-4 of the overlaps
CELL = 7.0  # side of the periodic square of a crowd [m]


def box(length: float, width: float, corner_radius: float = 0.05) -> Any:
    """A rounded rectangle, long axis along x; corner_radius in its equivalent diameter."""
    x, y = 0.5 * length, 0.5 * width
    scale = np.sqrt(4.0 * length * width / np.pi)
    return lsm.shapes.from_polygon([(-x, -y), (x, -y), (x, y), (-x, y)], corner_radius * scale)


def rotated_outline(shape: Any, angle: float) -> NDArray:
    """Outline (k, 2) of the shape, rotated by `angle` [rad]."""
    parts = np.concatenate([part.outline(4000) for part in shape.parts])
    c, s = np.cos(angle), np.sin(angle)
    return parts @ np.array([[c, s], [-s, c]])


def impact(
    shapes: Sequence[Any],
    angles: Any,
    velocity: float = 1.0,
    height: float = 0.0,
    angular_velocity: ArrayLike = (0.0, 0.0),
    gap: float = 0.01,
    **more,
) -> lsm.Scene:
    """Two grains that fly at each other along x with a velocity [m s-1] of approach.

    The second is `height` [m] above the first, `gap` [m] lies between the lines that bound them.
    """
    ahead = rotated_outline(shapes[0], angles[0])[:, 0].max() - rotated_outline(shapes[1], angles[1])[:, 0].min() + gap
    flight = 0.5 * velocity * np.array([(1.0, 0.0), (-1.0, 0.0)])
    more = {"effects": [lsm.LinearElastic(STIFFNESS)], "shapes": list(shapes), "shape_index": [0, 1]} | more
    return scene_of(
        [(0.0, 0.0), (ahead, height)],
        angle=np.array(angles),
        velocity=flight,
        angular_velocity=np.array(angular_velocity)[:, None],
        **more,
    )


@hard("Seams hit at grazing angles", "relative error of the energy in one impact", 1e-3)
def grazing_seams(bench: Bench) -> float:
    """Spinning grains brush each other, and the contact runs over many seams between patches.

    Where the normal jumps at a seam, every crossing costs or gives energy; here it is continuous, only its rate of
    change jumps.
    """
    shapes = lsm.shapes.random_angular_shapes(8, 1)
    rng, worst = np.random.default_rng(1), 0.0
    for _ in range(bench.steps(40, 4)):
        pair = [shapes[i] for i in rng.integers(0, 8, 2)]
        angular_velocity, height = rng.uniform(5.0, 20.0, 2), rng.uniform(0.6, 0.8)
        scene = impact(pair, rng.uniform(0.0, 6.0, 2), height=height, angular_velocity=angular_velocity)
        worst = max(worst, error_of_impact(bench, scene))
    return worst


@hard("Flat side on flat side", "relative error of the energy in one impact", 1e-4, f32_bound=FLAT)
def flat_on_flat(bench: Bench) -> float:
    """Two boxes meet face on face, exactly parallel or tilted by 1e-12 to 1e-3.

    The place of the contact is not defined, or races along the faces while they tilt.
    """
    square = box(1.0, 1.0)
    tilts = (0.0, 1e-12, 1e-9, 1e-6, 1e-3)
    return max(error_of_impact(bench, impact((square, square), (0.0, tilt))) for tilt in tilts)


@hard("Flat side on flat side, exactly parallel", "angular velocity after the impact, times diameter over speed", 1e-6)
def parallel_faces_do_not_turn(bench: Bench) -> float:
    """Nothing in a symmetric impact prefers a side.

    Codes with several contact points, or a search that stops at the first patch that fits, turn the grains all the
    same.
    """
    square = box(1.0, 1.0)
    sim = bench.simulate(impact((square, square), (0.0, 0.0)))
    sim.run(4000)
    return float(np.abs(sim.state.angular_velocity.to_numpy()).max())


@hard("Corner on corner", "relative error of the energy in one impact", 1e-4)
def corner_on_corner(bench: Bench) -> float:
    """Two rounded corners meet head on, or nearly: the smallest radii of curvature, and the normal turns fastest."""
    square = box(1.0, 1.0)
    angles = ((0.25 * np.pi, 0.25 * np.pi), (0.25 * np.pi, 0.25 * np.pi + 1e-9), (0.7, 0.9))
    return max(error_of_impact(bench, impact((square, square), a)) for a in angles)


@hard("Sharp corner pressed to 0.8 of its overlap limit", "relative error of the energy in one impact", 1e-4)
def sharp_corner(bench: Bench) -> float:
    """A corner of radius 0.01 d carries a contact only to twice that depth.

    Beyond, the patches behind it take over the wrong side. Just below, all must still be smooth.
    """
    square = box(1.0, 1.0, corner_radius=0.01)
    mass = 1000.0 * np.pi / 4.0
    deepest = 0.8 * 2.0 * 0.01
    speed = deepest / np.sqrt(0.5 * mass / STIFFNESS)
    return error_of_impact(bench, impact((square, square), (0.25 * np.pi, 0.25 * np.pi), velocity=speed))


@hard("Needles of 10:1 that hit at their tips", "relative error of the energy in one impact", 1e-4, f32_bound=FLAT)
def needle_tips(bench: Bench) -> float:
    """A needle hit at its tip starts to rotate, and its other end may come back for a second impact.

    Its moment of inertia makes the contact many times stiffer than that of a disc, which the step has to know.
    """
    needle = box(10.0, 1.0)
    half = float(rotated_outline(needle, 0.0)[:, 0].max())
    heights = (0.98 * half, 0.9 * half, 0.5 * half)
    return max(error_of_impact(bench, impact((needle, needle), (0.5 * np.pi, 0.0), height=h)) for h in heights)


@hard("Flakes of 1:10 that meet face on face", "relative error of the energy in one impact", 1e-4, f32_bound=FLAT)
def flakes(bench: Bench) -> float:
    """Long faces, almost parallel: the contact point jumps from one end to the other within a few steps."""
    flake = box(10.0, 1.0)
    upright = 0.5 * np.pi
    tilts = (0.0, 1e-6, 1e-3, 0.02)
    return max(error_of_impact(bench, impact((flake, flake), (upright, upright + tilt))) for tilt in tilts)


def cross_pair(angles: Any, **more) -> lsm.Scene:
    """A cross and a square, or two crosses, as an impact."""
    return impact((lsm.shapes.crossed_bars(), more.pop("other", lsm.shapes.crossed_bars())), angles, **more)


@hard("Corner into a re-entrant notch", "relative error of the energy in one impact", 1e-4, f32_bound=FLAT)
def into_a_notch(bench: Bench) -> float:
    """A corner that enters the notch of a cross touches both of its arms at once.

    Codes with one contact per pair of grains lose one of them, codes that join overlaps into one get the direction of
    the force wrong.
    """
    angles = ((0.25 * np.pi, 0.0), (0.25 * np.pi, 0.3), (0.25 * np.pi + 1e-6, 0.0))
    return max(error_of_impact(bench, cross_pair(a)) for a in angles)


def locked_crosses() -> lsm.Scene:
    """Two crosses with an arm each in a notch of the other, 2 cm apart, moving against each other."""
    cross = lsm.shapes.crossed_bars()
    half = float(rotated_outline(cross, 0.0)[:, 0].max())
    width = 2.0 * half / 3.0  # of a bar: a third of its length
    offset = half + 0.5 * width + 0.02, width + 0.02
    speed = np.array([(0.3, 0.2), (-0.3, -0.2)])
    shapes = {"shapes": [cross], "shape_index": [0, 0], "angle": np.zeros(2)}
    effects = [lsm.LinearElastic(STIFFNESS)]
    return scene_of([(0.0, 0.0), offset], effects, velocity=speed, angular_velocity=np.array([[0.2], [-0.1]]), **shapes)


@hard("Interlocked crosses", "relative error of the energy, with the grains apart", 1e-4, f32_bound=FLAT)
def interlocked(bench: Bench) -> float:
    """Non-convex grains that hold each other touch at several places in turn, up to four contacts in one pair."""
    sim = bench.simulate(locked_crosses())
    start, worst = lsm.energies(sim).balance, 0.0
    for _ in range(bench.steps(2000, 200)):
        sim.run(50)
        if sim.measure.sums()["contact_count"] == 0:
            worst = max(worst, abs(lsm.energies(sim).balance / start - 1.0))
    return worst


def crowd(
    shapes: Sequence[Any], scale: Any, seed: int, restitution: float, friction: float, speed: float | NDArray = 1.0
) -> lsm.Scene:
    """CROWD grains on a lattice in a periodic square, at random velocities of `speed` [m s-1; of rotation, s-1]."""
    rng = np.random.default_rng(seed)
    rows = int(np.ceil(np.sqrt(CROWD)))
    place = np.stack(np.divmod(np.arange(CROWD), rows), axis=1) + 0.5
    effects = [
        lsm.LinearElastic(STIFFNESS),
        lsm.ViscousDamping(restitution=restitution),
        lsm.CoulombFriction(friction, 0.5 * STIFFNESS),
    ]
    return scene_of(
        place * (CELL / rows),
        effects,
        shapes=shapes,
        shape_index=np.arange(CROWD) % len(shapes),
        diameter=scale,
        angle=rng.uniform(0.0, 6.0, CROWD),
        velocity=speed * rng.normal(0.0, 1.0, (CROWD, 2)),
        angular_velocity=speed * rng.normal(0.0, 1.0, (CROWD, 1)),
        lengths=(CELL, CELL),
        periodic=(True, True),
    )


def worst_error(bench: Bench, scene: lsm.Scene, full: int, short: int) -> float:
    """Greatest error of the energy balance over the energy at the start."""
    sim = bench.simulate(scene)
    start, worst = lsm.energies(sim).balance, 0.0
    for _ in range(20):
        sim.run(bench.steps(full, short) // 20)
        worst = max(worst, abs(lsm.energies(sim).balance / start - 1.0))
    return worst


@hard("Crowd of needles and angular grains", "error of stored and dissipated energy over that of the start", 5e-3)
def needles_in_a_crowd(bench: Bench) -> float:
    """Elongated and angular grains with friction and damping, in contact at several places and turning fast.

    The sum of all errors of contacts and of the dissipated energy may not feed the crowd.
    """
    shapes = [box(3.0, 1.0), *lsm.shapes.random_angular_shapes(6, 2)]
    return worst_error(bench, crowd(shapes, 0.55, 3, 0.6, 0.5), 200_000, 4000)


@hard("Grains of sizes 1:20", "relative error of the energy", 1e-3)
def sizes_of_grains(bench: Bench) -> float:
    """Small grains among large ones in one list and one step.

    The smallest sets the step, the largest the cells, and a small corner meets faces that look like planes.
    """
    shapes = lsm.shapes.random_angular_shapes(6, 2)
    scale = np.full(CROWD, 0.08)
    scale[::10] = 1.6
    speed = 0.4 / scale[:, None]  # [m s-1]: as energy is shared equally
    return worst_error(bench, crowd(shapes, scale, 5, 1.0, 0.0, speed), 1_000_000, 50_000)


def stars() -> lsm.Scene:
    """16 grains of two bars crossed at a right angle, as close as their bounding circles allow, in random motion."""
    bar = lsm.shapes.from_polygon([(-1.5, -0.5), (1.5, -0.5), (1.5, 0.5), (-1.5, 0.5)], 0.2)
    star = lsm.shapes.union([lsm.shapes.place_part(bar, (0.0, 0.0), angle) for angle in (0.0, 0.5 * np.pi)])
    rng, pitch = np.random.default_rng(6), 2.02 * star.bounding_radius
    place = pitch * np.stack(np.divmod(np.arange(16), 4), axis=1)
    motion: dict[str, Any] = {
        "velocity": rng.normal(0.0, 1.0, (16, 2)),
        "angular_velocity": rng.normal(0.0, 1.0, (16, 1)),
    }
    cell: dict[str, Any] = {"lengths": (4 * pitch,) * 2, "periodic": (True, True), "angle": rng.uniform(0.0, 6.0, 16)}
    return scene_of(place, [lsm.LinearElastic(STIFFNESS)], shapes=[star], **cell, **motion)


@hard("Gas of stars", "relative error of the energy", 1e-3, f32_bound=FLAT)
def gas_of_stars(bench: Bench) -> float:
    """The circles of the parts of a grain reach out of the circle that bounds it as closely as possible.

    Where one is used in place of the other, a contact is looked for too late, and arms pass through each other.
    """
    return worst_error(bench, stars(), 200_000, 10_000)
