"""The files of one sheared layer or cell: run.nc (time series), grains.nc (snapshots), contacts.nc if it is wanted."""

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from ..bonds.bond_setup import bond_areas
from ..core.allocation import read
from ..core.errors import SimulationError
from ..core.schema import Variable
from ..measure.contacts import FLAGS
from ..measure.layer_rows import layer_rows
from ..measure.sheared_grains import Row, ShearedGrains
from ..shapes.patch_surfaces import PatchSurface, patch_surface
from .contacts_dataset import PARTED_POWER
from .contacts_file import ContactsWriter
from .grains_file import STATIC_DIMS, GrainsWriter, snapshot_rows, static_rows
from .netcdf_variables import Scalar
from .run_file import RunWriter, file_attributes

if TYPE_CHECKING:
    from ..scene import Scene


STAGE = {"stage": "stage of the run"}
STAGE_INDEX = Variable("stage_index", ("time",), "i32", "1", "place of the stage in the schedule from 1 on; 0 before")
CYCLE_ROWS = [
    Variable("cycle", ("time",), "i32", "1", "number of the repetition of its stages from 1 on; 0 of one not repeated"),
    Variable("stage_slip", ("time",), "f64", "m", "slip of the layer since the stage began"),
]
CELL_ROWS = [
    Variable("cell_height", ("time",), "f64", "m", "height of the cell"),
    Variable("cell_shift", ("time",), "f64", "m", "displacement of the image above the cell along the shear"),
    Variable("cell_shear_rate", ("time",), "f64", "s-1", "rate of shear of the cell"),
]
PARTED_ROW = Variable("parted_power", ("time",), "f64", *PARTED_POWER)
(STRAIN,) = (row for row in layer_rows() if row.name == "shear_strain")


class LayerRecorder:
    """Writes what a `ShearedLayer` or a `ShearedCell` measures, and contacts.nc if `Scene.track_contacts` is set.

    Use as a context manager: an exception leaves a file that says so. A run that a guard stops leaves its state at the
    stop in stopped.nc and as the last snapshot of grains.nc (`Simulation.keep_checkpoints`).

    Parameters
    ----------
    out
        Folder of the files.
    layer
        What is recorded.
    title, summary
        Of the files, see `file_attributes`.
    config_toml
        The merged parameters as TOML text.
    seed
        Random seed of the packing.
    scalars
        What tells the run from others, such as its name and parameters: scalar coordinates of both files.
    cycles
        Whether rows tell the repetition of their stage and the slip since it began.
    keep
        Rows of run.nc, snapshots of grains.nc and moments of contacts.nc in the folder, written by a run that was
        stopped, which this run goes on from; None: a new run.

    Attributes
    ----------
    rows, snapshots
        Number of them in the files.
    contacts
        The writer of contacts.nc, whose length is the number of its moments; None without that file.
    """

    def __init__(
        self,
        out: str | PathLike[str],
        layer: ShearedGrains,
        title: str,
        summary: str,
        config_toml: str,
        seed: int,
        scalars: Sequence[Scalar] = (),
        keep: tuple[int, int, int] | None = None,
        cycles: bool = False,
    ) -> None:
        sim = layer.sim
        self.layer, self.sim, self.cycles = layer, sim, cycles
        runtime = sim.runtime
        attributes = file_attributes(title, summary, config_toml, seed, sim.dt, runtime.arch, runtime.precision)
        self.begin_stage("", 0)
        scalars = [*scalars, Scalar("stiffness_number", layer.stiffness_number, "stiffness number of the contacts")]
        out = Path(out)
        self.rows, self.snapshots, _ = keep or (0, 0, 0)
        kept_rows, kept_snapshots, kept_moments = keep or (None, None, None)
        self.run = RunWriter(
            out / "run.nc",
            [*layer.variables, STAGE_INDEX, *(CYCLE_ROWS if cycles else ())],
            attributes,
            coordinates=layer.coordinates,
            auxiliary=("shear_strain",),
            text=STAGE,
            scalars=scalars,
            effects=sim.scene.effects,
            keep=kept_rows,
        )
        dim, spec, bonded = sim.scene.dim, sim.spec, sim.spec.bonds > 0
        cell = {"periodic_lengths": [n for n, p in zip(sim.scene.lengths, sim.scene.periodic) if p]}
        in_time = snapshot_rows(dim, rotates=spec.rotates, oriented=spec.oriented, bonded=bonded)
        self.grains = GrainsWriter(
            out / "grains.nc",
            _constants(sim.scene),
            static_rows(dim, bonded),
            [STRAIN, *CELL_ROWS * spec.cell_servo, *in_time],
            attributes | cell,
            text=STAGE,
            # A variable of the name of a dimension would be its coordinate.
            scalars=[replace(s, name=f"grain_{s.name}") if s.name in STATIC_DIMS else s for s in scalars],
            keep=kept_snapshots,
            shares=True,
        )
        self.contacts: ContactsWriter | None = None
        if sim.scene.track_contacts:
            self.contacts = ContactsWriter(
                out / "contacts.nc",
                sim.contact_table.variables,
                [STRAIN, PARTED_ROW, *CELL_ROWS * spec.cell_servo],
                attributes | cell,
                dim,
                text=STAGE,
                scalars=scalars,
                extra_attributes=FLAGS,
                shares=True,
                keep=kept_moments,
            )

    @property
    def id(self) -> str:
        """Identifier of the run, the same in all its files, also after it went on."""
        return self.run.attributes["id"]

    def begin_stage(self, name: str, index: int, cycle: int = 0, slip: float = 0.0) -> None:
        """Name the stage of the rows and snapshots that follow.

        index: its place in the schedule from 1 on; cycle: of its repetition; slip: of the layer as it began [m].
        """
        self._stage, self._cycle, self._slip = {"stage": name, "stage_index": index}, cycle, slip

    def row(self) -> Row:
        """Append a row to run.nc and return it."""
        row = self.layer.row() | self._stage
        if self.cycles:
            row |= {"cycle": self._cycle, "stage_slip": self.layer.slip - self._slip}
        with self.sim.clock("output"):
            self.run.append(row)
        self.rows += 1
        return row

    def snapshot(self) -> None:
        """Append all grains to grains.nc."""
        with self.sim.clock("output"):
            self._snapshot(self.sim.time)
        self.snapshots += 1

    def _snapshot(self, time: float) -> None:
        state, scene = self.sim.state, self.sim.scene
        position = state.position.to_numpy()
        arrays = {"position": position, "velocity": state.velocity.to_numpy() + self.sim.domain.missing_flow(position)}
        arrays |= self._of_moment()
        if self.sim.spec.rotates:
            angular_velocity = state.angular_velocity.to_numpy()
            arrays["angular_velocity"] = angular_velocity[:, 0] if scene.dim == 2 else angular_velocity
        if self.sim.spec.oriented:
            arrays["orientation"] = _quaternions(state.orientation.to_numpy())
        if self.sim.spec.bonds > 0:
            arrays["bond_intact"] = read(self.sim.bonds.intact)
        self.grains.append(time, arrays)

    def _of_moment(self) -> dict[str, Any]:
        """What grains.nc and contacts.nc have of an instant as a whole."""
        values: dict[str, Any] = {"shear_strain": self.layer.strain, "stage": self._stage["stage"]}
        if self.sim.spec.cell_servo:
            cell = self.sim.domain.snapshot()
            values |= {f"cell_{name}": cell[name] for name in ("height", "shift", "shear_rate")}
        return values

    def moment(self) -> None:
        """Append all contacts to contacts.nc, unless there is no such file or it has this instant."""
        if self.contacts is None or self.contacts.last_time >= self.sim.time:
            return
        sim = self.sim
        with sim.clock("output"):
            table = sim.contact_table
            values = self._of_moment() | {"parted_power": table.parted_power(sim.scene, sim.dt)}
            self.contacts.append(sim.time, values, table.rows(sim.scene, sim.dt))

    @property
    def moments(self) -> int:
        """Number of moments in contacts.nc, 0 without that file."""
        return 0 if self.contacts is None else len(self.contacts)

    def _snapshot_of_stop(self) -> None:
        """Append the state in which a run was stopped, if its positions are finite.

        Times of snapshots must rise: where there is one of the present time, the state is that of the next step, which
        had begun.
        """
        if np.isfinite(self.sim.state.position.to_numpy()).all():
            self._snapshot(self.sim.time + self.sim.dt * (self.sim.time <= self.grains.last_time))

    def flush(self) -> None:
        """Write all rows, snapshots and moments to disk."""
        with self.sim.clock("output"):
            self.run.flush()
            self.grains.flush()
            if self.contacts:
                self.contacts.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        status = "complete" if kind is None else "failed" if issubclass(kind, Exception) else "interrupted"
        # Each of these whatever becomes of the others; grains.nc is closed first, as that needs no space on the disk.
        last = [lambda: self.grains.close(status), lambda: self.run.close(status)]
        if contacts := self.contacts:
            last.append(lambda: contacts.close(status))
        if kind is not None and issubclass(kind, SimulationError):
            last.insert(0, self._snapshot_of_stop)
        failures = []
        for write in last:
            try:
                write()
            except SimulationError as failure:
                failures.append(failure)
        if error is not None:  # what ended the run is what is told
            for failure in failures:
                error.add_note(str(failure))
        elif failures:
            raise failures[0]


