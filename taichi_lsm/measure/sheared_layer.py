"""A layer sheared between two platens: its stresses, strain, porosity and closed energy budget, row by row."""

import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from ..bonds.fragments import fragments
from ..boundaries.platen_drives import ServoStress, SpringLoadPoint
from ..boundaries.stress_drives import ServoWithSpring, VelocityOrStress
from ..core.errors import InputError, SimulationError
from .contact_stiffness import contact_stiffness
from .energy_budget import energies
from .layer_memory import LayerMemory

if TYPE_CHECKING:
    from ..boundaries.platens import Platens
    from ..simulation import Simulation

Row: TypeAlias = dict[str, Any]  # one row of run.nc: values by the names of `layer_rows`, and the time

MARGIN = 3.0  # diameters kept from the platens where bulk stress is measured
DEEP = 0.9  # share of its limit at which an overlap is warned of
LOST_BALANCE = 0.1  # share of the work that the energy residual may reach before a run is stopped
SETTLED = 10.0  # the balance is judged once the work is this many times the elastic energy


class ShearedLayer:
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

    def __init__(self, sim: "Simulation", target_stress: float, diameter: float) -> None:
        for name, value in (("target_stress", target_stress), ("diameter", diameter)):
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"ShearedLayer.{name}: {value!r}, must be > 0")
        if not sim.scene.track_dissipation:
            raise InputError("ShearedLayer: Scene.track_dissipation is False, must be True for a closed energy budget")
        self.sim, self._target, self.diameter = sim, target_stress, diameter
        self.platens = platens = two_platens(sim)
        self.effects = [e.name for e in sim.forces.channels] + ["servo"]
        scene = sim.scene
        measure = np.array([s.measure for s in scene.shapes])[scene.shape_index] * scene.diameter**scene.dim
        self.mobile = scene.platen_index < 0
        depth = scene.thickness if scene.dim == 2 else 1.0  # measures of shapes are areas in 2D
        self.solid_volume = float(measure[self.mobile].sum()) * depth
        self.area = platens.area
        along, normal = platens.drives[1][:2]
        self.sprung = isinstance(along, SpringLoadPoint)
        self.pushed, self.confined = isinstance(along, VelocityOrStress), isinstance(normal, ServoWithSpring)
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
            works=works_of(now),
            row_step=sim.step,
            row_platens=now,
        )
        self.sample()
        self.memory.first_residual = self.memory.residual

    def _planes(self, platens: Mapping[str, npt.NDArray]) -> tuple[float, float]:
        """Heights of the reference planes of the bottom and of the top platen [m]."""
        bottom, top = (self.plane[p] + float(platens["displacement"][p, 1]) for p in (0, 1))
        if not top > bottom:
            raise SimulationError(f"step {self.sim.step}: the layer's thickness is {top - bottom:g} m, the platens met")
        return bottom, top

    def sample(self) -> None:
        """Measure the state now and add it to the present row."""
        with self.sim.clock("diagnostics"):
            self._sample()

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
        if sums["deepest"] > DEEP:
            warnings.warn(f"step {sim.step}: an overlap is {sums['deepest']:.2f} of its limit", stacklevel=2)
        # Strain by what the platens moved since the last sample, however unevenly, over the thickness of that time.
        moved = shear_displacement(platens) - memory.displacement
        memory.strain += moved / (0.5 * (memory.thickness + thickness))
        memory.slip += moved
        memory.displacement, memory.thickness = shear_displacement(platens), thickness
        # The budget: what is stored and dissipated now less the work done, against the same at the start.
        now = energies(sim, sums, platens)
        sums["translational_energy"] = now.kinetic - sums["rotational_energy"]
        lost = [sums[f"dissipated_{e.name}"] for e in sim.forces.channels] + [float(platens["dissipated"].sum())]
        memory.first_balance = now.balance if memory.first_balance is None else memory.first_balance
        memory.residual = memory.first_balance - now.balance
        memory.samples.append(
            sums | {"lost": lost, "work": now.work, "thickness": thickness, "shear_velocity": shear_velocity}
        )

    def begin_shear(self) -> None:
        """Count strain, slip and the energy residual from here: the end of consolidation."""
        memory = self.memory
        memory.strain = memory.slip = memory.throughput = 0.0
        memory.first_residual = memory.residual
        memory.works = works_of(memory.platens)

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Go on from what `memory.as_plain()` gave, once the simulation is in the state of that time."""
        self.memory = LayerMemory.from_plain(memory)

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

    @property
    def strain(self) -> float:
        """Shear strain since shear began [1], up to the last sample."""
        return self.memory.strain

    @property
    def slip(self) -> float:
        """Displacement of the top platen against the bottom one along the shear since shear began [m]."""
        return self.memory.slip

    @property
    def thickness(self) -> float:
        """Distance between the reference planes of the platens [m] at the last sample."""
        return self.memory.thickness

    def residual_fraction(self) -> float:
        """Absolute energy residual since shear began over the work throughput since then [1]; nan before any work."""
        memory = self.memory
        changed = abs(memory.residual - memory.first_residual)
        return changed / memory.throughput if memory.throughput > 0 else float("nan")

    @property
    def stiffness_number(self) -> float:
        """Stiffness number of the contacts under the stress that the layer was given [1], of the effects that repel.

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
            raise InputError("ShearedLayer.row: no sample since the last row, call sample() before")
        sim, now, samples = self.sim, memory.platens, memory.samples
        last = samples[-1]

        def mean(name: str) -> float:
            return float(np.mean([s[name] for s in samples]))

        stress = np.mean([s["stress"] for s in samples], axis=0)
        contact, off_target = self._platen_stress(now)
        works = works_of(now)
        memory.throughput += float(np.abs(works - memory.works).sum())
        memory.works = works
        contacts, normal = mean("contact_count"), float(stress[1, 1])
        velocity = self._mean_velocity()
        rate = velocity / mean("thickness")
        driven = self.platens.load_velocity(now["velocity"])
        row = {
            "time": sim.time,
            "shear_strain": memory.strain,
            "displacement": memory.displacement,
            "friction": -float(stress[0, 1]) / normal if normal > 0 else float("nan"),
            "shear_stress": -float(stress[0, 1]),
            "normal_stress": normal,
            "platen_shear_stress": -float(contact[0]),
            "platen_normal_stress": float(contact[1]),
            "platen_normal_rms": off_target,
            "layer_thickness": mean("thickness"),
            "porosity": 1.0 - self.solid_volume / (self.area * mean("thickness")),
            "plate_velocity": velocity,
            "instantaneous_plate_velocity": last["shear_velocity"],
            "load_point_velocity": float(driven[1, 0] - driven[0, 0]),
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
            "inertial_number": abs(rate) * self.diameter * np.sqrt(sim.scene.density / self.target),
        }
        row |= self._of_drives(now)
        if sim.bonds:
            row["bond_count"] = int(last["bond_count"])
            row["fragment_count"] = len(np.unique(fragments(sim)[self.mobile]))
        memory.elastic, memory.time = last["elastic_energy"], sim.time
        memory.row_step, memory.row_platens = sim.step, now
        samples.clear()
        self._check_balance()
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
        mean_square = square / self.area**2
        off_target = mean_square - 2 * self.target * contact[1] + self.target**2  # mean of (stress - target)^2
        return contact, float(np.sqrt(max(0.0, off_target)))

    def _check_balance(self) -> None:
        memory = self.memory
        settled = memory.throughput > SETTLED * memory.elastic
        if settled and self.residual_fraction() > LOST_BALANCE:
            raise SimulationError(
                f"step {self.sim.step}: energy balance lost, residual {memory.residual:g} J is "
                f"{100 * self.residual_fraction():.0f} % of the work done; use a smaller step"
            )


def shear_displacement(platens: Mapping[str, npt.NDArray]) -> float:
    """Displacement of the top platen against the bottom one along the shear [m], of a snapshot of the platens."""
    return float(platens["displacement"][1, 0] - platens["displacement"][0, 0])


def works_of(platens: Mapping[str, npt.NDArray]) -> npt.NDArray:
    """Work of the shear drive and of the normal drive since the start [J], of a snapshot of the platens."""
    work = platens["work"].sum(axis=0)
    return np.array([work.sum() - work[1], work[1]])


def two_platens(sim: "Simulation") -> "Platens":
    """The platens of a simulation of a layer; InputError if there are not two."""
    if sim.platens is None or sim.platens.count != 2:
        count = 0 if sim.platens is None else sim.platens.count
        raise InputError(f"Scene.platens: {count}, must be 2 for a sheared layer: the bottom and the top one")
    return sim.platens
