"""Grain shapes: what a grain's surface is, and the ways to make one. Host code, no kernels."""

from .arc_chain import arc_chain, from_polygon, regular_disc_of_arcs
from .ball_polyhedron import BallPolyhedron, ball_of_faces, ball_polyhedron, tangent_ball_polyhedron
from .grain import GrainShape
from .library import random_angular_shapes
from .patch import ArcChain, disc, sphere
from .paving import pave, pave_volume
from .polyhedra import ellipsoid, from_planes, random_angular_polyhedra, regular_polyhedron, superellipsoid
from .tiling import PolygonMeasures, polygon_measures, voronoi_tiles

__all__ = [
    "ArcChain",
    "BallPolyhedron",
    "GrainShape",
    "PolygonMeasures",
    "arc_chain",
    "ball_of_faces",
    "ball_polyhedron",
    "disc",
    "ellipsoid",
    "from_planes",
    "from_polygon",
    "pave",
    "pave_volume",
    "polygon_measures",
    "random_angular_polyhedra",
    "random_angular_shapes",
    "regular_disc_of_arcs",
    "regular_polyhedron",
    "sphere",
    "superellipsoid",
    "tangent_ball_polyhedron",
    "voronoi_tiles",
]
