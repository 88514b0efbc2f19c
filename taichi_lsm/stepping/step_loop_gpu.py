"""One step in a launch for each stage, with a thread for each grain: for a GPU, and on the CPU with the same bits."""

from ..core.runtime import ti
from .step_stages import Launched

LAUNCHED_STEPS = 8  # before the flags are read


@ti.data_oriented
class StepLoopGPU:
    """Runs the stages of `StepStages` with a thread for each grain. Steps after one that halts do nothing."""

    def __init__(self, stages):
        self.stages, self.spec, self.forces = stages, stages.spec, stages.forces
        self.scheme, self.validity, self.grains = stages.scheme, stages.validity, stages.grains

    def launch(self, count: int) -> Launched:
        """Make up to `count` steps, fewer if the list must be rebuilt."""
        for _ in range(min(count, LAUNCHED_STEPS)):
            self.step()
        done = Launched(*map(int, self.done()))
        self.scheme.count_steps(done.steps)
        return done

    def finish_step(self) -> Launched:
        """Contacts of a step that has drifted and then waited for a new list."""
        self.contacts_only(1.0)
        self.scheme.count_steps(1)
        return Launched(*map(int, self.done()))._replace(steps=1)

    def start(self) -> Launched:
        """Contacts at the positions of the start of a run; no time passes."""
        self.scheme.restart()
        self.contacts_only(0.0)
        return Launched(*map(int, self.done()))

    @ti.kernel
    def done(self) -> ti.types.vector(3, ti.i32):
        """What the launches since the last call did."""
        found = self.stages.launched()
        self.stages.steps_done[None] = 0
        return found

    @ti.kernel
    def step(self):
        """One step; does nothing while the list must be rebuilt. Each loop over grains is a launch of its own."""
        self.move_boundaries()
        self.drift()
        if ti.static(self.spec.bonds > 0):
            self.evaluate_bonds()
        self.count_or_halt()
        self.evaluate_contacts()
        if self.stages.halted[None] == 0:
            self.sum_boundaries(self.scheme.dt[None])

    @ti.func
    def move_boundaries(self):
        """BOUNDARIES: kick the platens, move walls and cell; glued grains drift with the others."""
        if self.stages.halted[None] == 0:
            if ti.static(self.spec.platens > 0):
                self.stages.platens.kick(self.scheme.dt[None])
            self.stages.domain.note_strain()
            self.stages.drift_walls_and_cell(self.scheme.dt[None])

    @ti.func
    def drift(self):
        """DRIFT: kick, drift and rotate the mobile grains, move the glued ones with their platens."""
        for k in range(self.grains.count[None]):
            if self.stages.halted[None] == 0:
                if self.grains.platen_index[k] < 0:
                    self.stages.drift_mobile(k, 0)
                elif ti.static(self.spec.platens > 0):
                    self.stages.drift_glued(k, 0)

    @ti.func
    def evaluate_bonds(self):
        """BONDS: forces of the bonds at the new positions."""
        for k in range(self.grains.count[None]):
            if self.stages.halted[None] == 0:
                self.stages.evaluate_bonds(k, 0)

    @ti.func
    def count_or_halt(self):
        """Halt if the list is outdated, with the contacts of the step missing; else the step counts as done."""
        if self.stages.halted[None] == 0:
            if self.validity.outdated[None] == 1:
                self.stages.halted[None] = 1
            else:
                self.stages.steps_done[None] += 1

    @ti.func
    def evaluate_contacts(self):
        """CONTACTS: forces of the contacts at the new positions, a row of the list for each grain."""
        for k in range(self.grains.count[None]):
            if self.stages.halted[None] == 0:
                block = self.forces.block(0)
                self.forces.evaluate_rows(block, k, k + 1, self.scheme.dt[None], 1)

    @ti.kernel
    def contacts_only(self, steps: ti.f64):
        """Contacts at the present positions, which end so many steps: 1, or 0 at the start of a run."""
        for k in range(self.grains.count[None]):
            block = self.forces.block(0)
            self.forces.evaluate_rows(block, k, k + 1, steps * self.scheme.dt[None], 1)
        self.validity.outdated[None] = 0
        self.stages.halted[None] = 0
        self.sum_boundaries(steps * self.scheme.dt[None])

    @ti.func
    def sum_boundaries(self, dt):
        """Forces on platens and walls after a step of dt [s]."""
        if ti.static(self.spec.platens > 0):
            self.stages.end_platens()
        if ti.static(self.spec.walls > 0):
            self.stages.walls.gather(self.forces, dt)
        if ti.static(self.spec.cell_servo):
            if dt >= 0.0:  # within a condition, so that the sum is made by one thread, in its order
                self.stages.domain.gather()
