"""Many steps in one launch, by a team of threads that share the stages of each step; one thread is a team too.

Any number of threads gives the same bits: each grain, bond and row of the list is worked on by one thread alone, and
sums that are not divided are made by one of them.
"""

from ..core.runtime import ti
from .step_stages import RESUMED, STARTED, WHOLE, Launched
from .thread_team import SPREAD, ThreadTeam

# Stages of a step. A thread that slept through a step must not mistake one stage for another, so that each stage of
# each step of a launch has counters of its own in the team.
STAGES = 4
BOUNDARIES, DRIFT, BONDS, CONTACTS = range(STAGES)
MOST_STEPS = 512  # of a launch
END_OF_LAUNCH = STAGES * (MOST_STEPS + 1)
GRAIN_STEPS = 4_000_000  # of a launch: short enough to answer a signal at once


@ti.data_oriented
class StepLoopCPU:
    """Runs the stages of `StepStages` with `threads` threads."""

    def __init__(self, stages, threads=1):
        self.stages, self.spec, self.forces = stages, stages.spec, stages.forces
        self.scheme, self.validity, self.grains = stages.scheme, stages.validity, stages.grains
        self.team = ThreadTeam(threads, END_OF_LAUNCH + 1)

    def launch(self, count: int) -> Launched:
        """Make up to `count` steps, fewer if the list must be rebuilt or a launch would take long."""
        most = max(1, min(MOST_STEPS, GRAIN_STEPS // len(self.grains)))
        done = Launched(*map(int, self.steps(min(count, most), WHOLE)))
        self.scheme.count_steps(done.steps)
        return done

    def finish_step(self) -> Launched:
        """Contacts of a step that has drifted and then waited for a new list."""
        done = Launched(*map(int, self.steps(1, RESUMED)))
        self.scheme.count_steps(1)
        return done

    def start(self) -> Launched:
        """Contacts at the positions of the start of a run; no time passes."""
        self.scheme.restart()
        return Launched(*map(int, self.steps(1, STARTED)))

    def empty_launch(self) -> None:
        """A launch without a step, of which only the time is of interest."""
        self.steps(0, WHOLE)

    @ti.kernel
    def steps(self, count: ti.i32, mode: ti.i32) -> ti.types.vector(3, ti.i32):
        """Up to `count` steps, the first of them as `mode` says; one kernel serves all modes, as it compiles long."""
        # Counters of the team, flags and the strain of the cell as they are before the first step.
        self.team.begin(self.grains.count[None], self.forces.pairs.row_start)
        self.validity.outdated[None] = 0
        self.stages.steps_done[None] = 0
        self.stages.domain.note_strain()
        # Taichi hands out blocks of at least SPREAD indices: one index of each block stands for a thread.
        ti.loop_config(serialize=self.team.size == 1)
        for i in range(self.team.size * SPREAD):
            if i % SPREAD == 0:
                self.run_thread(i // SPREAD, count, mode)
        return self.stages.launched()

    @ti.func
    def run_thread(self, t, count, mode):
        """What thread t does in a launch: steps, until one must wait for a new list or an error flag is raised."""
        block = self.forces.block(0)
        step, going, flag = 0, 1, 0
        while step <= count and going == 1 and flag == 0:
            going, flag = self.step(t, block, step, count, mode)
            step += going
        # All threads agree on where they stopped; the step that waits for a list is not counted as done.
        if self.team.lead(END_OF_LAUNCH):
            self.stages.halted[None] = 1 - going
        ti.atomic_max(self.stages.steps_done[None], ti.min(step, count) - ti.cast(mode == STARTED, ti.i32))

    @ti.func
    def step(self, t, block: ti.template(), step, count, mode):
        """One step; returns (0 if it waits for a new list, else 1; error flag). Step `count` only ends the last one."""
        drifts = step > 0 or mode == WHOLE
        going, flag = 1, 0
        self.move_boundaries(t, step, count, mode)
        if step < count:
            if drifts:
                self.drift(t, step)
            if ti.static(self.spec.bonds > 0):
                if drifts or mode == STARTED:
                    self.evaluate_bonds(t, step)
            # Other threads may have gone on, and found the list outdated in a later step: only this step counts.
            if drifts:
                going = ti.cast(self.validity.outdated[None] != 1 + step, ti.i32)
            if going == 1:
                dt = ti.select(mode == STARTED, 0.0, self.scheme.dt[None])
                self.evaluate_contacts(t, block, step, dt, ti.cast(step == count - 1, ti.i32))
                flag = self.stages.error_flags.code[None]  # of this step, or of one that other threads have begun
        return going, flag

    @ti.func
    def move_boundaries(self, t, step, count, mode):
        """BOUNDARIES: one thread moves platens, walls and the cell while the others let the mobile grains drift.

        It first ends the step before: the contact forces on platens and walls are summed.
        """
        if ti.static(self.spec.has_boundaries):
            stage = STAGES * step + BOUNDARIES
            if self.team.lead(stage):
                dt = self.scheme.dt[None]
                moves = step < count and (step > 0 or mode == WHOLE)
                if ti.static(self.spec.platens > 0):
                    if step > 0:
                        self.stages.end_platens()
                    if moves:
                        self.stages.begin_platens(step)
                if ti.static(self.spec.walls > 0):
                    if step > 0:
                        self.stages.walls.gather(self.forces, ti.select(mode == STARTED, 0.0, dt))
                if ti.static(self.spec.cell_servo):
                    if step > 0:
                        self.stages.domain.gather()
                self.stages.drift_walls_and_cell(ti.select(moves, dt, 0.0))
                self.team.finish_alone(t, stage)
            # Grains are carried with a height that moves: they must know how far it does.
            if ti.static(self.spec.cell_servo):
                self.team.barrier(t, stage)

    @ti.func
    def drift(self, t, step):
        """DRIFT: kick, drift and rotate the mobile grains; wait for all grains and for the boundaries."""
        stage = STAGES * step + DRIFT
        share = self.team.claim(t, stage)
        while share >= 0:
            for k in range(self.team.first_slot[share], self.team.first_slot[share + 1]):
                if self.grains.platen_index[k] < 0:
                    self.stages.drift_mobile(k, step)
            share = self.team.finish(t, stage)
        if ti.static(self.spec.has_boundaries):
            self.team.barrier(t, STAGES * step + BOUNDARIES)
        self.team.barrier(t, stage)

    @ti.func
    def evaluate_bonds(self, t, step):
        """BONDS: forces of the bonds at the new positions."""
        stage = STAGES * step + BONDS
        share = self.team.claim(t, stage)
        while share >= 0:
            for k in range(self.team.first_slot[share], self.team.first_slot[share + 1]):
                self.stages.evaluate_bonds(k, step)
            share = self.team.finish(t, stage)
        self.team.barrier(t, stage)

    @ti.func
    def evaluate_contacts(self, t, block: ti.template(), step, dt, noted):
        """CONTACTS: forces of the contacts at the new positions, a row of the list for each grain."""
        stage = STAGES * step + CONTACTS
        share = self.team.claim(t, stage)
        while share >= 0:
            self.forces.evaluate_rows(block, self.team.first_slot[share], self.team.first_slot[share + 1], dt, noted)
            share = self.team.finish(t, stage)
        self.team.barrier(t, stage)
