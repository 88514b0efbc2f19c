"""A layer sheared between two platens: its stresses, strain, porosity and closed energy budget, row by row."""

import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from ..bonds.fragments import fragments
from ..core.errors import InputError, SimulationError
from ..core.schema import Variable
from .contact_stiffness import contact_stiffness
from .energy_budget import energies

if TYPE_CHECKING:
    from ..boundaries.platens import Platens
    from ..simulation import Simulation

Row: TypeAlias = dict[str, Any]  # one row of run.nc: values by the names of `layer_rows`, and the time

MARGIN = 3.0  # diameters kept from the platens where bulk stress is measured
DEEP = 0.9  # share of its limit at which an overlap is warned of
LOST_BALANCE = 0.1  # share of the work that the energy residual may reach before a run is stopped
SETTLED = 10.0  # the balance is judged once the work is this many times the elastic energy
STAGES = ("generate", "consolidate", "shear")


def series(name: str, units: str, long_name: str, dtype: str = "f64", dims: tuple[str, ...] = ("time",)) -> Variable:
    """Schema row of a time series."""
    return Variable(name, dims, dtype, units, long_name)


def layer_rows(bonded: bool = False) -> list[Variable]:
    """Schema rows of run.nc; `bonded`: of a scene with bonds."""
    return [
        series(
            "shear_strain",
            "1",
            "shear strain, integral of plate velocity over layer thickness since shear began",
        ),
        series("displacement", "m", "shear displacement of the top platen against the bottom platen"),
        series("friction", "1", "shear stress over normal stress in the bulk of the layer"),
        series("shear_stress", "Pa", "shear stress in the bulk, at least 3 diameters from the platens"),
        series("normal_stress", "Pa", "normal stress in the bulk, compression positive"),
        series(
            "platen_shear_stress",
            "Pa",
            "shear stress on the top platen, mean over all steps since the last row",
        ),
        series(
            "platen_normal_stress",
            "Pa",
            "normal stress on the top platen, mean over all steps since the last row",
        ),
        series(
            "platen_normal_rms",
            "Pa",
            "root mean square deviation of the normal stress on the platen from its target",
        ),
        series("layer_thickness", "m", "distance between the reference planes of the platens"),
        series("porosity", "1", "share of the layer not filled by mobile grains"),
        series("plate_velocity", "m s-1", "velocity of the top platen against the bottom platen along the shear"),
        series(
            "load_point_velocity", "m s-1", "velocity imposed on the load point, or on the platen if no spring pulls it"
        ),
        series("translational_energy", "J", "kinetic energy of translation, platens included"),
        series("rotational_energy", "J", "kinetic energy of rotation"),
        series("elastic_energy", "J", "energy stored in the contacts"),
        series("dissipated_energy", "J", "energy dissipated since the start, by effect", dims=("time", "effect")),
        series("external_work", "J", "work of the drives since the start"),
        series(
            "energy_residual",
            "J",
            "external work less changes of kinetic and elastic energy less dissipation",
        ),
        series(
            "work_throughput",
            "J",
            "integral of the absolute power of shear and of normal load since shear began",
        ),
        series("contact_count", "1", "contacts with at least one mobile grain"),
        series("coordination_number", "1", "mean number of contacts of a mobile grain"),
        series("sliding_fraction", "1", "share of the contacts that slide"),
        series("deepest_overlap", "1", "greatest overlap over its limit"),
        series("inertial_number", "1", "shear rate times diameter times sqrt(density over stress), as measured"),
    ] + [
        series("bond_count", "1", "bonds that have not broken", dtype="i32"),
        series(
            "fragment_count", "1", "mobile grains that no intact bond joins, or groups that bonds join", dtype="i32"
        ),
    ] * bonded


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
    linear velocity profile. Shear strain is the sum over samples of the displacement increment over the thickness at
    that instant. The inertial number is I = (v/h) d sqrt(rho/P), v/h the measured shear rate.
    """

    def __init__(self, sim: "Simulation", target_stress: float, diameter: float) -> None:
        for name, value in (("target_stress", target_stress), ("diameter", diameter)):
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"ShearedLayer.{name}: {value!r}, must be > 0")
        if not sim.scene.track_dissipation:
            raise InputError("ShearedLayer: Scene.track_dissipation is False, must be True for a closed energy budget")
        self.sim, self.target, self.diameter = sim, target_stress, diameter
        self.platens = platens = two_platens(sim)
        self.effects = [e.name for e in sim.forces.channels] + ["servo"]
        scene = sim.scene
        measure = np.array([s.measure for s in scene.shapes])[scene.shape_index] * scene.diameter**scene.dim
        self.mobile = scene.platen_index < 0
        depth = scene.thickness if scene.dim == 2 else 1.0  # measures of shapes are areas in 2D
        self.solid_volume = float(measure[self.mobile].sum()) * depth
        self.area = platens.area
        # Reference planes: mean innermost surface of the glued grains, fixed to each platen.
        radius = scene.per_grain("bounding_radius")
        inner = [scene.position[:, 1] + radius, scene.position[:, 1] - radius]
        self.plane = [float(inner[p][scene.platen_index == p].mean()) for p in (0, 1)]
        self.strain = self.throughput = 0.0
        self._sums: list[dict[str, Any]] = []
        self._last_sample_time = sim.time
        self._mark_step = sim.step
        self._mark = platens.snapshot()
        self._elastic = 0.0
        self._balance0: float | None = None
        self.sample()
        self.residual_mark, self._work_mark = self.residual, self._works()

    def _works(self) -> npt.NDArray:
        """Work of the shear drive and of the normal drive since the start [J]."""
        work = self._platens["work"].sum(axis=0)
        return np.array([work.sum() - work[1], work[1]])

    def sample(self) -> None:
        """Measure the state now and add it to the present row."""
        with self.sim.clock("diagnostics"):
            self._sample()

    def _sample(self) -> None:
        sim = self.sim
        self._platens = platens = self.platens.snapshot()
        bottom, top = (self.plane[p] + platens["displacement"][p, 1] for p in (0, 1))
        self.thickness = thickness = top - bottom
        if not thickness > 0:
            raise SimulationError(f"step {sim.step}: the layer's thickness is {thickness:g} m, the platens have met")
        velocity = platens["velocity"]
        # Stress in the slab between the margins, its kinetic part relative to a linear profile between the platens.
        margin = min(MARGIN * self.diameter, thickness / 3)
        shear_velocity = velocity[1, 0] - velocity[0, 0]
        gradient = shear_velocity / thickness
        volume = self.area * (thickness - 2 * margin)
        at_low = velocity[0, 0] + gradient * margin
        sums = sim.measure.sums(bottom + margin, top - margin, volume, at_low, gradient)
        if sums["deepest"] > DEEP:
            warnings.warn(f"step {sim.step}: an overlap is {sums['deepest']:.2f} of its limit", stacklevel=2)
        self.strain += gradient * (sim.time - self._last_sample_time)
        self._last_sample_time = sim.time
        # The budget: what is stored and dissipated now less the work done, against the same at the start.
        now = energies(sim, sums, platens)
        sums["translational_energy"] = now.kinetic - sums["rotational_energy"]
        lost = [sums[f"dissipated_{e.name}"] for e in sim.forces.channels] + [float(platens["dissipated"].sum())]
        self._balance0 = now.balance if self._balance0 is None else self._balance0
        self.residual = self._balance0 - now.balance
        self._sums.append(
            sums | {"lost": lost, "work": now.work, "thickness": thickness, "shear_velocity": shear_velocity}
        )

    def begin_shear(self) -> None:
        """Count strain and the energy residual from here: the end of consolidation."""
        self.strain = self.throughput = 0.0
        self.residual_mark = self.residual
        self._work_mark = self._works()

    def residual_fraction(self) -> float:
        """Absolute energy residual since shear began over the work throughput since then [1]; nan before any work."""
        return abs(self.residual - self.residual_mark) / self.throughput if self.throughput > 0 else float("nan")

    @property
    def stiffness_number(self) -> float:
        """Stiffness number of the contacts under the target stress [1], of the effects that repel.

        k/(P b) in 2D and k/(P d) in 3D of springs k, (E/P)^(2/3) of Hertz's contacts; nan without either.
        """
        scene = self.sim.scene
        width = scene.thickness if scene.dim == 2 else self.diameter
        return contact_stiffness(scene.effects, self.target, width) / (self.target * width)

    def row(self, stage: int) -> Row:
        """The row of run.nc for the time since the last one; `stage` is an index of STAGES.

        Raises
        ------
        InputError
            If nothing was sampled since the last row.
        SimulationError
            If the energy balance is lost.
        """
        if not self._sums:
            raise InputError("ShearedLayer.row: no sample since the last row, call sample() before")
        sim, now, samples = self.sim, self._platens, self._sums
        last = samples[-1]

        def mean(name: str) -> float:
            return float(np.mean([s[name] for s in samples]))

        stress = np.mean([s["stress"] for s in samples], axis=0)
        contact, off_target = self._platen_stress(now)
        works = self._works()
        self.throughput += float(np.abs(works - self._work_mark).sum())
        self._work_mark = works
        contacts, normal = mean("contact_count"), float(stress[1, 1])
        rate = last["shear_velocity"] / last["thickness"]
        driven = self.platens.load_velocity(now["velocity"])
        row = {
            "time": sim.time,
            "shear_strain": self.strain,
            "displacement": float(now["displacement"][1, 0] - now["displacement"][0, 0]),
            "friction": -float(stress[0, 1]) / normal if normal > 0 else float("nan"),
            "shear_stress": -float(stress[0, 1]),
            "normal_stress": normal,
            "platen_shear_stress": -float(contact[0]),
            "platen_normal_stress": float(contact[1]),
            "platen_normal_rms": off_target,
            "layer_thickness": mean("thickness"),
            "porosity": 1.0 - self.solid_volume / (self.area * mean("thickness")),
            "plate_velocity": last["shear_velocity"],
            "load_point_velocity": float(driven[1, 0] - driven[0, 0]),
            "translational_energy": last["translational_energy"],
            "rotational_energy": last["rotational_energy"],
            "elastic_energy": last["elastic_energy"],
            "dissipated_energy": last["lost"],
            "external_work": last["work"],
            "energy_residual": self.residual,
            "work_throughput": self.throughput,
            "contact_count": contacts,
            "coordination_number": mean("contact_ends") / max(1, int(self.mobile.sum())),
            "sliding_fraction": mean("sliding_count") / contacts if contacts else 0.0,
            "deepest_overlap": max(s["deepest"] for s in samples),
            "inertial_number": abs(rate) * self.diameter * np.sqrt(sim.scene.density / self.target),
            "stage": STAGES[stage],
        }
        if sim.bonds:
            row["bond_count"] = int(last["bond_count"])
            row["fragment_count"] = len(np.unique(fragments(sim)[self.mobile]))
        self._elastic = last["elastic_energy"]
        samples.clear()
        self._check_balance()
        return row

    def _platen_stress(self, now: Mapping[Any, npt.NDArray]) -> tuple[npt.NDArray, float]:
        """Stress (dim,) on the top platen and root mean square of its normal component off the target [Pa].

        Both over every step since the last row, from sums that the platens add up in each step.
        """
        steps = max(1, self.sim.step - self._mark_step)
        contact = (now["force_sum"] - self._mark["force_sum"])[1] / steps / self.area
        square = (now["force_square_sum"] - self._mark["force_square_sum"])[1, 1] / steps
        mean_square = square / self.area**2
        off_target = mean_square - 2 * self.target * contact[1] + self.target**2  # mean of (stress - target)^2
        self._mark_step, self._mark = self.sim.step, now
        return contact, float(np.sqrt(max(0.0, off_target)))

    def _check_balance(self) -> None:
        settled = self.throughput > SETTLED * self._elastic
        if settled and self.residual_fraction() > LOST_BALANCE:
            raise SimulationError(
                f"step {self.sim.step}: energy balance lost, residual {self.residual:g} J is "
                f"{100 * self.residual_fraction():.0f} % of the work done; use a smaller step"
            )


def two_platens(sim: "Simulation") -> "Platens":
    """The platens of a simulation of a layer; InputError if there are not two."""
    if sim.platens is None or sim.platens.count != 2:
        count = 0 if sim.platens is None else sim.platens.count
        raise InputError(f"Scene.platens: {count}, must be 2 for a sheared layer: the bottom and the top one")
    return sim.platens
