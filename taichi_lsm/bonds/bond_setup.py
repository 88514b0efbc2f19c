"""Bonds of a scene before anything is compiled: which there are, how stiff and strong, and the step they allow."""

import numpy as np

from ..core.errors import InputError


def checked_bonds(pairs, effects, count):
    """Bonds (m, 2) of `count` grains with the lower id first, sorted, or None for none.

    Raises InputError if they make no sense, or if the effects hold a law of bonds and there are none or the reverse.
    """
    if (bond_effect(effects) is None) != (pairs is None):
        raise InputError(
            "Scene.bonds: a law of bonds in Scene.effects and bonded grains, must be given both or neither"
        )
    if pairs is None:
        return None
    pairs = np.asarray(pairs)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or len(pairs) == 0 or pairs.dtype.kind not in "iu":
        raise InputError(f"Scene.bonds: {pairs.dtype} array of shape {pairs.shape}, must be integers (m, 2), m > 0")
    if pairs.min() < 0 or pairs.max() >= count:
        raise InputError(f"Scene.bonds: grains {pairs.min()}..{pairs.max()}, must be 0..{count - 1}")
    pairs = np.sort(pairs.astype(np.int32), axis=1)
    same = pairs[:, 0] == pairs[:, 1]
    if same.any():
        raise InputError(f"Scene.bonds: grain {pairs[same][0, 0]} is bonded to itself, a bond needs two grains")
    unique = np.unique(pairs, axis=0)
    if len(unique) < len(pairs):
        raise InputError(f"Scene.bonds: {len(pairs) - len(unique)} bonds are given twice, each may be listed once")
    return unique


def bond_branches(scene):
    """Vectors (m, dim) [m] from the first grain of each bond to the nearest image of the second, at the start."""
    d = scene.position[scene.bonds[:, 1]] - scene.position[scene.bonds[:, 0]]
    for axis, (length, periodic) in enumerate(zip(scene.lengths, scene.periodic, strict=True)):
        if periodic:
            d[:, axis] -= length * np.round(d[:, axis] / length)
    return d


def bond_numbers(scene):
    """(stiffness (m, 4), strength (m, 4), length (m,) [m]) of the bonds of a scene."""
    effect = bond_effect(scene.effects)
    length = np.linalg.norm(bond_branches(scene), axis=1)
    apart = length > 1e-6 * scene.diameter[scene.bonds].max(axis=1)
    if not apart.all():
        raise InputError(f"Scene.bonds: grains {scene.bonds[~apart][0].tolist()} lie on each other, must be apart")
    radius = 0.25 * scene.diameter[scene.bonds].sum(axis=1)
    depth = scene.thickness if scene.dim == 2 else None
    return effect.bond_stiffness(radius, length, depth), effect.bond_strength(radius, depth), length


def bond_effect(effects):
    """The law of the bonds, None if there is none."""
    return next((e for e in effects if e.phase == "bond"), None)


def bond_rate(scene):
    """Bound on the square of the angular frequencies of the bonds [s-2].

    The energy of a bond is at most twice the sum of what either grain's motion alone would give; so is omega^2 at most
    twice the greatest sum over the bonds of a grain. Grains on platens do not move by bonds.
    """
    stiffness, _, length = bond_numbers(scene)
    mass, inertia = scene.masses()
    tension, shear, bend, torsion = stiffness.T
    rate = np.zeros(len(mass))
    for end in (0, 1):
        k = scene.bonds[:, end]
        m, least = mass[k], inertia[k].min(axis=1)
        turning = shear * (1.0 / m + 0.25 * length**2 / least) + np.maximum(bend, torsion) / least
        np.add.at(rate, k, np.maximum(tension / m, turning))
    return 2.0 * float(rate[scene.platen_index < 0].max(initial=0.0))
