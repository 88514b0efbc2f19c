"""The simulated cell: a box, periodic along some axes and open along the others, at rest or in homogeneous shear."""

import numpy as np

from ..core.errors import InputError
from ..core.runtime import ti, when_allocated
from ..core.schema import Variable

SHEAR_ROWS = [
    Variable("strain", ("cell",), "f64", "1", "shear strain since the start", True),
    Variable("built_strain", ("cell",), "f64", "1", "shear strain when the neighbour list was built", True),
]


def check_box(lengths, periodic, largest_diameter, skin):
    """Refuse a periodic axis on which a grain could meet its own image.

    lengths [m], periodic (bool): one per axis; largest_diameter [m]: of the bounding circles; skin [m].
    Raises InputError if a periodic length is below 2 (largest_diameter + skin).
    """
    for axis, (length, repeats) in enumerate(zip(lengths, periodic, strict=True)):
        least = 2.0 * (largest_diameter + skin)
        if repeats and not (np.isfinite(length) and length >= least):
            raise InputError(f"box axis {'xyz'[axis]}: length {length:g} m is periodic and must be >= {least:g} m")


@ti.func
def nearest_integer(a):
    """Nearest integer of an f64 below 2^51 in magnitude, without the library call that `floor` costs."""
    big = ti.cast(6755399441055744.0, ti.f64)  # 1.5 * 2^52: there f64 numbers are integers; exact in f32 as well
    return (a + big) - big


