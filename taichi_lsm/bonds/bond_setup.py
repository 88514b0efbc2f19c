"""Bonds of a scene before anything is compiled: their grains, stiffness and strength, and the step they allow."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError


def checked_bonds(
    pairs: ArrayLike | None, area: NDArray | None, effects: Sequence[Any], count: int
) -> tuple[NDArray | None, NDArray | None]:
    """Bonds and the areas of their sections in their stored order.

    Parameters
    ----------
    pairs
        Ids of the two grains of each bond (m, 2), integers, or None.
    area
        Areas of their sections (m,) [m2], or None.
    effects
        Effects of the scene.
    count
        Number of grains.

    Returns
    -------
    pairs : array (m, 2) or None
        The lower id first, sorted by the first, then the second id; None if there are no bonds.
    area : array (m,) or None
        In the order of the pairs; None if it was not given.

    Raises
    ------
    InputError
        If there is an effect for bonds and no bonds or the reverse, or the pairs are no integers (m, 2), name grains
        that do not exist, bond a grain to itself or occur twice; if areas are given without bonds, or are not one
        number > 0 for each of them.
    """
    if (bond_effect(effects) is None) != (pairs is None):
        raise InputError(
            "Scene.bonds: bonded grains and an effect for bonds in Scene.effects, must be given both or neither"
        )
    if pairs is None:
        if area is not None:
            raise InputError("Scene.bond_area: given without bonds, whose sections it would be; leave it out")
        return None, None
    try:
        pairs = np.asarray(pairs)
    except ValueError:  # rows of different lengths
        raise InputError("Scene.bonds: rows of different lengths, must be integers (m, 2), m > 0") from None
    if pairs.ndim != 2 or pairs.shape[1] != 2 or len(pairs) == 0 or pairs.dtype.kind not in "iu":
        raise InputError(f"Scene.bonds: {pairs.dtype} array of shape {pairs.shape}, must be integers (m, 2), m > 0")
    if pairs.min() < 0 or pairs.max() >= count:
        raise InputError(f"Scene.bonds: grains {pairs.min()}..{pairs.max()}, must be 0..{count - 1}")
    pairs = np.sort(pairs.astype(np.int32), axis=1)
    same = pairs[:, 0] == pairs[:, 1]
    if same.any():
        raise InputError(f"Scene.bonds: grain {pairs[same][0, 0]} is bonded to itself, a bond needs two grains")
    unique, order = np.unique(pairs, axis=0, return_index=True)
    if len(unique) < len(pairs):
        raise InputError(f"Scene.bonds: {len(pairs) - len(unique)} bonds are given twice, each may be listed once")
    if area is None:
        return unique, None
    if area.shape != (len(pairs),) or not np.all(np.isfinite(area) & (area > 0.0)):
        raise InputError(f"Scene.bond_area: array of shape {area.shape}, must be one number > 0 m2 for each bond")
    return unique, area[order]


def bond_branches(scene: Any) -> NDArray:
    """Vectors (m, dim) [m] from the first grain of each bond to the nearest image of the second, at the start."""
    d = scene.position[scene.bonds[:, 1]] - scene.position[scene.bonds[:, 0]]
    for axis, (length, periodic) in enumerate(zip(scene.lengths, scene.periodic, strict=True)):
        if periodic:
            d[:, axis] -= length * np.round(d[:, axis] / length)
    return d


def bond_numbers(scene: Any) -> tuple[NDArray, NDArray, NDArray]:
    """Stiffness, strength and length of the bonds of a scene.

    Parameters
    ----------
    scene : Scene
        Scene with bonds.

    Returns
    -------
    stiffness : array (m, 4)
        Of tension, shear [N m-1], bending and torsion [N m].
    strength : array (m, 4)
        In tension, shear [N], bending and torsion [N m].
    length : array (m,)
        Distance between the centres of the grains at the start [m].

    Raises
    ------
    InputError
        If two bonded grains lie on each other.
    """
    effect = bond_effect(scene.effects)
    length = np.linalg.norm(bond_branches(scene), axis=1)
    apart = length > 1e-6 * scene.diameter[scene.bonds].max(axis=1)
    if not apart.all():
        raise InputError(f"Scene.bonds: grains {scene.bonds[~apart][0].tolist()} lie on each other, must be apart")
    radius, depth = bond_radii(scene)
    return effect.bond_stiffness(radius, length, depth), effect.bond_strength(radius, depth), length


def bond_radii(scene: Any) -> tuple[NDArray, float | None]:
    """Radii (m,) [m] of the bonds of a scene, and its thickness in 2D [m], None in 3D."""
    # The mean of the equivalent radii of two grains is a quarter of the sum of their diameters.
    radius = 0.25 * scene.diameter[scene.bonds].sum(axis=1)
    depth = scene.thickness if scene.dim == 2 else None
    return bond_effect(scene.effects).bond_radius(radius, scene.bond_area, depth), depth


def bond_areas(scene: Any) -> NDArray:
    """Areas (m,) [m2] of the sections of the bonds of a scene."""
    return bond_effect(scene.effects).bond_sections(*bond_radii(scene))[0]


def bond_effect(effects: Sequence[Any]) -> Any:
    """The effect that acts in bonds, None if there is none."""
    return next((e for e in effects if e.phase == "bond"), None)


def bond_rate(scene: Any) -> float:
    """Bound on the square of the angular frequencies of the bonds [s-2].

    Parameters
    ----------
    scene : Scene
        Scene with bonds.

    Returns
    -------
    float
        max over the mobile grains of 2 sum over their bonds of max(k_n/m, k_s (1/m + l^2/(4 I)) + max(k_b, k_t)/I),
        with the stiffnesses in tension k_n, shear k_s, bending k_b and torsion k_t, the length l of the bond, and the
        mass m and least moment of inertia I of the grain.

    Notes
    -----
    The energy of a bond is at most twice the sum of what the motion of either grain alone would give; hence omega^2 is
    at most twice the greatest sum over the bonds of a grain. Bonds do not move grains on platens.
    """
    stiffness, _, length = bond_numbers(scene)
    mass, inertia = scene.masses()
    tension, shear, bend, torsion = stiffness.T
    rate = np.zeros(len(mass))
    # Either grain of a bond alone: its rate in tension, and in shear, to which the rotation of the grain adds.
    for end in (0, 1):
        k = scene.bonds[:, end]
        m, least = mass[k], inertia[k].min(axis=1)
        rotating = shear * (1.0 / m + 0.25 * length**2 / least) + np.maximum(bend, torsion) / least
        np.add.at(rate, k, np.maximum(tension / m, rotating))
    return 2.0 * float(rate[scene.platen_index < 0].max(initial=0.0))
