"""Grains of many patches beside rigid clumps of spheres: the states P8_500 and P30_500, in both codes.

The clumps are 512 grains of 8 or 30 equal spheres, no two alike, in a dense sheared packing made with LAMMPS; units and
walls as in `scenes`. They are what LAMMPS computes. Ours are grains of 20 faces at the clumps' centres of mass: equal
in number, in total mass and in the ratio of their volumes, and relaxed (`benchmarks.relax`) until the walls carry the
same normal stress. Equal volumes alone would not do: a round grain of a clump's volume packs more densely than a clump,
so that all sizes are multiplied by one factor, which the state keeps.
"""

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
    """Rigid clumps of equal spheres: centres of mass (n, 3), offsets (n, m, 3) of the spheres from them and their
    diameters d (n,), kind (n,) MOBILE | BOTTOM | TOP, box (3,), volume (n,) of the union of each clump's spheres."""

    tag: str
    centre: np.ndarray
    offset: np.ndarray
    d: np.ndarray
    kind: np.ndarray
    box: np.ndarray
    volume: np.ndarray

    @property
    def x(self):
        """Centres of mass (n, 3), by the name that `scenes.State` uses."""
        return self.centre

    @property
    def spheres(self):
        """Centres of all spheres (n m, 3), clump after clump; not wrapped into the box."""
        return (self.centre[:, None] + self.offset).reshape(-1, 3)

    @cached_property
    def mass(self):
        """Mass of every clump (n,) in LAMMPS: density 1, summed over spheres, overlaps counted as often as covered."""
        return self.offset.shape[1] * np.pi / 6.0 * self.d**3


def load(tag) -> Clumps:
    """The stored clumps of a scene; ValueError for an unknown tag.

    Offsets are stored in sphere diameters with 32 bits: positions are those of the original to 3e-8.
    """
    if tag not in TAGS:
        raise ValueError(f"clumps {tag!r}: must be one of {', '.join(TAGS)}")
    with np.load(scenes.STATES / f"{tag}.npz") as file:
        offset = file["offset"].astype(float) * file["d"][:, None, None]
        return Clumps(tag, file["centre"], offset, file["d"], file["kind"], file["box"], file["volume"])


def union_volume(offset, d):
    """Volume of the union of spheres of diameter d about the points (m, 3): share of the points of a cubic lattice."""
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
    """Our grains for a clump scene: position (n, 3), orientation (n, 4) as unit quaternions w, x, y, z; factor: their
    equivalent diameters over those of the clumps they stand for."""

    position: np.ndarray
    orientation: np.ndarray
    factor: float


def unrelaxed(clumps, factor) -> Faces:
    """Grains at the clumps' centres of mass, turned at random (fixed seed), sizes times `factor`."""
    turns = lsm.random_rotations(np.random.default_rng(0), len(clumps.x), 3)
    return Faces(clumps.centre, turns, factor)


def relaxed(tag) -> Faces:
    """The stored grains at equal normal stress; see `benchmarks.relax`."""
    with np.load(scenes.STATES / f"{tag}_faces.npz") as file:
        return Faces(file["position"], file["orientation"], float(file["factor"]))


def diameters(clumps):
    """Equivalent diameters (n,): of the sphere with the volume of each clump."""
    return np.cbrt(6.0 / np.pi * clumps.volume)


def build(clumps, faces, extras=False, parallel=None) -> lsm.Scene:
    """Our scene: grains of FACES faces, glued ones too, with the clumps' laws, walls, step and skin.

    Their density makes the sum of the masses that of LAMMPS. extras, parallel: as in `scenes.build`.
    """
    state = scenes.State(clumps.tag, faces.position, diameters(clumps) * faces.factor, clumps.kind, clumps.box)
    return replace(
        scenes.build(state, extras, parallel),
        shapes=[lsm.ball_of_faces(FACES, scenes.DILATION)],
        orientation=faces.orientation,
        density=float(clumps.mass.sum() / state.mass.sum()),
    )


def layer(clumps):
    """(low, high) [d] of the slab over which our normal stress is taken: the middle half between the walls' centres."""
    low = clumps.centre[clumps.kind == scenes.BOTTOM, 1].mean()
    high = clumps.centre[clumps.kind == scenes.TOP, 1].mean()
    return low + 0.25 * (high - low), high - 0.25 * (high - low)


def metrics(sim, clumps):
    """What `lammps_clumps.run` gives too: contacts of mobile grains with others, normal stress, energy, mass."""
    low, high = layer(clumps)
    area = clumps.box[0] * clumps.box[2]
    sums = sim.measure.sums(low=low, high=high, volume=area * (high - low))
    mobile = clumps.kind == scenes.MOBILE
    return {
        "contacts_per_grain": sums["contact_ends"] / int(mobile.sum()),
        "normal_stress": float(sums["stress"][1, 1]),
        "translational_energy": sums["translational_energy"],
        "mass": float(sim.scene.masses()[0].sum()),
    }
