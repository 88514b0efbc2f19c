"""VTK: the true surface of every grain in a .vtp file for each snapshot, and a .pvd file that lists them with times."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import taichi_lsm as lsm
from workflows.common.libraries import library
from workflows.export.snapshots import Frame, Snapshots

if TYPE_CHECKING:
    from pyvista import PolyData


def write(snapshots: Snapshots, out: Path) -> Path:
    """Write grains.pvd and its files to the folder `out`; returns its path."""
    frames = ((frame.number, frame.time, surfaces(frame, snapshots.outlines)) for frame in snapshots)
    return write_series(out, "grains", frames, snapshots.digits)


def write_series(out: Path, name: str, meshes: Iterable[tuple[int, float, PolyData]], digits: int) -> Path:
    """Write a series of meshes: `name`_<number>.vtp for each, and `name`.pvd, which is written last.

    Parameters
    ----------
    out, name
        Folder and name of the series.
    meshes
        Number, time [s] and mesh of each; taken one at a time.
    digits
        Of a number in the name of a file.

    Returns
    -------
    Path
        Of the .pvd file.
    """
    collection = ElementTree.Element("Collection")
    for number, time, mesh in meshes:
        file = f"{name}_{number:0{digits}d}.vtp"
        _write_mesh(out / file, mesh)
        ElementTree.SubElement(collection, "DataSet", timestep=repr(time), part="0", file=file)
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    root.append(collection)
    ElementTree.indent(root)
    with lsm.replacing(out / f"{name}.pvd") as new:
        ElementTree.ElementTree(root).write(new, encoding="utf-8", xml_declaration=True)
    return out / f"{name}.pvd"


def _write_mesh(path: Path, mesh: PolyData) -> None:
    """Write one .vtp file, which appears whole or not at all."""
    writer = library("vtkmodules.vtkIOXML", "lsm export --format vtk", "export").vtkXMLPolyDataWriter()
    with lsm.replacing(path) as new:
        writer.SetFileName(str(new))
        writer.SetInputData(mesh)
        if not writer.Write():
            raise OSError(writer.GetErrorCode(), "VTK could not write it")


def surfaces(frame: Frame, outlines: lsm.GrainOutlines) -> PolyData:
    """The surfaces of the grains as one mesh: a polygon for each grain in 2D, triangles in 3D.

    Cells have the values of their grain: id, kind (0 mobile, 1 glued), mass [kg], velocity [m/s], speed [m/s] and
    angular_velocity [rad/s]. Points are in m, those of a grain about its position in the cell.
    """
    pyvista = library("pyvista", "lsm export --format vtk", "export")
    points, faces, cells, first = [], [], [], 0
    placed = zip(outlines.around_centres(frame.dataset), frame.constant("shape_index"), frame.position, strict=True)
    for vertices, shape, centre in placed:
        corners = _corners(outlines, shape)
        points.append((np.pad(vertices, ((0, 0), (0, 3 - frame.dim))) + centre).astype(np.float32))
        sides = np.full((len(corners), 1), corners.shape[1])
        faces.append(np.hstack([sides, corners + first]).ravel())
        cells.append(len(corners))
        first += len(vertices)
    mesh = pyvista.PolyData(np.concatenate(points), faces=np.concatenate(faces))
    for name, values in _values(frame):
        mesh.cell_data[name] = np.repeat(values, cells, axis=0)
    mesh.field_data["TimeValue"] = [frame.time]
    return mesh


def _corners(outlines: lsm.GrainOutlines, shape: int) -> np.ndarray:
    """Rows of the corners of each cell of a shape: (1, k) of its outline, or (t, 3) of its triangles."""
    found = outlines.shapes[shape]
    return np.arange(len(found))[None] if isinstance(found, np.ndarray) else found.triangles


def _values(frame: Frame) -> Iterator[tuple[str, np.ndarray]]:
    yield "id", frame.grain.astype(np.int32)
    yield "kind", frame.constant("kind").astype(np.int8)
    yield "mass", frame.constant("mass").astype(np.float32)
    yield "velocity", frame.velocity.astype(np.float32)
    yield "speed", frame.speed.astype(np.float32)
    yield "angular_velocity", frame.angular_velocity.astype(np.float32)
