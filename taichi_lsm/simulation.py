"""A scene as plain data, and the simulation that runs it."""

import time
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from .contact.broad import NeighbourList, NeighbourSearch, grown
from .contact.faults import Faults
from .contact.pairs import Pairs
from .contact.parts import PartTable
from .contact.surfaces import kind_of, surface_table
from .diagnostics import Measure
from .domain import Domain, check_box, check_shear
from .drives import Platens
from .effects import Bodies, Effect
from .effects.base import ON_CONTACTS
from .errors import InputError, SimulationError
from .forces import ContactForces
from .integrators import OnsetVerlet
from .runtime import allocating, start, when_allocated
from .state import Grains, grain_variables, spin_size, turn_size
from .walls import Walls, check_walls

COORDINATION = {2: 6.0, 3: 10.0}  # contacts that a grain may have at once, for the stable step
SKIN = 0.07  # default margin of the neighbour list, in mean diameters
PAIRS_PER_GRAIN = {2: 2.8, 3: 3.8}  # capacity at the start: what a dense packing of discs or spheres needs
SHAPED_PAIRS = 1.4  # times as many for other shapes, whose bounding spheres overlap
MANY = 20_000  # grains; for more memory matters, for fewer a list that need not grow, as each growth compiles anew
GROWTH = 1.5  # each larger storage of pairs compiles the kernels anew, so it should be rare
SERIAL_LIMIT = 2000  # grains; below, two threads gain little over one


