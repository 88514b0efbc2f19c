"""The surfaces of 3D grains, seen from above the shear: rendered by pyvista, or painted by matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from workflows.common.offscreen import rendering_problem

if TYPE_CHECKING:
    from workflows.plots.run_files import Moment

TOWARDS = (0.42, 0.36, 0.83)  # direction of the eye: to the right of the width, above the layer
LIGHT = (0.25, 0.75, 0.6)
DIM = 0.45  # brightness of a surface that turns away from the light
GLUED = (0.88, 0.88, 0.88)
SEAM = (0.12, 0.12, 0.12)  # colour of edges of grains
COARSE = 180  # vertices that matplotlib paints of a convex grain
PIXELS = 1400  # across a picture that pyvista renders
MARGIN = 0.02  # of the extent of a picture
BELOW = 0.07  # of its height, below the layer, for the directions of the axes


class Solids(NamedTuple):
    """Surfaces of many grains; lengths in mm.

    Attributes
    ----------
    vertices : ndarray, (k, 3)
        World frame.
    triangles : ndarray of int, (t, 3)
        Rows of their corners.
    grain : ndarray of int, (t,)
        Row of the snapshot that each triangle belongs to.
    seams : ndarray of int, (s, 2)
        Rows of the ends of the lines between two faces of a grain.
    """

    vertices: NDArray
    triangles: NDArray
    grain: NDArray
    seams: NDArray


class ShapeMesh(NamedTuple):
    """Those vertices of a shape that are drawn, its triangles, and its seams as pairs of vertices."""

    rows: NDArray
    triangles: NDArray
    seams: NDArray


def basis() -> NDArray:
    """Unit vectors to the right, upwards and towards the eye as rows, (3, 3)."""
    towards = np.array(TOWARDS) / np.linalg.norm(TOWARDS)
    right = np.cross((0.0, 1.0, 0.0), towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards])


def box_of(moment: Moment) -> NDArray:
    """Lowest and highest corner [mm] of the box of a layer, (2, 3)."""
    cell = moment.grains.cell
    return 1e3 * np.stack([cell.origin, cell.origin + np.diag(cell.matrix)])


def corners_of(box: NDArray) -> NDArray:
    """The corners (8, 3) of a box (2, 3), z running fastest."""
    return np.array([(box[i, 0], box[j, 1], box[k, 2]) for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def extent_of(moment: Moment) -> dict[str, tuple[float, float]]:
    """Ends of the picture of a layer to the right and upwards [mm]: as far as the grains reach."""
    seen = 1e3 * moment.grains.position @ basis().T
    reach = 1e3 * moment.grains.constant("bounding_radius")[:, None]
    low, high = (seen - reach).min(axis=0), (seen + reach).max(axis=0)
    room = MARGIN * (high - low)
    low[1] -= BELOW * (high[1] - low[1])
    return {name: (float(low[i] - room[i]), float(high[i] + room[i])) for i, name in ((0, "across"), (1, "up"))}


def draw_solids(axes: Any, moment: Moment, colours: NDArray, ends: dict[str, tuple[float, float]]) -> None:
    """Draw the grains of a snapshot.

    Parameters
    ----------
    axes
        They become those of the picture, [mm] to the right and upwards.
    moment
        With a 3D snapshot.
    colours
        (grain, 3) of the mobile grains; those of a platen are white.
    ends
        As `extent_of` gives them.
    """
    colours = np.where((moment.grains.constant("kind") == 1)[:, None], GLUED, colours)
    clear_axes(axes, ends)
    if rendering_problem() is None:
        picture = _rendered(_solids(moment, False), colours, ends)
        axes.imshow(picture, extent=(*ends["across"], *ends["up"]), interpolation="antialiased", aspect="equal")
    else:
        _paint(axes, _solids(moment, True), colours)
    draw_directions(axes, moment, ends)


def clear_axes(axes: Any, ends: dict[str, tuple[float, float]]) -> None:
    """Axes for a picture with these ends, without lines and numbers: lengths are told by `draw_directions`."""
    axes.set(xlim=ends["across"], ylim=ends["up"], aspect="equal", xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def draw_box(axes: Any, moment: Moment) -> None:
    """The edges of the box of a layer."""
    from matplotlib.collections import LineCollection

    corners = corners_of(box_of(moment)) @ basis().T[:, :2]
    # Corners whose numbers differ by one bit are joined by an edge.
    ends = [(i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit]
    axes.add_collection(LineCollection([corners[[i, j]] for i, j in ends], colors="0.7", linewidths=0.6))


def draw_directions(axes: Any, moment: Moment, ends: dict[str, tuple[float, float]]) -> None:
    """The directions of the axes in the lower left corner; that of x tells how long they are."""
    wide, high = (ends[name][1] - ends[name][0] for name in ("across", "up"))
    length = nice_length(0.12 * wide)
    origin = np.array([ends["across"][0] + 0.06 * wide, ends["up"][0] + 0.05 * high])
    arrow = {"arrowstyle": "-|>", "color": "black", "lw": 1.1, "shrinkA": 0, "shrinkB": 0}
    for name, along in zip("xyz", basis().T[:, :2], strict=True):
        tip = origin + length * along
        axes.annotate("", tip, origin, arrowprops=arrow)
        words = f"x (shear), {length:g} mm" if name == "x" else name
        aside = {"x": ("left", "center"), "y": ("center", "bottom"), "z": ("right", "top")}[name]
        axes.text(*(tip + 0.02 * wide * along / np.linalg.norm(along)), words, ha=aside[0], va=aside[1], fontsize=7.5)


def nice_length(most: float) -> float:
    """The greatest of 1, 2, 5, 10, ... times a power of ten that is not above `most`."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(step for step in (1.0, 2.0, 5.0) if step * power <= most) * power)


