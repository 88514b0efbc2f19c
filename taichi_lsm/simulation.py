"""The simulation that runs a scene."""

import time
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from .bonds.bond_network import Bonds, FreedContacts
from .bonds.bond_setup import bond_effect
from .boundaries.periodic_cell import Domain
from .boundaries.plane_walls import Walls
from .boundaries.platens import Platens
from .contact.error_flags import ErrorFlags
from .contact.neighbour_list import NeighbourList, grown
from .contact.neighbour_search import NeighbourSearch
from .contact.pair_geometry import PairGeometry
from .contact.pair_storage import Pairs
from .contact.part_table import PartTable
from .contact.surface_kinds import surface_table
from .core.errors import InputError, SimulationError
from .core.runtime import allocating, start, when_allocated
from .io.checkpoint import save_checkpoint
from .measure.sums import Measure
from .stepping.contact_forces import ContactForces
from .stepping.grain_state import Grains
from .stepping.kernel_spec import KernelSpec
from .stepping.monitor import Monitor

PAIRS_PER_GRAIN = {2: 2.8, 3: 3.8}  # capacity at the start: what a dense packing of discs or spheres needs
SHAPED_PAIRS = 1.4  # times as many for other shapes, whose bounding spheres overlap
MANY = 20_000  # grains; for more memory matters, for fewer a list that need not grow, as each growth compiles anew
GROWTH = 1.5  # each larger storage of pairs compiles the kernels anew, so it should be rare
LAST_GOOD, STOPPED = "checkpoint.nc", "stopped.nc"
SERIAL_LIMIT = 2000  # grains; below, two threads gain little over one


class StateView:
    """`sim.state.<name>.to_numpy()`: a state row by persistent id. `from_numpy` writes one."""

    def __init__(self, grains, changed):
        self._grains, self._changed = grains, changed

    def __getattr__(self, name):
        if name.startswith("_") or not self._grains.has(name):
            raise AttributeError(f"no state {name!r} in this scene; it has {', '.join(sorted(self._grains.variables))}")
        return _Column(self._grains, name, self._changed)


@dataclass(frozen=True)
class _Column:
    grains: Grains
    name: str
    changed: Callable

    def to_numpy(self):
        return self.grains.column(self.name)

    def from_numpy(self, values):
        self.grains.set_column(self.name, values)
        self.changed()


