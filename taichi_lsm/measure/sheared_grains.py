"""Grains in shear, in a layer or in a cell: what both measure from sample to sample, with a closed energy budget."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError, SimulationError
from .contact_stiffness import contact_stiffness
from .energy_budget import energies, wall_servo_energies
from .layer_memory import LayerMemory
from .wall_rows import wall_coordinates, wall_row, wall_sums

if TYPE_CHECKING:
    from ..core.schema import Variable
    from ..simulation import Simulation

Row: TypeAlias = dict[str, Any]  # one row of run.nc: values by the names of `variables`, and the time

DEEP = 0.9  # share of its limit at which an overlap is warned of
LOST_BALANCE = 0.1  # share of the work that the energy residual may reach before a run is stopped
SETTLED = 10.0  # the balance is judged once the work is this many times the elastic energy


class ShearedGrains(ABC):
    """What `ShearedLayer` and `ShearedCell` share; see there. y is the normal axis, x the shear.

    Parameters
    ----------
    sim
        A simulation whose scene tracks dissipation.
    target_stress
        Normal stress [Pa] > 0 that the servo is to keep, compression positive.
    diameter
        Mean equivalent diameter d [m] > 0 of the mobile grains.

    Raises
    ------
    InputError
        For another scene or values that are not positive.
    """

    memory: LayerMemory

    def __init__(self, sim: Simulation, target_stress: float, diameter: float) -> None:
        kind = type(self).__name__
        for name, value in (("target_stress", target_stress), ("diameter", diameter)):
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"{kind}.{name}: {value!r}, must be > 0")
        if not sim.scene.track_dissipation:
            raise InputError(f"{kind}: Scene.track_dissipation is False, must be True for a closed energy budget")
        self.sim, self._target, self.diameter = sim, target_stress, diameter
        self.effects = [e.name for e in sim.forces.channels] + ["servo"]
        scene = sim.scene
        measure = np.array([s.measure for s in scene.shapes])[scene.shape_index] * scene.diameter**scene.dim
        self.mobile = scene.platen_index < 0
        depth = scene.thickness if scene.dim == 2 else 1.0  # measures of shapes are areas in 2D
        self.solid_volume = float(measure[self.mobile].sum()) * depth

    @property
    @abstractmethod
    def variables(self) -> list[Variable]:
        """Schema rows of run.nc."""

    @property
    @abstractmethod
    def target(self) -> float:
        """Normal stress that the servo keeps now [Pa]."""

    @abstractmethod
    def _sample(self) -> None:
        """Measure the state now, set `memory.platens` to a snapshot of the drives and call `_add_sample`."""

    @abstractmethod
    def _own_row(self, mean: Callable[[str], float]) -> Row:
        """What only this kind of row has; `mean`: of what was sampled under a name."""

    @staticmethod
    @abstractmethod
    def works(drives: Mapping[str, Any]) -> npt.NDArray:
        """Work of the shear and of the normal stress since the start [J], of a snapshot of the drives."""

    @property
    def coordinates(self) -> dict[str, list[str]]:
        """Labels of the dimensions of the schema rows beside time."""
        return {"effect": self.effects, **wall_coordinates(self.sim)}

    def sample(self) -> None:
        """Measure the state now and add it to the present row."""
        with self.sim.clock("diagnostics"):
            self._sample()

    def _add_sample(self, sums: dict[str, Any], drives: Mapping[str, Any] | None, lost: float, **more: float) -> None:
        """Add the budget and what else was measured to the present row.

        Parameters
        ----------
        sums
            What `Measure.sums` gave.
        drives
            Snapshot of the platens, None where there are none.
        lost
            Energy that the drives of platens or of a cell dissipated [J].
        more
            Further numbers of the sample.
        """
        sim, memory = self.sim, self.memory
        if sums["deepest"] > DEEP:
            warnings.warn(f"step {sim.step}: an overlap is {sums['deepest']:.2f} of its limit", stacklevel=3)
        # The budget: what is stored and dissipated now less the work done, against the same at the start.
        now = energies(sim, sums, drives)
        sums["translational_energy"] = now.kinetic - sums["rotational_energy"]
        by_effect = [sums[f"dissipated_{e.name}"] for e in sim.forces.channels] + [lost + wall_servo_energies(sim)[1]]
        memory.first_balance = now.balance if memory.first_balance is None else memory.first_balance
        memory.residual = memory.first_balance - now.balance
        memory.samples.append(sums | {"lost": by_effect, "work": now.work} | more)

    def begin_shear(self) -> None:
        """Count strain, slip and the energy residual from here: the end of consolidation."""
        memory = self.memory
        memory.strain = memory.slip = memory.throughput = 0.0
        memory.first_residual = memory.residual
        memory.works = self.works(memory.platens)

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Go on from what `memory.as_plain()` gave, once the simulation is in the state of that time."""
        self.memory = LayerMemory.from_plain(memory)

    @property
    def strain(self) -> float:
        """Shear strain since shear began [1], up to the last sample."""
        return self.memory.strain

    @property
    def slip(self) -> float:
        """Displacement of the upper border against the lower one along the shear since shear began [m]."""
        return self.memory.slip

    @property
    def thickness(self) -> float:
        """Distance between the two borders [m] at the last sample."""
        return self.memory.thickness

    def residual_fraction(self) -> float:
        """Absolute energy residual since shear began over the work throughput since then [1]; nan before any work."""
        memory = self.memory
        changed = abs(memory.residual - memory.first_residual)
        return changed / memory.throughput if memory.throughput > 0 else float("nan")

    @property
    def stiffness_number(self) -> float:
        """Stiffness number of the contacts under the stress that the grains were given [1], of the effects that repel.

        k/(P b) in 2D and k/(P d) in 3D of springs k, (E/P)^(2/3) of Hertz's contacts; nan without either.
        """
        scene = self.sim.scene
        width = scene.thickness if scene.dim == 2 else self.diameter
        return contact_stiffness(scene.effects, self._target, width) / (self._target * width)

    def row(self) -> Row:
        """The row of run.nc for the time since the last one, but for its stage.

        Raises
        ------
        InputError
            If nothing was sampled since the last row.
        SimulationError
            If the energy balance is lost.
        """
        memory = self.memory
        if not memory.samples:
            raise InputError(f"{type(self).__name__}.row: no sample since the last row, call sample() before")
        sim, samples = self.sim, memory.samples
        last = samples[-1]

        def mean(name: str) -> float:
            return float(np.mean([s[name] for s in samples]))

        stress = np.mean([s["stress"] for s in samples], axis=0)
        works = self.works(memory.platens)
        memory.throughput += float(np.abs(works - memory.works).sum())
        memory.works = works
        contacts, normal = mean("contact_count"), float(stress[1, 1])
        row = {
            "time": sim.time,
            "shear_strain": memory.strain,
            "displacement": memory.displacement,
            "friction": -float(stress[0, 1]) / normal if normal > 0 else float("nan"),
            "shear_stress": -float(stress[0, 1]),
            "normal_stress": normal,
            "translational_energy": last["translational_energy"],
            "rotational_energy": last["rotational_energy"],
            "elastic_energy": last["elastic_energy"],
            "dissipated_energy": last["lost"],
            "external_work": last["work"],
            "energy_residual": memory.residual,
            "work_throughput": memory.throughput,
            "contact_count": contacts,
            "coordination_number": mean("contact_ends") / max(1, int(self.mobile.sum())),
            "sliding_fraction": mean("sliding_count") / contacts if contacts else 0.0,
            "deepest_overlap": max(s["deepest"] for s in samples),
        } | self._own_row(mean)
        row |= wall_row(sim, memory.row_walls, memory.row_step)
        memory.row_walls = wall_sums(sim)
        memory.elastic, memory.time = self._at_play(last), sim.time
        memory.row_step, memory.row_platens = sim.step, memory.platens
        samples.clear()
        self._check_balance()
        return row

    def _at_play(self, last: Mapping[str, Any]) -> float:
        """Energy [J] that the work must exceed for the balance to be judged: that of the contacts in a sample."""
        return last["elastic_energy"]

    def _off_target(self, mean_stress: float, mean_square: float) -> float:
        """Root mean square of a normal stress off the target [Pa], of its mean and the mean of its square."""
        off_target = mean_square - 2 * self.target * mean_stress + self.target**2  # mean of (stress - target)^2
        return float(np.sqrt(max(0.0, off_target)))

    def _inertial_number(self, rate: float) -> float:
        """I = |rate| d sqrt(rho/P) [1] of a shear rate [s-1]."""
        return abs(rate) * self.diameter * np.sqrt(self.sim.scene.density / self.target)

    def _check_balance(self) -> None:
        memory = self.memory
        settled = memory.throughput > SETTLED * memory.elastic
        if settled and self.residual_fraction() > LOST_BALANCE:
            raise SimulationError(
                f"step {self.sim.step}: energy balance lost, residual {memory.residual:g} J is "
                f"{100 * self.residual_fraction():.0f} % of the work done; use a smaller step"
            )
