"""Shapes: patches and discs per grain, corner radius, non-convexity, by outline, impact, layer and gas (2D)."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import taichi_lsm as lsm
from workflows import shape_roughness, shear_gouge
from workflows.accuracy import Trial, seconds_per_step
from workflows.common.metrics import number
from workflows.common.small_scenes import scene_of

if TYPE_CHECKING:
    from workflows.accuracy_cost import Params

PATCHES = (12, 18, 30, 60, 120)  # per grain
DISCS = (12, 18, 30, 60)  # per clump
SHARPEST = 0.02
LAYER = {"layer_thickness": 8.0, "length": 8.0, "inertial_number": 1e-2, "strain": 1.2}  # in which shapes are timed
STIFFNESS = 1e7  # [N m-1], of impacts
SPEED = 1.0  # [m s-1], of impacts
MOST_PATCHES = 300
BARS = (1, 2, 3)  # of a star; one bar is convex
STARS = 8  # along each side of their gas


def polygons(params: Params, corner_radius: float = 0.05) -> shape_roughness.Params:
    """Parameters of `shape_roughness` with this corner radius."""
    return shape_roughness.Params(seed=params.seed, corner_radius=corner_radius)


def layer_cost(params: Params, shapes: Sequence[Any]) -> tuple[float, float, float]:
    """(seconds for one grain and step, step over the inertial time, friction) of a sheared layer of these shapes."""
    of_run = shear_gouge.Params.model_validate(LAYER | {"shape": "angular", "seed": params.seed})
    scene = shear_gouge.build(of_run, shapes=shapes)
    with tempfile.TemporaryDirectory() as out:
        dataset = shear_gouge.simulate(scene, of_run, out)
        friction = number(shear_gouge.analyse(dataset, of_run)["friction_mean"])
        return 1.0 / shape_roughness.rate_of(out), float(dataset.dt) / of_run.inertial_time, friction


def shapes_of(params: Params, kind: str, count: Any) -> tuple[list[Any], float]:
    """(shapes, shape error in diameters) of "patches", "discs" (per clump), "corner" (radius) or "round"."""
    if kind == "round":
        return [lsm.disc()], np.nan
    if kind == "corner":
        shapes, *_ = shape_roughness.shapes_of(polygons(params, count), "patches", 30)
        vertices, sharp = shape_roughness.polygons(polygons(params, SHARPEST))[0]
        rounded = shape_roughness.patch_shape(vertices, 30, count)
        return shapes, shape_roughness.deviation(rounded.outline(4000), sharp)[0]
    shapes, error, _ = shape_roughness.shapes_of(polygons(params), "clump" if kind == "discs" else kind, count)
    return shapes, error


def measure_layer(params: Params, kind: str, count: Any) -> tuple[float, float, float, float]:
    """(shape error, seconds for one grain and step, step over inertial time, friction) of one kind of grain."""
    shapes, error = shapes_of(params, kind, count)
    return error, *layer_cost(params, shapes)


def trials_of(rows: dict[Any, list[Any]]) -> list[Trial]:
    """Trials from {(kind, count): results of `measure_layer`, one per repetition}; discs are ("round", 0)."""

    def cost(of_kind):
        return float(np.median([seconds / step for _, seconds, step, _ in of_kind]))

    usual = cost(rows["round", 0])
    trials = []
    names = {"patches": "patches", "discs": "discs of a clump", "corner": "corner radius"}
    for (kind, count), of_kind in rows.items():
        if kind in names:
            where = (names[kind], f"{count:g}", count, "shape error", 0)
            trials.append(Trial(*where, of_kind[0][0], cost(of_kind), cost(of_kind) / usual))
    return trials


def impact(shapes: Sequence[Any], pair: NDArray, angles: ArrayLike) -> lsm.Scene:
    """Two grains, of the rows `pair` of `shapes`, at the angles [rad] `angles`, that collide off their axis."""
    velocity = 0.5 * SPEED * np.array([(1.0, 0.0), (-1.0, 0.0)])
    more = {"shapes": shapes, "shape_index": pair, "angle": angles, "velocity": velocity, "safety": 0.1}
    return scene_of([(0.0, 0.0), (1.3, 0.25)], [lsm.LinearElastic(STIFFNESS)], **more)


def measure_impacts(params: Params) -> list[Trial]:
    """Trials of the motion after impacts of ellipses of more and more patches, without costs.

    For polygons it would not converge: with more patches their sides become flatter, and the contact point of two flat
    sides depends on that and not on the outline.
    """
    trials, results, sim = [], {}, None
    rng = np.random.default_rng(params.seed)
    orientations = rng.uniform(0.0, 6.0, (params.impacts, 2))
    for count in (MOST_PATCHES, *PATCHES):
        shapes, ends = [lsm.shapes.ellipse(1.5, count)], []
        for angles in orientations:
            scene = impact(shapes, np.array([0, 0]), angles)
            if sim is None:
                sim = lsm.Simulation(scene)
            else:
                sim.reset(scene)
            sim.run(int(0.8 / (SPEED * sim.dt)))
            ends.append(
                np.concatenate([sim.state.velocity.to_numpy().ravel(), sim.state.angular_velocity.to_numpy().ravel()])
            )
        results[count] = np.array(ends)
    for count in PATCHES:
        off = (results[count] - results[MOST_PATCHES]) / SPEED
        error = float(np.sqrt((off**2).sum(axis=1).mean()))
        where = ("patches", f"{count}", count, "motion after an impact of ellipses", 0)
        trials.append(Trial(*where, error, np.nan, np.nan))
    return trials


def star(bars: int) -> Any:
    """A grain of `bars` rounded bars through one centre."""
    bar = lsm.shapes.from_polygon([(-1.5, -0.5), (1.5, -0.5), (1.5, 0.5), (-1.5, 0.5)], 0.2)
    return lsm.shapes.union([lsm.shapes.place_part(bar, (0.0, 0.0), i * np.pi / bars) for i in range(bars)])


def hull_error(bars: int) -> float:
    """Greatest distance [diameters] between the outline of a star and its convex hull, which could replace it."""
    import shapely

    outlines = [part.outline(2000) for part in star(bars).parts]
    body = shapely.union_all([shapely.Polygon(outline) for outline in outlines])
    return float(
        shapely.hausdorff_distance(shapely.get_exterior_ring(body.convex_hull), shapely.get_exterior_ring(body))
    )


def gas_of(shape: Any, seed: int) -> lsm.Scene:
    """STARS^2 grains in a periodic square, as close as their bounding circles allow, at random velocities."""
    rng, count = np.random.default_rng(seed), STARS**2
    pitch = 2.02 * shape.bounding_radius
    place = pitch * np.stack(np.divmod(np.arange(count), STARS), axis=1)
    cell: dict[str, Any] = {"lengths": (pitch * STARS,) * 2, "periodic": (True, True), "shapes": [shape]}
    motion: dict[str, Any] = {
        "velocity": rng.normal(0.0, 0.1 * SPEED, (count, 2)),
        "angular_velocity": rng.normal(0.0, 0.1 * SPEED, (count, 1)),
    }
    return scene_of(place, [lsm.LinearElastic(STIFFNESS)], angle=rng.uniform(0.0, 6.0, count), **cell, **motion)


def measure_parts(params: Params) -> list[Trial]:
    """Trials of non-convex grains: shape error of their hull, and cost in a gas over that of discs."""
    sims = {bars: lsm.Simulation(gas_of(star(bars), params.seed)) for bars in BARS}
    sims[0] = lsm.Simulation(gas_of(lsm.disc(), params.seed))
    taken = seconds_per_step(sims, params.timed_steps, params.turns)
    cost = {bars: taken[bars] / sim.dt for bars, sim in sims.items()}
    quantity = "outline that the hull would lose"
    return [
        Trial("convex parts", f"{bars}", bars, quantity, 0, hull_error(bars), cost[bars], cost[bars] / cost[0])
        for bars in BARS
    ]