@dataclass
class Scene:
    """Everything that defines a run, as plain data in SI units; n grains in `dim` dimensions.

    lengths (dim,) [m] and periodic (dim,) of the cell; shapes: GrainShape table; shape (n,): row of the table;
    position (n, dim) [m]; scale (n,) [m]: equivalent diameter; density [kg m-3]; angle (n,) [rad] (2D);
    orientation (n, 4): unit quaternions w, x, y, z, body to world (3D);
    platen (n,): index into `platens`, -1 for mobile grains; velocity (n, dim), spin (n, 1 or 3): at the start;
    walls: PlaneWalls; shear_rate [s-1]: of a sheared cell, whose mean flow (see domain.py) is added to `velocity`;
    thickness [m]: out-of-plane depth in 2D; area [m2]: of a platen, default from lengths and thickness;
    skin [m]: margin of the neighbour list; dt [s]: None chooses `safety` times the stable step;
    integrator: class of the time integration, OnsetVerlet | VelocityVerlet | SymplecticEuler | ExplicitEuler;
    ledger: book the energy dissipated by each effect; parallel: share the grains among all threads
    (True) or not (False); default: if there are many.
    """

    dim: int
    lengths: tuple
    periodic: tuple
    shapes: list
    shape: np.ndarray
    position: np.ndarray
    scale: np.ndarray
    density: float
    effects: list
    angle: np.ndarray | None = None
    orientation: np.ndarray | None = None
    platen: np.ndarray | None = None
    platens: list = field(default_factory=list)
    walls: list = field(default_factory=list)
    shear_rate: float = 0.0
    velocity: np.ndarray | None = None
    spin: np.ndarray | None = None
    thickness: float | None = None
    area: float | None = None
    skin: float | None = None
    dt: float | None = None
    safety: float = 0.3
    integrator: type = OnsetVerlet
    ledger: bool = True
    parallel: bool | None = None

    def __post_init__(self):
        if self.dim not in (2, 3):
            raise InputError(f"dim {self.dim!r}: must be 2 or 3")
        n = len(self.position)
        self.position = np.asarray(self.position, float)
        self.scale = np.asarray(self.scale, float)
        self.shape = np.asarray(self.shape, np.int32)
        self.platen = np.full(n, -1, np.int32) if self.platen is None else np.asarray(self.platen, np.int32)
        self._orient(n)
        self.velocity = np.zeros((n, self.dim)) if self.velocity is None else np.asarray(self.velocity, float)
        self.spin = np.zeros((n, spin_size(self.dim))) if self.spin is None else np.asarray(self.spin, float)
        self.thickness = float(np.mean(self.scale)) if self.thickness is None else self.thickness
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
            "scale": (n,),
            "shape": (n,),
            "platen": (n,),
            **({"angle": (n,)} if self.dim == 2 else {"orientation": (n, turn_size(3))}),
            "velocity": (n, self.dim),
            "spin": (n, spin_size(self.dim)),
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
        if n == 0:
            raise InputError("Scene.position: no grains, must be at least one")
        if not (self.scale > 0).all():
            raise InputError(f"Scene.scale: least value {self.scale.min():g} m, must be > 0")
        if not (np.isfinite(self.density) and self.density > 0):
            raise InputError(f"Scene.density: {self.density!r} kg/m3, must be > 0")
        if self.shape.min() < 0 or self.shape.max() >= len(self.shapes):
            raise InputError(f"Scene.shape: rows {self.shape.min()}..{self.shape.max()} of {len(self.shapes)} shapes")
        if self.platen.max() >= len(self.platens) or self.platen.min() < -1:
            raise InputError(f"Scene.platen: {self.platen.max()} but there are {len(self.platens)} platens")
        if not all(isinstance(e, Effect) for e in self.effects):
            raise InputError(f"Scene.effects: {self.effects!r}, must be instances of Effect")
        names = [e.name for e in self.effects]
        if len(set(names)) < len(names):
            raise InputError(f"Scene.effects: {names}, each law may be listed once")
        for role in {e.role for e in self.effects if e.role}:
            same = [e.name for e in self.effects if e.role == role]
            if len(same) > 1:
                raise InputError(f"Scene.effects: {same} are all laws of {role}, one may be listed")
        for effect in self.effects:
            effect.check(self)
        if self.skin is None:
            self.skin = SKIN * float(np.mean(self.scale))
        if not (np.isfinite(self.skin) and self.skin > 0):
            raise InputError(f"Scene.skin: {self.skin!r} m, must be > 0")
        check_box(self.lengths, self.periodic, self.widest(), self.skin)
        if self.dim == 3 and np.abs(np.linalg.norm(self.orientation, axis=1) - 1.0).max() > 1e-9:
            raise InputError("Scene.orientation: must be unit quaternions (w, x, y, z) to 1e-9")
        wrong = [s.name for s in self.shapes if s.dim != self.dim]
        if wrong:
            raise InputError(f"Scene.shapes: {wrong[0]!r} is not a shape in {self.dim}D")
        kind_of(self.shapes)
        check_walls(self)
        check_shear(self)

    def masses(self):
        """(mass (n,) [kg], principal moments of inertia (n, 1 or 3) [kg m2]); a disc has the scene's thickness."""
        s = self.scale
        depth = self.thickness if self.dim == 2 else 1.0
        measure = np.array([g.measure for g in self.shapes])[self.shape]
        inertia = np.array([g.inertia for g in self.shapes])[self.shape]
        unit = self.density * depth * s**self.dim
        return unit * measure, (unit * s**2)[:, None] * inertia

    def per_grain(self, attribute):
        """Length `attribute` of the shapes, scaled to every grain [m]."""
        return np.array([getattr(g, attribute) for g in self.shapes])[self.shape] * self.scale

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
        mobile = self.platen < 0 if (self.platen < 0).any() else np.ones(len(mass), bool)
        return Bodies(
            dim=self.dim,
            least_mass=float(mass[mobile].min()),
            least_inertia=float(inertia[mobile].min()),
            spin_factor=float((self.per_grain("bounding_radius") ** 2 * mass / inertia)[mobile].max()),
            lever_factor=float((self.per_grain("lever") ** 2 * mass / inertia)[mobile].max()),
            coordination=COORDINATION[self.dim],
            normal_stiffness=sum(e.normal_stiffness() for e in self.effects),
        )

    def stable_dt(self):
        """Largest stable step [s]: the laws' frequencies add up as the sum of 1/dt^2."""
        bodies = self.bodies()
        rates = sum(e.stable_dt(bodies) ** -2 for e in self.effects)
        if rates == 0.0:
            raise InputError("Scene.dt: no effect bounds the step, so it must be given")
        return rates**-0.5


