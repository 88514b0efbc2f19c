"""The declared scenes: dense packings sheared between two platens of glued grains at constant volume.

The states in `states/` are dense sheared packings, made with LAMMPS, in units of the mean diameter d = 1 and
the density rho = 1. Diameters are uniform in [0.8, 1.2]. Velocities are zero and no contact remembers
a tangential spring. Both codes start from these arrays and nothing else.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import taichi_lsm as lsm

STATES = Path(__file__).parent / "states"
TAGS = ("S2_1000", "S2_10000", "S3_1000", "S3_10000")
MOBILE, BOTTOM, TOP = 1, 2, 3  # values of State.kind

NORMAL_STIFFNESS = 1e4
TANGENTIAL_RATIO = 2.0 / 7.0
FRICTION = 0.5
DAMPING_RATE = 40.0
WALL_SPEED = 0.2
TIME_STEP = 5e-4
SKIN = 0.1


@dataclass(frozen=True)
class State:
    """A packing: centres x (n, dim), diameters d (n,), kind (n,) MOBILE | BOTTOM | TOP, box (dim,)."""

    tag: str
    x: np.ndarray
    d: np.ndarray
    kind: np.ndarray
    box: np.ndarray

    @property
    def dim(self):
        """2 (discs of thickness 1) or 3 (spheres)."""
        return self.x.shape[1]

    @property
    def mass(self):
        """Mass of every grain (n,): rho pi d^2/4 in 2D, rho pi d^3/6 in 3D."""
        return np.pi / 4 * self.d**2 if self.dim == 2 else np.pi / 6 * self.d**3


def load(tag) -> State:
    """The stored state of a scene; ValueError for an unknown tag."""
    if tag not in TAGS:
        raise ValueError(f"scene {tag!r}: must be one of {', '.join(TAGS)}")
    with np.load(STATES / f"{tag}.npz") as file:
        return State(tag, file["x"], file["d"], file["kind"], file["box"])


def build(state, extras=False, parallel=None) -> lsm.Scene:
    """Our scene: plain velocity Verlet, as LAMMPS. parallel: see lsm.Scene.

    extras: what LAMMPS does not do and we do by default: book dissipated energy, correct the onset of contacts.
    """
    dim = state.dim
    still = [lsm.Fixed()] * dim
    return lsm.Scene(
        dim=dim,
        lengths=tuple(state.box),
        periodic=(True, False, True)[:dim],
        shapes=[lsm.disc() if dim == 2 else lsm.sphere()],
        shape=np.zeros(len(state.x), int),
        position=state.x,
        scale=state.d,
        density=1.0,
        thickness=1.0,
        platen=np.where(state.kind == MOBILE, -1, state.kind - BOTTOM),
        platens=[
            lsm.Platen("bottom", still),
            lsm.Platen("top", [lsm.ConstantVelocity(WALL_SPEED), *still[1:]]),
        ],
        effects=[
            lsm.LinearElastic(NORMAL_STIFFNESS),
            lsm.ViscousDamping(rate=DAMPING_RATE),
            lsm.CoulombFriction(FRICTION, TANGENTIAL_RATIO * NORMAL_STIFFNESS),
        ],
        dt=TIME_STEP,
        skin=SKIN,
        integrator=lsm.OnsetVerlet if extras else lsm.VelocityVerlet,
        ledger=extras,
        parallel=parallel,
    )
