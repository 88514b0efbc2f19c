"""Grain shapes: what a grain's surface is, and the ways to make one. Host code, no kernels."""

from .aggregates import Aggregate, angular_aggregate
from .apparent_stiffness import ApparentStiffness, apparent_stiffness
from .arc_chain import ArcChain, disc, sphere
from .ball_polyhedron import BallPolyhedron
from .base import GrainShape, rescaled
from .clumps import clump, equal_clump, from_chain, outline_error
from .cone_patches import Coverage, PatchGrain, from_patches
from .dilated_balls import ball_of_faces, ball_polyhedron, tangent_ball_polyhedron
from .ellipses import ellipse, superellipse
from .image_outlines import outline_of_image
from .laguerre_tiles import Tile, laguerre_packing, laguerre_tiles
from .mesh_bodies import bodies_of_mesh
from .meshes import Misfit, from_mesh
from .non_convex_meshes import non_convex_mesh
from .non_convex_outlines import PartsMisfit, non_convex_outline
from .outlines import OutlineMisfit, from_outline
from .patch_meshes import SurfaceMesh
from .patch_surfaces import PatchSurface, patch_surface
from .placement import Imported, Placement
from .polygon_fit import arc_chain, from_polygon, regular_disc_of_arcs
from .polyhedra import ellipsoid, from_planes, regular_polyhedron, superellipsoid
from .polyhedral_aggregates import polyhedral_aggregate
from .random_polygons import random_polygons
from .random_polyhedra import random_angular_polyhedra, random_polyhedra
from .rounded_cores import inscribed_balls, rounded_core
from .storage import load_shapes, save_shapes
from .union import Union, crossed_bars, place_part, union, union_and_placement
from .voronoi_grains import random_angular_shapes, regular_polygon, voronoi_packing
from .voronoi_tiles import PolygonMeasures, polygon_measures, voronoi_tiles

GrainShape.from_patches = staticmethod(from_patches)

__all__ = [
    "Aggregate",
    "ApparentStiffness",
    "ArcChain",
    "BallPolyhedron",
    "Coverage",
    "GrainShape",
    "Imported",
    "Misfit",
    "OutlineMisfit",
    "PartsMisfit",
    "PatchGrain",
    "PatchSurface",
    "Placement",
    "PolygonMeasures",
    "SurfaceMesh",
    "Tile",
    "Union",
    "angular_aggregate",
    "apparent_stiffness",
    "arc_chain",
    "ball_of_faces",
    "ball_polyhedron",
    "bodies_of_mesh",
    "clump",
    "crossed_bars",
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
    "inscribed_balls",
    "laguerre_packing",
    "laguerre_tiles",
    "load_shapes",
    "non_convex_mesh",
    "non_convex_outline",
    "outline_error",
    "outline_of_image",
    "patch_surface",
    "place_part",
    "polygon_measures",
    "polyhedral_aggregate",
    "random_angular_polyhedra",
    "random_angular_shapes",
    "random_polygons",
    "random_polyhedra",
    "regular_disc_of_arcs",
    "regular_polygon",
    "regular_polyhedron",
    "rescaled",
    "rounded_core",
    "save_shapes",
    "sphere",
    "superellipse",
    "superellipsoid",
    "tangent_ball_polyhedron",
    "union",
    "union_and_placement",
    "voronoi_packing",
    "voronoi_tiles",
]