class StateView:
    """`sim.state.<name>.to_numpy()`: a state row by persistent id. `from_numpy` writes one."""

    def __init__(self, grains):
        self._grains = grains

    def __getattr__(self, name):
        if name.startswith("_") or not self._grains.has(name):
            raise AttributeError(f"no state {name!r} in this scene; it has {', '.join(sorted(self._grains.variables))}")
        return _Column(self._grains, name)


@dataclass(frozen=True)
class _Column:
    grains: Grains
    name: str

    def to_numpy(self):
        return self.grains.column(self.name)

    def from_numpy(self, values):
        self.grains.set_column(self.name, values)


class Simulation:
    """Runs a scene. Starts Taichi if nobody has; one process can hold several simulations of one runtime."""

    def __init__(self, scene, arch="cpu", precision="f64", threads=1):
        self.runtime = start(arch, precision, threads)
        self.scene = scene
        self.step = 0
        self.rebuilds = 0
        self.launches = 0
        self.seconds = {}  # by what the run was doing
        n = len(scene.position)
        together = n > SERIAL_LIMIT if scene.parallel is None else scene.parallel
        self.crew = self.runtime.threads if together else 1
        self.skin = scene.skin
        stable = scene.stable_dt() if scene.dt is None else None
        self._dt = scene.dt if scene.dt is not None else scene.safety * stable
        kind = kind_of(scene.shapes)
        shaped, several = kind != "sphere", max(len(s.parts) for s in scene.shapes) > 1
        self.rotates = shaped or any(e.phase == "tangential" or e.couples for e in scene.effects)
        books = [e for e in scene.effects if e.dissipates] if scene.ledger else []
        self.history = sum(e.history_size(scene.dim) for e in scene.effects if e.phase in ON_CONTACTS)
        onset = scene.integrator.onset and any(hasattr(type(e), "onset_impulse") for e in scene.effects)
        tumbles = shaped and scene.dim == 3
        rows = grain_variables(self.rotates, shaped, shaped, len(books), onset, tumbles, several, scene.shear_rate)
        with allocating():
            self.effects = [e.bound() for e in scene.effects]
            self.domain = Domain(scene.lengths, scene.periodic, scene.shear_rate or 0.0)
            self.grains = Grains(scene.dim, n, rows, len(books))
            self.faults = Faults()
            self.surfaces = surface_table(kind, scene.shapes)
            self.parts = PartTable(scene.shapes, self.grains) if several else None
            self.state = StateView(self.grains)
            when_allocated(lambda: self._load_scene(shaped))
            self.platens = None
            if scene.platens:
                mass, _ = scene.masses()
                self.platens = Platens(scene.platens, self.grains, self._area(), scene.platen, mass)
            self.walls = Walls(scene.walls, self.grains, self.history, onset) if scene.walls else None
            self.search = NeighbourSearch(self.grains, self.domain, self.skin + scene.reach(), self.parts)
        wanted = self.search.count()
        capacity = self.grains.slot_of.shape[0]
        dense = PAIRS_PER_GRAIN[scene.dim] * n * (SHAPED_PAIRS if shaped else 1.0) if n <= MANY else 0
        room = int(max(1.15 * wanted, dense))
        with allocating():
            self._compose(Pairs(scene.dim, capacity, room, self.rotates, kind, self.history, onset, several))
        self.neighbours.write()
        self._begin()

    def _begin(self):
        """First evaluation of the contacts, then velocities half a step back."""
        self.integrator.contacts_only(0.0)
        self.integrator.shift_velocities()
        self.faults.raise_any(self.step)

    def load(self, scene):
        """Start again from another scene of the same make-up, without compiling anything.

        The number of grains, the laws and the integrator must be the same and there may be no platens; positions,
        shapes, sizes, parameters of the laws and the time step may differ. Raises InputError otherwise.
        """
        mine = [(s.dim, len(s.position), [type(e) for e in s.effects], s.integrator) for s in (self.scene, scene)]
        mine = [(*m, len(s.walls), bool(s.shear_rate)) for m, s in zip(mine, (self.scene, scene), strict=True)]
        if mine[0] != mine[1] or scene.platens or self.platens:
            raise InputError(f"Simulation.load: scene of make-up {mine[1]}, must be {mine[0]} without platens")
        self.scene, self.step = scene, 0
        self.faults.clear()
        self._dt = scene.dt if scene.dt is not None else scene.safety * scene.stable_dt()
        self.integrator.dt[None] = self._dt
        for bound, effect in zip(self.effects, scene.effects, strict=True):
            bound.write_parameters(effect)
        if self.surfaces:
            self.surfaces.fill([part for s in scene.shapes for part in s.parts])
        if self.parts:
            self.parts.fill(scene.shapes)
        if self.walls:
            self.walls.begin(scene.walls)
        self._load_scene(self.surfaces is not None)
        if scene.ledger and self.grains.has("dissipated"):
            self.grains.dissipated.fill(0.0)
        self.pairs.row_start.fill(0)  # nothing is remembered of the pairs
        self._rebuild()
        self._begin()

    def _area(self):
        if self.scene.area is not None:
            return self.scene.area
        lengths = self.scene.lengths
        return lengths[0] * (self.scene.thickness if self.scene.dim == 2 else lengths[2])

    def _load_scene(self, shaped):
        scene, state = self.scene, self.state
        mass, inertia = scene.masses()
        state.position.from_numpy(scene.position)
        if self.domain.sheared:
            self.domain.set_shear(scene.shear_rate, scene.widest())
            self.grains.shear_work.fill(0.0)
        state.velocity.from_numpy(scene.velocity + self.domain.mean_flow(scene.position))
        state.platen.from_numpy(scene.platen)
        state.radius.from_numpy(scene.per_grain("bounding_radius"))
        state.inverse_mass.from_numpy(1.0 / mass)
        if self.rotates:
            state.spin.from_numpy(scene.spin)
            state.inverse_inertia.from_numpy(1.0 / inertia)
        if shaped:
            state.orientation.from_numpy(scene.turns())
            state.shape.from_numpy(scene.shape)
            state.scale.from_numpy(scene.scale)
            state.cap_radius.from_numpy(scene.per_grain("cap_radius"))

    def _compose(self, pairs):
        """Specialise the kernels for this scene and this storage of pairs."""
        self.pairs = pairs
        self.neighbours = NeighbourList(self.search, pairs)
        self.forces = ContactForces(
            self.grains, self.surfaces, self.parts, self.domain, pairs, self.effects, self.faults, self.walls
        )
        self.integrator = self.scene.integrator(self.forces, self.platens, self.skin, self._dt, self.crew)
        self.measure = Measure(self.forces, self.integrator)

    @property
    def dt(self):
        """Time step [s]."""
        return self._dt

    @property
    def time(self):
        """Simulated time [s]."""
        return self.step * self._dt

    def __len__(self):
        return len(self.grains)

    @contextmanager
    def clock(self, name):
        """Add the wall-clock time of the block to `seconds[name]` [s]."""
        began = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - began

    def run(self, steps):
        """Advance by an integer number of steps. Raises SimulationError naming the step, the grains and the cause."""
        target = self.step + int(steps)
        while self.step < target:
            with self.clock("steps"):
                self.integrator.launch(target - self.step)
            self.launches += 1
            self.step += self.integrator.steps_done[None]
            self.integrator.steps_done[None] = 0
            self.faults.raise_any(self.step)
            if self.integrator.halted[None]:
                with self.clock("neighbour list"):
                    self._rebuild()
                with self.clock("steps"):
                    self.integrator.contacts_only(self._dt)
                self.step += 1
                self.faults.raise_any(self.step)

    def _rebuild(self):
        try:
            wanted = self.search.count()
        except SimulationError as error:
            raise SimulationError(f"step {self.step}: {error}") from None
        if wanted > self.pairs.capacity:
            capacity = self.grains.slot_of.shape[0]
            self._compose(grown(self.pairs, self.scene.dim, capacity, self.rotates, int(GROWTH * wanted)))
        self.neighbours.write()
        self.rebuilds += 1
