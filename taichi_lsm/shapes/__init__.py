"""Grain shapes: what a grain's surface is, and the ways to make one. Host code, no kernels."""

from .aggregates import Aggregate, angular_aggregate
from .arc_chain import ArcChain, disc, sphere
from .ball_polyhedron import BallPolyhedron, ball_of_faces, ball_polyhedron, tangent_ball_polyhedron
from .base import GrainShape, rescaled
from .cone_patches import PatchGrain, clump, equal_clump, from_chain, from_patches, outline_error
from .ellipses import ellipse, superellipse
from .laguerre_tiles import laguerre_packing, laguerre_tiles
from .meshes import Misfit, from_mesh
from .outlines import from_outline, outline_of_image
from .polygon_fit import arc_chain, from_polygon, regular_disc_of_arcs
from .polyhedra import (
    ellipsoid,
    from_planes,
    random_angular_polyhedra,
    random_polyhedra,
    regular_polyhedron,
    superellipsoid,
)
from .random_polygons import random_polygons
from .storage import load_shapes, save_shapes
from .union import Union, cross, placed, union
from .voronoi_grains import random_angular_shapes, regular_polygon, voronoi_packing
from .voronoi_tiles import PolygonMeasures, polygon_measures, voronoi_tiles

# the seed's constructor by its natural name; the base class itself cannot know its subclasses
GrainShape.from_patches = staticmethod(from_patches)

__all__ = [
    "Aggregate",
    "ArcChain",
    "BallPolyhedron",
    "GrainShape",
    "Misfit",
    "PatchGrain",
    "PolygonMeasures",
    "Union",
    "angular_aggregate",
    "arc_chain",
    "ball_of_faces",
    "ball_polyhedron",
    "clump",
    "cross",
    "disc",
    "ellipse",
    "ellipsoid",
    "equal_clump",
    "from_chain",
    "from_mesh",
    "from_outline",
    "from_patches",
    "from_planes",
    "from_polygon",
    "laguerre_tiles",
    "load_shapes",
    "outline_error",
    "outline_of_image",
    "voronoi_packing",
    "laguerre_packing",
    "placed",
    "polygon_measures",
    "random_angular_polyhedra",
    "random_polygons",
    "random_polyhedra",
    "random_angular_shapes",
    "regular_disc_of_arcs",
    "regular_polygon",
    "regular_polyhedron",
    "rescaled",
    "save_shapes",
    "sphere",
    "superellipse",
    "superellipsoid",
    "tangent_ball_polyhedron",
    "union",
    "voronoi_tiles",
]
