"""A fourth-order scheme for comparison: three Verlet steps, of which the middle one goes back in time."""

from ..core.errors import InputError
from ..core.runtime import ti
from .verlet import VelocityVerlet

OUTER = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))  # Yoshida (1990), Eq. (2.8): part of three steps
WEIGHTS = (3.0 * OUTER, 3.0 * (1.0 - 2.0 * OUTER), 3.0 * OUTER)  # of the parts, in steps dt


@ti.data_oriented
class ForestRuth(VelocityVerlet):
    """Composition of Forest & Ruth (1990) and Yoshida (1990): three steps of dt make one of 3 dt, of fourth order where
    the forces are smooth.

    The forces of contacts are not: they begin inside a step, and backward parts open contacts again. Here to show what
    that costs. For scenes that lose no energy; the state is that of the scheme after every third step.
    """

    conservative = True

    def __init__(self, forces, platens, skin, dt, threads=1):
        super().__init__(forces, platens, skin, dt, threads)
        if self.offloaded:
            raise InputError("Scene.integrator: ForestRuth counts the steps of a launch, which a GPU makes one by one")
        self.made = 0  # steps since the start
        self.begun = ti.field(ti.i32, ())

    @ti.func
    def weight(self, number):
        """Part of three steps that the step of this number takes, in dt."""
        return ti.select(number % 3 == 1, WEIGHTS[1], WEIGHTS[0])

    @ti.func
    def drift_time(self, step):
        return self.dt[None] * self.weight(self.begun[None] + step)

    @ti.func
    def kick_time(self, step):
        number = self.begun[None] + step
        return 0.5 * self.dt[None] * (self.weight(number + 2) + self.weight(number))

    @ti.func
    def last_time(self):
        return self.dt[None] * self.weight(self.begun[None] + 2)

    def launch(self, count):
        super().launch(count)
        self._count(self.steps_done[None])

    def contacts_only(self, dt):
        super().contacts_only(dt)
        self.made = self.made if dt > 0.0 else 0
        self._count(1 if dt > 0.0 else 0)

    def go_on_from(self, former):
        self.made = former.made
        self._count(0)

    def _count(self, steps):
        self.made += steps
        self.begun[None] = self.made % 3
