"""A scene: everything that defines a run, as plain data, checked before anything is compiled."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import describe
from .bonds.bond_setup import bond_rate
from .boundaries.cell_servo import CellServo
from .boundaries.platens import Platen
from .boundaries.wall_servo import check_servo_steps
from .boundaries.wall_setup import PlaneWall
from .core.errors import InputError, finite
from .core.fields import rotation_size
from .effects.base import Bodies, Effect
from .scene_checks import check_orientation, check_scene, float_array, index_array
from .shapes import GrainShape, disc, sphere
from .stepping.guards import Guards
from .stepping.verlet import OnsetVerlet, VelocityVerlet

COORDINATION = {2: 6.0, 3: 10.0}  # contacts that a grain may have at once, for the stable step
STIFFENING_DEPTH = 0.1  # of a grain's radius: depth at which force laws that stiffen with it bound the step
SKIN = 0.07  # default margin of the neighbour list, in mean diameters

# Defaults of fields that `__post_init__` completes. They are typed as Any so that a type checker sees in each field
# what it holds from then on: an array, never None.
DERIVED: Any = None
UNIT: Any = 1.0


@dataclass(kw_only=True, eq=False)
class Scene:
    """Everything that defines a run of n grains, as plain data in SI units.

    All parameters are keywords, and each is an attribute of the same name. Arrays may be given as anything that NumPy
    turns into an array; the attributes are arrays, and defaults that depend on other parameters are filled in.

    Parameters
    ----------
    position : (n, dim) array of float
        Centres of mass at the start [m], world frame. Along periodic axes they need not lie inside the cell.
    density : float
        Mass density of all grains [kg m-3].
    effects : sequence of Effect
        What acts on the grains: contact forces, body forces, damping, bonds (`taichi_lsm.effects`). Each at most once.
    dim : {2, 3}
        Number of dimensions. Default: the number of columns of `position`.
    lengths : (dim,) sequence of float
        Lengths of the cell [m]; those along open axes do not matter. Default: infinite.
    periodic : (dim,) sequence of bool
        Along which axes the cell repeats. Default: along none.
    shapes : sequence of GrainShape
        Table of the shapes that occur, each of equivalent diameter 1 (`taichi_lsm.shapes`). Default: one disc (2D) or
        one sphere (3D).
    shape_index : (n,) array of int, or int
        Row of `shapes` of every grain. Default: 0 for all.
    diameter : (n,) array of float, or float
        Equivalent diameter of every grain [m]: the length unit of its shape, in 2D that of the disc of equal area, in
        3D that of the sphere of equal volume. Default: 1 m for all.
    angle : (n,) array of float
        2D only: angle from the body frame to the world frame at the start [rad]. Default: 0.
    orientation : (n, 4) array of float
        3D only: unit quaternions (w, x, y, z) from the body frame to the world frame. Default: no rotation.
    velocity : (n, dim) array of float
        Velocity at the start [m s-1], world frame; in a sheared cell, relative to the mean flow. Default: 0.
    angular_velocity : (n, 1) array of float in 2D, (n, 3) in 3D
        Angular velocity at the start [rad s-1], world frame. Default: 0.
    platen_index : (n,) array of int
        Row of `platens` that a grain is glued to, -1 for a mobile grain. Default: all are mobile.
    platens : sequence of Platen
        Rigid bodies of glued grains, each with one drive per axis. Default: none.
    walls : sequence of PlaneWall
        Rigid half-spaces that bound the grains. Default: none.
    shear_rate : float
        Rate of homogeneous shear of the cell [s-1], in which the mean velocity is `shear_rate` times y along x (Lees &
        Edwards 1972); see `boundaries/periodic_cell.py`. Default: 0, a cell at rest.
    cell_servo : CellServo
        Servo of the normal stress, which moves the height of the cell, and the grains with it; for a cell that is
        periodic along every axis, at rest or in shear. Default: None, a cell of constant height.
    thickness : float
        Depth of a 2D scene out of the plane [m], which turns areas into volumes. Default: the mean diameter.
    area : float
        Area of a platen over which its stress is taken [m2]. Default: from `lengths` and `thickness`.
    bonds : (m, 2) array of int
        Ids of grains that are bonded at the start, without stress; needs an effect of phase "bond". Stored sorted, the
        lower id first. Default: None, no bonds.
    bond_area : (m,) array of float
        Areas of the sections of the bonds [m2], in the order of `bonds`; a circle in 3D, in 2D a rectangle as deep as
        the scene. Default: None, by the `radius_ratio` of the effect.
    skin : float
        Margin of the neighbour list [m]. A larger one lists more pairs and is renewed less often. Results do not
        depend on it. Default: 0.07 mean diameters.
    dt : float
        Time step [s]. Default: None, `safety` times the stable step of a dense packing of these grains.
    safety : float
        Share of the stable step that is taken where `dt` is not given. Default: 0.3.
    integrator : type
        Class of the time integration: OnsetVerlet (default), VelocityVerlet, SymplecticEuler, ExplicitEuler or
        ForestRuth.
    track_dissipation : bool
        Whether the energy that each effect dissipates is added up; the energy budget needs it. Default: True.
    track_contacts : bool
        Whether what each contact dissipated in the last step is kept, for contacts.nc and for the powers of
        `Simulation.contacts`, which are not a number without it; the motion does not change. Default: False.
    parallel : bool
        Whether the grains are shared among all threads. Default: None, if there are more than 2000.
    guards : Guards
        Limits beyond which a run is stopped. Default: `Guards()`.

    Raises
    ------
    InputError
        If a value makes no sense by itself or together with others. The message names the parameter, its value and
        what is allowed.

    Examples
    --------
    Two discs that fall on a floor:

    >>> import taichi_lsm as lsm
    >>> scene = lsm.Scene(
    ...     position=[(0.0, 0.6), (0.2, 1.7)],
    ...     density=2650.0,
    ...     effects=[lsm.LinearElastic(1e6), lsm.Gravity((0.0, -9.81))],
    ...     walls=[lsm.PlaneWall("floor", point=(0.0, 0.0), normal=(0.0, 1.0))],
    ... )
    """

    position: NDArray
    density: float
    effects: Sequence[Effect]
    dim: int = DERIVED
    lengths: Sequence[float] = DERIVED
    periodic: Sequence[bool] = DERIVED
    shapes: Sequence[GrainShape] = DERIVED
    shape_index: NDArray = DERIVED
    diameter: NDArray = UNIT
    angle: NDArray = DERIVED
    orientation: NDArray = DERIVED
    velocity: NDArray = DERIVED
    angular_velocity: NDArray = DERIVED
    platen_index: NDArray = DERIVED
    platens: Sequence[Platen] = ()
    walls: Sequence[PlaneWall] = ()
    shear_rate: float = 0.0
    cell_servo: CellServo | None = None
    thickness: float = DERIVED
    area: float | None = None
    bonds: NDArray | None = None
    bond_area: NDArray | None = None
    skin: float = DERIVED
    dt: float | None = None
    safety: float = 0.3
    integrator: type[VelocityVerlet] = OnsetVerlet
    track_dissipation: bool = True
    track_contacts: bool = False
    parallel: bool | None = None
    guards: Guards = field(default_factory=Guards)

    def __post_init__(self) -> None:
        self.position = float_array("position", self.position)
        n = len(self.position) if self.position.ndim else 0
        if n == 0:
            raise InputError("Scene.position: no grains, must be at least one")
        if self.position.ndim != 2:
            raise InputError(f"Scene.position: array of shape {self.position.shape}, must be (n, 2) or (n, 3)")
        if self.dim is DERIVED:
            self.dim = self.position.shape[1]
        if self.dim not in (2, 3):
            raise InputError(f"Scene.dim: {self.dim!r}, must be 2 or 3")
        self._complete_cell_and_shapes()
        self.diameter = _per_grain(float_array("diameter", self.diameter), n)
        self.shape_index = _per_grain(index_array("shape_index", self.shape_index, default=0), n)
        self.platen_index = _per_grain(index_array("platen_index", self.platen_index, default=-1), n)
        self._complete_orientation(n)
        self.velocity = _array("velocity", self.velocity, (n, self.dim))
        self.angular_velocity = _array("angular_velocity", self.angular_velocity, (n, rotation_size(self.dim)))
        self.thickness = float(np.mean(self.diameter)) if self.thickness is DERIVED else self.thickness
        self.skin = SKIN * float(np.mean(self.diameter)) if self.skin is DERIVED else self.skin
        check_scene(self)

    def _complete_cell_and_shapes(self) -> None:
        """Fill in an open cell and one round shape where none are given."""
        self.lengths = (np.inf,) * self.dim if self.lengths is DERIVED else self.lengths
        self.periodic = (False,) * self.dim if self.periodic is DERIVED else self.periodic
        if self.shapes is DERIVED:
            self.shapes = [disc() if self.dim == 2 else sphere()]

    def _complete_orientation(self, n: int) -> None:
        """Fill in one description of the orientations: angles in 2D, unit quaternions in 3D."""
        check_orientation(self)
        if self.dim == 2:
            self.angle = _array("angle", self.angle, (n,))
        elif self.orientation is DERIVED:
            self.orientation = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (n, 4))  # takes no memory
        else:
            self.orientation = float_array("orientation", self.orientation)

    def __len__(self) -> int:
        return len(self.position)

    def __repr__(self) -> str:
        return describe.scene_line(self)

    def __str__(self) -> str:
        return describe.as_text(describe.scene_tree(self))

    def _repr_html_(self) -> str:
        return describe.as_html(describe.scene_tree(self))

    def orientation_state(self) -> NDArray:
        """Orientations as the state holds them: unit complex numbers (n, 2) or unit quaternions (n, 4)."""
        if self.dim == 2:
            return np.stack([np.cos(self.angle), np.sin(self.angle)], axis=1)
        return self.orientation

    def masses(self) -> tuple[NDArray, NDArray]:
        """Masses (n,) [kg] and principal moments of inertia (n, 1 or 3) [kg m2]; in 2D of the scene's thickness."""
        s = self.diameter
        depth = self.thickness if self.dim == 2 else 1.0
        measure = np.array([g.measure for g in self.shapes])[self.shape_index]
        inertia = np.array([g.inertia for g in self.shapes])[self.shape_index]
        unit = self.density * depth * s**self.dim
        return unit * measure, (unit * s**2)[:, None] * inertia

    def per_grain(self, attribute: str) -> NDArray:
        """Length `attribute` of the shapes, scaled to every grain (n,) [m]."""
        return np.array([getattr(g, attribute) for g in self.shapes])[self.shape_index] * self.diameter

    def platen_area(self) -> float:
        """Area over which the stress of a platen is taken [m2]: `area` if it is given, else that of the cell."""
        if self.area is not None:
            return self.area
        return self.lengths[0] * (self.thickness if self.dim == 2 else self.lengths[2])

    def reach(self) -> float:
        """Greatest distance of two surfaces [m] at which an effect acts."""
        return max((e.reach() for e in self.effects), default=0.0)

    def widest(self) -> float:
        """Greatest distance of two centres [m] at which grains act on each other."""
        return 2.0 * float(self.per_grain("bounding_radius").max()) + self.reach()

    def bodies(self) -> Bodies:
        """Facts that bound the time step; see `effects.Bodies`."""
        mass, inertia = self.masses()
        inertia = inertia.min(axis=1)
        mobile = self.platen_index < 0 if (self.platen_index < 0).any() else np.ones(len(mass), bool)
        least_mass = float(mass[mobile].min())
        per_mass = float(self.contact_radii(mobile, mass).max())
        return Bodies(
            dim=self.dim,
            least_mass=least_mass,
            least_inertia=float(inertia[mobile].min()),
            rotation_factor=float((self.per_grain("bounding_radius") ** 2 * mass / inertia)[mobile].max()),
            lever_factor=float((self.per_grain("lever") ** 2 * mass / inertia)[mobile].max()),
            coordination=COORDINATION[self.dim],
            normal_stiffness=sum(
                e.normal_stiffness() + e.stiffness_per_radius() * per_mass * least_mass for e in self.effects
            ),
            contact_radius_per_mass=per_mass,
            bond_rate=0.0 if self.bonds is None else bond_rate(self),
        )

    def contact_radii(self, mobile: NDArray, mass: NDArray) -> NDArray:
        """Radius of a contact over the grain's mass [m kg-1], for every mobile grain.

        The contact is as deep as STIFFENING_DEPTH of the grain, and its other body is the largest grain or a wall. The
        result is 0 unless an effect needs the reduced radius.

        Parameters
        ----------
        mobile : (n,) array of bool
            Which grains are mobile.
        mass : (n,) array of float
            Masses [kg].
        """
        if not any("reduced_radius" in e.needs for e in self.effects):
            return np.zeros(1)
        radius = self.per_grain("equivalent_radius")
        if any(e.local_radius for e in self.effects):
            radius = np.array([g.patches()[1].max() for g in self.shapes])[self.shape_index] * self.diameter
        reduced = radius * radius.max() / (radius + radius.max())
        # Two mobile grains oscillate with twice the stiffness over the mass, a grain at a rigid wall with once that of
        # a reduced radius of four times its own.
        if any(wall.rigid for wall in self.walls):
            reduced = radius
        return (np.sqrt(reduced * STIFFENING_DEPTH * self.per_grain("bounding_radius")) / mass)[mobile]

    def stable_dt(self) -> float:
        """Largest stable step [s] of a dense packing of these grains.

        Raises
        ------
        InputError
            If no effect bounds the step, so that `dt` must be given.
        """
        bound = self.step_bound(self.bodies())
        if not np.isfinite(bound):
            raise InputError("Scene.dt: no effect bounds the step, so it must be given")
        return bound

    def step_bound(self, bodies: Bodies) -> float:
        """Largest stable step [s] of such bodies, infinite if no effect bounds it.

        The squares of the frequencies of all effects add up, hence the inverse squares of their steps.
        """
        rates = sum(e.stable_dt(bodies) ** -2 for e in self.effects)
        return rates**-0.5 if rates > 0.0 else np.inf

    def chosen_dt(self) -> float:
        """The time step [s]: `dt` if it is given, else `safety` times the stable one.

        Raises
        ------
        InputError
            For a step at which a single contact of the lightest grains, or the servo of a wall, may be unstable.
        """
        if self.dt is None:
            dt = self.safety * self.stable_dt()
            check_servo_steps(self.walls, dt)
            return dt
        if not (finite(self.dt) and self.dt > 0.0):
            raise InputError(f"Scene.dt: {self.dt!r} s, must be > 0, or None for a stable one")
        if self.guards.step:
            most = self.guards.step * self.step_bound(replace(self.bodies(), coordination=1.0))
            if self.dt > most:
                raise InputError(
                    f"Scene.dt: {self.dt:g} s, must be <= {most:g} s, "
                    "the stable step of a single contact of the lightest grains"
                )
        check_servo_steps(self.walls, self.dt)
        return self.dt


def _array(name: str, given: Any, shape: tuple[int, ...]) -> NDArray:
    """Array of floats, zeros of this shape if nothing is given."""
    return np.zeros(shape) if given is DERIVED else float_array(name, given)


def _per_grain(values: NDArray, n: int) -> NDArray:
    """One number per grain: a scalar holds for all."""
    return np.full(n, values) if values.ndim == 0 else values
