"""NetCDF files of a run: time series, tables and energies, with their global attributes.

Every write makes a whole new file and renames it over the old one, so that a killed run leaves a file that can be read.
Conventions CF-1.11 and ACDD-1.3. Times are float64 elapsed seconds with units "s", never "seconds since" a
date. Text labels are auxiliary coordinates such as `effect_name(effect)`.
"""

import time
from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..core.atomic_netcdf import compose, write_atomically
from ..core.errors import InputError
from ..core.schema import Variable
from ..core.whole_files import require_folder_still
from .effect_table import put_effects
from .global_attributes import RUN_STATUS, require_status, set_global_attributes
from .global_attributes import file_attributes as file_attributes
from .netcdf_variables import (
    Scalar,
    checked_array,
    checked_text,
    netcdf_type,
    put_labels,
    put_scalars,
    put_text,
    put_text_in_time,
    put_time,
    put_variable,
    require_known,
    require_names,
    rows_by_name,
)
from .resumed_file import opened, require_count, require_rows, require_same_declaration, resumed_attributes

if TYPE_CHECKING:
    import netCDF4

    from ..effects.base import Effect


def write_table(
    path: str | PathLike[str],
    columns: Mapping[str, Sequence[Any] | npt.NDArray],
    variables: Sequence[Variable],
    attributes: Mapping[str, Any],
    parameters: Sequence[str] = (),
    text: Mapping[str, str] | None = None,
    run_status: str = "complete",
    extra_attributes: Mapping[str, Mapping[str, Any]] | None = None,
) -> None:
    """Write a file with one row per run (dimension `run`), such as compare.nc and sweep.nc.

    Parameters
    ----------
    path
        The file, which appears whole or not at all.
    columns
        {name: n numbers or texts}.
    variables
        Schema rows, dims ("run",), of the number columns.
    attributes
        Global attributes, see `file_attributes`.
    parameters
        Names of the columns that were varied; they become coordinates.
    text
        {name: long_name} of the text columns.
    run_status
        "complete", "running", "failed" or "interrupted".
    extra_attributes
        {name: attributes}, such as flag_values.

    Raises
    ------
    InputError
        For a column that is missing, unknown, of another length or of the wrong type, or a folder that does not exist.
    """
    text, extra_attributes = text or {}, extra_attributes or {}
    rows = rows_by_name(variables)
    require_status(run_status)
    require_names(columns, [*rows, *text], "table columns")
    require_known("parameters", parameters, columns)
    require_known("extra_attributes", extra_attributes, columns)
    count = len(next(iter(columns.values()), ()))
    if count == 0:
        raise InputError("table columns: no runs to write")
    arrays = _checked_columns(columns, rows, text, count)

    def fill(dataset: "netCDF4.Dataset") -> None:
        set_global_attributes(dataset, attributes, run_status)
        dataset.createDimension("run", count)
        # Coordinates first: a variable can only be attached to what is there.
        for name in sorted(columns, key=lambda name: name not in parameters):
            attached = () if name in parameters else parameters
            if name in rows:
                put_variable(dataset, rows[name], arrays[name], extra_attributes.get(name), attached)
                continue
            put_text(dataset, name, text[name], ("run",), np.array(columns[name], dtype=object), attached)
            dataset[name].setncatts(extra_attributes.get(name, {}))

    write_atomically(path, fill)


def _checked_columns(
    columns: Mapping[str, Sequence[Any] | npt.NDArray],
    rows: Mapping[str, Variable],
    text: Iterable[str],
    count: int,
) -> dict[str, npt.NDArray]:
    """The number columns as arrays of `count` values; InputError for one, or for a text column, that does not fit."""
    arrays = {}
    for name, variable in rows.items():
        if variable.dims != ("run",):
            raise InputError(f"{name}: dims {variable.dims}, allowed is ('run',)")
        arrays[name] = checked_array(variable, columns[name], (count,))
    for name in text:
        if len(columns[name]) != count or not all(isinstance(value, str) for value in columns[name]):
            raise InputError(f"{name}: {count} texts expected, got {columns[name]!r}")
    return arrays


