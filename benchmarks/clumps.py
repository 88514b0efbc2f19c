"""Grains of many patches beside rigid clumps of spheres: the states P8_500 and P30_500, in both codes.

The clumps are 512 grains of 8 or 30 equal spheres, no two alike, in a dense sheared packing made with LAMMPS; units and
walls as in `scenes`. They are what LAMMPS computes. Ours are grains of 20 faces at the clumps' centres of mass: equal
in number, in total mass and in the ratio of their volumes, and relaxed (`benchmarks.relax`) until the walls carry the
same normal stress. Equal volumes alone would not do: a round grain of a clump's volume packs more densely than a clump,
so that all sizes are multiplied by one factor, which is stored with the state.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

import taichi_lsm as lsm
from benchmarks import scenes

TAGS = ("P8_500", "P30_500")
FACES = 20
LATTICE = 48  # points along each side of the cube round a clump, for its volume, to 3e-3 of it or better


@dataclass(frozen=True)
class Clumps:
    """Rigid clumps of equal spheres, in units of d = 1 and rho = 1.

    Attributes
    ----------
    centre : (n, 3)
        Centres of mass.
    offset : (n, m, 3)
        Centres of the spheres relative to those of mass.
    d : (n,)
        Diameter of the spheres of each clump.
    kind : (n,)
        MOBILE, BOTTOM or TOP.
    box : (3,)
        Lengths of the domain.
    volume : (n,)
        Volume of the union of each clump's spheres.
    """

    tag: str
    centre: np.ndarray
    offset: np.ndarray
    d: np.ndarray
    kind: np.ndarray
    box: np.ndarray
    volume: np.ndarray

    @property
    def x(self) -> np.ndarray:
        """Centres of mass (n, 3), by the name that `scenes.State` uses."""
        return self.centre

    @property
    def spheres(self) -> np.ndarray:
        """Centres of all spheres (n m, 3), clump after clump; not wrapped into the box."""
        return (self.centre[:, None] + self.offset).reshape(-1, 3)

    @cached_property
    def mass(self) -> np.ndarray:
        """Mass of every clump (n,) in LAMMPS: density 1, summed over spheres, overlaps counted as often as covered."""
        return self.offset.shape[1] * np.pi / 6.0 * self.d**3


def load(tag: str) -> Clumps:
    """Stored clumps of a scene.

    Offsets are stored in sphere diameters with 32 bits: positions are those of the original to 3e-8.

    Raises
    ------
    ValueError
        If the tag is unknown.
    """
    if tag not in TAGS:
        raise ValueError(f"clumps {tag!r}: must be one of {', '.join(TAGS)}")
    with np.load(scenes.STATES / f"{tag}.npz") as file:
        offset = file["offset"].astype(float) * file["d"][:, None, None]
        return Clumps(tag, file["centre"], offset, file["d"], file["kind"], file["box"], file["volume"])


def union_volume(offset: np.ndarray, d: float) -> float:
    """Volume of the union of spheres of diameter d about the points (m, 3), by counting points of a cubic lattice."""
    low, high = offset.min(axis=0) - 0.5 * d, offset.max(axis=0) + 0.5 * d
    step = (high - low) / LATTICE
    axes = [a + s * (np.arange(LATTICE) + 0.5) for a, s in zip(low, step)]
    squares = [(axis[:, None] - offset[:, k]) ** 2 for k, axis in enumerate(axes)]  # each (LATTICE, m)
    inside = np.zeros((LATTICE,) * 3, bool)
    for x, y, z in zip(*(square.T for square in squares)):
        inside |= x[:, None, None] + y[None, :, None] + z[None, None, :] < 0.25 * d * d
    return float(inside.mean() * (high - low).prod())


@dataclass(frozen=True)
class Faces:
    """Our grains for a clump scene.

    Attributes
    ----------
    position : (n, 3)
        Centres of mass.
    orientation : (n, 4)
        Unit quaternions w, x, y, z.
    factor : float
        Equivalent diameters over those of the clumps.
    """

    position: np.ndarray
    orientation: np.ndarray
    factor: float


def unrelaxed(clumps: Clumps, factor: float) -> Faces:
    """Grains at the clumps' centres of mass in random orientations (fixed seed), sizes times `factor`."""
    orientation = lsm.random_rotations(np.random.default_rng(0), len(clumps.x), 3)
    return Faces(clumps.centre, orientation, factor)


def relaxed(tag: str) -> Faces:
    """Stored grains at equal normal stress; see `benchmarks.relax`."""
    with np.load(scenes.STATES / f"{tag}_faces.npz") as file:
        return Faces(file["position"], file["orientation"], float(file["factor"]))


def diameters(clumps: Clumps) -> np.ndarray:
    """Equivalent diameters (n,): of the sphere with the volume of each clump."""
    return np.cbrt(6.0 / np.pi * clumps.volume)


def build(clumps: Clumps, faces: Faces, extras: bool = False, parallel: bool | None = None) -> lsm.Scene:
    """Scene of grains of FACES faces, glued ones too, with the clumps' effects, walls, step and skin.

    Their density makes the sum of the masses that of LAMMPS. extras, parallel: as in `scenes.build`.
    """
    state = scenes.State(clumps.tag, faces.position, diameters(clumps) * faces.factor, clumps.kind, clumps.box)
    return replace(
        scenes.build(state, extras, parallel),
        shapes=[lsm.shapes.ball_of_faces(FACES, scenes.DILATION)],
        orientation=faces.orientation,
        density=float(clumps.mass.sum() / state.mass.sum()),
    )


def layer(clumps: Clumps) -> tuple[float, float]:
    """Bounds (low, high) [d] of the slab of our normal stress: the middle half between the walls' centres."""
    low = clumps.centre[clumps.kind == scenes.BOTTOM, 1].mean()
    high = clumps.centre[clumps.kind == scenes.TOP, 1].mean()
    return low + 0.25 * (high - low), high - 0.25 * (high - low)


def metrics(sim: lsm.Simulation, clumps: Clumps) -> dict[str, float]:
    """Quantities that `lammps_clumps.run` gives too: contacts of mobile grains, normal stress, energy, mass."""
    low, high = layer(clumps)
    area = clumps.box[0] * clumps.box[2]
    sums = sim.measure.sums(low=low, high=high, volume=area * (high - low))
    mobile = clumps.kind == scenes.MOBILE
    return {
        "contacts_per_grain": sums["contact_ends"] / int(mobile.sum()),
        "normal_stress": float(np.asarray(sums["stress"])[1, 1]),
        "translational_energy": sums["translational_energy"],
        "mass": float(sim.scene.masses()[0].sum()),
    }
