"""The declared scenes: dense packings sheared between two platens of glued grains at constant volume.

The states in `states/` are dense sheared packings, made with LAMMPS, in units of the mean diameter d = 1 and
the density rho = 1. Diameters are uniform in [0.8, 1.2]. Velocities are zero and no contact has a tangential
spring. Both codes start from these arrays and nothing else.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import KDTree

import taichi_lsm as lsm
from benchmarks.effect_sets import EFFECT_SETS, linear_frictional

STATES = Path(__file__).parent / "states"
TAGS = ("S2_1000", "S2_10000", "S3_1000", "S3_10000")
LARGE = {  # the stored state that is repeated, and how often along x (2D) or along x and z (3D)
    "S2_100000": ("S2_10000", (10,)),
    "S2_1000000": ("S2_10000", (100,)),
    "S3_2000": ("S3_1000", (2, 1)),
    "S3_50000": ("S3_10000", (5, 1)),
    "S3_100000": ("S3_10000", (5, 2)),
    "S3_1000000": ("S3_10000", (10, 10)),
}
NUDGE = 1e-6  # of repeated grains [d]: a force of a thousandth of that of a mean contact
MOBILE, BOTTOM, TOP = 1, 2, 3  # values of State.kind

WALL_SPEED = 0.2
TIME_STEP = 5e-4
FROZEN = 1e-6  # of the time step, where sets of effects are timed on the same contacts
SKIN = 0.1
DILATION = 0.05  # of balls cut into faces [d]
LAYER = {2: {"layer_thickness": 24.0, "length": 30.0}, 3: {"layer_thickness": 8.0, "length": 10.0, "width": 8.0}}
CONSOLIDATION = 800.0  # inertial times: loose grains approach by a tenth of a diameter in each


@dataclass(frozen=True)
class State:
    """A packing of discs or spheres, in units of d = 1 and rho = 1.

    Attributes
    ----------
    x : (n, dim)
        Centres.
    d : (n,)
        Diameters.
    kind : (n,)
        MOBILE, BOTTOM or TOP.
    box : (dim,)
        Lengths of the domain.
    """

    tag: str
    x: np.ndarray
    d: np.ndarray
    kind: np.ndarray
    box: np.ndarray

    @property
    def dim(self) -> int:
        """2 (discs of thickness 1) or 3 (spheres)."""
        return self.x.shape[1]

    @property
    def mass(self) -> np.ndarray:
        """Mass of every grain (n,): rho pi d^2/4 in 2D, rho pi d^3/6 in 3D."""
        return np.pi / 4 * self.d**2 if self.dim == 2 else np.pi / 6 * self.d**3


def load(tag: str) -> State:
    """State of a scene, stored or repeated; ValueError for an unknown tag."""
    if tag in LARGE:
        stored, copies = LARGE[tag]
        return tiled(tag, load(stored), copies)
    if tag not in TAGS:
        raise ValueError(f"scene {tag!r}: must be one of {', '.join((*TAGS, *LARGE))}")
    with np.load(STATES / f"{tag}.npz") as file:
        return State(tag, file["x"], file["d"], file["kind"], file["box"])


def tiled(tag: str, state: State, copies: tuple[int, ...]) -> State:
    """State repeated `copies` times along each of its periodic axes: (along x,) in 2D, (along x, along z) in 3D.

    Mobile grains are displaced at random by up to NUDGE (fixed seed); otherwise all copies would move alike, and a
    contact would change in all of them at the same step.
    """
    axes = (0, 2)[: len(copies)]
    shifts = np.zeros((int(np.prod(copies)), state.dim))
    shifts[:, axes] = np.stack(np.unravel_index(np.arange(len(shifts)), copies), axis=1) * state.box[list(axes)]
    x = (shifts[:, None] + state.x).reshape(-1, state.dim)
    kind = np.tile(state.kind, len(shifts))
    nudge = np.random.default_rng(0).uniform(-NUDGE, NUDGE, x.shape)
    box = state.box.copy()
    box[list(axes)] *= copies
    x[kind == MOBILE] += nudge[kind == MOBILE]
    x[:, axes] %= box[list(axes)]
    return State(tag, x, np.tile(state.d, len(shifts)), kind, box)


def declared(tag: str, extras: bool = False, parallel: bool | None = None) -> tuple[lsm.Scene, float, int]:
    """Build the scene of a tag.

    Parameters
    ----------
    tag : str
        One of TAGS or LARGE; "S2_1000/30" for its mobile grains cut into 30 arcs or faces; "S3_10000@100" for a
        domain 100 times as long along each axis, empty but for the same grains; "S3_1000:gravity" for a set of
        effects of `effect_sets`; "layer2/angular" for a layer of angular grains in 2D as `lsm shear-gouge`
        consolidates it.
    extras, parallel
        As in `build`.

    Returns
    -------
    scene : Scene
    volume : float
        Volume of its domain, area in 2D.
    steps : int
        Steps to run before it is timed.

    Raises
    ------
    ValueError
        If the tag is unknown.
    """
    tag, _, effect_set = tag.partition(":")
    name, _, longer = tag.partition("@")
    name, _, shape = name.partition("/")
    if name.startswith("layer"):
        return _layer(int(name[-1]), shape)
    state = load(name)
    scene = build(state, extras, parallel, int(shape or 1))
    scene.lengths = tuple(length * float(longer or 1) for length in scene.lengths)
    if effect_set:
        scene.effects, scene.dt = EFFECT_SETS[effect_set][0], FROZEN * TIME_STEP
        if any(effect.phase == "bond" for effect in scene.effects):
            scene.bonds = touching(state)
    return scene, float(state.box.prod()), 0


def touching(state: State) -> np.ndarray:
    """Pairs (m, 2) of mobile grains that touch, without those across a periodic border; the lower number first."""
    mobile = np.flatnonzero(state.kind == MOBILE)
    pairs = mobile[KDTree(state.x[mobile]).query_pairs(state.d.max(), output_type="ndarray")]
    apart = np.linalg.norm(state.x[pairs[:, 0]] - state.x[pairs[:, 1]], axis=1)
    pairs = pairs[apart < 0.5 * state.d[pairs].sum(axis=1)].astype(np.int32)
    return pairs[np.lexsort(pairs.T[::-1])]


def _layer(dim: int, shape: str) -> tuple[lsm.Scene, float, int]:
    """A small layer under stress, with its volume and the steps in which it consolidates."""
    from workflows import shear_gouge

    params = shear_gouge.Params.model_validate({"dim": dim, "shape": shape, **LAYER[dim]})
    scene = shear_gouge.build(params)
    scene.parallel, scene.integrator, scene.track_dissipation = False, lsm.VelocityVerlet, False
    thickness, lengths = params.layer
    steps = int(CONSOLIDATION * params.inertial_time / (scene.safety * scene.stable_dt()))
    return scene, thickness * float(np.prod(lengths)), steps


def build(state: State, extras: bool = False, parallel: bool | None = None, patches: int = 1) -> lsm.Scene:
    """Scene of a state, with plain velocity Verlet as in LAMMPS.

    Parameters
    ----------
    state : State
        The packing.
    extras : bool
        Use our defaults, which LAMMPS does not have: track dissipated energy, correct the onset of contacts.
    parallel : bool, optional
        As in `lsm.Scene`.
    patches : int
        Arcs (2D) or faces tangent to the outline (3D) of every mobile grain; 1 leaves it a disc or sphere.
    """
    dim, count = state.dim, len(state.x)
    still: list[Any] = [lsm.Fixed()] * dim
    shapes: list[Any] = [lsm.disc() if dim == 2 else lsm.sphere()]
    orientations: dict[str, Any] = {}
    if patches > 1:
        rng = np.random.default_rng(0)
        shapes.append(
            lsm.shapes.regular_disc_of_arcs(patches) if dim == 2 else lsm.shapes.ball_of_faces(patches, DILATION)
        )
        orientations = {"angle" if dim == 2 else "orientation": lsm.random_rotations(rng, count, dim)}
    return lsm.Scene(
        dim=dim,
        lengths=tuple(state.box),
        periodic=(True, False, True)[:dim],
        shapes=shapes,
        shape_index=np.where(state.kind == MOBILE, len(shapes) - 1, 0),
        **orientations,
        position=state.x,
        diameter=state.d,
        density=1.0,
        thickness=1.0,
        platen_index=np.where(state.kind == MOBILE, -1, state.kind - BOTTOM),
        platens=[
            lsm.Platen("bottom", still),
            lsm.Platen("top", [lsm.ConstantVelocity(WALL_SPEED), *still[1:]]),
        ],
        effects=linear_frictional(),
        dt=TIME_STEP,
        skin=SKIN,
        integrator=lsm.OnsetVerlet if extras else lsm.VelocityVerlet,
        track_dissipation=extras,
        parallel=parallel,
    )
