"""A layer sheared between two platens: its stresses, strain, porosity and closed energy budget, row by row."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..bonds.bond_setup import bond_areas
from ..bonds.fragments import fragments
from ..boundaries.platen_drives import ServoStress, SpringLoadPoint
from ..boundaries.stress_drives import ServoWithSpring, VelocityOrStress
from ..core.allocation import read
from ..core.errors import InputError, SimulationError
from .layer_memory import LayerMemory
from .layer_rows import layer_rows
from .sheared_grains import Row, ShearedGrains
from .wall_rows import wall_sums, wall_variables

if TYPE_CHECKING:
    from ..boundaries.platens import Platens
    from ..core.schema import Variable
    from ..simulation import Simulation

MARGIN = 3.0  # diameters kept from the platens where bulk stress is measured


class ShearedLayer(ShearedGrains):
    """Measures the layer between platens 0 (bottom) and 1 (top) of a simulation; y is the normal axis, x the shear.

    Stresses, counts and porosity of a row are means over the samples since the last row; platen stresses are means
    over every step; energies are those of the last sample.

    Parameters
    ----------
    sim
        A simulation with two platens whose scene tracks dissipation.
    target_stress
        Normal stress [Pa] > 0 that the servo is to keep, compression positive.
    diameter
        Mean equivalent diameter d [m] > 0 of the mobile grains; sets the margin at the platens and the inertial number.

    Raises
    ------
    InputError
        For another scene or values that are not positive.

    Notes
    -----
    Bulk stresses are taken at least 3 d from the platens (a third of a thin layer), with the kinetic part relative to a
    linear velocity profile. Shear strain is the sum over samples of dD/h, of the increment of the displacement and the
    mean thickness of that time: sliding may be as uneven as it likes. The inertial number is I = (v/h) d sqrt(rho/P),
    v/h the mean shear rate since the last row.
    """

    def __init__(self, sim: Simulation, target_stress: float, diameter: float) -> None:
        super().__init__(sim, target_stress, diameter)
        self.platens = platens = two_platens(sim)
        scene = sim.scene
        self.area = platens.area
        along, normal = platens.drives[1][:2]
        self.sprung = isinstance(along, SpringLoadPoint)
        self.pushed, self.confined = isinstance(along, VelocityOrStress), isinstance(normal, ServoWithSpring)
        self.bond_area = bond_areas(scene) if sim.bonds else np.empty(0)
        # Reference planes: mean innermost surface of the glued grains, fixed to each platen.
        radius = scene.per_grain("bounding_radius")
        inner = [scene.position[:, 1] + radius, scene.position[:, 1] - radius]
        self.plane = [float(inner[p][scene.platen_index == p].mean()) for p in (0, 1)]
        now = platens.snapshot()
        bottom, top = self._planes(now)
        self.memory = LayerMemory(
            time=sim.time,
            displacement=shear_displacement(now),
            thickness=top - bottom,
            works=self.works(now),
            row_step=sim.step,
            row_platens=now,
            row_walls=wall_sums(sim),
        )
        self.sample()
        self.memory.first_residual = self.memory.residual

    @property
    def variables(self) -> list[Variable]:
        """Schema rows of run.nc."""
        rows = layer_rows(self.sim.spec.bonds > 0, self.sprung, self.pushed, self.confined)
        return rows + wall_variables(self.sim)

    def _planes(self, platens: Mapping[str, npt.NDArray]) -> tuple[float, float]:
        """Heights of the reference planes of the bottom and of the top platen [m]."""
        bottom, top = (self.plane[p] + float(platens["displacement"][p, 1]) for p in (0, 1))
        if not top > bottom:
            raise SimulationError(f"step {self.sim.step}: the layer's thickness is {top - bottom:g} m, the platens met")
        return bottom, top

    def _sample(self) -> None:
        sim, memory = self.sim, self.memory
        memory.platens = platens = self.platens.snapshot()
        bottom, top = self._planes(platens)
        thickness, velocity = top - bottom, platens["velocity"]
        # Stress in the slab between the margins, its kinetic part relative to a linear profile between the platens.
        margin = min(MARGIN * self.diameter, thickness / 3)
        shear_velocity = float(velocity[1, 0] - velocity[0, 0])
        gradient = shear_velocity / thickness
        volume = self.area * (thickness - 2 * margin)
        at_low = velocity[0, 0] + gradient * margin
        sums = sim.measure.sums(bottom + margin, top - margin, volume, at_low, gradient)
        # Strain by what the platens moved since the last sample, however unevenly, over the thickness of that time.
        moved = shear_displacement(platens) - memory.displacement
        memory.strain += moved / (0.5 * (memory.thickness + thickness))
        memory.slip += moved
        memory.displacement, memory.thickness = shear_displacement(platens), thickness
        lost = float(platens["dissipated"].sum())
        self._add_sample(sums, platens, lost, thickness=thickness, shear_velocity=shear_velocity)

    @property
    def target(self) -> float:
        """Normal stress that the servo keeps [Pa], with a spring behind it that of the last sample.

        The one that was given where the top platen has no servo.
        """
        drive = self.platens.drives[1][1]
        if isinstance(drive, ServoWithSpring):
            return drive.stress_at(float(self.memory.platens["stretch"][1, 1]))
        return drive.stress if isinstance(drive, ServoStress) else self._target

    @property
    def imposed_shear_stress(self) -> float:
        """Shear stress that is imposed on the top platen now [Pa]; nan where its velocity is."""
        stress = getattr(self.platens.drives[1][0], "stress", None)
        return float("nan") if stress is None else stress

    @staticmethod
    def works(drives: Mapping[str, Any]) -> npt.NDArray:
        """Work of the shear drive and of the normal drive since the start [J], of a snapshot of the platens."""
        work = drives["work"].sum(axis=0)
        return np.array([work.sum() - work[1], work[1]])

    def _own_row(self, mean: Callable[[str], float]) -> Row:
        sim, memory, now = self.sim, self.memory, self.memory.platens
        contact, off_target = self._platen_stress(now)
        velocity = self._mean_velocity()
        rate = velocity / mean("thickness")
        driven = self.platens.load_velocity(now["velocity"])
        row = {
            "platen_shear_stress": -float(contact[0]),
            "platen_normal_stress": float(contact[1]),
            "platen_normal_rms": off_target,
            "layer_thickness": mean("thickness"),
            "porosity": 1.0 - self.solid_volume / (self.area * mean("thickness")),
            "plate_velocity": velocity,
            "instantaneous_plate_velocity": memory.samples[-1]["shear_velocity"],
            "load_point_velocity": float(driven[1, 0] - driven[0, 0]),
            "inertial_number": self._inertial_number(rate),
        }
        row |= self._of_drives(now)
        if sim.bonds:
            row["bond_count"] = int(memory.samples[-1]["bond_count"])
            row["fracture_area"] = float(self.bond_area[read(sim.bonds.intact) == 0].sum())
            row["fragment_count"] = len(np.unique(fragments(sim)[self.mobile]))
        return row

    def _of_drives(self, now: Mapping[Any, npt.NDArray]) -> Row:
        """What a row has of other drives than the usual ones."""
        row: Row = {}
        if self.sprung:
            row["spring_stretch"] = float(now["stretch"][1, 0])
        if self.pushed:
            row["imposed_shear_stress"] = self.imposed_shear_stress
        if self.confined:
            row["servo_stress"] = self.target
        return row

    def _mean_velocity(self) -> float:
        """Velocity of the platens against each other along the shear since the last row [m s-1]; at no time, now."""
        memory, elapsed = self.memory, self.sim.time - self.memory.time
        moved = memory.displacement - shear_displacement(memory.row_platens)
        return moved / elapsed if elapsed > 0 else memory.samples[-1]["shear_velocity"]

    def _platen_stress(self, now: Mapping[Any, npt.NDArray]) -> tuple[npt.NDArray, float]:
        """Stress (dim,) on the top platen and root mean square of its normal component off the target [Pa].

        Both over every step since the last row, from sums that the platens add up in each step.
        """
        steps, before = max(1, self.sim.step - self.memory.row_step), self.memory.row_platens
        contact = (now["force_sum"] - before["force_sum"])[1] / steps / self.area
        square = (now["force_square_sum"] - before["force_square_sum"])[1, 1] / steps
        return contact, self._off_target(contact[1], square / self.area**2)


def shear_displacement(platens: Mapping[str, npt.NDArray]) -> float:
    """Displacement of the top platen against the bottom one along the shear [m], of a snapshot of the platens."""
    return float(platens["displacement"][1, 0] - platens["displacement"][0, 0])


def two_platens(sim: Simulation) -> Platens:
    """The platens of a simulation of a layer; InputError if there are not two."""
    if sim.platens is None or sim.platens.count != 2:
        count = 0 if sim.platens is None else sim.platens.count
        raise InputError(f"Scene.platens: {count}, must be 2 for a sheared layer: the bottom and the top one")
    return sim.platens
