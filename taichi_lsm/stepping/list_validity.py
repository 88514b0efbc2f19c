"""Whether the neighbour list still holds every pair that may touch."""

from typing import Any

from ..core.allocation import when_allocated, write
from ..core.runtime import ti

ROTATION_MARGIN = 1.01  # the angular velocity is a mean over the step; the rotation may be a little more


@ti.data_oriented
class ListValidity:
    """Asks for a new neighbour list when a grain, or a part of it, has moved by half the skin since the list was built.

    Parameters
    ----------
    spec : KernelSpec
        What the scene needs.
    scheme
        Integration scheme, which knows grains, cell and time step.
    skin : float
        Skin of the neighbour list [m].

    Attributes
    ----------
    outdated : Taichi field ()
        0, or 1 + the number of the step in the launch in which that happened.
    """

    def __init__(self, spec: Any, scheme: Any, skin: float) -> None:
        self.spec, self.scheme = spec, scheme
        self.grains, self.domain = scheme.grains, scheme.domain
        self.half_skin = ti.field(ti.f64, ())
        self.outdated = ti.field(ti.i32, ())
        when_allocated(lambda: self.set_skin(skin))

    def set_skin(self, skin: float) -> None:
        """Set the skin of the neighbour list [m]."""
        write(self.half_skin, 0.5 * skin)

    @ti.func
    def check(self, k, before, step):
        """Compare the displacement of grain k since the list was built with half the skin.

        before [m]: position at the start of the step, from which the path length of the grain's surface follows.
        """
        g = self.grains
        if ti.static(self.spec.shaped):
            self.add_travel(k, before, step)
        limit = self.half_skin[None]
        displacement = g.position[k] - g.built_position[k]
        if ti.static(self.spec.sheared):
            time = (step + 1) * self.scheme.dt[None]
            displacement, limit = self.domain.displacement_in_flow(displacement, g.built_position[k], limit, time)
        if ti.static(self.spec.multi_part):
            # A point at the distance R moves by less than R |change of q| (2D), 2 R |change of q| (3D).
            change = (g.orientation[k] - g.built_orientation[k]).norm()
            limit -= ti.static(1.0 if self.grains.dim == 2 else 2.0) * change * g.radius[k]
        # Written so that a position that is not a number also asks for a new list, which then reports it.
        if not (limit > 0.0 and displacement.dot(displacement) < limit * limit):
            self.outdated[None] = 1 + step

    @ti.func
    def add_travel(self, k, before, step):
        """Add this step to the path length of the farthest surface point of grain k.

        Two surfaces that are apart stay unexamined until their grains have travelled the gap.
        """
        g = self.grains
        path = (g.position[k] - before).norm()
        if ti.static(self.spec.sheared):
            path = self.domain.path_length(g.position[k], before, self.half_skin[None], self.scheme.dt[None])
        fastest = ti.abs(g.angular_velocity[k][0]) if ti.static(g.dim == 2) else g.angular_velocity[k].norm()
        rotation = ROTATION_MARGIN * fastest * self.scheme.drift_time(step) * g.radius[k]
        g.travel[k] = g.travel[k] + path + ti.abs(rotation)  # a step may also go back in time
