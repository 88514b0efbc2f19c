"""A fourth-order scheme for comparison: three Verlet steps, of which the middle one goes back in time."""

from ..core.errors import InputError
from ..core.runtime import current, ti
from .verlet import VelocityVerlet

OUTER = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))  # Yoshida (1990), Eq. (2.8): share of three steps
WEIGHTS = (3.0 * OUTER, 3.0 * (1.0 - 2.0 * OUTER), 3.0 * OUTER)  # lengths of the three steps, in dt


@ti.data_oriented
class ForestRuth(VelocityVerlet):
    """Forest & Ruth (1990), Yoshida (1990): three steps of dt make one of 3 dt, of fourth order for smooth forces.

    The forces of contacts are not smooth: they begin inside a step, and backward steps open contacts again. The
    scheme is here to show what that costs. For scenes that lose no energy; the state is that of the scheme after every
    third step.
    """

    conservative = True

    def __init__(self, spec, forces, dt):
        super().__init__(spec, forces, dt)
        if current().arch != "cpu":
            raise InputError("Scene.integrator: ForestRuth counts the steps of a launch, which a GPU makes one by one")
        self.steps_made = 0  # since the start
        self.begun = ti.field(ti.i32, ())  # steps of the present three that were made before this launch

    @ti.func
    def weight(self, number):
        """Length of the step of this number, in dt."""
        return ti.select(number % 3 == 1, WEIGHTS[1], WEIGHTS[0])

    @ti.func
    def drift_time(self, step):
        """Time [s] of the drift in this step of a launch; negative in the middle one of three."""
        return self.dt[None] * self.weight(self.begun[None] + step)

    @ti.func
    def kick_time(self, step):
        """Half of the drift before (two steps on, for the three repeat) and half of this step's [s]."""
        number = self.begun[None] + step
        return 0.5 * self.dt[None] * (self.weight(number + 2) + self.weight(number))

    @ti.func
    def last_drift_time(self):
        """Time [s] of the drift that led to the present positions."""
        return self.dt[None] * self.weight(self.begun[None] + 2)

    def restart(self, step: int = 0) -> None:
        """Begin after so many steps, with the one of three that follows them."""
        self.steps_made = 0
        self.count_steps(step)

    def count_steps(self, steps: int) -> None:
        """Count the steps of a launch; the next one begins with the one of three that follows."""
        self.steps_made += steps
        self.begun[None] = self.steps_made % 3

    def take_over(self, former: VelocityVerlet) -> None:
        """Go on where another integrator of this class is."""
        self.steps_made = former.steps_made
        self.count_steps(0)
