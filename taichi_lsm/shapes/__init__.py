"""Grain shapes: what a grain's surface is, and the ways to make one. Host code, no kernels."""

from .arc_chain import arc_chain, from_polygon, regular_disc_of_arcs
from .grain import GrainShape
from .library import random_angular_shapes
from .patch import ArcChain, disc, sphere
from .paving import pave
from .tiling import PolygonMeasures, polygon_measures, voronoi_tiles

__all__ = [
    "ArcChain",
    "GrainShape",
    "PolygonMeasures",
    "arc_chain",
    "disc",
    "from_polygon",
    "pave",
    "polygon_measures",
    "random_angular_shapes",
    "regular_disc_of_arcs",
    "sphere",
    "voronoi_tiles",
]