def _solids(moment: Moment, coarse: bool) -> Solids:
    """The surfaces of a snapshot, of all vertices or of those that matplotlib paints."""
    frame, outlines, drawn = moment.grains, moment.run.snapshots.outlines, moment.run.drawn_shapes
    index = frame.constant("shape_index")
    for shape in np.unique(index):
        if shape not in drawn:
            drawn[shape] = _mesh_of(outlines, int(shape), coarse)
    vertices, triangles, seams, first = [], [], [], 0
    for around, shape, centre in zip(outlines.around_centres(frame.dataset), index, frame.position, strict=True):
        mesh = drawn[shape]
        vertices.append(1e3 * (around[mesh.rows] + centre))
        triangles.append(mesh.triangles + first)
        seams.append(mesh.seams + first)
        first += len(mesh.rows)
    grain = np.repeat(np.arange(len(index)), [len(t) for t in triangles])
    return Solids(np.concatenate(vertices), np.concatenate(triangles), grain, np.concatenate(seams))


def _mesh_of(outlines: lsm.GrainOutlines, shape: int, coarse: bool) -> ShapeMesh:
    """What is drawn of a shape."""
    vertices, triangles = outlines.shapes[shape]
    surface = outlines.surfaces[shape]
    rows = np.arange(len(vertices))
    if coarse and not surface.part.any() and len(vertices) > COARSE:
        rows, triangles = _thinned(np.asarray(vertices))
    faces = surface.rows(surface.radius > surface.edge_radius)
    if not surface.edge_radius.all() or surface.part.any() or len(faces.radius) < 2:
        return ShapeMesh(rows, triangles, np.empty((0, 2), int))
    # A point of a ball-polyhedron belongs to the face whose ball it is deepest outside of, on edges to the nearer one.
    middle = np.asarray(vertices)[rows][triangles].mean(axis=1)
    outside = np.linalg.norm(middle[:, None] - faces.centre, axis=2) - faces.radius
    return ShapeMesh(rows, triangles, _borders(triangles, outside.argmax(axis=1)))


