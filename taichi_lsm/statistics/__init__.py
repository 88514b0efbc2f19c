"""Statistics of runs: means with honest errors, and what laboratory protocols ask of their data.

Plain functions on NumPy arrays and xarray objects, without a kernel; docs/statistics.md has their equations.
"""

from .catalogue import BValue, Catalogue, b_value, catalogue_statistics, magnitude_of_completeness
from .cell_images import Cell, cell_of, into_cell
from .contact_fabric import Fabric, fabric
from .cycles import stack_cycles
from .event_energies import event_energies
from .events import detect_events
from .force_networks import force_chains
from .fragment_sizes import FragmentSizes, fragment_dimension, share_below
from .grain_stress import grain_stress
from .healing import Healing, healing_rate
from .height_profiles import profiles
from .nonaffine_motion import d2min
from .rate_and_state import friction_after_step, log_state_after_step, spring_slider
from .resampling import Resampled
from .shear_bands import BoundarySlip, ShearBand, boundary_slip, shear_band
from .steady_means import Estimate, combine_replicas, difference, steady_ratio, steady_state
from .steady_steps import Dilatancy, dilatancy_coefficient, steady_rate_dependence
from .velocity_step_fit import LawComparison, StepFit, compare_laws, fit_velocity_step
from .work_shares import work_by_stage, work_partition

__all__ = [
    "BValue",
    "BoundarySlip",
    "Catalogue",
    "Cell",
    "Dilatancy",
    "Estimate",
    "Fabric",
    "FragmentSizes",
    "Healing",
    "LawComparison",
    "Resampled",
    "ShearBand",
    "StepFit",
    "b_value",
    "boundary_slip",
    "catalogue_statistics",
    "cell_of",
    "combine_replicas",
    "compare_laws",
    "d2min",
    "detect_events",
    "difference",
    "dilatancy_coefficient",
    "event_energies",
    "fabric",
    "fit_velocity_step",
    "force_chains",
    "fragment_dimension",
    "friction_after_step",
    "grain_stress",
    "healing_rate",
    "into_cell",
    "log_state_after_step",
    "magnitude_of_completeness",
    "profiles",
    "share_below",
    "shear_band",
    "spring_slider",
    "stack_cycles",
    "steady_rate_dependence",
    "steady_ratio",
    "steady_state",
    "work_by_stage",
    "work_partition",
]