class Simulation:
    """Runs a scene. Starts Taichi if nobody has; one process can hold several simulations of one runtime."""

    def __init__(self, scene, arch="cpu", precision="f64", threads=1):
        self.runtime = start(arch, precision, threads)
        self.scene = scene
        self.step = 0
        self.rebuilds = 0
        self.launches = 0
        self._folder = self.monitor = self.integrator = None
        self.seconds = {}  # by what the run was doing
        n = len(scene.position)
        together = n > SERIAL_LIMIT if scene.parallel is None else scene.parallel
        self.crew = self.runtime.threads if together else 1
        self.skin = scene.skin
        self._dt = scene.chosen_dt()
        made = self.kernel_spec = KernelSpec.of(scene)
        self.rotates = made.rotates
        with allocating():
            self.effects = [e.bound() for e in scene.effects]
            self.domain = Domain(scene.lengths, scene.periodic, scene.shear_rate or 0.0)
            self.grains = Grains(scene.dim, n, made.grain_rows(), made.channels)
            self.error_flags = ErrorFlags()
            self.surfaces = surface_table(made.kind, scene.shapes)
            self.parts = PartTable(scene.shapes, self.grains) if made.multi_part else None
            self.state = StateView(self.grains, self._energies_changed)
            when_allocated(self._load_scene)
            self.bonds = Bonds(scene, bond_effect(self.effects), self.grains, self.domain) if made.bonds else None
            self.platens = None
            if scene.platens:
                mass, _ = scene.masses()
                self.platens = Platens(scene.platens, self.grains, self._area(), scene.platen_index, mass, self._dt)
            self.walls = Walls(scene.walls, self.grains, made.history, made.onset) if scene.walls else None
            self.search = NeighbourSearch(self.grains, self.domain, self.skin + scene.reach(), self.parts, self.bonds)
        wanted = self._count()
        capacity = self.grains.slot_of.shape[0]
        dense = PAIRS_PER_GRAIN[scene.dim] * n * (SHAPED_PAIRS if made.shaped else 1.0) if n <= MANY else 0
        room = int(max(1.15 * wanted, dense))
        with allocating():
            pairs = Pairs(scene.dim, capacity, room, made.rotates, made.kind, made.history, made.onset, made.multi_part)
            self._compose(pairs)
        self.neighbours.write()
        self._begin()

    def _begin(self):
        """First evaluation of the contacts, then velocities half a step back."""
        self.integrator.contacts_only(0.0)
        self.integrator.shift_velocities()
        self.monitor.begin()
        self.monitor.check_error_flags()

    def load(self, scene):
        """Start again from another scene of the same make-up, without compiling anything.

        Numbers of grains and bonds, laws, integrator and periodic axes must be the same and there may be no platens;
        positions, shapes, sizes, lengths of the cell, parameters of the laws, guards and the time step may differ.
        Raises InputError otherwise.
        """
        other = KernelSpec.of(scene)
        if other != self.kernel_spec or scene.platens or self.platens:
            raise InputError(f"Simulation.load: scene of {other}, must be of {self.kernel_spec} without platens")
        self.scene, self.step = scene, 0
        self.error_flags.clear()
        self._dt = scene.chosen_dt()
        self.skin = scene.skin
        self.integrator.set_step(self._dt, self.skin)
        self.domain.set_lengths(scene.lengths)
        for bound, effect in zip(self.effects, scene.effects, strict=True):
            bound.write_parameters(effect)
        if self.surfaces:
            self.surfaces.fill([part for s in scene.shapes for part in s.parts])
        if self.parts:
            self.parts.fill(scene.shapes)
        if self.walls:
            self.walls.begin(scene.walls)
        self._load_scene()
        self.search.set_skin(self.skin + scene.reach())
        if self.forces.reaches:
            self.forces.geometry.set_reach(scene.reach())
        if self.bonds:
            self.bonds.fill(scene)
        if scene.track_dissipation and self.grains.has("dissipated"):
            self.grains.dissipated.fill(0.0)
        self.pairs.row_start.fill(0)  # nothing is remembered of the pairs
        self._rebuild()
        self._begin()

    def _area(self):
        if self.scene.area is not None:
            return self.scene.area
        lengths = self.scene.lengths
        return lengths[0] * (self.scene.thickness if self.scene.dim == 2 else lengths[2])

    def _load_scene(self):
        scene, state = self.scene, self.state
        mass, inertia = scene.masses()
        state.position.from_numpy(scene.position)
        if self.domain.sheared:
            self.domain.set_shear(scene.shear_rate, scene.widest())
            self.grains.shear_work.fill(0.0)
        state.velocity.from_numpy(scene.velocity + self.domain.mean_flow(scene.position))
        state.platen_index.from_numpy(scene.platen_index)
        state.radius.from_numpy(scene.per_grain("bounding_radius"))
        state.inverse_mass.from_numpy(1.0 / mass)
        if self.rotates:
            state.angular_velocity.from_numpy(scene.angular_velocity)
            state.inverse_inertia.from_numpy(1.0 / inertia)
        if self.grains.has("orientation"):
            state.orientation.from_numpy(scene.turns())
        if self.kernel_spec.shaped:
            state.shape_index.from_numpy(scene.shape_index)
            state.diameter.from_numpy(scene.diameter)
            state.overlap_limit.from_numpy(scene.per_grain("overlap_limit"))

    def _compose(self, pairs):
        """Specialise the kernels for this scene and this storage of pairs."""
        self.pairs = pairs
        self.neighbours = NeighbourList(self.search, pairs)
        geometry = PairGeometry(
            self.grains, self.surfaces, self.parts, self.domain, pairs, self.error_flags, self.scene.reach()
        )
        self.forces = ContactForces(geometry, self.domain, self.effects, self.walls, self.bonds)
        self.freed = FreedContacts(self.bonds, self.forces) if self.bonds else None
        former, self.integrator = (
            self.integrator,
            self.scene.integrator(self.forces, self.platens, self.skin, self._dt, self.crew),
        )
        if former:
            self.integrator.go_on_from(former)
        self.measure = Measure(self.forces, self.integrator)
        self.monitor = Monitor(self, self.monitor)

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

    def keep(self, folder, seconds=60.0):
        """Keep the last good state in `folder`: checkpoint.nc, written every so many seconds of wall clock when all
        guards are content. A run that stops with an error leaves its state in stopped.nc; `restore_checkpoint` reads
        both."""
        self._folder, self._keep_seconds, self._kept = Path(folder), seconds, time.monotonic()

    def run(self, steps):
        """Advance by an integer number of steps. Raises SimulationError naming the step, the grains and the cause."""
        target = self.step + int(steps)
        try:
            while self.step < target:
                self._launch(target - self.step)
                if self._folder is not None and time.monotonic() - self._kept >= self._keep_seconds:
                    self.monitor.check_all()
                    with self.clock("output"):
                        save_checkpoint(self, self._folder / LAST_GOOD)
                    self._kept = time.monotonic()
        except SimulationError as error:
            self._save_stopped(error)
            raise

    def _launch(self, steps):
        with self.clock("steps"):
            self.integrator.launch(steps)
        self.launches += 1
        self.step += self.integrator.steps_done[None]
        self.integrator.steps_done[None] = 0
        self.monitor.check_error_flags()
        if self.integrator.halted[None]:
            with self.clock("neighbour list"):
                self._rebuild()
            with self.clock("steps"):
                self.integrator.contacts_only(self._dt)
            self.step += 1
            self.monitor.check_error_flags()
        with self.clock("guards"):
            self.monitor.check()

    def _save_stopped(self, error):
        """Add to the error what was saved of the run."""
        if self._folder is not None:
            save_checkpoint(self, self._folder / STOPPED)
            error.saved = tuple(self._folder / name for name in (STOPPED, LAST_GOOD) if (self._folder / name).exists())

    def _energies_changed(self):
        if self.monitor:
            self.monitor.forget()

    def _count(self):
        """Number of pairs to be listed; no grain may be lost or have jumped."""
        try:
            return self.search.count(self._dt, self.scene.guards)
        except SimulationError as error:
            raise SimulationError(f"step {self.step}: {error}", self.step, error.grains, error.values) from None

    def _rebuild(self):
        wanted = self._count()
        if wanted > self.pairs.capacity:
            capacity = self.grains.slot_of.shape[0]
            self._compose(grown(self.pairs, self.scene.dim, capacity, self.rotates, int(GROWTH * wanted)))
        self.neighbours.write()
        self.rebuilds += 1
        if self.bonds:
            self.freed.begin()
