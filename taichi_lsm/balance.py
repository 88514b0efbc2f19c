"""The closed energy budget of a simulation at one instant."""

from typing import NamedTuple


class Energies(NamedTuple):
    """Terms of the budget [J]: kinetic (platens included), elastic (contacts and bonds), potential, dissipated and work.

    dissipated: booked by laws and drives since the start, without a ledger only by drives; work: done since the start
    by what moves platens, plane walls and a sheared cell.
    """

    kinetic: float
    elastic: float
    potential: float
    dissipated: float
    work: float

    @property
    def stored(self):
        """Energy in the grains and platens [J]."""
        return self.kinetic + self.elastic + self.potential

    @property
    def balance(self):
        """Stored and dissipated energy less work [J]: constant while the budget is closed."""
        return self.stored + self.dissipated - self.work


def energies(sim, sums=None):
    """Energies of `sim` now; sums: what `sim.measure.sums` returned just now, if it is known."""
    sums = sim.measure.sums() if sums is None else sums
    kinetic = sums["translational_energy"] + sums["rotational_energy"]
    dissipated = sum(value for name, value in sums.items() if name.startswith("dissipated_"))
    work = sums.get("shear_work", 0.0)
    if sim.platens:
        now = sim.platens.snapshot()
        kinetic += 0.5 * float((sim.platens.mass.to_numpy() * now["velocity"] ** 2).sum())
        dissipated += float(now["dissipated"].sum())
        work += float(now["work"].sum())
    if sim.walls:
        work += float(sim.walls.work.to_numpy().sum())
    return Energies(kinetic, sums["elastic_energy"], sums["potential_energy"], dissipated, work)
