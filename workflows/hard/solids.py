"""Hard cases of solid grains in 3D: edges, faces, corners, needles and plates, and rotation without forces."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import taichi_lsm as lsm
from workflows.common.small_scenes import scene_of
from workflows.hard import Bench, error_of_impact, hard

STIFFNESS = 1e8  # [N m-1]: overlaps of a thousandth of a diameter at 1 m/s
FLAT = 5e-3  # bound in f32: 1e-6 m, the rounding of face radii of some meters, is some 1e-3 of the overlaps
EFFECTS = [lsm.LinearElastic(STIFFNESS)]
X, Y, Z = np.eye(3)


def box(length: float, width: float, height: float, corner_radius: float = 0.05) -> Any:
    """A rounded block of these sides [m], rescaled to the equivalent diameter 1."""
    sides = np.array([length, width, height], float)
    distances = 0.5 * np.concatenate([sides, sides])
    size = (6.0 * sides.prod() / np.pi) ** (1.0 / 3.0)
    return lsm.shapes.from_planes(np.concatenate([np.eye(3), -np.eye(3)]), distances, corner_radius * size)


def rotation(axis: NDArray, angle: float) -> NDArray:
    """Unit quaternion (w, x, y, z) of the rotation by `angle` [rad] about an axis."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    return np.concatenate([[np.cos(0.5 * angle)], np.sin(0.5 * angle) * axis])


def after(second: NDArray, first: NDArray) -> NDArray:
    """Quaternion of the rotation `first` followed by `second`."""
    w, v, u, x = second[0], second[1:], first[0], first[1:]
    return np.concatenate([[w * u - v @ x], w * x + u * v + np.cross(v, x)])


def rotated(q: NDArray, a: NDArray) -> NDArray:
    """The vector a, rotated by the quaternion q."""
    across = 2.0 * np.cross(q[1:], a)
    return a + q[0] * across + np.cross(q[1:], across)


AS_IT_IS = rotation(X, 0.0)
EDGE_FIRST = rotation(Z, 0.25 * np.pi)  # of a cube: an edge along z points along x
CORNER_FIRST = after(rotation(Y, np.arctan(np.sqrt(0.5))), EDGE_FIRST)


def impact(
    shapes: Sequence[Any],
    orientations: Any,
    velocity: float = 1.0,
    offset: Sequence[float] | NDArray = (0.0, 0.0),
    angular_velocity: ArrayLike | None = None,
    kinds: Any = (0, 1),
) -> lsm.Scene:
    """Two grains that fly at each other along x with a velocity [m s-1] of approach.

    They have the shapes `kinds`, and the second is displaced by `offset` [m] in y and z.
    """
    ahead = max(s.bounding_radius for s in shapes) * 2.0 + 0.01
    flight = 0.5 * velocity * np.array([X, -X])
    return scene_of(
        [(0.0, 0.0, 0.0), (ahead, *offset)],
        EFFECTS,
        shapes=list(shapes),
        shape_index=kinds,
        orientation=np.array(orientations),
        velocity=flight,
        angular_velocity=np.zeros((2, 3)) if angular_velocity is None else np.array(angular_velocity, float),
    )


def worst_impact(bench: Bench, scenes: Iterable[lsm.Scene]) -> float:
    """Greatest error of the energy over several impacts."""
    return max(error_of_impact(bench, scene, most=200_000) for scene in scenes)


@hard("Spinning grains that brush edges", "relative error of the energy in one impact", 1e-4, f32_bound=FLAT)
def brushing_edges(bench: Bench) -> float:
    """Fast rotation drags the contact over edges and seams at grazing angles within one impact."""
    # First in this file, as the tables of a compiled simulation are as large as those of its first scene.
    shapes = lsm.shapes.random_angular_polyhedra(4, 1)
    rng = np.random.default_rng(2)

    def scenes():
        for i in range(bench.steps(20, 3)):
            orientations = rng.normal(size=(2, 4))
            orientations /= np.linalg.norm(orientations, axis=1)[:, None]
            omega, aside = rng.normal(0.0, 10.0, (2, 3)), rng.uniform(-0.3, 0.3, 2)
            yield impact(shapes, orientations, offset=aside, angular_velocity=omega, kinds=(i % 4, (i + 1) % 4))

    return worst_impact(bench, scenes())


