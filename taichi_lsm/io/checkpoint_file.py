"""Exact save and restore of a simulation: every row that the schema marks `restart`, bit for bit.

The file is plain NetCDF, one group per table, and bears a digest of all that it holds. A simulation is restored into
one that was made from the same scene, in the same precision; the steps that follow give the same bits as if the run
had not been interrupted.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import netCDF4
import numpy as np
import numpy.typing as npt

from ..boundaries.plane_walls import WALL_ROWS
from ..boundaries.wall_servo import SERVO_ROWS
from ..contact.neighbour_list import grown
from ..core.allocation import read, row_shape, share_kernels, write
from ..core.atomic_netcdf import write_atomically
from ..core.errors import InputError, finite, reason
from ..core.netcdf_input import opened_netcdf
from ..core.schema import Variable
from ..measure.energy_budget import Energies
from .global_attributes import package_version
from .scene_identity import scene_identity

if TYPE_CHECKING:
    from ..simulation import Simulation

FORMAT = 7
OF_SCENE = "scene_"  # with which the attributes begin that `scene_identity` gives
COUNTERS = ("step", "rebuilds")
COUNTS = (*COUNTERS, "searches", "pair_capacity")  # attributes of the file beside NUMBERS and those of `_identity`
NUMBERS = {"dt": "s", "skin": "m", "list_skin": "m"}
EXPECTED = "must be a whole file that save_checkpoint wrote"
LIST_ROWS = (Variable("row_start", ("row",), "i32", "1", "first list slot of each grain", True),)
PLATEN_ROWS = tuple(
    Variable(name, ("platen", width), "f64", units, long_name, True)
    for name, width, units, long_name in (
        ("displacement", "space", "m", "displacement of the platen"),
        ("velocity", "space", "m s-1", "velocity of the platen half a step before"),
        ("force", "space", "N", "force of the contacts on the platen"),
        ("force_sum", "space", "N", "sum of that force over steps"),
        ("force_square_sum", "space", "N2", "sum of its square over steps"),
        ("work", "space", "J", "work of the drives"),
        ("dissipated", "space", "J", "energy that the drives dissipated"),
        ("mass", "space", "kg", "inertia of the platen along each axis"),
    )
)
DRIVE_ROW = Variable(
    "values", ("platen", "space", "value"), "f64", "1", "values of the drives, in their own units", True
)
SPRING_ROW = Variable("stretch", ("platen", "space"), "f64", "m", "stretch of the springs of load points", True)


@dataclass(frozen=True)
class _Saved:
    """Contents of a checkpoint.

    Attributes
    ----------
    numbers, counts
        Those of NUMBERS, in their units; whole numbers of COUNTS.
    tables
        {group: {row: values of the rows in use}}.
    drives
        Drives of the platens along each axis, [] if there are none.
    guards
        `Monitor.memory`.
    run_state
        What was saved beside the simulation.
    """

    numbers: dict[str, float]
    counts: dict[str, int]
    tables: dict[str, dict[str, npt.NDArray]]
    drives: list[list[Any]]
    guards: dict[str, Any]
    run_state: dict[str, Any]


class DamagedCheckpointError(InputError):
    """A checkpoint that is missing, truncated or altered: an earlier one may still be good."""


def save_checkpoint(sim: "Simulation", path: str | PathLike[str], run_state: Mapping[str, Any] | None = None) -> None:
    """Write the state of `sim` to the NetCDF file `path`, which appears whole or not at all.

    Parameters
    ----------
    sim : Simulation
    path
        The file, replaced if it exists.
    run_state
        What else the run needs to go on, such as its place in a schedule: numbers, texts, lists and dicts of these.
        `restore_checkpoint` gives it back.

    Raises
    ------
    InputError
        If there is no folder to write to.
    """

    def fill(file: netCDF4.Dataset) -> None:
        file.setncatts(_identity(sim))
        for name in COUNTERS:
            file.setncattr(name, np.int64(getattr(sim, name)))
        file.searches = np.int64(sim.search.searches)
        for name, value in zip(NUMBERS, (sim.dt, sim.skin, sim.search.width), strict=True):
            file.setncattr(name, value)
        file.pair_capacity = np.int64(sim.pairs.capacity)
        for group, rows, owner, count in _tables(sim):
            _write(file.createGroup(group), rows, owner, count)
        if sim.platens:
            file.drives = _drives_text(sim)
        file.guards = json.dumps(sim.monitor.memory())
        file.run_state = json.dumps(dict(run_state or {}))
        file.digest = content_digest(file)

    write_atomically(path, fill)


def restore_checkpoint(sim: "Simulation", path: str | PathLike[str]) -> dict[str, Any]:
    """Put `sim`, made from the same scene, into the state saved at `path`.

    Every input of the scene must be the same, but for those of `scene_identity.FREE`: positions, velocities and
    orientations, the time step and the margin of the list are those of the file; guards and threads those of `sim`.

    Returns
    -------
    dict
        The `run_state` that was saved with it, {} if there was none.

    Raises
    ------
    DamagedCheckpointError
        An InputError: if the file is missing, truncated, altered or no checkpoint. The simulation is then as it was.
    InputError
        If it belongs to a simulation of another scene. The simulation is then as it was.
    """
    saved = _read(sim, Path(path))
    sim.set_time_step(saved.numbers["dt"])
    sim.set_skin(saved.numbers["skin"])
    sim.search.set_skin(saved.numbers["list_skin"])
    capacity = saved.counts["pair_capacity"]
    if capacity > sim.pairs.capacity:
        sim.compose(grown(sim.pairs, capacity))
    for group, rows, owner, _ in _tables(sim):
        _fill(saved.tables[group], rows, owner)
    if sim.platens:
        sim.platens.drives = saved.drives
    for name in COUNTERS:
        setattr(sim, name, saved.counts[name])
    sim.search.searches = saved.counts["searches"]
    _resume(sim)
    sim.monitor.recall(**saved.guards)
    return saved.run_state


def _resume(sim: "Simulation") -> None:
    """What a simulation derives from its state, after the state was replaced."""
    sim.clear_flags()
    sim.monitor.begin()
    if sim.walls:
        sim.walls.mark_all()
    if sim.spec.sheared:
        sim.domain.settle()
    grains = sim.grains
    grains.set_order(read(grains.id, len(grains)))
    sim.neighbours.transpose_only()


def _tables(sim: "Simulation") -> list[tuple[str, Sequence[Variable], Any, int]]:
    """(group, schema rows, object that holds the fields, rows in use) of everything that is saved."""
    count, pairs = len(sim.grains), sim.pairs
    tables: list[tuple[str, Sequence[Variable], Any, int]] = [
        ("grains", list(sim.grains.variables.values()), sim.grains, count),
        ("list", LIST_ROWS, pairs, count + 1),
    ]
    if sim.bonds:
        tables.append(("bonds", sim.bonds.variables, sim.bonds, sim.bonds.count))
    if sim.platens:
        rows = [*PLATEN_ROWS, DRIVE_ROW] + ([SPRING_ROW] if sim.platens.springs else [])
        tables.append(("platens", rows, sim.platens, sim.platens.count))
    if sim.spec.sheared:
        tables.append(("cell", sim.domain.rows, sim.domain, 1))
    if sim.walls:
        tables.append(("walls", WALL_ROWS, sim.walls, sim.walls.count))
        if sim.walls.servos:
            tables.append(("wall_servos", SERVO_ROWS, sim.walls.servos, sim.walls.count))
        tables.append(("wall_contacts", sim.walls.rows, sim.walls, sim.walls.count * count))
    saved = [(owner, row.name) for _, rows, owner, _ in tables for row in rows if row.restart]
    saved += [(pairs, row.name) for row in pairs.variables if row.restart]
    share_kernels(getattr(owner, name) for owner, name in saved)
    return [*tables, ("pairs", pairs.variables, pairs, int(read(pairs.row_start, count + 1)[count]))]


def _identity(sim: "Simulation") -> dict[str, Any]:
    """What two simulations must share, as attributes of the file."""
    return {
        "format": np.int64(FORMAT),
        "Conventions": "CF-1.11, ACDD-1.3",
        "title": "Checkpoint of a simulation of grains",
        "taichi_lsm": package_version("taichi-lsm"),
        "taichi": package_version("taichi"),
        "grains": np.int64(len(sim.grains)),
        "precision": sim.runtime.precision,
        "arch": sim.runtime.arch,
        **{f"{OF_SCENE}{name}": text for name, text in scene_identity(sim.scene).items()},
    }


def _require_same(sim: "Simulation", path: Path, file: netCDF4.Dataset) -> None:
    for name, mine in _identity(sim).items():
        if name not in file.ncattrs():
            raise InputError(f"checkpoint {path}: {name} missing, {EXPECTED}")
        theirs = file.getncattr(name)
        if theirs != mine:
            field = name.replace(OF_SCENE, "Scene.")
            if name in ("taichi_lsm", "taichi"):
                raise InputError(
                    f"checkpoint {path}: was written by version {theirs} of {name}, this is {mine}, which may give "
                    "other bits; go on with that version, or begin anew"
                )
            raise InputError(
                f"checkpoint {path}: {field} is {theirs}, but the scene has {mine}; "
                "restore it into a simulation of the scene that it was saved from"
            )


def _write(group: netCDF4.Group, rows: Sequence[Variable], owner: Any, count: int) -> None:
    """One variable per restart row, the rows in use."""
    group.createDimension("row", count)
    for row in rows:
        if not row.restart:
            continue
        values = read(getattr(owner, row.name), count)
        dims = ["row"]
        for axis, size in enumerate(values.shape[1:]):
            dims.append(f"{row.name}_{axis}")
            group.createDimension(dims[-1], size)
        variable = group.createVariable(row.name, values.dtype, dims, fill_value=False)
        variable.units, variable.long_name = row.units, row.long_name
        variable[:] = values


def _read(sim: "Simulation", path: Path) -> _Saved:
    """The whole file, before anything of the simulation is changed; InputError if it does not fit."""
    if not path.is_file():
        raise DamagedCheckpointError(f"checkpoint {path}: no such file, {EXPECTED}")
    try:
        with opened_netcdf(path) as file:
            if "format" not in file.ncattrs():
                raise DamagedCheckpointError(f"checkpoint {path}: is none, {EXPECTED}")
            if file.format != FORMAT:
                raise InputError(
                    f"checkpoint {path}: is of format {file.format}, must be {FORMAT}: another version wrote it"
                )
            if file.digest != content_digest(file):
                raise DamagedCheckpointError(f"checkpoint {path}: is damaged, its digest differs, {EXPECTED}")
            _require_same(sim, path, file)
            lacking = [name for name in (*COUNTS, *NUMBERS) if name not in file.ncattrs()]
            if lacking:
                raise InputError(f"checkpoint {path}: {', '.join(lacking)} missing, {EXPECTED}")
            numbers = {name: file.getncattr(name) for name in (*COUNTS, *NUMBERS)}
            tables = {
                group: {row.name: file[group][row.name][:] for row in rows if row.restart}
                for group, rows, _, _ in _tables(sim)
            }
            drives = file.drives if sim.platens else "[]"
            guards, run_state = _saved_guards(file.guards), json.loads(file.run_state)
    except InputError:
        raise
    except (OSError, RuntimeError, IndexError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise DamagedCheckpointError(f"checkpoint {path}: cannot be read ({reason(error)}), {EXPECTED}") from None
    for name, unit in NUMBERS.items():
        least = "> 0" if name == "dt" else ">= 0"
        if not (finite(numbers[name]) and (numbers[name] > 0.0 or (least == ">= 0" and numbers[name] == 0.0))):
            raise InputError(f"checkpoint {path}: {name} is {numbers[name]!r} {unit}, must be {least}, {EXPECTED}")
    for name in COUNTS:
        if not (finite(numbers[name]) and numbers[name] >= 0 and numbers[name] == int(numbers[name])):
            raise InputError(f"checkpoint {path}: {name} is {numbers[name]!r}, must be a whole number >= 0, {EXPECTED}")
    counts = {name: int(numbers[name]) for name in COUNTS}
    _require_shapes(sim, path, tables, counts["pair_capacity"])
    lengths_and_time = {name: float(numbers[name]) for name in NUMBERS}
    return _Saved(lengths_and_time, counts, tables, _saved_drives(sim, path, drives), guards, run_state)


def content_digest(file: netCDF4.Dataset) -> str:
    """SHA-256 of the attributes and variables of a file and of its groups, but for the attribute `digest` itself."""
    sha = hashlib.sha256()
    for part in _content(file):
        sha.update(part)
    return sha.hexdigest()


def _content(group: netCDF4.Dataset | netCDF4.Group) -> Iterator[bytes]:
    """All texts and numbers of a group, in the order of their names."""
    yield f"{group.path}:".encode()
    for name in sorted(set(group.ncattrs()) - {"digest"}):
        yield f"{name}={group.getncattr(name)};".encode()
    for name, variable in sorted(group.variables.items()):
        variable.set_auto_mask(False)
        values = np.ascontiguousarray(variable[:])
        yield f"{name} {values.shape} {values.dtype} {variable.units} {variable.long_name}:".encode()
        yield values.tobytes()
    for _, inner in sorted(group.groups.items()):
        yield from _content(inner)


def _drives_text(sim: "Simulation") -> str:
    """The drives of all platens now, which may differ from those of the scene: class and values, as JSON."""
    drives = [[{"kind": type(drive).__name__, **asdict(drive)} for drive in axes] for axes in sim.platens.drives]
    return json.dumps(drives)


def _saved_drives(sim: "Simulation", path: Path, text: str) -> list[list[Any]]:
    """The drives that `_drives_text` wrote, of the classes that the simulation has compiled; InputError otherwise."""
    found = []
    present = sim.platens.drives if sim.platens else []
    try:
        for saved, now in zip(json.loads(text), present, strict=True):
            numbers = [{name: v for name, v in drive.items() if name != "kind"} for drive in saved]
            if [drive["kind"] for drive in saved] != [type(drive).__name__ for drive in now]:
                raise ValueError("other kinds of drives")
            found.append([type(drive)(**given) for drive, given in zip(now, numbers, strict=True)])
    except (ValueError, TypeError, KeyError, AttributeError, InputError) as error:
        raise InputError(f"checkpoint {path}: drives cannot be read ({error}), {EXPECTED}") from None
    return found


def _saved_guards(text: str) -> dict[str, Any]:
    """What `Monitor.memory` gave; ValueError, TypeError or KeyError if it is anything else."""
    found = json.loads(text)
    energies, counts = found["first_energies"], [found[name] for name in ("next_check", "check_steps", "next_sum")]
    numbers = [found["highest"], *([0.0] * len(Energies._fields) if energies is None else energies)]
    whole = all(isinstance(count, int) and count >= 0 for count in counts)
    if len(found) != 5 or len(numbers) != 1 + len(Energies._fields) or not whole:
        raise ValueError("guards")
    if not all(isinstance(number, int | float) for number in numbers):
        raise TypeError("guards")
    return found


def _require_shapes(sim: "Simulation", path: Path, tables: dict[str, dict[str, npt.NDArray]], capacity: int) -> None:
    """Refuse values that do not fit the fields, which have room for `capacity` pairs once they have grown."""
    used = int(np.ravel(tables["list"]["row_start"])[-1:].sum())
    if not 0 <= used <= max(capacity, sim.pairs.capacity):
        raise InputError(f"checkpoint {path}: row_start ends at {used}, must be 0..{capacity}, {EXPECTED}")
    for group, rows, owner, count in _tables(sim):
        for name, values in tables[group].items():
            shape = (used if group == "pairs" else count, *row_shape(getattr(owner, name)))
            if values.shape != shape:
                raise InputError(f"checkpoint {path}: {name} has shape {values.shape}, must be {shape}, {EXPECTED}")


def _fill(table: dict[str, npt.NDArray], rows: Sequence[Variable], owner: Any) -> None:
    """Put the saved values into the first rows of the fields."""
    for row in rows:
        if row.restart:
            write(getattr(owner, row.name), table[row.name])
