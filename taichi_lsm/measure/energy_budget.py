"""The closed energy budget of a simulation at one instant."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ..simulation import Simulation


class Energies(NamedTuple):
    """Terms of the budget [J]: kinetic, elastic (contacts, bonds), potential, dissipated and work.

    kinetic: of grains, platens, and of the walls and the height of a cell that a servo moves; dissipated: by effects
    and drives since the start, without `Scene.track_dissipation` by drives alone; work: done since the start by what
    moves platens, plane walls and a sheared cell, and by servos on walls and on its height.
    """

    kinetic: float
    elastic: float
    potential: float
    dissipated: float
    work: float

    def __repr__(self) -> str:
        terms = ", ".join(f"{name} {value:.6g} J" for name, value in self._asdict().items())
        return f"Energies({terms}; balance {self.balance:.6g} J)"

    @property
    def stored(self) -> float:
        """Energy in the grains and platens [J]."""
        return self.kinetic + self.elastic + self.potential

    @property
    def balance(self) -> float:
        """Stored and dissipated energy less work [J]: constant while the budget is closed."""
        return self.stored + self.dissipated - self.work


def energies(
    sim: "Simulation", sums: Mapping[str, Any] | None = None, platens: Mapping[str, NDArray] | None = None
) -> Energies:
    """Energies of a simulation now.

    Parameters
    ----------
    sim : Simulation
    sums : dict, optional
        What `sim.measure.sums` returned for this state, if it is known.
    platens : dict, optional
        What `sim.platens.snapshot` returned for this state, if it is known.

    Returns
    -------
    Energies
        The terms of the budget [J], velocities at the time of the positions.
    """
    sums = sim.measure.sums() if sums is None else sums
    kinetic = sums["translational_energy"] + sums["rotational_energy"]
    dissipated = sum(value for name, value in sums.items() if name.startswith("dissipated_"))
    work = sums.get("shear_work", 0.0)
    if sim.platens:
        now = sim.platens.snapshot() if platens is None else platens
        mass = np.array([sim.platens.mass[p] for p in range(sim.platens.count)])
        kinetic += 0.5 * float((mass * now["velocity"] ** 2).sum())
        dissipated += float(now["dissipated"].sum())
        work += float(now["work"].sum())
    if sim.spec.cell_servo:
        cell = sim.domain.snapshot()
        kinetic += sim.domain.kinetic_energy(sim.dt)
        dissipated, work = dissipated + cell["dissipated"], work + cell["work"]
    if sim.walls:
        work += float(sum(sim.walls.work[w] for w in range(sim.walls.count)))
        moving, lost = wall_servo_energies(sim)
        kinetic, dissipated = kinetic + moving, dissipated + lost
    return Energies(kinetic, sums["elastic_energy"], sums["potential_energy"], dissipated, work)


def wall_servo_energies(sim: "Simulation") -> tuple[float, float]:
    """Kinetic energy of the plane walls that servos move, and energy that these dissipated [J]; 0 without any."""
    if not (sim.walls and sim.walls.servos):
        return 0.0, 0.0
    return sim.walls.servos.energies(sim.walls, sim.dt if sim.integrator.half_step else 0.0)
