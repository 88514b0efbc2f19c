"""What each stage of a step does, for one grain or one row of the list; both step loops are made of these."""

from typing import NamedTuple

from ..core.runtime import ti

# How a launch begins.
WHOLE = 0  # with whole steps
RESUMED = 1  # with the contacts alone of a step that has drifted and then waited for a new neighbour list
STARTED = 2  # with the contacts alone at the start of a run: no time passes


class Launched(NamedTuple):
    """What a launch did: finished steps; 1 if a step waits for a new neighbour list; code of an error, 0 for none.

    A launch returns all three: to read a field from the host compiles a kernel of its own.
    """

    steps: int
    halted: int
    error: int


@ti.data_oriented
class StepStages:
    """Stages of a step, in this order: boundaries (platens, walls, sheared cell), drift, bonds, contacts.

    `halted` is 1 when a grain has moved half the skin since the list was built: the step then waits with its drift
    done and its contacts missing, until the list is rebuilt. `steps_done` counts the finished steps of a launch.
    """

    def __init__(self, spec, scheme, validity, platens=None):
        self.spec, self.scheme, self.validity = spec, scheme, validity
        self.forces, self.grains, self.domain = scheme.forces, scheme.grains, scheme.domain
        self.platens, self.walls, self.bonds = platens, self.forces.walls, self.forces.bonds
        self.error_flags = self.forces.geometry.error_flags
        self.halted = ti.field(ti.i32, ())
        self.steps_done = ti.field(ti.i32, ())

    @ti.func
    def launched(self):
        """Values of `Launched`."""
        return ti.Vector([self.steps_done[None], self.halted[None], self.error_flags.code[None]])

    @ti.func
    def drift_mobile(self, k, step):
        """Kick, drift and rotation of the mobile grain k."""
        before = self.grains.position[k]
        self.scheme.advance(k, step)
        self.validity.check(k, before, step)

    @ti.func
    def drift_glued(self, k, step):
        """Drift of grain k, which is glued to a platen, with that platen."""
        before = self.grains.position[k]
        self.scheme.remember_velocity(k)
        self.platens.carry(k, self.scheme.dt[None])
        self.validity.check(k, before, step)

    @ti.func
    def evaluate_bonds(self, k, step):
        """Forces of the bonds that grain k leads. Where one breaks the contact of its grains is missing on the list."""
        if self.bonds.evaluate(k) == 1:
            self.validity.outdated[None] = 1 + step

    @ti.func
    def end_platens(self):
        """Sum the contact forces on the platens, which end a step."""
        self.platens.gather(self.forces, self.scheme.dt[None])

    @ti.func
    def begin_platens(self, step):
        """Kick the platens and let their glued grains drift, in rising ids."""
        self.platens.kick(self.scheme.dt[None])
        for m in range(self.platens.glued):
            self.drift_glued(self.grains.slot_of[self.platens.member[m]], step)

    @ti.func
    def drift_walls_and_cell(self, dt):
        """Let plane walls and the sheared cell move for dt [s], with its height if that has a servo."""
        if ti.static(self.spec.walls > 0):
            self.walls.drift(dt)
        if ti.static(self.spec.sheared):
            self.domain.shear(dt)
