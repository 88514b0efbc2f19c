"""The mobile grains of a gouge layer before consolidation: loose, whole or breakable."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from workflows.common.refusals import in_terms_of
from workflows.gouge.parameters import Params

if TYPE_CHECKING:
    from taichi_lsm.shapes import GrainShape

AGGREGATES = 24  # different breakable grains in a layer, at most
SHAPES = {2: 200, 3: 60}  # different angular shapes in a layer, at most


class MobileGrains(NamedTuple):
    """Mobile grains of a loose layer, n of them or of their pieces.

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
    top
        Upper border [m] that no grain crosses.
    bonds
        Pairs (m, 2) of bonded pieces; None of whole grains.
    """

    shapes: "list[GrainShape]"
    shape_index: NDArray
    position: NDArray
    diameter: NDArray
    rotation: NDArray
    top: float
    bonds: NDArray | None


def least_cell(params: Params, across: float, what: str) -> None:
    """Refuse a periodic cell in which a grain `across` [m] could touch two images of another one.

    Raises
    ------
    InputError
        If length or width is below twice `across`; `what` names the grains in the message.
    """
    d = params.diameter
    for option, length in zip(("--length", "--width"), params.layer[1]):
        if length < 2.0 * across:
            raise lsm.InputError(
                f"{option} {length / d:g} mean diameters: must be >= {2.0 * across / d:.3g}, twice the largest of the "
                f"{what}, which are up to {across / d:.3g} across; raise it, or lower "
                + (f"--platen-roughness {params.platen_roughness:g} or " if "platen" in what else "")
                + f"--largest-diameter {params.largest_diameter:g} m"
            )


def loose_grains(
    params: Params, rng: np.random.Generator, count: int, lengths: Sequence[float], shapes: "list[GrainShape]"
) -> MobileGrains:
    """Whole grains in a loose packing, without bonds.

    Parameters
    ----------
    params, rng, count
        Parameters of the layer; its random numbers; number of grains.
    lengths
        Periodic lengths of the cell [m].
    shapes
        Shapes that come first in the table; discs and spheres use the first of them.
    """
    p = params
    if p.shape == "angular":
        angular = lsm.shapes.random_angular_shapes if p.dim == 2 else lsm.shapes.random_angular_polyhedra
        with in_terms_of(f"--corner-radius {p.corner_radius:g}, --seed {p.seed}", "lower the corner radius"):
            shapes = shapes + angular(min(count, SHAPES[p.dim]), p.seed, p.corner_radius)
    diameter = lsm.grain_diameters(rng, count, p.smallest_diameter, p.largest_diameter)
    shape_index = rng.integers(1, len(shapes), count) if p.shape == "angular" else np.zeros(count, int)
    reach = np.array([s.bounding_radius for s in shapes])[shape_index] * diameter
    least_cell(p, 2.0 * float(reach.max()), "grains")
    loose = lsm.loose_packing(rng, reach, lengths, p.dim)
    rotation = lsm.random_rotations(rng, count, p.dim)
    return MobileGrains(shapes, shape_index, loose, diameter, rotation, (loose[:, 1] + reach).max(), None)


def breakable_grains(
    params: Params, rng: np.random.Generator, count: int, lengths: Sequence[float], shapes: "list[GrainShape]"
) -> MobileGrains:
    """As `loose_grains`, but pieces of `count` breakable grains (2D), with the bonds between them."""
    p = params
    with in_terms_of(
        f"--pieces {p.pieces}, --corner-radius {p.corner_radius:g}, --seed {p.seed}", "lower the corner radius"
    ):
        kinds = min(count, AGGREGATES)
        whole = [lsm.shapes.angular_aggregate(p.pieces, [p.seed, i], p.corner_radius) for i in range(kinds)]
    size = lsm.grain_diameters(rng, count, p.smallest_diameter, p.largest_diameter)
    kind = rng.integers(0, len(whole), count)
    reach = np.array([grain.reach for grain in whole])[kind] * size
    least_cell(p, 2.0 * float(reach.max()), "grains")
    middle = lsm.loose_packing(rng, reach, lengths, p.dim)
    angle = lsm.random_rotations(rng, count, p.dim)
    c, s = np.cos(angle), np.sin(angle)
    rotate = np.stack([np.stack([c, -s], axis=1), np.stack([s, c], axis=1)], axis=1)
    arms = size[:, None, None] * np.array([grain.position for grain in whole])[kind]
    loose = middle[:, None] + np.einsum("nab,npb->npa", rotate, arms)
    diameter = size[:, None] * np.array([grain.diameter for grain in whole])[kind]
    shape_index = len(shapes) + kind[:, None] * p.pieces + np.arange(p.pieces)
    bonds = np.concatenate([whole[k].pairs + i * p.pieces for i, k in enumerate(kind)])
    shapes = shapes + [piece for grain in whole for piece in grain.shapes]
    rotation, top = np.repeat(angle, p.pieces), (middle[:, 1] + reach).max()
    return MobileGrains(shapes, shape_index.ravel(), loose.reshape(-1, 2), diameter.ravel(), rotation, top, bonds)


def initial_orientations(rotation: NDArray, glued: int) -> dict[str, Any]:
    """Orientations of the mobile grains as given, zero rotation for the `glued` ones, as an argument of `Scene`."""
    if rotation.ndim == 1:
        return {"angle": np.concatenate([rotation, np.zeros(glued)])}
    return {"orientation": np.concatenate([rotation, np.tile([1.0, 0.0, 0.0, 0.0], (glued, 1))])}
