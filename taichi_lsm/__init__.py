"""Lattice Solid Model of granular matter with real grain shapes, after Abe & Mora (2003).

Public names are imported when first used: Taichi is loaded only when something is simulated.
"""

import importlib

__version__ = "0.1.0"

_HOME = {
    "Scene": "scene",
    "Simulation": "simulation",
    "ShadowEnergy": "shadow",
    "OnsetVerlet": "integrators",
    "VelocityVerlet": "integrators",
    "SymplecticEuler": "euler",
    "ExplicitEuler": "euler",
    "Platen": "drives",
    "Fixed": "drives",
    "ConstantVelocity": "drives",
    "ServoStress": "drives",
    "PlaneWall": "walls",
    "SpringLoadPoint": "drives",
    "LinearElastic": "effects.linear_elastic",
    "Hertz": "effects.hertz",
    "CoulombFriction": "effects.coulomb_friction",
    "VelocityWeakeningFriction": "effects.velocity_weakening_friction",
    "RateAndStateFriction": "effects.rate_and_state_friction",
    "Mindlin": "effects.mindlin",
    "ViscousDamping": "effects.viscous_damping",
    "Gravity": "effects.gravity",
    "RollingResistance": "effects.rolling_resistance",
    "Cohesion": "effects.cohesion",
    "GlobalDamping": "effects.global_damping",
    "find_effects": "effects",
    "make_effects": "effects",
    "ElasticBrittleBond": "effects.elastic_brittle_bond",
    "fragments": "bonds",
    "GrainShape": "shapes",
    "ArcChain": "shapes",
    "disc": "shapes",
    "sphere": "shapes",
    "arc_chain": "shapes",
    "from_polygon": "shapes",
    "regular_disc_of_arcs": "shapes",
    "random_angular_shapes": "shapes",
    "pave": "shapes",
    "angular_aggregate": "shapes",
    "PatchGrain": "shapes",
    "Union": "shapes",
    "from_chain": "shapes",
    "clump": "shapes",
    "from_patches": "shapes",
    "equal_clump": "shapes",
    "outline_error": "shapes",
    "union": "shapes",
    "from_mesh": "shapes",
    "from_outline": "shapes",
    "outline_of_image": "shapes",
    "ellipse": "shapes",
    "superellipse": "shapes",
    "regular_polygon": "shapes",
    "load_shapes": "shapes",
    "save_shapes": "shapes",
    "rescaled": "shapes",
    "placed": "shapes",
    "cross": "shapes",
    "pave_volume": "shapes",
    "BallPolyhedron": "shapes",
    "ball_polyhedron": "shapes",
    "tangent_ball_polyhedron": "shapes",
    "ball_of_faces": "shapes",
    "from_planes": "shapes",
    "ellipsoid": "shapes",
    "superellipsoid": "shapes",
    "regular_polyhedron": "shapes",
    "random_angular_polyhedra": "shapes",
    "random_polygons": "shapes",
    "random_polyhedra": "shapes",
    "laguerre_tiles": "shapes",
    "grain_diameters": "packing",
    "loose_packing": "packing",
    "random_rotations": "packing",
    "rough_platen": "packing",
    "ShearedLayer": "layer",
    "LayerRecorder": "recording",
    "profile": "profiling",
    "profile_text": "profiling",
    "save_checkpoint": "checkpoint",
    "restore_checkpoint": "checkpoint",
    "write_table": "output",
    "file_attributes": "output",
    "write_energies": "energy_file",
    "steady_state": "analysis",
    "steady_ratio": "analysis",
    "combine_replicas": "analysis",
    "difference": "analysis",
    "open_run": "analysis",
    "references": "analysis",
    "data_path": "paths",
    "InputError": "errors",
    "SimulationError": "errors",
    "Variable": "schema",
}

__all__ = ["__version__", *_HOME]


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)


def __dir__():
    return sorted(__all__)