@hard("Edge on parallel edge", "relative error of the energy in one impact", 1e-4, f32_bound=FLAT)
def parallel_edges(bench: Bench) -> float:
    """Two cubes meet edge on edge, exactly parallel or tilted by 1e-9 to 1e-3.

    The nearest points of two parallel lines are not defined, and a solver for them divides by zero.
    """
    cube = box(1.0, 1.0, 1.0)
    tilts = (0.0, 1e-9, 1e-3)
    return worst_impact(bench, (impact((cube, cube), (EDGE_FIRST, after(rotation(X, a), EDGE_FIRST))) for a in tilts))


@hard("Edge across edge", "relative error of the energy in one impact", 1e-4, f32_bound=FLAT)
def crossed_edges(bench: Bench) -> float:
    """The contact lies on no corner and no face of either grain: codes that test corners against faces miss it."""
    cube = box(1.0, 1.0, 1.0)
    return worst_impact(
        bench, (impact((cube, cube), (EDGE_FIRST, after(rotation(X, a), EDGE_FIRST))) for a in (0.5 * np.pi, 0.3))
    )


@hard("Face on face", "relative error of the energy in one impact", 1e-4, f32_bound=FLAT)
def face_on_face(bench: Bench) -> float:
    """Two faces that meet exactly parallel touch everywhere at once.

    Tilted by 1e-9, the contact point runs across the face in a few steps.
    """
    cube = box(1.0, 1.0, 1.0)
    return worst_impact(bench, (impact((cube, cube), (AS_IT_IS, rotation(Y, a))) for a in (0.0, 1e-9, 1e-3)))


@hard("Corner on corner of solids", "relative error of the energy in one impact", 1e-4, f32_bound=FLAT)
def corners(bench: Bench) -> float:
    """Where three edges meet, seven features lie within a corner radius of each other."""
    cube = box(1.0, 1.0, 1.0)
    mirrored = after(rotation(Z, np.pi), CORNER_FIRST)
    return worst_impact(
        bench, (impact((cube, cube), (CORNER_FIRST, mirrored), offset=(y, 0.0)) for y in (0.0, 1e-9, 0.02))
    )


@hard("Needle of 10:1 hit at its tip", "relative error of the energy in one impact", 1e-4, f32_bound=FLAT)
def needle(bench: Bench) -> float:
    """Two needles across each other meet near their tips.

    They start to rotate at once, about axes with moments of inertia a hundred times apart.
    """
    rod = box(10.0, 1.0, 1.0)
    upright = rotation(Z, 0.5 * np.pi)
    half = float(rod.support([X])[0])
    return worst_impact(bench, (impact((rod, rod), (upright, AS_IT_IS), offset=(y * half, 0.0)) for y in (0.5, 0.95)))


@hard("Plate of 1:10 hit on its rim", "relative error of the energy in one impact", 1e-4, f32_bound=FLAT)
def plate(bench: Bench) -> float:
    """A plate hits another with its rim, flat on and near the rim: thin edges against wide faces."""
    flake = box(10.0, 10.0, 1.0)
    facing = rotation(Y, 0.5 * np.pi)
    half = float(flake.support([X])[0])
    return worst_impact(bench, (impact((flake, flake), (facing, AS_IT_IS), offset=(y * half, 0.0)) for y in (0.0, 0.9)))