def _thinned(vertices: NDArray) -> tuple[NDArray, NDArray]:
    """Rows (k,) of vertices that are farthest in even directions, and the triangles (t, 3) of their hull."""
    from scipy.spatial import ConvexHull

    count = np.arange(COARSE)
    height, angle = 1.0 - 2.0 * (count + 0.5) / COARSE, np.pi * (3.0 - np.sqrt(5.0)) * count
    level = np.sqrt(1.0 - height**2)
    even = np.stack([level * np.cos(angle), level * np.sin(angle), height], axis=1)
    rows = np.unique((vertices @ even.T).argmax(axis=0))
    hull = ConvexHull(vertices[rows])
    a, b, c = (vertices[rows][hull.simplices[:, i]] for i in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    triangles = hull.simplices.copy()
    triangles[inward] = triangles[inward][:, ::-1]
    return rows, triangles


def _borders(triangles: NDArray, label: NDArray) -> NDArray:
    """The sides (s, 2) between triangles of different labels."""
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    order = np.lexsort(sides.T)
    sides, label = sides[order], np.repeat(label, 3)[order]
    shared = np.flatnonzero((sides[1:] == sides[:-1]).all(axis=1))
    return sides[shared[label[shared] != label[shared + 1]]]


def _rendered(solids: Solids, colours: NDArray, ends: dict[str, tuple[float, float]]) -> NDArray:
    """A picture (rows, columns, 3) by pyvista that fills these ends."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # it would tell that there is no display
    (left, right), (low, high) = ends["across"], ends["up"]
    size = [PIXELS, round(PIXELS * (high - low) / (right - left))]
    plotter: Any = pyvista.Plotter(off_screen=True, window_size=size, lighting="none")
    plotter.set_background("white")
    count = len(solids.triangles)
    mesh = pyvista.PolyData(solids.vertices, np.hstack([np.full((count, 1), 3), solids.triangles]).ravel())
    mesh.cell_data["colour"] = np.round(255.0 * colours[solids.grain]).astype(np.uint8)
    plotter.add_mesh(
        mesh,
        scalars="colour",
        rgb=True,
        smooth_shading=True,
        split_sharp_edges=True,
        ambient=DIM,
        diffuse=1.0 - DIM,
        specular=0.12,
        specular_power=20,
    )
    if len(solids.seams):
        lines = np.hstack([np.full((len(solids.seams), 1), 2), solids.seams]).ravel()
        plotter.add_mesh(pyvista.PolyData(solids.vertices, lines=lines), color=SEAM, line_width=1.6, lighting=False)
    right_, up, towards = basis()
    middle = 0.5 * (left + right) * right_ + 0.5 * (low + high) * up
    depth = solids.vertices @ towards
    middle += 0.5 * (depth.min() + depth.max()) * towards
    away = 2.0 * (np.ptp(depth) + right - left)
    plotter.add_light(
        pyvista.Light(position=tuple(middle + away * np.array(LIGHT)), intensity=0.8, light_type="scene light")
    )
    plotter.add_light(pyvista.Light(position=tuple(middle + away * towards), intensity=0.25))
    plotter.enable_parallel_projection()
    plotter.camera_position = [middle + away * towards, middle, up]
    plotter.camera.parallel_scale = 0.5 * (high - low)
    plotter.enable_anti_aliasing("ssaa")
    picture = plotter.screenshot(None, return_img=True)
    plotter.close()
    return np.asarray(picture)


def _paint(axes: Any, solids: Solids, colours: NDArray) -> None:
    """Paint the triangles that face the eye from the farthest to the nearest, and the seams between them."""
    from matplotlib.collections import PolyCollection

    seen = solids.vertices @ basis().T
    a, b, c = (solids.vertices[solids.triangles[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    facing = normal @ basis()[2] > 0.0
    light = np.array(LIGHT) / np.linalg.norm(LIGHT)
    bright = np.clip(DIM + (1.0 - DIM) * (0.8 * np.clip(normal @ light, 0, 1) + 0.25 * (normal @ basis()[2])), 0, 1)
    shaded = (colours[solids.grain] * bright[:, None])[facing]
    sides = solids.triangles[facing]
    # A seam is drawn with the nearer of the triangles beside it, hence as if it were a little nearer than it is.
    length = np.linalg.norm(b - a, axis=1).mean()
    depth = np.concatenate([seen[sides, 2].mean(axis=1), seen[solids.seams, 2].mean(axis=1) + 0.5 * length])
    shapes = [*seen[sides, :2], *seen[solids.seams, :2]]
    paint = np.concatenate([shaded, np.broadcast_to(SEAM, (len(solids.seams), 3))])
    width = np.concatenate([np.full(len(sides), 0.15), np.full(len(solids.seams), 0.35)])
    order = np.argsort(depth)
    axes.add_collection(
        PolyCollection(
            [shapes[i] for i in order],
            facecolors=paint[order],
            edgecolors=paint[order],
            linewidths=width[order],
            rasterized=True,
        )
    )
