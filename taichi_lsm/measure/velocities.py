"""Velocities of the grains at the time of their positions."""

from typing import TYPE_CHECKING

import numpy as np

from ..core.runtime import current, ti

if TYPE_CHECKING:
    from ..stepping.verlet import VelocityVerlet


@ti.data_oriented
class SynchronisedVelocities:
    """Reads velocities at the time of the positions, which the state of a Verlet scheme holds half a step before.

    The state stays as it is. Compiled when `values` is first called.
    """

    def __init__(self, integrator: "VelocityVerlet") -> None:
        self.integrator, self.grains, self.serial = integrator, integrator.grains, current().serial

    def values(self) -> np.ndarray:
        """Velocities (n, dim) [m s-1] by persistent id, world frame."""
        result = np.zeros((len(self.grains), self.grains.dim))
        self.write(result)
        return result

    @ti.kernel
    def write(self, result: ti.types.ndarray()):
        """v(t) = v(t - dt/2) + (F dt/2 + J) / m, with the force F at t and the impulses J of the last step."""
        ti.loop_config(serialize=self.serial)
        for k in range(self.grains.count[None]):
            v, omega = self.integrator.synchronised(k)
            if ti.static(self.integrator.spec.cell_servo):
                v[1] += self.integrator.domain.stretch_rate() * self.grains.position[k][1]
            for axis in ti.static(range(self.grains.dim)):
                result[self.grains.id[k], axis] = v[axis]
