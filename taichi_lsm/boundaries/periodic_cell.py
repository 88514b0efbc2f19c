"""The simulated cell: a box, periodic along some axes and open along the others, at rest or in homogeneous shear."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.allocation import read, when_allocated, write
from ..core.errors import InputError
from ..core.runtime import ti
from ..core.schema import Variable

SHEAR_ROWS = [
    Variable("strain", ("cell",), "f64", "1", "shear strain since the start", True),
    Variable("built_strain", ("cell",), "f64", "1", "shear strain when the neighbour list was built", True),
]


def check_box(lengths: Sequence[float], periodic: Sequence[bool], largest_diameter: float, skin: float) -> None:
    """Refuse a periodic axis on which a grain could touch its own image.

    Parameters
    ----------
    lengths
        Lengths of the cell (dim,) [m].
    periodic
        Whether the cell is periodic along each axis (dim,).
    largest_diameter
        Greatest diameter of the bounding circles or spheres of the grains [m].
    skin
        Skin of the neighbour list [m].

    Raises
    ------
    InputError
        If a periodic length is below 2 (largest_diameter + skin).
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

    Parameters
    ----------
    lengths
        Lengths of the cell (dim,) [m]; those of open axes do not matter.
    periodic
        Whether the cell is periodic along each axis (dim,).
    sheared
        Whether the cell is in simple shear, with a mean flow of du_x/dy = shear_rate (`set_shear`).

    Notes
    -----
    In a sheared cell (Lees & Edwards 1972) the image above, at y + L_y, is shifted along x by the strain times L_y and
    moves with shear_rate times L_y. As positions are not wrapped, velocities need no change when a grain crosses the
    border: the mean flow is shear_rate times y everywhere.
    """

    rows: Sequence[Variable] = SHEAR_ROWS  # of the state of a sheared cell
    driven = False  # whether the height of the cell moves

    def __init__(self, lengths: Sequence[float], periodic: Sequence[bool], sheared: bool = False) -> None:
        self.dim = len(lengths)
        self.sheared = sheared
        self.periodic = tuple(bool(p) for p in periodic)
        self.length = ti.field(ti.f64, self.dim)
        self.inverse_length = ti.field(ti.f64, self.dim)
        if self.sheared:
            self.shear_rate, self.tilt = ti.field(ti.f64, 1), ti.field(ti.f64, 1)
            self.strain, self.built_strain, self.strain_before = (ti.field(ti.f64, 1) for _ in range(3))
            self.widest = ti.field(ti.f64, 1)
        when_allocated(lambda: self.set_lengths(lengths))

    def set_shear(self, shear_rate: float, widest: float, strain: float = 0.0) -> None:
        """Shear the cell from now on.

        Parameters
        ----------
        shear_rate
            Rate of simple shear [s-1].
        widest
            Greatest distance between the centres of two grains that act on each other [m].
        strain
            Shear strain so far [-].
        """
        for field, value in ((self.shear_rate, shear_rate), (self.widest, widest), (self.strain, strain)):
            write(field, value)
        length, shift = read(self.length), strain * read(self.length)[1]
        write(self.tilt, shift - length[0] * np.rint(shift * read(self.inverse_length)[0]))

    def settle(self) -> None:
        """What follows from the rows, after they were replaced."""
        self.set_shear(*(float(read(row)[0]) for row in (self.shear_rate, self.widest, self.strain)))

    def mean_flow(self, position: NDArray) -> NDArray:
        """Velocity (n, dim) [m s-1] of the mean flow at positions (n, dim) [m]; 0 in a cell at rest."""
        flow = np.zeros_like(position)
        if self.sheared:
            flow[:, 0] = read(self.shear_rate)[0] * position[:, 1]
        return flow

    def missing_flow(self, position: NDArray) -> NDArray:
        """Velocity (n, dim) [m s-1] of the mean flow at positions (n, dim) [m] that velocities of the state lack."""
        return np.zeros_like(position)

    def flow_over(self, skin: float) -> float:
        """Greatest speed [m s-1] at which the mean flow separates two grains within reach plus `skin` [m]."""
        return abs(read(self.shear_rate)[0]) * (read(self.widest)[0] + skin) if self.sheared else 0.0

    @property
    def lengths(self) -> NDArray:
        """Lengths of the cell (dim,) [m] now; 1 m along open axes."""
        return self._lengths

    def set_lengths(self, lengths: Sequence[float]) -> None:
        """Write the lengths of the cell (dim,) [m]; those of open axes do not matter."""
        self._lengths = finite = np.where(self.periodic, lengths, 1.0).astype(float)  # as the fields below hold them
        write(self.length, finite)
        write(self.inverse_length, 1.0 / finite)

    @ti.func
    def displacement(self, x_k, x_l):
        """Vector (dim,) [m] from x_k to the nearest image of x_l, by the minimum-image convention."""
        d = x_l - x_k
        # First the image across y, which is shifted along x; only then is the nearest image along x known.
        if ti.static(self.sheared):
            d[0] -= self.tilt[0] * self.borders(x_k, x_l)
        for axis in ti.static(range(self.dim)):
            if ti.static(self.periodic[axis]):
                d[axis] -= self.length[axis] * nearest_integer(d[axis] * self.inverse_length[axis])
        return d

    def displacement_on_host(self, x_k: NDArray, x_l: NDArray) -> NDArray:
        """`displacement` on the host: vector (dim,) [m] from x_k to the nearest image of x_l."""
        d = x_l - x_k
        if self.sheared:
            d[0] -= self.tilt[0] * np.rint(d[1] * self.inverse_length[1])
        for axis in np.flatnonzero(self.periodic):
            d[axis] -= self.length[axis] * np.rint(d[axis] * self.inverse_length[axis])
        return d

    @ti.func
    def borders(self, x_k, x_l):
        """Number of cell borders along y between x_l and the image of x_l nearest to x_k; 0 if that is x_l itself."""
        return nearest_integer((x_l[1] - x_k[1]) * self.inverse_length[1])

    @ti.func
    def border_speed(self, x_k, x_l):
        """Velocity along x [m s-1] of a point at x_l relative to its image nearest to x_k."""
        return self.borders(x_k, x_l) * self.shear_rate[0] * self.length[1]

    @ti.func
    def note_strain(self):
        """Store the strain between the last list and the start of a launch, for `displacement_in_flow`."""
        if ti.static(self.sheared):
            self.strain_before[0] = self.strain[0] - self.built_strain[0]

    @ti.func
    def note_built(self):
        """Keep the strain for which the neighbour list is built."""
        self.built_strain[0] = self.strain[0]

    @ti.func
    def shear(self, dt):
        """Move the images by a step of dt [s]; other threads must not read them at the same time."""
        # The tilt is the shift of the image above, reduced to at most half a cell length.
        self.strain[0] = self.strain[0] + self.shear_rate[0] * dt
        shift = self.strain[0] * self.length[1]
        self.tilt[0] = shift - self.length[0] * nearest_integer(shift * self.inverse_length[0])

    @ti.func
    def carried(self, v, x, dt):
        """u_x u_y dt [m2 s-1], u the velocity of a grain relative to the mean flow: its kinetic shear stress over m/V.

        v [m s-1]: velocity of the grain; x [m]: its position a step of dt [s] ago.
        """
        flow = self.shear_rate[0] * (x[1] + 0.5 * v[1] * dt)
        return (v[0] - flow) * v[1] * dt

    @ti.func
    def path_length(self, x, before, half_skin, dt):
        """Upper bound [m] of what a grain adds in a step of dt [s] to the approach of two surfaces.

        It is the path length relative to the mean flow, from `before` to x [m], plus half of the displacement by which
        the flow moves a listed neighbour relative to the grain; half_skin [m] bounds how far that neighbour is.
        """
        displacement = x - before
        displacement[0] -= self.shear_rate[0] * before[1] * dt
        return displacement.norm() + ti.abs(self.shear_rate[0]) * dt * (0.5 * self.widest[0] + 2.0 * half_skin)

    @ti.func
    def displacement_in_flow(self, displacement, built, half_skin, time):
        """Displacement of a grain since the list was built less that of the mean flow, and its upper bound [m].

        displacement [m]: with the flow; built [m]: position when the list was built; time [s]: since the launch began,
        from which the strain is computed because another thread may be changing the stored one.
        With e the strain since then and d the vector between two grains then, that vector now is d + e d_y along x plus
        the difference of their displacements, and |d_y| is at most `widest` plus both displacements if they touch.
        """
        strain = self.strain_before[0] + self.shear_rate[0] * time
        displacement[0] -= strain * built[1]
        return displacement, (half_skin - 0.5 * ti.abs(strain) * self.widest[0]) / (1.0 + ti.abs(strain))

    @ti.func
    def straightened(self, x):
        """Position [m] after the tilt of the sheared cell is undone: there all images lie along the axes."""
        result = x
        if ti.static(self.sheared):
            result[0] -= self.tilt[0] * self.inverse_length[1] * x[1]
        return result

    def widening(self) -> float:
        """Greatest factor [-] by which `straightened` may stretch a distance along x.

        The tilt is at most half a cell length L_x over the height L_y: |d_x + d_y L_x/(2 L_y)| <= |d| times the factor.
        """
        length = read(self.length)
        return np.hypot(1.0, 0.5 * length[0] / length[1]) if self.sheared else 1.0


def check_shear(scene: Any) -> None:
    """Refuse a scene that cannot be sheared homogeneously.

    Parameters
    ----------
    scene : Scene
        The scene; without a shear rate and without a servo of the cell it always passes.

    Raises
    ------
    InputError
        If the rate is not finite, the cell is not periodic along x and y, or the scene has platens, walls, effects or
        an integrator that do not go with a mean flow.
    """
    rate = scene.shear_rate
    if not rate and scene.cell_servo is None:
        return
    given = f"Scene.shear_rate: {rate:g} s-1" if rate else "Scene.cell_servo: given"
    if not np.isfinite(rate):
        raise InputError(f"Scene.shear_rate: {rate!r} s-1, must be a finite number")
    if not (scene.periodic[0] and scene.periodic[1]):
        raise InputError(f"{given} needs a cell that is periodic along x and y; see Scene.periodic")
    for name in ("platens", "walls"):
        if getattr(scene, name):
            raise InputError(f"{given} with {name}, which would not take part in the mean flow")
    wrong = [e.name for e in scene.effects if e.phase in ("body", "motion")]
    if wrong:
        raise InputError(f"{given} with {wrong}, which would change the mean flow")
    if not scene.integrator.half_step:
        name = scene.integrator.__name__
        raise InputError(f"{given} with {name}, which does not account for the work; must be a Verlet scheme")
