"""The stages of a step as launches of their own with a thread per grain, for a GPU."""

from ..core.runtime import ti


@ti.data_oriented
class Offloaded:
    """Kernels of an integrator, which provides `advance`, `carry`, `move_walls` and what they work on."""

    @ti.kernel
    def step_offloaded(self):
        """One step with a thread per grain, for a GPU; does nothing if the list must be rebuilt."""
        if self.halted[None] == 0:
            if ti.static(self.driven):
                self.platens.kick(self.dt[None])
            self.domain.note_strain()
            self.move_walls(0, 1, 0, 0.0)
        for k in range(self.grains.count[None]):
            if self.halted[None] == 0:
                if self.grains.platen_index[k] < 0:
                    self.advance(k, 0)
                elif ti.static(self.driven):
                    self.carry(k, 0)
        if ti.static(self.bonded):
            for k in range(self.grains.count[None]):
                if self.halted[None] == 0:
                    if self.bonds.evaluate(k) == 1:
                        self.moved[None] = 1
        if self.halted[None] == 0:
            if self.moved[None] == 1:
                self.halted[None] = 1
            else:
                self.steps_done[None] += 1
        for k in range(self.grains.count[None]):
            if self.halted[None] == 0:
                block = self.forces.block(0)
                self.forces.rows(block, k, k + 1, self.dt[None])
        if ti.static(self.driven):
            if self.halted[None] == 0:
                self.platens.gather(self.forces, self.dt[None])
        if ti.static(self.walled):
            if self.halted[None] == 0:
                self.forces.walls.gather(self.forces, self.dt[None])

    @ti.kernel
    def contacts_offloaded(self, dt: ti.f64):
        """Contacts at the present positions with a thread per grain: see `contacts_only`."""
        for k in range(self.grains.count[None]):
            block = self.forces.block(0)
            self.forces.rows(block, k, k + 1, dt)
        self.moved[None] = 0
        self.halted[None] = 0
        if ti.static(self.driven):
            self.platens.gather(self.forces, self.dt[None])
        if ti.static(self.walled):
            self.forces.walls.gather(self.forces, dt)
