"""Lattice Solid Model of granular matter with real grain shapes, after Abe & Mora (2003).

    import taichi_lsm as lsm

Every public name has one home: a namespace, or this module for what belongs to none.

lsm.shapes
    Grain shapes and the ways to make them: discs, spheres, polygons, polyhedra, meshes, Voronoi packings.
lsm.effects
    What acts on the grains: contact forces, friction, body forces, damping, bonds.
lsm.statistics
    Means with standard errors of the time series of a run, and what laboratory protocols ask of them: rate and state,
    events, healing, profiles, fabric, work.
lsm
    Scene and Simulation; integrators; platens, their drives and plane walls; start packings; energies and other
    measures; files; errors.

The ten names that most scripts need are all at the top: Scene, Simulation, open_run, and from the namespaces disc,
sphere, LinearElastic, ViscousDamping, CoulombFriction, Gravity and steady_state. So are the analyses of what open_run
gives: profiles, shear_band, fabric, force_chains and d2min.

Names are imported when they are first used: Taichi is loaded only when something is simulated.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # what `__getattr__` finds, for type checkers and editors
    from . import effects as effects
    from . import shapes as shapes
    from . import statistics as statistics
    from .bonds.fragments import fragments as fragments
    from .boundaries.cell_servo import CellServo as CellServo
    from .boundaries.platen_drives import ConstantVelocity as ConstantVelocity
    from .boundaries.platen_drives import Fixed as Fixed
    from .boundaries.platen_drives import ServoStress as ServoStress
    from .boundaries.platen_drives import SpringLoadPoint as SpringLoadPoint
    from .boundaries.platens import Platen as Platen
    from .boundaries.stress_drives import ServoWithSpring as ServoWithSpring
    from .boundaries.stress_drives import VelocityOrStress as VelocityOrStress
    from .boundaries.wall_servo import WallServo as WallServo
    from .boundaries.wall_setup import PlaneWall as PlaneWall
    from .core.data_files import data_path as data_path
    from .core.data_files import published_friction as published_friction
    from .core.errors import InputError as InputError
    from .core.errors import SimulationError as SimulationError
    from .core.memory import machine_memory as machine_memory
    from .core.netcdf_input import opened_netcdf as opened_netcdf
    from .core.runtime import check_arch as check_arch
    from .core.schema import Variable as Variable
    from .core.whole_files import replacing as replacing
    from .dense_start import dense_packing as dense_packing
    from .effects.coulomb_friction import CoulombFriction as CoulombFriction
    from .effects.gravity import Gravity as Gravity
    from .effects.linear_elastic import LinearElastic as LinearElastic
    from .effects.viscous_damping import ViscousDamping as ViscousDamping
    from .io import checkpoints as checkpoints
    from .io.checkpoint_file import restore_checkpoint as restore_checkpoint
    from .io.checkpoint_file import save_checkpoint as save_checkpoint
    from .io.effect_table import read_effects as read_effects
    from .io.folder_lock import holder_of as holder_of
    from .io.folder_lock import locked as locked
    from .io.global_attributes import file_attributes as file_attributes
    from .io.grain_outlines import GrainOutlines as GrainOutlines
    from .io.grain_outlines import outlines as outlines
    from .io.layer_recorder import LayerRecorder as LayerRecorder
    from .io.netcdf_variables import Scalar as Scalar
    from .io.open_run import by_row as by_row
    from .io.open_run import open_run as open_run
    from .io.open_run import open_runs as open_runs
    from .io.open_run import opened_run as opened_run
    from .io.open_sweep import open_sweep as open_sweep
    from .io.run_file import RunWriter as RunWriter
    from .io.run_file import write_energies as write_energies
    from .io.run_file import write_table as write_table
    from .measure.contact_stiffness import contact_stiffness as contact_stiffness
    from .measure.energy_budget import Energies as Energies
    from .measure.energy_budget import energies as energies
    from .measure.fragment_catalogue import fragment_catalogue as fragment_catalogue
    from .measure.profiling import runtime_profile as runtime_profile
    from .measure.profiling import runtime_profile_text as runtime_profile_text
    from .measure.shadow_energy import ShadowEnergy as ShadowEnergy
    from .measure.sheared_cell import ShearedCell as ShearedCell
    from .measure.sheared_grains import ShearedGrains as ShearedGrains
    from .measure.sheared_layer import ShearedLayer as ShearedLayer
    from .measure.wall_rows import WallSeries as WallSeries
    from .packing import grain_diameters as grain_diameters
    from .packing import loose_packing as loose_packing
    from .packing import random_rotations as random_rotations
    from .packing import rough_platen as rough_platen
    from .scene import Scene as Scene
    from .shapes import disc as disc
    from .shapes import sphere as sphere
    from .simulation import Simulation as Simulation
    from .statistics import d2min as d2min
    from .statistics import fabric as fabric
    from .statistics import force_chains as force_chains
    from .statistics import profiles as profiles
    from .statistics import shear_band as shear_band
    from .statistics import steady_state as steady_state
    from .statistics.contact_moments import contacts_at as contacts_at
    from .stepping.euler import ExplicitEuler as ExplicitEuler
    from .stepping.euler import SymplecticEuler as SymplecticEuler
    from .stepping.forest_ruth import ForestRuth as ForestRuth
    from .stepping.guards import Guards as Guards
    from .stepping.kernel_spec import KernelSpec as KernelSpec
    from .stepping.verlet import OnsetVerlet as OnsetVerlet
    from .stepping.verlet import VelocityVerlet as VelocityVerlet

__version__ = "0.1.0"

_NAMESPACES = {
    "effects": "effects",
    "shapes": "shapes",
    "statistics": "statistics",
    "checkpoints": "io.checkpoints",
}
_HOME = {
    "Scene": "scene",
    "Simulation": "simulation",
    "Guards": "stepping.guards",
    "KernelSpec": "stepping.kernel_spec",
    "Energies": "measure.energy_budget",
    "energies": "measure.energy_budget",
    "ShadowEnergy": "measure.shadow_energy",
    "OnsetVerlet": "stepping.verlet",
    "VelocityVerlet": "stepping.verlet",
    "SymplecticEuler": "stepping.euler",
    "ExplicitEuler": "stepping.euler",
    "ForestRuth": "stepping.forest_ruth",
    "CellServo": "boundaries.cell_servo",
    "Platen": "boundaries.platens",
    "Fixed": "boundaries.platen_drives",
    "ConstantVelocity": "boundaries.platen_drives",
    "ServoStress": "boundaries.platen_drives",
    "PlaneWall": "boundaries.wall_setup",
    "WallServo": "boundaries.wall_servo",
    "SpringLoadPoint": "boundaries.platen_drives",
    "ServoWithSpring": "boundaries.stress_drives",
    "VelocityOrStress": "boundaries.stress_drives",
    "fragments": "bonds.fragments",
    "fragment_catalogue": "measure.fragment_catalogue",
    "grain_diameters": "packing",
    "dense_packing": "dense_start",
    "loose_packing": "packing",
    "random_rotations": "packing",
    "rough_platen": "packing",
    "ShearedCell": "measure.sheared_cell",
    "ShearedGrains": "measure.sheared_grains",
    "ShearedLayer": "measure.sheared_layer",
    "GrainOutlines": "io.grain_outlines",
    "outlines": "io.grain_outlines",
    "WallSeries": "measure.wall_rows",
    "LayerRecorder": "io.layer_recorder",
    "RunWriter": "io.run_file",
    "holder_of": "io.folder_lock",
    "locked": "io.folder_lock",
    "runtime_profile": "measure.profiling",
    "runtime_profile_text": "measure.profiling",
    "save_checkpoint": "io.checkpoint_file",
    "restore_checkpoint": "io.checkpoint_file",
    "contact_stiffness": "measure.contact_stiffness",
    "contacts_at": "statistics.contact_moments",
    "read_effects": "io.effect_table",
    "Scalar": "io.netcdf_variables",
    "write_table": "io.run_file",
    "file_attributes": "io.global_attributes",
    "write_energies": "io.run_file",
    "by_row": "io.open_run",
    "open_run": "io.open_run",
    "open_runs": "io.open_run",
    "opened_run": "io.open_run",
    "open_sweep": "io.open_sweep",
    "published_friction": "core.data_files",
    "data_path": "core.data_files",
    "InputError": "core.errors",
    "SimulationError": "core.errors",
    "Variable": "core.schema",
    "check_arch": "core.runtime",
    "machine_memory": "core.memory",
    "opened_netcdf": "core.netcdf_input",
    "replacing": "core.whole_files",
}
# The most used names of the namespaces, here as well.
_SHORTCUTS = {
    "CoulombFriction": "effects.coulomb_friction",
    "Gravity": "effects.gravity",
    "LinearElastic": "effects.linear_elastic",
    "ViscousDamping": "effects.viscous_damping",
    "disc": "shapes",
    "sphere": "shapes",
    "steady_state": "statistics",
    "d2min": "statistics",
    "fabric": "statistics",
    "force_chains": "statistics",
    "profiles": "statistics",
    "shear_band": "statistics",
}

__all__ = sorted(["__version__", *_NAMESPACES, *_HOME, *_SHORTCUTS])


if not TYPE_CHECKING:  # else type checkers would take any name for granted

    def __getattr__(name: str) -> object:
        if name in _NAMESPACES:
            return importlib.import_module(f".{_NAMESPACES[name]}", __name__)
        home = _HOME.get(name) or _SHORTCUTS.get(name)
        if home is None:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(importlib.import_module(f".{home}", __name__), name)


def __dir__() -> list[str]:
    return __all__
