"""Which contact geometry a set of shapes needs; a scene has one, and spheres need none."""

from ..core.errors import InputError
from .arc_chains import ChainTable
from .ball_polyhedra import PolyhedronTable
from .cone_patches import ConeTable

TABLES = {"chain": ChainTable, "polyhedron": PolyhedronTable, "cones": ConeTable}
CURVED = ("sphere", "chain")  # kinds with one radius of curvature at every contact


def kind_of(shapes):
    """Sphere | chain | polyhedron | cones. Discs and spheres go with every kind. Raises InputError for a mixture."""
    first = {}
    for shape in shapes:
        if shape.patch_count > 1 or shape.kind == "cones":  # the cone of a single patch need not be all directions
            first.setdefault(shape.kind, shape.name)
    if len(first) > 1:
        raise InputError(f"Scene.shapes: surfaces of different kinds cannot meet, but there are {first}")
    return next(iter(first), "sphere")


def surface_table(kind, shapes):
    """The device table of all parts of the shapes; None for spheres."""
    return None if kind == "sphere" else TABLES[kind]([part for shape in shapes for part in shape.parts])
