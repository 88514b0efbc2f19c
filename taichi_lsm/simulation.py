"""The simulation that runs a scene."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import describe
from .bonds.bond_network import Bonds
from .bonds.bond_setup import bond_effect
from .bonds.freed_contacts import FreedContacts
from .boundaries.driven_cell import cell_of
from .boundaries.plane_walls import Walls
from .boundaries.platens import Platens
from .boundaries.wall_servo import check_servo_steps
from .contact.error_flags import ErrorFlags
from .contact.neighbour_list import NeighbourList, grown
from .contact.neighbour_search import NeighbourSearch
from .contact.pair_geometry import PairGeometry
from .contact.pair_storage import Pairs
from .contact.part_table import PartTable
from .contact.surface_kinds import surface_table
from .core.allocation import allocating, when_allocated, writing_together
from .core.errors import InputError, SimulationError, step_count
from .core.runtime import start
from .io.checkpoint_file import save_checkpoint
from .io.checkpoints import keep_checkpoint
from .io.contacts_dataset import contacts_dataset
from .measure.contacts import ContactTable
from .measure.sums import Measure
from .measure.velocities import SynchronisedVelocities
from .scene import Scene
from .scene_loading import load_scene, load_state
from .stepping.contact_forces import ContactForces
from .stepping.grain_state import Grains, StateView
from .stepping.kernel_spec import KernelSpec
from .stepping.list_validity import ListValidity
from .stepping.monitor import Monitor
from .stepping.step_loop_cpu import StepLoopCPU
from .stepping.step_loop_gpu import StepLoopGPU
from .stepping.step_stages import StepStages
from .stepping.verlet import VelocityVerlet

if TYPE_CHECKING:
    import xarray

PAIRS_PER_GRAIN = {2: 2.8, 3: 3.8}  # capacity at the start: what a dense packing of discs or spheres needs
SHAPED_PAIRS = 1.4  # times as many for other shapes, whose bounding spheres overlap
MANY = 20_000  # grains; for more memory matters, for fewer a list that need not grow, as each growth compiles anew
GROWTH = 1.5  # each larger storage of pairs compiles the kernels anew, so it should be rare
NOT_COMPOSED: Any = None  # before the first `compose`; Any, so that attributes are typed as what they hold afterwards
STOPPED = "stopped.nc"
SERIAL_LIMIT = 2000  # grains; below, two threads gain little over one


class Simulation:
    """Runs a scene; `print(sim)` shows what it consists of.

    Parameters
    ----------
    scene : Scene
        What to run.
    arch : {"cpu", "gpu"}
        Where kernels run.
    precision : {"f64", "f32"}
        Precision of contact geometry, forces and histories; positions, velocities and sums are always f64.
    threads : int
        Number of CPU threads. Results do not depend on it, to the last bit.

    Notes
    -----
    The first simulation starts Taichi; all of a process share its arch, precision and number of threads.
    """

    def __init__(self, scene: Scene, arch: str = "cpu", precision: str = "f64", threads: int = 1):
        self.runtime = start(arch, precision, threads)
        self.scene = scene
        self.step = 0
        self.rebuilds = 0
        self.launches = 0
        self.seconds = {}  # by what the run was doing
        self._folder: Path | None = None  # of checkpoints
        self._last_good: Path | None = None  # the last one of this run
        self._keep_seconds, self._kept = np.inf, 0.0  # interval of them and time of the last one, in wall clock
        self.monitor: Monitor = NOT_COMPOSED
        self.integrator: VelocityVerlet = NOT_COMPOSED
        shared = len(scene.position) > SERIAL_LIMIT if scene.parallel is None else scene.parallel
        self.threads = self.runtime.threads if shared else 1
        self.skin = scene.skin
        self._dt = scene.chosen_dt()
        self.spec = KernelSpec.of(scene)
        with allocating():
            self._allocate(scene)
        if self.bonds:
            self.bonds.set_reference()
        wanted = self._count_pairs()
        with allocating():
            self.compose(Pairs(self.spec, self.grains.slot_of.shape[0], self._pair_capacity(wanted)))
        self.neighbours.write()
        self._start()

    def _allocate(self, scene):
        """Everything that does not depend on the number of listed pairs."""
        spec = self.spec
        self.effects = [e.bound() for e in scene.effects]
        self.grains = Grains(spec)
        self.domain: Any = cell_of(scene, spec, self.grains)  # its class depends on the scene
        self.error_flags = ErrorFlags()
        self.surfaces = surface_table(spec.kind, scene.shapes)
        self.parts = PartTable(scene.shapes, self.grains) if spec.multi_part else None
        self.state = StateView(self.grains, self._energies_changed)
        when_allocated(lambda: load_state(self))
        when_allocated(lambda: self.error_flags.want(scene.guards))
        # None where the scene lists none; typed Any, for a caller knows what its scene lists.
        self.bonds: Any = None
        self.platens: Any = None
        self.walls: Any = None
        if spec.bonds:
            self.bonds = Bonds(spec, scene, bond_effect(self.effects), self.grains, self.domain)
        if spec.platens:
            mass, _ = scene.masses()
            self.platens = Platens(scene.platens, self.grains, scene.platen_area(), scene.platen_index, mass, self._dt)
        if spec.walls:
            self.walls = Walls(spec, scene.walls, self.grains, self._dt)
        reach = self.skin + scene.reach()
        self.search = NeighbourSearch(spec, self.grains, self.domain, reach, self.parts, self.bonds)

    def _pair_capacity(self, wanted):
        """Listed pairs to make room for at the start: those there are, or those of a dense packing if that is more."""
        n = self.spec.count
        dense = PAIRS_PER_GRAIN[self.spec.dim] * n * (SHAPED_PAIRS if self.spec.shaped else 1.0) if n <= MANY else 0
        return int(max(1.15 * wanted, dense))

    def compose(self, pairs: Pairs) -> None:
        """Specialise the kernels for this scene and this storage of pairs."""
        scene, spec = self.scene, self.spec
        self.pairs = pairs
        self.neighbours = NeighbourList(self.search, pairs)
        geometry = PairGeometry(
            spec, self.grains, self.surfaces, self.parts, self.domain, pairs, self.error_flags, scene.reach()
        )
        self.forces = ContactForces(spec, geometry, self.domain, self.effects, self.walls, self.bonds)
        self.freed = FreedContacts(self.bonds, self.forces) if self.bonds else None
        former, self.integrator = self.integrator, scene.integrator(spec, self.forces, self._dt)
        if former:
            self.integrator.take_over(former)
        self.validity = ListValidity(spec, self.integrator, self.skin)
        self.stages = StepStages(spec, self.integrator, self.validity, self.platens)
        on_gpu = self.runtime.arch != "cpu"
        self.step_loop = StepLoopGPU(self.stages) if on_gpu else StepLoopCPU(self.stages, self.threads)
        self.measure = Measure(self.forces, self.integrator, scene.thickness)
        self.contact_table = ContactTable(self.forces)
        self._velocities = SynchronisedVelocities(self.integrator)
        self.monitor = Monitor(self, self.monitor)

    def _start(self):
        """First evaluation of the contacts, then velocities half a step back."""
        begun = self.step_loop.start()
        self.integrator.shift_velocities()
        self.monitor.begin()
        self.monitor.check_error_flags(begun.error)

    def reset(self, scene: Scene) -> None:
        """Start again from another scene of equal KernelSpec, without compiling anything.

        Numbers of grains and bonds, effects, integrator and periodic axes must be the same and there may be no
        platens; positions, shapes, sizes, lengths of the cell, parameters of the effects, guards and the time step may
        differ. Raises InputError otherwise, and leaves the simulation as it was.
        """
        other, dt = KernelSpec.of(scene), scene.chosen_dt()
        if other != self.spec or self.platens:
            raise InputError(f"Simulation.reset: scene of {other}, must be of {self.spec} without platens")
        names = [wall.name for wall in scene.walls]
        if self.walls and names != self.walls.names:
            raise InputError(f"Simulation.reset: walls {names}, must be {self.walls.names}")
        former, self.scene = self.scene, scene
        try:
            with writing_together():
                load_scene(self)
        except InputError:
            self.scene = former
            raise
        self.set_time_step(dt)
        if self.bonds:
            self.bonds.begin()
        self.restart()

    def restart(self, strain: float = 0.0) -> None:
        """Start again from the present positions and velocities, taken to belong to the same time, without a past.

        No contact remembers anything, not even a rest overlap; nothing has been dissipated, no work done. Platens and
        plane walls are where the scene has them, broken bonds stay broken, a cell keeps its height and has this strain.
        """
        self.step = 0
        self._last_good = None
        self.error_flags.clear()
        self.pairs.row_start.fill(0)
        if self.spec.tracks_dissipation:
            self.grains.dissipated.fill(0.0)
        if self.platens:
            self.platens.clear()
        if self.spec.sheared:
            self.domain.set_shear(self.scene.shear_rate, self.scene.widest(), strain)
            self.grains.shear_work.fill(0.0)
        if self.walls:
            self.walls.begin(self.scene.walls)
        if self.bonds:
            self.bonds.forget_breaks()
        self.rebuild_neighbours()
        self._start()

    def set_time_step(self, dt: float) -> None:
        """Choose the time step [s], for a run that is about to `restart`: velocities live half a step before positions.

        Raises InputError unless it is a positive number that resolves the platens and walls on what drives them.
        """
        if not (np.isfinite(dt) and dt > 0.0):
            raise InputError(f"Simulation.set_time_step: dt = {dt!r} s, must be > 0")
        if self.platens:
            self.platens.set_time_step(float(dt))
        if self.walls:
            check_servo_steps(self.scene.walls, float(dt))
            self.walls.dt = float(dt)
        self._dt = float(dt)
        self.integrator.set_time_step(self._dt)

    def set_skin(self, skin: float) -> None:
        """Choose the skin of the neighbour list [m], from the next rebuild on."""
        self.skin = skin
        self.search.set_skin(skin + self.scene.reach())
        self.validity.set_skin(skin)

    @property
    def dt(self) -> float:
        """Time step [s]."""
        return self._dt

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.step * self._dt

    def __len__(self) -> int:
        return len(self.grains)

    def __repr__(self) -> str:
        return describe.simulation_line(self)

    def __str__(self) -> str:
        return describe.as_text(describe.simulation_tree(self))

    def _repr_html_(self) -> str:
        return describe.as_html(describe.simulation_tree(self))

    @property
    def positions(self) -> NDArray:
        """Centres of mass (n, dim) [m] by persistent id, world frame; never wrapped into a periodic cell."""
        return self.grains.column("position")

    @property
    def velocities(self) -> NDArray:
        """Velocities (n, dim) [m s-1] by persistent id, world frame, at the time of the positions.

        In a sheared cell the mean flow is included. The first call compiles a small kernel; the run is not changed.
        """
        return self._velocities.values()

    def contacts(self) -> "xarray.Dataset":
        """All contacts at this instant, one row each; the first call compiles a small kernel.

        Each pair of grains appears once, under the lower of its ids, or once for each pair of their parts that touch.

        Returns
        -------
        xarray.Dataset
            Dimensions contact, sorted by first_id, second_id and parts, and space (x, y, z). Variables, each with
            units and long_name:

            first_id, second_id : persistent ids of the grains; second_id is -1 - w at wall w of `Scene.walls`.
            first_part, second_part, first_patch, second_patch : where on their shapes; patch -1 on an edge or unknown.
            point, arm : middle of the overlap, beside the first grain; vector to it from the first centre [m].
            normal : unit vector from the first grain to the second, or into the wall.
            branch : vector from the first centre to the nearest image of the second [m]; at a wall, to the contact.
            overlap : depth along the normal [m]; negative for a force across a gap, not a number for a bond.
            normal_force : [N], positive in compression: elastic_normal_force, also of cohesion, and a dissipative one.
            tangential_force : on the second grain [N].
            elastic_energy, history_... : of the contact or the bond [J]; what its effects remember, by name.
            dissipated_power, parted_power : in the last step, of each and of all that ended in it [W]; see `Scene`.
            sliding, bonded : True at the limit of friction; True for an intact bond, which acts in place of a contact.

        Notes
        -----
        The force on the second grain is normal_force * normal + tangential_force. Impulses with which OnsetVerlet
        corrects the begin and end of contacts are not part of it. The mean stress of the contacts in a volume V,
        compression positive, is the sum of force (x) branch over V.
        """
        return contacts_dataset(self)

    @contextmanager
    def clock(self, name: str) -> Iterator[None]:
        """Add the wall-clock time of the block to `seconds[name]` [s]."""
        began = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - began

    def keep_checkpoints(self, folder: str | Path, seconds: float = 60.0, last: Path | None = None) -> None:
        """Keep the last good state in `folder`: checkpoint.nc, every so many seconds of wall clock if no guard objects.

        The one before is kept beside it, see `checkpoints`. A run that stops with an error leaves its state in
        stopped.nc, to be looked at: it may be in the midst of a step. last: the file that a restored run goes on from.
        """
        self._folder, self._last_good = Path(folder), last
        self._keep_seconds, self._kept = seconds, time.monotonic()

    def keep_checkpoint(self, run_state: Mapping[str, Any] | None = None) -> None:
        """Keep the state now, with `run_state`, in the folder of `keep_checkpoints`, if no guard objects."""
        if self._folder is None:
            raise InputError("Simulation.keep_checkpoint: there is no folder, call keep_checkpoints before")
        try:
            self.monitor.check_all()
        except SimulationError as error:
            self._save_stopped(error)
            raise
        with self.clock("output"):
            self._last_good = keep_checkpoint(self, self._folder, run_state)
        self._kept = time.monotonic()

    def run(self, steps: int) -> None:
        """Advance by a whole number of steps. Raises SimulationError naming the step, the grains and the cause."""
        target = self.step + step_count(steps)
        try:
            while self.step < target:
                self._launch(target - self.step)
                if self._folder is not None and time.monotonic() - self._kept >= self._keep_seconds:
                    self.keep_checkpoint()
        except SimulationError as error:
            self._save_stopped(error)
            raise

    def _launch(self, steps):
        with self.clock("steps"):
            launched = self.step_loop.launch(steps)
        self.launches += 1
        self.step += launched.steps
        self.monitor.check_error_flags(launched.error)
        if launched.halted:
            with self.clock("neighbour list"):
                self.rebuild_neighbours()
            with self.clock("steps"):
                finished = self.step_loop.finish_step()
            self.step += finished.steps
            self.monitor.check_error_flags(finished.error)
        with self.clock("guards"):
            self.monitor.check()

    def _save_stopped(self, error: SimulationError) -> None:
        """Add to the error what was saved of the run."""
        if self._folder is None or error.saved:
            return
        good = [self._last_good] if self._last_good else []
        try:
            save_checkpoint(self, self._folder / STOPPED)
            error.saved = (self._folder / STOPPED, *good)
        except (SimulationError, InputError) as failure:  # the disk is full, or the folder gone
            error.add_note(str(failure))
            error.saved = tuple(good)

    def _energies_changed(self):
        if self.monitor:
            self.monitor.forget()

    def _count_pairs(self):
        """Number of pairs to be listed; no grain may be lost or have jumped."""
        try:
            return self.search.count(self._dt, self.scene.guards)
        except SimulationError as error:
            raise SimulationError(f"step {self.step}: {error}", self.step, error.grains, error.values) from None

    def rebuild_neighbours(self) -> None:
        """Search for neighbours and write the list anew; pairs that stay listed keep what they remember."""
        wanted = self._count_pairs()
        if wanted > self.pairs.capacity:
            self.compose(grown(self.pairs, int(GROWTH * wanted)))
        self.neighbours.write()
        self.rebuilds += 1
        if self.freed:
            self.freed.begin()

    def clear_flags(self) -> None:
        """Forget what the last launch reported (halts, finished steps, errors) and go on from `step`."""
        for flag in (self.validity.outdated, self.stages.halted, self.stages.steps_done):
            flag[None] = 0
        self.error_flags.clear()
        self.integrator.restart(self.step)
