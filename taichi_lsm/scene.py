"""A scene: everything that defines a run, as plain data, checked before anything is compiled."""

from dataclasses import dataclass, field, replace

import numpy as np

from .bonds.bond_setup import bond_rate, checked_bonds
from .boundaries.periodic_cell import check_box, check_shear
from .boundaries.wall_setup import check_walls
from .contact.surface_kinds import CURVED, kind_of
from .core.errors import InputError
from .core.fields import orientation_size, rotation_size
from .effects import Bodies, Effect
from .stepping.guards import Guards
from .stepping.verlet import OnsetVerlet

COORDINATION = {2: 6.0, 3: 10.0}  # contacts that a grain may have at once, for the stable step
DEEP = 0.1  # of a grain's radius: depth at which laws that stiffen with it bound the step
SKIN = 0.07  # default margin of the neighbour list, in mean diameters


@dataclass
class Scene:
    """Everything that defines a run, as plain data in SI units; n grains in `dim` dimensions.

    lengths (dim,) [m] and periodic (dim,) of the cell; shapes: GrainShape table; shape_index (n,): row of the table;
    position (n, dim) [m]; diameter (n,) [m]: equivalent diameter; density [kg m-3]; angle (n,) [rad] (2D);
    orientation (n, 4): unit quaternions w, x, y, z, body to world (3D);
    platen_index (n,): index into `platens`, -1 for mobile grains; velocity (n, dim), spin (n, 1 or 3): at the start;
    walls: PlaneWalls; shear_rate [s-1]: of a sheared cell, whose mean flow (see domain.py) is added to `velocity`;
    thickness [m]: out-of-plane depth in 2D; area [m2]: of a platen, default from lengths and thickness;
    skin [m]: margin of the neighbour list; dt [s]: None chooses `safety` times the stable step;
    bonds (m, 2): ids of grains bonded at the start, without stress; None for none; sorted here, lower id first;
    integrator: class of the time integration, OnsetVerlet | VelocityVerlet | SymplecticEuler | ExplicitEuler;
    ledger: book the energy dissipated by each effect; parallel: share the grains among all threads
    (True) or not (False); default: if there are many; guards: limits beyond which a run is stopped.
    """

    dim: int
    lengths: tuple
    periodic: tuple
    shapes: list
    shape_index: np.ndarray
    position: np.ndarray
    diameter: np.ndarray
    density: float
    effects: list
    angle: np.ndarray | None = None
    orientation: np.ndarray | None = None
    platen_index: np.ndarray | None = None
    platens: list = field(default_factory=list)
    walls: list = field(default_factory=list)
    shear_rate: float = 0.0
    velocity: np.ndarray | None = None
    angular_velocity: np.ndarray | None = None
    thickness: float | None = None
    area: float | None = None
    skin: float | None = None
    dt: float | None = None
    safety: float = 0.3
    integrator: type = OnsetVerlet
    track_dissipation: bool = True
    parallel: bool | None = None
    bonds: np.ndarray | None = None
    guards: Guards = Guards()

    def __post_init__(self):
        if self.dim not in (2, 3):
            raise InputError(f"dim {self.dim!r}: must be 2 or 3")
        n = len(self.position)
        if n == 0:
            raise InputError("Scene.position: no grains, must be at least one")
        self.position = np.asarray(self.position, float)
        self.diameter = np.asarray(self.diameter, float)
        self.shape_index = np.asarray(self.shape_index, np.int32)
        self.platen_index = (
            np.full(n, -1, np.int32) if self.platen_index is None else np.asarray(self.platen_index, np.int32)
        )
        self._orient(n)
        self.velocity = np.zeros((n, self.dim)) if self.velocity is None else np.asarray(self.velocity, float)
        self.angular_velocity = (
            np.zeros((n, rotation_size(self.dim)))
            if self.angular_velocity is None
            else np.asarray(self.angular_velocity, float)
        )
        self.thickness = float(np.mean(self.diameter)) if self.thickness is None else self.thickness
        self._check(n)

    def _orient(self, n):
        """One description of the orientations: angles in 2D, unit quaternions in 3D."""
        given, other = ("angle", "orientation") if self.dim == 2 else ("orientation", "angle")
        if getattr(self, other) is not None:
            raise InputError(f"Scene.{other}: given in {self.dim}D, where `{given}` says how a grain is turned")
        if self.dim == 2:
            self.angle = np.zeros(n) if self.angle is None else np.asarray(self.angle, float)
        elif self.orientation is None:
            self.orientation = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (n, 4))  # takes no memory
        else:
            self.orientation = np.asarray(self.orientation, float)

    def turns(self):
        """Orientations as the state keeps them: unit complex numbers (n, 2) or unit quaternions (n, 4)."""
        if self.dim == 2:
            return np.stack([np.cos(self.angle), np.sin(self.angle)], axis=1)
        return self.orientation

    def _check(self, n):
        expected = {
            "position": (n, self.dim),
            "diameter": (n,),
            "shape_index": (n,),
            "platen_index": (n,),
            **({"angle": (n,)} if self.dim == 2 else {"orientation": (n, orientation_size(3))}),
            "velocity": (n, self.dim),
            "angular_velocity": (n, rotation_size(self.dim)),
        }
        for name, shape in expected.items():
            value = getattr(self, name)
            if value.shape != shape:
                raise InputError(f"Scene.{name}: array of shape {value.shape}, must be {shape}")
            if not np.isfinite(value).all():
                raise InputError(f"Scene.{name}: grain {np.argwhere(~np.isfinite(value))[0][0]} is not finite")
        for name in ("lengths", "periodic"):
            if len(getattr(self, name)) != self.dim:
                raise InputError(f"Scene.{name}: {len(getattr(self, name))} values, must be one per axis ({self.dim})")
        if not (self.diameter > 0).all():
            raise InputError(f"Scene.diameter: least value {self.diameter.min():g} m, must be > 0")
        if not (np.isfinite(self.density) and self.density > 0):
            raise InputError(f"Scene.density: {self.density!r} kg/m3, must be > 0")
        if self.shape_index.min() < 0 or self.shape_index.max() >= len(self.shapes):
            raise InputError(
                f"Scene.shape_index: {self.shape_index.min()}..{self.shape_index.max()}, "
                f"must be 0..{len(self.shapes) - 1}"
            )
        if self.platen_index.max() >= len(self.platens) or self.platen_index.min() < -1:
            raise InputError(f"Scene.platen_index: {self.platen_index.max()} but there are {len(self.platens)} platens")
        if not all(isinstance(e, Effect) for e in self.effects):
            raise InputError(f"Scene.effects: {self.effects!r}, must be instances of Effect")
        names = [e.name for e in self.effects]
        if len(set(names)) < len(names):
            raise InputError(f"Scene.effects: {names}, each law may be listed once")
        for role in {e.role for e in self.effects if e.role}:
            same = [e.name for e in self.effects if e.role == role]
            if len(same) > 1:
                raise InputError(f"Scene.effects: {same} are all laws of {role}, one may be listed")
        lossy = [e.name for e in self.effects if e.dissipates]
        if self.integrator.conservative and lossy:
            raise InputError(f"Scene.integrator: {self.integrator.__name__} is for scenes without losses, not {lossy}")
        self.bonds = checked_bonds(self.bonds, self.effects, n)
        for effect in self.effects:
            effect.check(self)
        if self.skin is None:
            self.skin = SKIN * float(np.mean(self.diameter))
        if not (np.isfinite(self.skin) and self.skin > 0):
            raise InputError(f"Scene.skin: {self.skin!r} m, must be > 0")
        check_box(self.lengths, self.periodic, self.widest(), self.skin)
        if self.dim == 3 and np.abs(np.linalg.norm(self.orientation, axis=1) - 1.0).max() > 1e-9:
            raise InputError("Scene.orientation: must be unit quaternions (w, x, y, z) to 1e-9")
        wrong = [s.name for s in self.shapes if s.dim != self.dim]
        if wrong:
            raise InputError(f"Scene.shapes: {wrong[0]!r} is not a shape in {self.dim}D")
        kind = kind_of(self.shapes)
        curved = [e.name for e in self.effects if "reduced_radius" in e.needs]
        if curved and kind not in CURVED:
            raise InputError(
                f"Scene.effects: {curved} need one radius of curvature at the contact, which grains with {kind} "
                f"surfaces do not have; shapes must be discs, spheres or arc chains"
            )
        check_walls(self)
        check_shear(self)

    def masses(self):
        """(mass (n,) [kg], principal moments of inertia (n, 1 or 3) [kg m2]); a disc has the scene's thickness."""
        s = self.diameter
        depth = self.thickness if self.dim == 2 else 1.0
        measure = np.array([g.measure for g in self.shapes])[self.shape_index]
        inertia = np.array([g.inertia for g in self.shapes])[self.shape_index]
        unit = self.density * depth * s**self.dim
        return unit * measure, (unit * s**2)[:, None] * inertia

    def per_grain(self, attribute):
        """Length `attribute` of the shapes, scaled to every grain [m]."""
        return np.array([getattr(g, attribute) for g in self.shapes])[self.shape_index] * self.diameter

    def reach(self):
        """Greatest distance of two surfaces [m] at which a law acts."""
        return max((e.reach() for e in self.effects), default=0.0)

    def widest(self):
        """Greatest distance of two centres [m] at which grains act on each other."""
        return 2.0 * float(self.per_grain("bounding_radius").max()) + self.reach()

    def bodies(self):
        """Facts that bound the time step; see effects.Bodies."""
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

    def contact_radii(self, mobile, mass):
        """Radius of a contact as deep as DEEP of a grain over its mass [m kg-1], of every mobile grain; 0 if no law
        asks for radii of curvature."""
        if not any("reduced_radius" in e.needs for e in self.effects):
            return np.zeros(1)
        curved = np.array([g.patches()[1].max() for g in self.shapes])[self.shape_index] * self.diameter
        reduced = curved * curved.max() / (curved + curved.max())
        return (np.sqrt(reduced * DEEP * self.per_grain("bounding_radius")) / mass)[mobile]

    def stable_dt(self):
        """Largest stable step [s] of a dense packing of these grains."""
        bound = self.step_bound(self.bodies())
        if not np.isfinite(bound):
            raise InputError("Scene.dt: no effect bounds the step, so it must be given")
        return bound

    def step_bound(self, bodies):
        """Largest stable step [s] of such bodies, infinite if no law bounds it: the laws' frequencies add up as the sum
        of 1/dt^2."""
        rates = sum(e.stable_dt(bodies) ** -2 for e in self.effects)
        return rates**-0.5 if rates > 0.0 else np.inf

    def chosen_dt(self):
        """The time step [s]: `dt` if it is given, else `safety` times the stable one.

        Raises InputError for a step at which a single contact of the lightest grains may be unstable.
        """
        if self.dt is None:
            return self.safety * self.stable_dt()
        if not (np.isfinite(self.dt) and self.dt > 0.0):
            raise InputError(f"Scene.dt: {self.dt!r} s, must be > 0, or None for a stable one")
        if self.guards.step:
            most = self.guards.step * self.step_bound(replace(self.bodies(), coordination=1.0))
            if self.dt > most:
                raise InputError(
                    f"Scene.dt: {self.dt:g} s, must be <= {most:g} s, "
                    "the stable step of a single contact of the lightest grains"
                )
        return self.dt
