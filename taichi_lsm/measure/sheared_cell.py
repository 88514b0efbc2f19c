"""A homogeneously sheared cell: its stresses, strain, porosity and closed energy budget, row by row."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError
from .layer_memory import LayerMemory
from .layer_rows import cell_rows
from .sheared_grains import Row, ShearedGrains

if TYPE_CHECKING:
    from ..core.schema import Variable
    from ..simulation import Simulation


class ShearedCell(ShearedGrains):
    """Measures the grains of a simulation whose cell has a servo; x is the shear, y the normal axis.

    Stresses, counts and porosity of a row are means over the samples since the last row; `cell_normal_stress` is the
    mean over every step; energies are those of the last sample.

    Parameters
    ----------
    sim
        A simulation with `Scene.cell_servo` whose scene tracks dissipation.
    target_stress
        Normal stress [Pa] > 0 that the servo is to keep, compression positive.
    diameter
        Mean equivalent diameter d [m] > 0 of the grains; sets the inertial number.

    Raises
    ------
    InputError
        For another scene or values that are not positive.

    Notes
    -----
    All stresses are of the whole cell and have the kinetic part, of velocities relative to the mean flow: a homogeneous
    cell has neither platens nor a profile. Shear strain is that of the cell. The inertial number is
    I = rate d sqrt(rho/P), with the mean rate since the last row.
    """

    def __init__(self, sim: Simulation, target_stress: float, diameter: float) -> None:
        super().__init__(sim, target_stress, diameter)
        if not sim.spec.cell_servo:
            raise InputError("Scene.cell_servo: none, must be a CellServo for a ShearedCell; see CellServo")
        self.area = sim.scene.platen_area()
        now = self._drives(0.0)
        self.memory = LayerMemory(
            time=sim.time,
            displacement=now["shift"],
            thickness=now["height"],
            works=self.works(now),
            row_step=sim.step,
            row_platens=now,
        )
        self.memory.platens = now
        self.sample()
        self.memory.first_residual = self.memory.residual

    @property
    def variables(self) -> list[Variable]:
        """Schema rows of run.nc."""
        return cell_rows()

    def _drives(self, shear_work: float) -> dict[str, Any]:
        """Snapshot of the height, with the work of the shear [J]."""
        return self.sim.domain.snapshot() | {"shear_work": shear_work}

    def _sample(self) -> None:
        memory, sums = self.memory, self.sim.measure.sums()
        before, now = memory.platens, self._drives(sums["shear_work"])
        memory.platens = now
        memory.strain += now["strain"] - before["strain"]
        memory.slip += now["shift"] - before["shift"]
        memory.displacement, memory.thickness = now["shift"], now["height"]
        stress = sums["stress"]
        self._add_sample(sums, None, now["dissipated"], thickness=now["height"], along=float(stress[0, 0]))

    @property
    def target(self) -> float:
        """Normal stress that the servo keeps now [Pa]."""
        return self.sim.domain.servo.stress

    @staticmethod
    def works(drives: Mapping[str, Any]) -> npt.NDArray:
        """Work of the shear and of the normal stress since the start [J], of a snapshot of the cell."""
        return np.array([drives["shear_work"], drives["work"]])

    def _own_row(self, mean: Callable[[str], float]) -> Row:
        memory, now, before = self.memory, self.memory.platens, self.memory.row_platens
        steps, elapsed = max(1, self.sim.step - memory.row_step), self.sim.time - memory.time
        # Over every step since the last row, from sums that the cell adds up in each of them.
        normal = (now["force_sum"] - before["force_sum"]) / steps / self.area
        square = (now["force_square_sum"] - before["force_square_sum"]) / steps / self.area**2
        rate = (now["strain"] - before["strain"]) / elapsed if elapsed > 0 else 0.0
        return {
            "normal_stress_along": mean("along"),
            "cell_normal_stress": normal,
            "cell_normal_rms": self._off_target(normal, square),
            "cell_height": mean("thickness"),
            "porosity": 1.0 - self.solid_volume / (self.area * mean("thickness")),
            "shear_rate": rate,
            "inertial_number": self._inertial_number(rate),
        }

    def _at_play(self, last: Mapping[str, Any]) -> float:
        """Also the energy of the motion: grains at constant volume may hardly touch."""
        return last["elastic_energy"] + last["translational_energy"] + last["rotational_energy"]

    @property
    def solid_fraction(self) -> float:
        """Share of the cell filled by grains [1] at the last sample."""
        return self.solid_volume / (self.area * self.memory.thickness)