class RunWriter:
    """Time series of one run: rows are buffered, the whole file is rewritten at every flush.

    Parameters
    ----------
    path
        The file, written at once with run_status "running".
    variables
        Schema rows with dims ("time",) or ("time", <labelled dimension>); "real" is stored as f64.
    attributes
        Global attributes, see `file_attributes`.
    coordinates
        {dimension: labels} for every dimension other than time, such as {"effect": [...]}.
    flush_seconds
        `append` flushes when the last write is older [s].
    auxiliary
        Names of variables along time that serve the others as coordinates, such as the shear strain.
    extra_attributes
        {name: attributes}, such as {"stage": {"flag_values": [0, 1], "flag_meanings": ["settle", "shear"]}}.
    text
        {name: long_name} of texts along time, which serve as coordinates too, such as the stage.
    scalars
        What holds for the whole file, such as the parameters: scalar coordinates.
    effects
        The effects of the scene, whose parameters are written as a table (`effect_table.put_effects`).
    keep
        None makes a new file. A number takes over the file at `path`, which a former process wrote with the same
        declaration: its first `keep` rows stay, later ones are dropped, and its date_created, id and history are kept.
        The parameters (`scalars`) and other attributes are those given here.

    Raises
    ------
    InputError
        For a declaration that contradicts itself; names the file and what differs if it cannot be taken over. It is
        then unchanged.
    SimulationError
        If the file cannot be written (`core.whole_files`), also from `append`, `flush` and `close`: no row is lost, the
        next write has them all.

    Notes
    -----
    Not reentrant: see `write_atomically`.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        variables: Iterable[Variable],
        attributes: Mapping[str, Any],
        coordinates: Mapping[str, Iterable[str]] | None = None,
        flush_seconds: float = 30.0,
        auxiliary: Iterable[str] = (),
        extra_attributes: Mapping[str, Mapping[str, Any]] | None = None,
        text: Mapping[str, str] | None = None,
        scalars: Sequence[Scalar] = (),
        effects: Sequence["Effect"] = (),
        keep: int | None = None,
    ) -> None:
        self.path = Path(path)
        self.attributes = dict(attributes)
        self.text, self.scalars, self.effects = dict(text or {}), tuple(scalars), tuple(effects)
        self.labels = {name: list(texts) for name, texts in (coordinates or {}).items()}
        self.flush_seconds = flush_seconds
        self.extra = dict(extra_attributes or {})
        self.variables = rows_by_name([v for v in variables if v.name != "time"])
        self.auxiliary = tuple(auxiliary)
        self.run_status = "running"
        self._check_declaration()
        self._shapes = {name: tuple(len(self.labels[d]) for d in v.dims[1:]) for name, v in self.variables.items()}
        self._rows = {name: [] for name in ("time", *self.variables, *self.text)}
        self._stored: dict[str, npt.NDArray] = {"time": np.empty(0), **{n: np.empty(0, object) for n in self.text}}
        for name, variable in self.variables.items():
            self._stored[name] = np.empty((0, *self._shapes[name]), netcdf_type(variable))
        self._last_time = -np.inf
        if keep is not None:
            self._take_over(keep)
        self._flushed = -np.inf
        self._write()

    def _check_declaration(self) -> None:
        for name, variable in self.variables.items():
            if variable.dims[:1] != ("time",):
                raise InputError(f"{name}: dims {variable.dims}, the first must be 'time'")
            for dimension in variable.dims[1:]:
                if dimension not in self.labels:
                    raise InputError(f"{name}: dimension {dimension!r} has no labels in coordinates")
        require_known("auxiliary", self.auxiliary, self.variables)
        require_known("extra_attributes", self.extra, self.variables)

    def _take_over(self, keep: int) -> None:
        """Read the first `keep` rows of the file that is there."""
        require_count(self.path, keep)
        image = compose(self._fill)
        with opened(self.path) as there:
            require_same_declaration(self.path, there, image, [scalar.name for scalar in self.scalars])
            require_rows(self.path, keep, len(there.dimensions["time"]), "rows")
            self.attributes = resumed_attributes(self.attributes, there)
            if keep:
                self._stored = {name: there[name][:keep].astype(was.dtype) for name, was in self._stored.items()}
                self._last_time = float(self._stored["time"][-1])

    def append(self, row: Mapping[str, Any]) -> None:
        """Add one row: time [s] and a value for every declared variable, in its units.

        Raises
        ------
        InputError
            And keeps nothing of the row, if a name is missing or unknown, a value has the wrong shape or type, time
            does not increase, or the writer is closed.
        """
        if self.run_status != "running":
            raise InputError(f"{self.path.name} is closed ({self.run_status}); no row can be appended")
        require_names(row, ["time", *self.variables, *self.text], f"row of {self.path.name}")
        now = float(row["time"])
        if not (np.isfinite(now) and now > self._last_time):
            raise InputError(f"time: {now} s, must be finite and above the last row's {self._last_time} s")
        checked = {n: checked_array(v, row[n], self._shapes[n]) for n, v in self.variables.items()}
        texts = {name: checked_text(name, row[name]) for name in self.text}
        self._last_time = now
        for name, value in {"time": np.float64(now), **checked, **texts}.items():
            self._rows[name].append(value)
        if time.monotonic() - self._flushed >= self.flush_seconds:
            self.flush()

    def flush(self) -> None:
        """Write all rows so far."""
        for name, rows in self._rows.items():
            if rows:  # buffered since the last write
                self._stored[name] = np.concatenate([self._stored[name], np.stack(rows)])
                rows.clear()
        require_folder_still(self.path)
        self._write()

    def _write(self) -> None:
        write_atomically(self.path, self._fill)
        self._flushed = time.monotonic()

    def close(self, run_status: str) -> None:
        """Write all rows with the final run_status: complete, failed or interrupted."""
        require_status(run_status, RUN_STATUS[1:])
        self.run_status = run_status
        self.flush()

    def _fill(self, dataset: "netCDF4.Dataset") -> None:
        set_global_attributes(dataset, self.attributes, self.run_status)
        put_time(dataset, self._stored["time"])
        scalars = put_scalars(dataset, self.scalars)
        put_effects(dataset, self.effects)
        for name, long_name in self.text.items():
            put_text_in_time(dataset, name, long_name, self._stored[name])
        attached = (*self.auxiliary, *self.text, *put_labels(dataset, self.labels), *scalars)
        # Auxiliary variables first: a variable can only be attached to what is there.
        for name in (*self.auxiliary, *(n for n in self.variables if n not in self.auxiliary)):
            extra, coordinates = self.extra.get(name), () if name in self.auxiliary else attached
            put_variable(dataset, self.variables[name], self._stored[name], extra, coordinates)


ENERGY_ROWS = [
    Variable("translational_energy", ("time",), "f64", "J", "kinetic energy of translation, Eq. (23)"),
    Variable("rotational_energy", ("time",), "f64", "J", "kinetic energy of rotation, Eq. (23)"),
    Variable("elastic_energy", ("time",), "f64", "J", "energy stored in the contacts, Eq. (24)"),
    Variable("shadow_correction", ("time",), "f64", "J", "shadow energy of the integrator less the energy"),
    Variable("total_energy", ("time",), "f64", "J", "sum of the three energies, Eq. (22)"),
]


def write_energies(
    path: str | PathLike[str], series: Mapping[str, Sequence[float] | npt.NDArray], attributes: Mapping[str, Any]
) -> None:
    """Write energy.nc: the energies of a run over time, Eqs. (22)-(24) of Abe & Mora (2003), and their total.

    Parameters
    ----------
    path
        The file.
    series
        Arrays (time,): time [s], translational_energy, rotational_energy, elastic_energy, shadow_correction [J].
    attributes
        Global attributes, see `file_attributes`.
    """
    writer = RunWriter(path, ENERGY_ROWS, attributes)
    for i, moment in enumerate(series["time"]):
        row = {v.name: series[v.name][i] for v in ENERGY_ROWS[:-1]}
        total = row["translational_energy"] + row["rotational_energy"] + row["elastic_energy"]
        writer.append({"time": moment, "total_energy": total, **row})
    writer.close("complete")
