"""Non-convex grains from triangle meshes: convex parts that overlap inside only."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from ..core.errors import InputError
from .apparent_stiffness import apparent_stiffness, nearest
from .ball_polyhedron import BallPolyhedron
from .dilated_balls import SLACK, ball_polyhedron_and_frame
from .grown_parts import PUSH
from .input_checks import check_between, check_corner_radius
from .mesh_bodies import chosen_body
from .mesh_files import triangles_of
from .mesh_repair import mended
from .non_convex_outlines import PartsMisfit
from .union import Union, union
from .union_mass import moments_of

if TYPE_CHECKING:
    import trimesh

    from .solid_parts import Solid

SHARES = (1.0, 0.7, 0.4)  # of the push, tried until the part closes
SLACKS = (SLACK, 1.6, 2.5, 6.0)  # likewise
FOLLOW_STEPS = 2
VOLUME_STEPS = 2
DISTANCES = 1500  # points of the surface whose distance from the grain is measured
NEAR = 0.03  # equivalent diameters


def non_convex_mesh(
    mesh: str | PathLike[str] | trimesh.Trimesh,
    faces: int = 24,
    corner_radius: float = 0.03,
    *,
    concavity: float = 0.05,
    parts: Sequence[trimesh.Trimesh] | None = None,
    body: int | None = None,
    random_seed: int = 0,
) -> tuple[Union | BallPolyhedron, PartsMisfit]:
    """A grain from a triangle mesh that need not be convex, as a union of convex parts, and its misfit.

    Parameters
    ----------
    mesh : path or trimesh.Trimesh
        File (STL, PLY, OBJ) or mesh in any unit of length and any place, closed, of at most a million triangles; flaws
        are mended as by `from_mesh`.
    faces : int
        Greatest number of faces of each part on the outside of the grain, 4 to 100.
    corner_radius : float
        Radius of edges and vertices in equivalent diameters of the mesh, above 0 and below 0.25.
    concavity : float
        What hollows the parts may ignore, the `threshold` of CoACD, 0.01 to 1: less gives more parts.
    parts : sequence of trimesh.Trimesh, optional
        Convex parts that another program has found, in the frame of the mesh; by default CoACD finds them, which
        `pip install 'taichi-lsm[decompose]'` installs.
    body : int, optional
        Which of several bodies to take, 0 for the largest; see `bodies_of_mesh`.
    random_seed : int
        Of the search of CoACD.

    Returns
    -------
    shape : Union or BallPolyhedron
        Grain of equivalent diameter 1, body frame; a ball-polyhedron if one part is enough.
    misfit : PartsMisfit
        How far its surface is from that of the mesh, and how stiff it seems along it.

    Raises
    ------
    InputError
        If the mesh cannot be read or is not closed, a parameter is out of range, CoACD is missing, or a part does not
        close.

    Notes
    -----
    Parts overlap inside as those of `non_convex_outline` do. At last the outer faces move by the same length, so that
    the volume is right.

    References
    ----------
    Wei, Liu, Ling and Su (2022), Approximate convex decomposition for 3D meshes with collision-aware concavity and tree
    search, ACM Transactions on Graphics 41.
    """
    from .solid_parts import grown_solids

    check_between("faces", faces, 4, 100)
    check_corner_radius(corner_radius, 0.25)
    check_between("concavity", concavity, 0.01, 1.0)
    solid, hulls, repairs = _body_and_hulls(mesh, parts, body)
    hulls = hulls or _decomposed(solid, concavity, random_seed)
    members = _of_right_volume(grown_solids(hulls, faces, corner_radius), corner_radius, solid)
    whole = union(members, name="mesh")
    shape = whole if isinstance(whole, Union) else members[0].normalised()
    return shape, _misfit(members, shape, solid)._replace(repairs=repairs)


def _body_and_hulls(
    mesh: str | PathLike[str] | trimesh.Trimesh, parts: Sequence[trimesh.Trimesh] | None, body: int | None
) -> tuple[trimesh.Trimesh, list[trimesh.Trimesh], tuple[str, ...]]:
    """A mesh about its centre of mass in units of its equivalent diameter, hulls of its parts there, its repairs."""
    import trimesh

    label, vertices, triangles = triangles_of(mesh)
    found = mended(label, vertices, triangles)
    solid = trimesh.Trimesh(*chosen_body(label, found, body), process=False)
    hulls = [part.convex_hull.copy() for part in parts or ()]
    for hull in hulls:
        hull.apply_translation(-found.origin)
        hull.apply_scale(1.0 / found.size)
    size, centre = (6.0 * solid.volume / np.pi) ** (1.0 / 3.0), solid.center_mass
    for one in (solid, *hulls):
        one.apply_translation(-centre)
        one.apply_scale(1.0 / size)
    return solid, hulls, found.repairs


def _of_right_volume(solids: list[Solid], radius: float, body: trimesh.Trimesh) -> list[BallPolyhedron]:
    """The rounded parts: their faces follow those of smooth hulls, then all move by one length."""
    for _ in range(FOLLOW_STEPS):
        for solid in solids:
            if solid.bulging:
                solid.follow(_rounded(solid, radius))
    members = [_rounded(solid, radius) for solid in solids]
    for _ in range(VOLUME_STEPS):
        offset = (body.volume - _volume(members)) / body.area
        for solid in solids:
            solid.offset += offset
        members = [_rounded(solid, radius) for solid in solids]
    return members


def _decomposed(body: trimesh.Trimesh, concavity: float, random_seed: int) -> list[trimesh.Trimesh]:
    """Convex hulls that cover a body, by CoACD."""
    try:
        import coacd
    except ImportError:
        raise InputError(
            "parts: none given, and CoACD, which finds them, is not installed; pip install 'taichi-lsm[decompose]'"
        ) from None
    import trimesh

    coacd.set_log_level("error")
    found = coacd.run_coacd(coacd.Mesh(body.vertices, body.faces), threshold=concavity, seed=random_seed)
    return [trimesh.Trimesh(vertices, triangles).convex_hull for vertices, triangles in found]


def _rounded(solid: Solid, radius: float) -> BallPolyhedron:
    """The part where it lies, its cuts moved out as far as it closes and its faces as round."""
    problem = None
    for slack in SLACKS:
        for share in SHARES:
            try:
                shape, centroid, frame = ball_polyhedron_and_frame(
                    *solid.balls(radius, share * PUSH * radius, slack), radius, "part"
                )
            except ValueError as error:  # slivers, on which any step may fail
                problem = error
            else:
                return shape.moved(frame, centroid)
    raise InputError(f"mesh: a part does not close ({problem}); change faces or corner_radius")


def _volume(members: Sequence[BallPolyhedron]) -> float:
    """Volume of the union of the parts."""
    return members[0].measure if len(members) == 1 else moments_of(members)[0]


def _misfit(members: Sequence[BallPolyhedron], shape: Union | BallPolyhedron, body: trimesh.Trimesh) -> PartsMisfit:
    """How far parts are from a mesh of equivalent diameter 1."""
    import trimesh

    x = np.asarray(trimesh.sample.sample_surface(body, DISTANCES, seed=0)[0])
    distance = np.abs(np.min([nearest(m, x, NEAR)[0] for m in members], axis=0))
    moments = np.sort(np.linalg.eigvalsh(body.moment_inertia)) / body.volume ** (5.0 / 3.0)
    mine = np.sort(shape.inertia) / shape.measure ** (5.0 / 3.0)
    error = mine / moments - 1.0
    found = apparent_stiffness(members)
    return PartsMisfit(
        measure=float(_volume(members) / body.volume - 1.0),
        inertia=float(error[np.argmax(np.abs(error))]),
        greatest_distance=float(distance.max()),
        rms_distance=float(np.sqrt((distance**2).mean())),
        parts=len(members),
        least_radius=min(m.overlap_limit for m in members),
        least_stiffness=found.least,
        greatest_stiffness=found.greatest,
        doubled_share=found.doubled_share,
        junction_share=found.junction_share,
    )
