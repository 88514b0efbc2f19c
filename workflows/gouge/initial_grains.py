"""The mobile grains of a gouge layer before consolidation: dense or loose, whole or breakable."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm
from workflows.common.refusals import in_terms_of
from workflows.common.reports import Progress
from workflows.gouge.grain_parameters import GrainParams
from workflows.gouge.layer_parameters import LayerParams

if TYPE_CHECKING:
    from taichi_lsm.shapes import Aggregate, GrainShape

    Spheres = tuple[NDArray, NDArray]  # centres (m, dim) and diameters (m,) [m] of the grains of a platen
    Platens = tuple[Spheres, Spheres]  # the lower and the upper one

AGGREGATES = 24  # different breakable grains in a layer, at most
SHAPES = {2: 200, 3: 60}  # different angular shapes in a layer, at most
# Solid fraction, by dimension and shape, at which the search for a dense start begins: about the densest it finds.
DENSEST = {2: {"round": 0.80, "angular": 0.71}, 3: {"round": 0.60, "angular": 0.47}}


LENGTHS = ("--length", "--width")  # options of the periodic lengths


class MobileGrains(NamedTuple):
    """Mobile grains between two platens, n of them or of their pieces.

    Attributes
    ----------
    shapes
        Table of shapes, those that were given first.
    shape_index
        Row of the table (n,).
    position
        Places (n, dim) [m].
    diameter
        Equivalent diameters (n,) [m].
    rotation
        Angles (n,) [rad] in 2D, unit quaternions (n, 4) in 3D.
    platen_heights
        Heights [m] by which the lower and the upper platen are raised from where they were given.
    bonds
        Pairs (m, 2) of bonded pieces; None of whole grains.
    bond_area
        Areas (m,) [m2] of the faces that the pieces of a pair share, in 3D; else None.
    """

    shapes: "list[GrainShape]"
    shape_index: NDArray
    position: NDArray
    diameter: NDArray
    rotation: NDArray
    platen_heights: tuple[float, float]
    bonds: NDArray | None = None
    bond_area: NDArray | None = None


def lengths_as_options(params: GrainParams) -> str:
    """The periodic lengths as a user gives them, "--length 20, --width 7"."""
    return ", ".join(f"{option} {length / params.diameter:g}" for option, length in zip(LENGTHS, params.layer[1]))


def least_cell(params: GrainParams, across: float, what: str) -> None:
    """Refuse a periodic cell in which a grain `across` [m] could touch two images of another one.

    Raises
    ------
    InputError
        If length or width is below twice `across`; `what` names the grains in the message.
    """
    d = params.diameter
    for option, length in zip(LENGTHS, params.layer[1]):
        if length < 2.0 * across:
            raise lsm.InputError(
                f"{option} {length / d:g} mean diameters: must be >= {2.0 * across / d:.3g}, twice the largest of the "
                f"{what}, which are up to {across / d:.3g} across; raise it, or lower "
                + (
                    f"--platen-roughness {params.platen_roughness:g} or "
                    if isinstance(params, LayerParams) and "platen" in what
                    else ""
                )
                + f"--largest-diameter {params.largest_diameter:g} m"
            )


def whole_grains(
    params: LayerParams,
    rng: np.random.Generator,
    count: int,
    platens: "Platens",
    shapes: "list[GrainShape]",
    progress: Progress | None = None,
    given: "Sequence[GrainShape]" = (),
) -> MobileGrains:
    """Whole grains between the platens, without bonds.

    Parameters
    ----------
    params, rng, count, shapes, progress, given
        As for `unplaced_grains`.
    platens
        Centres and diameters [m] of the grains of the lower and of the upper platen.
    """
    shapes, unplaced = unplaced_grains(params, rng, count, shapes, progress, given)
    position, heights = _between(params, rng, unplaced, platens)
    return MobileGrains(shapes, unplaced.kind, position, unplaced.diameter, unplaced.rotation, heights)


def unplaced_grains(
    params: GrainParams,
    rng: np.random.Generator,
    count: int,
    shapes: "list[GrainShape]",
    progress: Progress | None = None,
    given: "Sequence[GrainShape]" = (),
) -> "tuple[list[GrainShape], Unplaced]":
    """Table of shapes of whole grains, and the grains without their places.

    Parameters
    ----------
    params, rng, count
        Parameters of the grains; their random numbers; number of grains.
    shapes
        Shapes that come first in the table; discs and spheres use the first of them.
    progress
        Takes a report after each shape that is made.
    given
        Shapes of the grains in place of random angular ones, of equivalent diameter 1.
    """
    p = params
    if given:
        shapes = [*shapes, *given]
    elif p.shape == "angular":
        angular = lsm.shapes.random_angular_shapes if p.dim == 2 else lsm.shapes.random_angular_polyhedra
        with in_terms_of(f"--corner-radius {p.corner_radius:g}, --seed {p.seed}", "lower the corner radius"):
            kinds = min(count, SHAPES[p.dim])
            made = _making_shapes(progress, kinds)
            shapes = shapes + angular(kinds, p.seed, p.corner_radius, made=made, **p.flat_sides)
    diameter = lsm.grain_diameters(rng, count, p.smallest_diameter, p.largest_diameter)
    shape_index = rng.integers(1, len(shapes), count) if p.shape == "angular" else np.zeros(count, int)
    rotation = lsm.random_rotations(rng, count, p.dim)
    reach = np.array([s.bounding_radius for s in shapes])[shape_index] * diameter
    unplaced = Unplaced([s.spanning_balls() for s in shapes], shape_index, diameter, rotation, reach)
    return shapes, unplaced


def _making_shapes(progress: Progress | None, total: int) -> Callable[[int], None]:
    """What takes the number of shapes made so far, and reports it."""

    def report(done: int) -> None:
        if progress:
            progress({"stage": "making shapes", "done": done, "total": total})

    return report


def breakable_grains(
    params: LayerParams,
    rng: np.random.Generator,
    count: int,
    platens: "Platens",
    shapes: "list[GrainShape]",
    progress: Progress | None = None,
) -> MobileGrains:
    """As `whole_grains`, but pieces of `count` breakable grains, with the bonds between them."""
    p = params
    with in_terms_of(
        f"--pieces {p.pieces}, --corner-radius {p.corner_radius:g}, --seed {p.seed}", "lower the corner radius"
    ):
        kinds = min(count, AGGREGATES)
        made, whole = _making_shapes(progress, kinds), []
        aggregate = lsm.shapes.angular_aggregate if p.dim == 2 else lsm.shapes.polyhedral_aggregate
        for i in range(kinds):
            whole.append(aggregate(p.pieces, [p.seed, i], p.corner_radius))
            made(len(whole))
    size = lsm.grain_diameters(rng, count, p.smallest_diameter, p.largest_diameter)
    kind = rng.integers(0, len(whole), count)
    rotation = lsm.random_rotations(rng, count, p.dim)
    reach = np.array([grain.reach for grain in whole])[kind] * size
    unplaced = Unplaced([grain.spanning_balls() for grain in whole], kind, size, rotation, reach)
    middle, heights = _between(p, rng, unplaced, platens)
    pieces = placed_pieces(whole, kind, size, rotation, middle)
    # In 2D bonds have one width in diameters of the pieces, about that of the sides that they share.
    area = None if p.dim == 2 else pieces.bond_area
    shape_index = len(shapes) + pieces.shape_index
    shapes = shapes + [piece for grain in whole for piece in grain.shapes]
    return MobileGrains(
        shapes, shape_index, pieces.position, pieces.diameter, pieces.rotation, heights, pieces.bonds, area
    )


class Pieces(NamedTuple):
    """The pieces of n breakable grains of m pieces each, those of a grain in a row.

    Attributes
    ----------
    shape_index
        Row of all shapes of all kinds of grains, one after the other (n m,).
    position, diameter
        Places (n m, dim) and equivalent diameters (n m,) [m].
    rotation
        Angles (n m,) [rad] in 2D, unit quaternions (n m, 4) in 3D.
    bonds, bond_area
        Pairs (p, 2) of pieces, and what they share (p,): sides [m] in 2D, areas [m2] of faces in 3D.
    """

    shape_index: NDArray
    position: NDArray
    diameter: NDArray
    rotation: NDArray
    bonds: NDArray
    bond_area: NDArray


def placed_pieces(
    whole: "Sequence[Aggregate]", kind: NDArray, size: NDArray, rotation: NDArray, place: NDArray
) -> Pieces:
    """Pieces of breakable grains in their places.

    Parameters
    ----------
    whole
        The kinds of grains, of equally many pieces.
    kind, size, rotation, place
        Of each grain its kind (n,), equivalent diameter (n,) [m], orientation as of `lsm.random_rotations`, and centre
        of mass (n, dim) [m].
    """
    count, dim = len(whole[0].shapes), place.shape[1]
    arms = size[:, None, None] * np.array([grain.position for grain in whole])[kind]
    matrix, of_pieces = _rotated(rotation, np.array([grain.rotation for grain in whole])[kind])
    position = place[:, None] + np.einsum("nab,npb->npa", matrix, arms)
    diameter = size[:, None] * np.array([grain.diameter for grain in whole])[kind]
    return Pieces(
        (kind[:, None] * count + np.arange(count)).ravel(),
        position.reshape(-1, dim),
        diameter.ravel(),
        of_pieces,
        np.concatenate([whole[k].pairs + i * count for i, k in enumerate(kind)]),
        np.concatenate([whole[k].area * size[i] ** (dim - 1) for i, k in enumerate(kind)]),
    )


def _rotated(rotation: NDArray, pieces: NDArray) -> tuple[NDArray, NDArray]:
    """Rotation matrices (n, dim, dim) of grains, and orientations of their m pieces, n m in a row.

    rotation: of the grains, as of `lsm.random_rotations`; pieces: of each piece in its grain, angles (n, m) or
    quaternions (n, m, 4).
    """
    if rotation.ndim == 1:
        c, s = np.cos(rotation), np.sin(rotation)
        matrix = np.stack([np.stack([c, -s], axis=1), np.stack([s, c], axis=1)], axis=1)
        return matrix, (rotation[:, None] + pieces).ravel()
    grains = Rotation.from_quat(rotation, scalar_first=True)
    repeated = Rotation.from_quat(np.repeat(rotation, pieces.shape[1], axis=0), scalar_first=True)
    placed = repeated * Rotation.from_quat(pieces.reshape(-1, 4), scalar_first=True)
    return grains.as_matrix(), placed.as_quat(scalar_first=True)


class Unplaced(NamedTuple):
    """Outlines of grains before they have a place: arguments of `lsm.dense_packing`, and bounding radii (n,) [m]."""

    balls: list[tuple[NDArray, NDArray]]
    kind: NDArray
    diameter: NDArray
    rotation: NDArray
    reach: NDArray


def _between(
    params: LayerParams, rng: np.random.Generator, grains: Unplaced, platens: "Platens"
) -> tuple[NDArray, tuple[float, float]]:
    """Places of grains (n, dim) [m] without overlap, and the heights [m] of the platens below and above them."""
    p, lengths = params, params.layer[1]
    least_cell(p, 2.0 * float(grains.reach.max()), "grains")
    (low, low_size), (high, high_size) = platens
    if p.start == "loose":
        place = lsm.loose_packing(rng, grains.reach, lengths, p.dim)
        top = (place[:, 1] + grains.reach).max()
        return place, (-(low[:, 1] + 0.5 * low_size).max(), top - (high[:, 1] - 0.5 * high_size).min())
    # Grains reach into the valleys of the platens, so heights count from the mean of the innermost points.
    floor, roof = -(low[:, 1] + 0.5 * low_size).mean(), -(high[:, 1] - 0.5 * high_size).mean()
    up = np.eye(p.dim)[1]
    inner = (low + floor * up, low_size), (high + roof * up, high_size)
    with in_terms_of("--start dense", "give --start loose"):
        place, raised = lsm.dense_packing(rng, *grains[:4], lengths, inner, densest_height(p, grains))
    return place, (floor, roof + raised)


def densest_height(params: GrainParams, grains: Unplaced) -> float:
    """Height [m] at which the search for a dense start begins; at least a single layer of grains fits in."""
    one = lsm.disc() if params.dim == 2 else lsm.sphere()
    solid = one.measure * float((grains.diameter**params.dim).sum())
    filled = DENSEST[params.dim][params.shape] * float(np.prod(params.layer[1]))
    return max(solid / filled, 2.0 * float(grains.reach.max()))


def initial_orientations(rotation: NDArray, glued: int) -> dict[str, Any]:
    """Orientations of the mobile grains as given, zero rotation for the `glued` ones, as an argument of `Scene`."""
    if rotation.ndim == 1:
        return {"angle": np.concatenate([rotation, np.zeros(glued)])}
    return {"orientation": np.concatenate([rotation, np.tile([1.0, 0.0, 0.0, 0.0], (glued, 1))])}
