"""The contact geometry that a set of shapes needs: one per scene, and none for spheres."""

from collections.abc import Sequence
from typing import Any

from ..core.errors import InputError
from .arc_chains import ChainTable
from .cone_patches import ConeTable
from .polyhedron_table import PolyhedronTable

TABLES = {"chain": ChainTable, "polyhedron": PolyhedronTable, "cones": ConeTable}


def kind_of(shapes: Sequence[Any]) -> str:
    """Kind of contact geometry that the shapes of a scene need.

    Parameters
    ----------
    shapes : sequence of GrainShape
        Shapes of the scene; discs and spheres go with every kind.

    Returns
    -------
    str
        "sphere", "chain", "polyhedron" or "cones".

    Raises
    ------
    InputError
        If the shapes need different kinds.
    """
    examples: dict[str, str] = {}  # name of the first shape of each kind, for the message
    for shape in shapes:
        # A single patch is a full sphere, except among general cones, where its cone may be narrower.
        if shape.patch_count > 1 or shape.kind == "cones":
            examples.setdefault(shape.kind, shape.name)
    if len(examples) > 1:
        raise InputError(
            f"Scene.shapes: kinds {examples}, must all be of one kind; only discs and spheres may be added"
        )
    return next(iter(examples), "sphere")


def surface_table(kind: str, shapes: Sequence[Any]) -> ChainTable | PolyhedronTable | ConeTable | None:
    """Device table of all parts of the shapes of this kind; None for spheres."""
    return None if kind == "sphere" else TABLES[kind]([part for shape in shapes for part in shape.parts])
