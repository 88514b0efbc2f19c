"""A sheared cell whose height follows a servo, and the grains with it: affine flow along x and y, without walls.

The mean flow is u = (rate y, h'/h y): the grains are carried with it, so that no place in the cell differs from another
one. With w the velocity of a grain relative to the mean flow and F the force on it,

    x' = w + u(x),    m w' = F - m (rate w_y, (h'/h) w_y),    M h'' = (sigma_yy - sigma) A - C h',
    sigma_yy A h = sum over contacts of f_y d_y + sum over grains of m w_y^2.

Along y these are the equations of Andersen (1980) and, with the shape of the cell, of Parrinello and Rahman (1981);
along x those of Lees and Edwards (1972) as SLLOD writes them (Evans and Morriss 1984). What the grains lose in a
compression is -sigma_yy A h': kinetic and elastic energy of the grains, kinetic energy M h'^2/2 of the height and the
work -sigma A (h - h_0) of the stress balance, but for what contacts and drag dissipate.

The velocity of a grain in the state is its own along y, w_y, and has the mean flow along x, as in any sheared cell. A
step is one of Verlet: kicks by forces, of the grains and of the height, then a flight without forces while the height
moves at a constant speed, for which the equations above are solved exactly along y.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.allocation import read, write
from ..core.errors import InputError, SimulationError, require
from ..core.fields import allocate
from ..core.runtime import ti
from ..core.schema import Variable
from .cell_servo import CellServo
from .periodic_cell import SHEAR_ROWS, Domain, nearest_integer
from .servo import servo_kick


def _row(name: str, units: str, long_name: str, restart: bool = True) -> Variable:
    return Variable(name, ("cell",), "f64", units, long_name, restart)


HEIGHT_ROWS = [
    _row("height", "m", "height of the cell"),
    _row("speed", "m s-1", "rate of change of the height, half a step before"),
    _row("shift", "m", "displacement of the image above along x since the start, not reduced to the cell"),
    _row("built_height", "m", "height when the neighbour list was built"),
    _row("built_shift", "m", "shift when the neighbour list was built"),
    _row("shear_rate", "s-1", "rate of shear"),
    _row("stress", "Pa", "normal stress that the servo keeps"),
    _row("speed_limit", "m s-1", "greatest speed of the height"),
    _row("force", "N", "total normal stress of the grains times the area of the cell"),
    _row("force_sum", "N", "sum of that force over steps"),
    _row("force_square_sum", "N2", "sum of its square over steps"),
    _row("work", "J", "work of the normal stress on the height"),
    _row("dissipated", "J", "energy that drag, speed limit and least height dissipated"),
]
# What follows from them and from the scene: area of the cell, drag and mass of its height; the stretch of the height in
# the step and since the list was built, the shear since then, and the distortion by both.
DERIVED_ROWS = [
    _row("area", "m2", "area of the cell square to its height", restart=False),
    _row("drag", "kg s-1", "drag of the height", restart=False),
    _row("inertia", "kg", "mass of the height", restart=False),
    _row("least_height", "m", "height below which the servo does not press", restart=False),
    _row("stretch", "1", "relative change of the height in the last step", restart=False),
    _row("stretch_since", "1", "relative change of the height since the list was built", restart=False),
    _row("shear_since", "1", "shear along x since the list was built, per height of then", restart=False),
    _row("distortion", "1", "norm of the inverse deformation since the list was built, less the unit", restart=False),
]
PUBLISHED = ("strain", "shear_rate", "height", "speed", "shift", "force_sum", "force_square_sum", "work", "dissipated")


@ti.data_oriented
class DrivenCell(Domain):
    """A sheared cell whose height a `CellServo` moves.

    Parameters
    ----------
    scene : Scene
        With its `cell_servo`.
    grains
        State of the grains, which carry their shares of the normal stress (`virial`).
    """

    rows = (*SHEAR_ROWS, *HEIGHT_ROWS)
    driven = True

    def __init__(self, scene: Any, grains: Any) -> None:
        super().__init__(scene.lengths, scene.periodic, sheared=True)
        self.grains, self.servo, self.listed_within = grains, scene.cell_servo, 0.0
        own = [row for row in HEIGHT_ROWS + DERIVED_ROWS if row.name != "shear_rate"]
        for name, field in vars(allocate(own, 1, {})).items():
            setattr(self, name, field)

    def load(self, scene: Any) -> None:
        """Write what the scene says of the height; its lengths are known already."""
        self.servo = scene.cell_servo
        across = [length for axis, length in enumerate(scene.lengths) if axis != 1]
        write(self.area, float(np.prod(across)) * (scene.thickness if self.dim == 2 else 1.0))
        # Greatest distance of grains that are listed [m]: images must lie farther apart than twice as much.
        self.listed_within = scene.widest() + scene.skin

    def set_lengths(self, lengths: Any) -> None:
        """As `Domain.set_lengths`; the height begins there."""
        super().set_lengths(lengths)
        for row in (self.height, self.built_height):
            write(row, lengths[1])

    def set_shear(self, shear_rate: float, widest: float, strain: float = 0.0) -> None:
        """As `Domain.set_shear`; the height is at rest, and no work has been done."""
        height = read(self.height)[0]
        super().set_shear(shear_rate, widest, strain)
        for row in (self.speed, self.force, self.force_sum, self.force_square_sum, self.work, self.dissipated):
            write(row, 0.0)
        for row in (self.shift, self.built_shift):
            write(row, strain * height)
        self._write_servo()

    def _write_servo(self) -> None:
        """Write the values of the servo to the fields that the kernel reads."""
        for name in ("stress", "speed_limit", "drag", "inertia", "least_height"):
            write(getattr(self, name), getattr(self.servo, name))

    def set_servo(self, servo: CellServo) -> None:
        """Change the stress or the speed limit of the servo between two calls of `Simulation.run`.

        Raises
        ------
        InputError
            If anything else differs from the servo of the start.
        """
        for name in ("inertia", "stiffness", "damping_ratio", "least_height"):
            given, now = getattr(servo, name), getattr(self.servo, name)
            require(given == now, servo, name, given, f"{now!r} as at the start")
        if servo.speed_limit == 0.0:
            self.hold()
        self.servo = servo
        self._write_servo()

    def hold(self) -> None:
        """Bring the height to rest; its kinetic energy counts as dissipated."""
        kinetic = self.kinetic_energy()
        write(self.dissipated, read(self.dissipated)[0] + kinetic)
        write(self.speed, 0.0)

    def set_shear_rate(self, rate: float) -> None:
        """Shear at another rate [s-1] from now on; velocities relative to the mean flow stay what they are.

        Raises
        ------
        InputError
            If the rate is not finite.
        """
        if not np.isfinite(rate):
            raise InputError(f"DrivenCell.set_shear_rate: {rate!r} s-1, must be a finite number")
        grains, change = self.grains, rate - read(self.shear_rate)[0]
        height = grains.column("position")[:, 1]
        for name in ("velocity", "last_velocity"):
            if grains.has(name):
                velocity = grains.column(name)
                velocity[:, 0] += change * height
                grains.set_column(name, velocity)
        write(self.shear_rate, rate)

    def settle(self) -> None:
        """What follows from the rows, after they were replaced."""
        length = read(self.length)
        length[1] = read(self.height)[0]
        write(self.length, length)
        write(self.inverse_length, 1.0 / length)
        shift = read(self.shift)[0]
        write(self.tilt, shift - length[0] * np.rint(shift * read(self.inverse_length)[0]))
        stress, limit = float(read(self.stress)[0]), float(read(self.speed_limit)[0])
        self.servo = replace(self.servo, stress=stress, speed_limit=limit)

    @property
    def lengths(self) -> NDArray:
        """Lengths of the cell (dim,) [m] now."""
        return read(self.length)

    def flow_over(self, skin: float) -> float:
        """As `Domain.flow_over`, with the speed at which the height separates grains."""
        rate = np.hypot(read(self.shear_rate)[0], read(self.speed)[0] / read(self.height)[0])
        return float(rate) * (read(self.widest)[0] + skin)

    def missing_flow(self, position: NDArray) -> NDArray:
        """As `Domain.missing_flow`: the mean flow along y."""
        flow = np.zeros_like(position)
        flow[:, 1] = read(self.speed)[0] / read(self.height)[0] * position[:, 1]
        return flow

    def check_height(self) -> None:
        """Raise SimulationError if the cell has become so low that a grain could touch two images of another one."""
        height, least = float(read(self.height)[0]), 2.0 * self.listed_within
        if not height >= least:
            raise SimulationError(
                f"the height of the cell fell to {height:g} m, must be >= {least:g} m for grains of this size; "
                "begin with more grains"
            )

    def kinetic_energy(self, dt: float = 0.0) -> float:
        """Kinetic energy of the height [J] at the time of the positions.

        Its speed in the state is half a step of dt [s] older: the first half of the next kick is added.
        """
        rows = (self.speed, self.force, self.stress, self.area, self.speed_limit)
        v, force, stress, area, limit = (float(read(row)[0]) for row in rows)
        servo = self.servo
        v = np.clip(v + 0.5 * dt * (force - stress * area - servo.drag * v) / servo.inertia, -limit, limit)
        return float(0.5 * servo.inertia * v**2)

    def snapshot(self) -> dict[str, float]:
        """Rows of the height now: those of PUBLISHED, in their units."""
        return {name: float(read(getattr(self, name))[0]) for name in PUBLISHED}

    @ti.func
    def note_strain(self):
        """Nothing: threads read the deformation of a step only once it is complete."""

    @ti.func
    def note_built(self):
        """Keep the deformation for which the neighbour list is built."""
        self.built_strain[0] = self.strain[0]
        self.built_height[0] = self.height[0]
        self.built_shift[0] = self.shift[0]

    @ti.func
    def gather(self):
        """Sum the shares of the grains in the normal stress, in rising ids, which ends a step."""
        g, total = self.grains, ti.cast(0.0, ti.f64)
        for i in range(g.count[None]):
            total += g.virial[g.slot_of[i]]
        force = total * self.inverse_length[1]
        self.force[0] = force
        self.force_sum[0] = self.force_sum[0] + force
        self.force_square_sum[0] = self.force_square_sum[0] + force * force

    @ti.func
    def shear(self, dt):
        """Kick the height, then move it and the images by a step of dt [s]; of 0: nothing, as no step begins."""
        if dt > 0.0:
            before, v_before, load = self.height[0], self.speed[0], self.stress[0] * self.area[0]
            force, inertia = self.force[0], self.inertia[0]
            v, _, _ = servo_kick(load, self.drag[0], self.speed_limit[0], inertia, v_before, force, dt)
            v = ti.max(v, (self.least_height[0] - before) / dt)
            # Impulse of drag, speed limit and the stop at the least height, times the mean speed.
            held = inertia * (v - v_before) - (force - load) * dt
            self.dissipated[0] = self.dissipated[0] - held * 0.5 * (v_before + v)
            after = before + v * dt
            # The work of a constant stress depends on the heights alone.
            self.work[0] = self.work[0] - load * v * dt
            self.speed[0], self.height[0], self.stretch[0] = v, after, v * dt / before
            self.length[1], self.inverse_length[1] = after, 1.0 / after
            # The image above moves with the flow at the height where it is: that of the middle of the step.
            self.strain[0] = self.strain[0] + self.shear_rate[0] * dt
            shift = self.shift[0] + self.shear_rate[0] * dt * 0.5 * (before + after)
            self.shift[0] = shift
            self.tilt[0] = shift - self.length[0] * nearest_integer(shift * self.inverse_length[0])
            # The deformation since the list was built.
            e, stretch = (shift - self.built_shift[0]) / self.built_height[0], after / self.built_height[0] - 1.0
            self.shear_since[0], self.stretch_since[0] = e, stretch
            self.distortion[0] = ti.sqrt(e * e + stretch * stretch) / (1.0 + stretch)

    @ti.func
    def stretch_rate(self):
        """Rate h'/h [s-1] at which the mean flow stretches the cell along y."""
        return self.speed[0] * self.inverse_length[1]

    @ti.func
    def flight(self, x, v, dt):
        """Position and velocity of a grain after a flight of dt [s] without forces, and the integral of w_x w_y.

        x [m], v [m s-1]: before it. With the stretch s of the step, y becomes (1 + s) y + w_y dt and w_y becomes
        w_y/(1 + s), the solution of y' = w_y + (h'/h) y and w_y' = -(h'/h) w_y for a constant h'. The integral of w_y,
        by the trapezoidal rule, is what the shear takes from w_x; the integral of w_x w_y [m2 s-1] times m rate is the
        energy that goes into it.
        """
        rate, s = self.shear_rate[0], self.stretch[0]
        after, place = v, x + v * dt
        after[1] = v[1] / (1.0 + s)
        own_path = 0.5 * (v[1] + after[1]) * dt
        # v_x has the mean flow: rate times what the height of the grain changes by, less rate times its own path.
        after[0] = v[0] + rate * s * (x[1] + 0.5 * after[1] * dt)
        place[0] = x[0] + 0.5 * (v[0] + after[0]) * dt
        place[1] = x[1] + s * x[1] + v[1] * dt
        return place, after, (v[0] - rate * (x[1] + 0.5 * own_path)) * own_path

    @ti.func
    def path_length(self, x, before, half_skin, dt):
        """As `Domain.path_length`, with the stretch of the cell in the step beside its shear."""
        s, shear = self.stretch[0], self.shear_rate[0] * dt * (1.0 + 0.5 * self.stretch[0])
        displacement = x - before
        displacement[0] -= shear * before[1]
        displacement[1] -= s * before[1]
        return displacement.norm() + ti.sqrt(shear * shear + s * s) * (0.5 * self.widest[0] + 2.0 * half_skin)

    @ti.func
    def displacement_in_flow(self, displacement, built, half_skin, time):
        """As `Domain.displacement_in_flow`, for the deformation G = ((1, e), (0, 1 + s)) since the list was built.

        Two images d apart then are G d apart now but for their own displacements q. A pair that now touches, at most
        `widest` apart, was at most (1 + nu) (2 q) + nu widest farther apart then, with nu the norm of G^-1 - 1, which
        acts on heights alone: nu = sqrt(e^2 + s^2)/(1 + s).
        """
        displacement[0] -= self.shear_since[0] * built[1]
        displacement[1] -= self.stretch_since[0] * built[1]
        nu = self.distortion[0]
        return displacement, (half_skin - 0.5 * nu * self.widest[0]) / (1.0 + nu)


def cell_of(scene: Any, spec: Any, grains: Any) -> Domain:
    """The cell of a scene: one whose height moves if it has a servo.

    Parameters
    ----------
    scene : Scene
    spec : KernelSpec
        What the scene needs.
    grains
        State of the grains.
    """
    if spec.cell_servo:
        return DrivenCell(scene, grains)
    return Domain(scene.lengths, scene.periodic, spec.sheared)