@ti.data_oriented
class Domain:
    """Minimum-image geometry of the cell. Positions are never wrapped: wrapping would change their last bits.

    In a sheared cell (shear_rate [s-1] not 0, Lees & Edwards 1972) the image above, at y + L_y, is shifted along x by
    the strain times L_y and moves with shear_rate times L_y. As positions are not wrapped, velocities need no change
    when a grain crosses the border: the mean flow is shear_rate times y everywhere.
    """

    def __init__(self, lengths, periodic, shear_rate=0.0):
        self.dim = len(lengths)
        self.sheared = shear_rate != 0.0
        self.periodic = tuple(bool(p) for p in periodic)
        self.length = ti.field(ti.f64, self.dim)
        self.inverse_length = ti.field(ti.f64, self.dim)
        if self.sheared:
            self.shear_rate, self.tilt = ti.field(ti.f64, 1), ti.field(ti.f64, 1)
            self.strain, self.built_strain, self.strain_before = (ti.field(ti.f64, 1) for _ in range(3))
            self.widest = ti.field(ti.f64, 1)
        when_allocated(lambda: self.set_lengths(lengths))

    def set_shear(self, shear_rate, widest, strain=0.0):
        """Shear at this rate [s-1] from this strain on. widest [m]: greatest distance of centres at which grains act
        on each other.
        """
        self.shear_rate[0], self.widest[0], self.strain[0] = shear_rate, widest, strain
        shift = strain * self.length[1]
        self.tilt[0] = shift - self.length[0] * np.rint(shift * self.inverse_length[0])

    def mean_flow(self, position):
        """Velocity (n, dim) [m s-1] of the mean flow at these places (n, dim) [m]; 0 in a cell at rest."""
        flow = np.zeros_like(position)
        if self.sheared:
            flow[:, 0] = self.shear_rate[0] * position[:, 1]
        return flow

    def flow_over(self, skin):
        """Greatest speed [m s-1] at which the mean flow parts two grains within each other's reach and `skin` [m]."""
        return abs(self.shear_rate[0]) * (self.widest[0] + skin) if self.sheared else 0.0

    def set_lengths(self, lengths):
        """Write the lengths of the cell [m]; those of open axes do not matter."""
        finite = np.where(self.periodic, lengths, 1.0).astype(float)
        for axis, length in enumerate(finite):  # each `from_numpy` would be a kernel to compile
            self.length[axis], self.inverse_length[axis] = length, 1.0 / length

    @ti.func
    def displacement(self, x_k, x_l):
        """Vector from x_k to the nearest image of x_l [m]."""
        d = x_l - x_k
        if ti.static(self.sheared):
            d[0] -= self.tilt[0] * self.borders(x_k, x_l)
        for axis in ti.static(range(self.dim)):
            if ti.static(self.periodic[axis]):
                d[axis] -= self.length[axis] * nearest_integer(d[axis] * self.inverse_length[axis])
        return d

    def apart(self, x_k, x_l):
        """The same on the host, for one pair: (dim,) [m]."""
        d = x_l - x_k
        if self.sheared:
            d[0] -= self.tilt[0] * np.rint(d[1] * self.inverse_length[1])
        for axis in np.flatnonzero(self.periodic):
            d[axis] -= self.length[axis] * np.rint(d[axis] * self.inverse_length[axis])
        return d

    @ti.func
    def borders(self, x_k, x_l):
        """Borders along y that lie between x_k and the image of x_l nearest to it, which is then x_l itself if 0."""
        return nearest_integer((x_l[1] - x_k[1]) * self.inverse_length[1])

    @ti.func
    def border_speed(self, x_k, x_l):
        """Speed along x [m s-1] of what is at x_l against its image nearest to x_k."""
        return self.borders(x_k, x_l) * self.shear_rate[0] * self.length[1]

    @ti.func
    def note_strain(self):
        """Before a launch: remember the strain since the list was built, for `displacement_in_flow`."""
        if ti.static(self.sheared):
            self.strain_before[0] = self.strain[0] - self.built_strain[0]

    @ti.func
    def shear(self, dt):
        """Move the images by a step of dt [s]; they must not be read meanwhile."""
        self.strain[0] = self.strain[0] + self.shear_rate[0] * dt
        shift = self.strain[0] * self.length[1]
        self.tilt[0] = shift - self.length[0] * nearest_integer(shift * self.inverse_length[0])

    @ti.func
    def carried(self, v, x, dt):
        """u_x u_y dt [m2 s-1] of a grain with velocity v that was at x a step ago, u its velocity in the mean flow."""
        flow = self.shear_rate[0] * (x[1] + 0.5 * v[1] * dt)
        return (v[0] - flow) * v[1] * dt

    @ti.func
    def path_length(self, x, before, half_skin, dt):
        """Upper bound of the path length of a grain in a step against the mean flow [m], and half of the displacement
        by the flow of a listed neighbour against it.
        """
        displacement = x - before
        displacement[0] -= self.shear_rate[0] * before[1] * dt
        return displacement.norm() + ti.abs(self.shear_rate[0]) * dt * (0.5 * self.widest[0] + 2.0 * half_skin)

    @ti.func
    def displacement_in_flow(self, displacement, built, half_skin, time):
        """(displacement of a grain since the list was built less that of the mean flow, its upper bound) [m].

        displacement: with the flow; built: where it was then; time [s]: since the launch began, as the strain itself
        may be changing. With e the strain and d the vector between two grains then, that vector now is d + e d_y along x plus
        the difference of their displacements, and |d_y| is at most `widest` plus both displacements if they touch.
        """
        strain = self.strain_before[0] + self.shear_rate[0] * time
        displacement[0] -= strain * built[1]
        return displacement, (half_skin - 0.5 * ti.abs(strain) * self.widest[0]) / (1.0 + ti.abs(strain))

    @ti.func
    def straightened(self, x):
        """Position in the upright cell into which the sheared one is turned back [m], images along the axes."""
        result = x
        if ti.static(self.sheared):
            result[0] -= self.tilt[0] * self.inverse_length[1] * x[1]
        return result

    def widening(self):
        """How many times two points may lie farther apart along x in the upright cell than they are, at most."""
        return np.hypot(1.0, 0.5 * self.length[0] / self.length[1]) if self.sheared else 1.0


def check_shear(scene):
    """Raise InputError if the scene cannot be sheared homogeneously."""
    rate = scene.shear_rate
    if not rate:
        return
    if not np.isfinite(rate):
        raise InputError(f"Scene.shear_rate: {rate!r} s-1, must be a finite number")
    if not (scene.periodic[0] and scene.periodic[1]):
        raise InputError(f"Scene.shear_rate: {rate:g} s-1 needs a cell that is periodic along x and y")
    for name in ("platens", "walls"):
        if getattr(scene, name):
            raise InputError(f"Scene.shear_rate: {rate:g} s-1 with {name}, which would not take part in the mean flow")
    wrong = [e.name for e in scene.effects if e.phase in ("body", "motion")]
    if wrong:
        raise InputError(f"Scene.shear_rate: {rate:g} s-1 with {wrong}, which would change the mean flow")
    if not (scene.integrator.half_step):
        name = scene.integrator.__name__
        raise InputError(
            f"Scene.shear_rate: {rate:g} s-1 with {name}, which does not account for the work; must be a Verlet scheme"
        )