def rotors(shape: Any, angular_velocity: ArrayLike, dt: float | None = None) -> lsm.Scene:
    """Two grains of one shape far apart that rotate without forces, the second the other way."""
    apart = 10.0 * shape.bounding_radius
    more = {
        "shapes": [shape],
        "shape_index": [0, 0],
        "angular_velocity": np.array([angular_velocity, -np.asarray(angular_velocity)]),
    }
    return scene_of([(0.0, 0.0, 0.0), (apart, 0.0, 0.0)], EFFECTS, dt=dt, **more)


def energies_of(sim: lsm.Simulation, samples: int, every: int) -> NDArray:
    """Kinetic energy [J] at `samples` times, `every` steps apart."""
    found = [lsm.energies(sim).kinetic]
    for _ in range(samples):
        sim.run(every)
        found.append(lsm.energies(sim).kinetic)
    return np.array(found)


@hard("Moments of inertia 1e4 apart", "relative error of the energy of a free rotor", 1e-3)
def inertia_ratio(bench: Bench) -> float:
    """A long rod that tumbles end over end and turns about its axis.

    The two rates are ten thousand times apart, and Euler's equations are stiff.
    """
    rod = box(2.0, 1.0, 1.0)
    rod = replace(rod, inertia=rod.inertia.max() * np.array([1e-4, 0.9, 1.0]))
    sim = bench.simulate(rotors(rod, (20.0, 1.0, 0.5)))
    energy = energies_of(sim, 100, bench.steps(10_000, 200))
    return float(np.abs(energy / energy[0] - 1.0).max())


@hard("Half a radian per step", "change of the mean energy over a run", 1e-3)
def half_a_radian_per_step(bench: Bench) -> float:
    """A grain thrown out of a break may rotate so fast that it turns by half a radian in one step.

    A scheme that is only nearly symmetric warms it up or slows it down; here the energy may ripple, but has no trend.
    """
    shape = box(1.5, 1.2, 0.8)
    dt = bench.simulate(rotors(shape, (1.0, 0.0, 0.0))).dt
    sim = bench.simulate(rotors(shape, np.array([0.6, 0.48, 0.64]) * 0.5 / dt, dt))
    energy = energies_of(sim, 2000, bench.steps(500, 5))
    tenth = len(energy) // 10
    return float(abs(energy[-tenth:].mean() / energy[:tenth].mean() - 1.0))


@hard("Rotation about the middle axis", "relative error of the energy over all flips", 1e-4)
def middle_axis(bench: Bench) -> float:
    """Rotation about the axis of the middle moment is unstable: the grain flips over again and again.

    Schemes without symmetry lose the rhythm and settle to another axis.
    """
    shape = box(1.5, 1.0, 0.7)
    middle = int(np.argsort(shape.inertia)[1])
    dt = bench.simulate(rotors(shape, (1.0, 0.0, 0.0))).dt
    angular_velocity = np.full(3, 1e-3)
    angular_velocity[middle] = 1.0
    sim = bench.simulate(rotors(shape, 0.02 / dt * angular_velocity, dt))
    energy, along = [], []
    for _ in range(bench.steps(4000, 400)):
        sim.run(20)
        energy.append(lsm.energies(sim).kinetic)
        axis = rotated(sim.state.orientation.to_numpy()[0], np.eye(3)[middle])
        along.append(axis @ sim.state.angular_momentum.to_numpy()[0])
    flips = int((np.diff(np.sign(along)) != 0).sum())
    error = float(np.abs(np.array(energy) / energy[0] - 1.0).max())
    return error if flips >= 3 else np.inf


@hard("Quaternions after very many steps", "greatest deviation of their length from 1", 1e-12)
def unit_quaternions(bench: Bench) -> float:
    """Rounding lengthens a quaternion in every step; one that is not unit stretches the grain and all its contacts."""
    sim = bench.simulate(rotors(box(1.5, 1.2, 0.8), (3.0, 2.0, 1.0)))
    worst = 0.0
    for _ in range(20):
        sim.run(bench.steps(500_000, 500))
        worst = max(worst, np.abs(np.linalg.norm(sim.state.orientation.to_numpy(), axis=1) - 1.0).max())
    return float(worst)