def _quaternions(orientation: npt.NDArray) -> npt.NDArray:
    """Unit quaternions (n, 4), w, x, y, z, of orientations; a rotation in 2D is one about z."""
    if orientation.shape[1] == 4:
        return orientation
    half = 0.5 * np.arctan2(orientation[:, 1], orientation[:, 0])
    zero = np.zeros_like(half)
    return np.stack([np.cos(half), zero, zero, np.sin(half)], axis=1)


def _constants(scene: "Scene") -> dict[str, npt.NDArray]:
    """What does not change: per grain, then per patch of the shape table."""
    mass, inertia = scene.masses()
    surfaces = [patch_surface(shape) for shape in scene.shapes]
    patches = PatchSurface(*(np.concatenate(column) for column in zip(*surfaces, strict=True)))
    bonds: dict[str, npt.NDArray] = {}
    if scene.bonds is not None:
        bonds = {"bond_first": scene.bonds[:, 0], "bond_second": scene.bonds[:, 1], "bond_area": bond_areas(scene)}
    return bonds | {
        "mass": mass,
        "inertia": inertia[:, 0] if scene.dim == 2 else inertia,
        "bounding_radius": scene.per_grain("bounding_radius"),
        "kind": (np.asarray(scene.platen_index) >= 0).astype(np.int32),
        "shape_index": scene.shape_index.astype(np.int32),
        "shape_scale": scene.diameter,
        "patch_count": np.array([s.patch_count for s in scene.shapes], np.int32),
        "patch_centre": patches.centre,
        "patch_radius": patches.radius,
        "patch_axis": patches.axis,
        "patch_angle": patches.half_angle,
        "patch_part": patches.part.astype(np.int32),
        "patch_edge_radius": patches.edge_radius,
    }
