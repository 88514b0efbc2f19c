"""What of a sheared layer is as in the laboratory, and what is scaled so that a run ends.

Laboratory: glass, E = 70 GPa, whose layers of some mm are sheared at 10 um/s. By Hertz its stiffness number is about
(E/P)^(2/3) at the normal stress P; its inertial number is I = (v/h) d sqrt(rho/P). Sources: Mair, Frye and Marone
(2002), doi:10.1029/2001JB000516, for the layers; Knuth and Marone (2007), doi:10.1029/2006GC001327, for the velocity.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from workflows.common.metrics import read_summary
from workflows.report.configuration import Given
from workflows.report.parts import Section, Table

GLASS = 70e9  # Young's modulus [Pa]
VELOCITY = 10e-6  # of the shear in the laboratory [m s-1]
NEEDED = ("smallest_diameter", "largest_diameter", "density", "normal_stress", "layer")
HEAD = ("quantity", "this run", "laboratory", "what it means")
SOURCES = (
    "Laboratory: glass (E = 70 GPa) in layers of 2 to 3 mm (Mair, Frye and Marone 2002), sheared at 10 µm/s (Knuth and "
    "Marone 2007). A friction value holds if it stays at ten times the stiffness number and at a third of the inertial "
    "number."
)


def scaling(folder: Path, given: Given) -> Section:
    """Stiffness, rate and size of a sheared layer beside those of the laboratory; empty of other experiments."""
    section, params = Section("scaling", "What is scaled"), given.params
    if params is None or not all(hasattr(params, name) for name in NEEDED):
        return section
    section.tables.append(Table("This run and the laboratory", HEAD, _rows(folder, params), texts=frozenset({3})))
    section.texts.append(SOURCES)
    return section


def _rows(folder: Path, params: Any) -> list[tuple[str, ...]]:
    """The rows of the table; numbers that were measured win over those that were asked for."""
    d, stress = 0.5 * (params.smallest_diameter + params.largest_diameter), params.normal_stress
    thickness, lengths = params.layer
    inertial_time = d * math.sqrt(params.density / stress)
    rows = [("dimension", f"{params.dim}D", "3D", "in 2D grains do not move sideways: discs are weaker than beads")]
    kappa = _number(folder, params, "stiffness_number")
    if kappa:
        glass = (GLASS / stress) ** (2.0 / 3.0)
        rows.append(("stiffness number κ", f"{kappa:.4g}", f"{glass:.3g}", "overlaps are about a diameter over κ"))
    number = _number(folder, params, "inertial_number")
    if number:
        real = VELOCITY / thickness * inertial_time
        faster = f"the shear is {number / real:.1g} times as fast as it would be there, relative to inertia"
        rows.append(("inertial number I", f"{number:.3g}", f"{real:.2g}", faster))
        velocity = number * thickness / inertial_time
        rows.append(("velocity of the shear", f"{velocity:.3g} m/s", f"{VELOCITY:.0e} m/s", "follows from I"))
    sizes = dict.fromkeys(f"{1e6 * size:.4g}" for size in (params.smallest_diameter, params.largest_diameter))
    rows.append(("grain diameters", f"{' to '.join(sizes)} µm", "as given", "not scaled"))
    rows.append(("normal stress", f"{stress / 1e6:.4g} MPa", "as given", "not scaled"))
    rows.append(("thickness", f"{1e3 * thickness:.3g} mm", "2 to 3 mm", f"{thickness / d:.3g} mean diameters"))
    across = " by ".join(f"{1e3 * length:.3g}" for length in lengths)
    rows.append(("size along the layer", f"{across} mm", "far larger", "periodic, so that it has no ends"))
    return rows


def _number(folder: Path, params: Any, name: str) -> float | None:
    """A dimensionless number as it was measured, else as it was asked for."""
    entry = (read_summary(folder) or {"metrics": {}})["metrics"].get(name)
    measured = entry.get("value") if isinstance(entry, dict) else None
    asked_for = None if name in params.idle() else getattr(params, name, None)
    value = asked_for if measured is None else measured
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None
