"""Contacts at many moments (contacts.nc): a contiguous ragged array, of which each moment is a run of rows.

A file of records (`core.record_netcdf`), one for each contact. What belongs to a moment, its time and the number of its
rows too, stands in variables of fixed size before the records, with room for more moments. Rows are counted first, then
the moment is entered, its time last: a process that is killed at any instant leaves a file in which moments are whole
that have a time. Where the room is used up, and at the end, the file is made anew with its rows copied.
"""

from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError, SimulationError
from ..core.record_netcdf import (
    RecordAppender,
    RecordLayout,
    create_record_file,
    read_records,
    replace_texts,
    write_entries,
)
from ..core.schema import Variable
from .global_attributes import RUN_STATUS, require_status, set_global_attributes, utc_now
from .netcdf_variables import (
    TEXT_ROOM,
    TIME,
    Scalar,
    characters,
    checked_array,
    netcdf_type,
    put_labels,
    put_scalars,
    put_text_in_time,
    put_variable,
    require_names,
    rows_by_name,
    text_in_room,
)
from .resumed_file import record_file, require_count, require_rows, resumed_attributes

if TYPE_CHECKING:
    import netCDF4

COMMENT = (
    "The contacts of moment i are the row_size[i] consecutive entries of dimension contact that follow those of the "
    "moments before it (CF contiguous ragged array). The force on the second grain is normal_force * normal + "
    "tangential_force. Positions are not wrapped into the periodic cell: point lies beside the first grain, whose "
    "centre is point - arm. Ids, parts and patches are those of grains.nc."
)
ROW_SIZE = Variable("row_size", ("time",), "i32", "1", "number of contacts of this moment")
ROOM = 256  # moments that a new file has room for
LONGEST_STATUS = max(RUN_STATUS, key=len)  # keeps the room for the others


class ContactsWriter:
    """Contacts at many moments.

    Parameters
    ----------
    path
        The file, written at once with run_status "running".
    variables
        Schema rows with dims ("contact",) or ("contact", "space"), `measure.contacts.ContactTable.variables`.
    of_moment
        Schema rows of numbers with dims ("time",), such as the shear strain; time and row_size are added.
    attributes
        Global attributes, see `file_attributes`.
    dim
        2 or 3.
    text
        {name: long_name} of texts along time, such as the stage.
    scalars
        What holds for the whole file, such as the parameters.
    extra_attributes
        {name: attributes}, such as flag_values.
    shares
        As for `GrainsWriter`: whether moments that follow each other fast share their way to the disk.
    keep
        None makes a new file. A number takes over the file at `path`, which a former process wrote with the same
        declaration: its first `keep` moments stay, later ones are dropped.

    Raises
    ------
    InputError
        If a row does not fit; names the file and what differs if it cannot be taken over. It is then unchanged.
    SimulationError
        If the file cannot be written (`core.whole_files`), also from `append`, `flush` and `close`.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        variables: Iterable[Variable],
        of_moment: Iterable[Variable],
        attributes: Mapping[str, Any],
        dim: int,
        text: Mapping[str, str] | None = None,
        scalars: Iterable[Scalar] = (),
        extra_attributes: Mapping[str, Mapping[str, Any]] | None = None,
        shares: bool = False,
        keep: int | None = None,
    ) -> None:
        self.path, self.dim, self.shares = Path(path), dim, shares
        self.attributes = {**attributes, "comment": COMMENT}
        self.text, self.scalars, self.extra = dict(text or {}), tuple(scalars), dict(extra_attributes or {})
        self.variables = rows_by_name(list(variables))
        self.of_moment = rows_by_name([TIME, *of_moment, ROW_SIZE])
        for name, variable in self.variables.items():
            if variable.dims not in (("contact",), ("contact", "space")):
                raise InputError(f"{name}: dims {variable.dims}, must be ('contact',) or ('contact', 'space')")
        self.run_status = "running"
        self._room = ROOM
        # What is known of every moment: those from `_entered` on have still to be entered in the file.
        self._moments: dict[str, list[Any]] = {name: [] for name in (*self.of_moment, *self.text)}
        self._entered = 0
        self._make(() if keep is None else self._take_over(keep), max(ROOM, (keep or 0) + 1))

    def __len__(self) -> int:
        """Number of moments."""
        return len(self._moments["time"])

    @property
    def last_time(self) -> float:
        """Time of the last moment [s], -inf before the first."""
        return float(self._moments["time"][-1]) if len(self) else -np.inf

    def append(self, time: float, values: Mapping[str, Any], contacts: Mapping[str, npt.NDArray]) -> None:
        """Write the contacts of one moment behind the others.

        Parameters
        ----------
        time
            Of the moment [s].
        values
            {name: number or text} of what belongs to the moment, without time and row_size.
        contacts
            {name: (n,) or (n, dim)} of all variables along contact.

        Raises
        ------
        InputError
            And keeps nothing of the moment, if a name, a shape or a type does not fit, time does not increase, or the
            writer is closed.
        SimulationError
            And keeps nothing of the moment, if it cannot be written; the earlier ones stay readable.
        """
        if self.run_status != "running":
            raise InputError(f"{self.path.name} is closed ({self.run_status}); no moment can be appended")
        if not (np.isfinite(time) and time > self.last_time):
            raise InputError(f"time: {time} s, must be finite and above the last moment's {self.last_time} s")
        require_names(contacts, self.variables, f"contacts of {self.path.name}")
        count = len(next(iter(contacts.values())))
        values = {"time": time, **values, "row_size": count}
        require_names(values, self._moments, f"moment of {self.path.name}")
        numbers = {name: checked_array(v, values[name], ()) for name, v in self.of_moment.items()}
        moment = {**numbers, **{name: text_in_room(name, values[name]) for name in self.text}}
        records = self._records(contacts, count)
        if len(self) == self._room:
            self.flush()
            self._make(read_records(self.path, self._layout, self._layout.count), 2 * self._room)
        if count:
            self._appender.append([records.tobytes()], count)
        for name, value in moment.items():
            self._moments[name].append(value)
        if self._appender.due:
            self.flush()

    def _records(self, contacts: Mapping[str, npt.NDArray], count: int) -> npt.NDArray:
        """The rows as they lie in the file."""
        records = np.zeros(count, record_type(self._layout, self.variables, self.dim))
        for name, variable in self.variables.items():
            shape = (count, self.dim) if len(variable.dims) > 1 else (count,)
            records[name] = checked_array(variable, contacts[name], shape)
        return records

    def flush(self) -> None:
        """Bring all moments to the disk: their rows, then what is known of them, the times last."""
        self._appender.flush()
        if self._entered < len(self):
            new = self._known(self._entered)
            time = new.pop("time")
            write_entries(self.path, self._layout, self._entered, new | {"time": time})
            self._entered = len(self)

    @property
    def _layout(self) -> RecordLayout:
        return self._appender.layout

    def close(self, run_status: str) -> None:
        """Make the file anew with the final run_status, complete, failed or interrupted, and without spare room.

        A file that is short of space for its copy keeps its room; the status is then written in its place.
        """
        require_status(run_status, RUN_STATUS[1:])
        self.flush()
        self.run_status = run_status
        try:
            self._make(read_records(self.path, self._layout, self._layout.count), max(1, len(self)))
        except SimulationError:
            replace_texts(self.path, self._layout, {"run_status": run_status, "date_modified": utc_now()})

    def _make(self, records: Iterable[bytes], room: int) -> None:
        """Make the file with all moments so far and these rows, and room for so many moments."""
        former, self._room = self._room, room
        try:
            layout = create_record_file(self.path, self._fill, {"run_status": self.run_status}, records)
        except BaseException:
            self._room = former  # that of the file that is there
            raise
        self._appender = RecordAppender(self.path, layout, self.shares)
        self._entered = len(self)

    def _known(self, first: int) -> dict[str, npt.NDArray]:
        """What is known of the moments from number `first` on, as it lies in the file."""
        known = {name: values[first:] for name, values in self._moments.items()}
        found = {name: np.array(known[name], netcdf_type(v)) for name, v in self.of_moment.items()}
        return found | {name: characters(np.array(known[name], dtype=object), TEXT_ROOM) for name in self.text}

    def _take_over(self, keep: int) -> Iterable[bytes]:
        """Take the first `keep` moments of the file that is there, if it fits; returns their rows."""
        require_count(self.path, keep)
        with record_file(self.path, self._fill, [scalar.name for scalar in self.scalars]) as (there, layout):
            require_rows(self.path, keep, int(np.isfinite(there["time"][:]).sum()), "moments")
            self.attributes = resumed_attributes(self.attributes, there)
            for name in self.of_moment:
                self._moments[name] = list(there[name][:keep])
            if min(self._moments["row_size"], default=0) < 0:
                raise ValueError("a moment has fewer than no rows")
            for name in self.text:
                there[name].set_auto_chartostring(False)
                self._moments[name] = [row.tobytes().rstrip(b"\0").decode() for row in there[name][:keep]]
        rows = int(sum(self._moments["row_size"]))
        require_rows(self.path, rows, layout.whole, "whole rows of contacts")
        return read_records(self.path, layout, rows)

    def _fill(self, dataset: "netCDF4.Dataset") -> None:
        """Write what belongs to the moments, and declare what belongs to the contacts."""
        set_global_attributes(dataset, self.attributes, LONGEST_STATUS)
        dataset.createDimension("contact", None)
        dataset.createDimension("time", self._room)
        space = put_labels(dataset, {"space": list("xyz")[: self.dim]})
        scalars = put_scalars(dataset, self.scalars)
        spare = self._room - len(self)
        for name, long_name in self.text.items():
            texts = np.array([*self._moments[name], *[""] * spare], dtype=object)
            put_text_in_time(dataset, name, long_name, texts, TEXT_ROOM)
        # Coordinates first: a variable can only be attached to what is there. Spare moments have no time and no rows.
        own = [name for name in self.of_moment if name not in ("time", "row_size", "parted_power")]
        for name in ("time", *own, *(name for name in self.of_moment if name not in ("time", *own))):
            variable = self.of_moment[name]
            known = np.array(self._moments[name], netcdf_type(variable))
            empty = np.full(spare, 0 if variable.dtype == "i32" else np.nan, known.dtype)
            extra = {"sample_dimension": "contact"} if name == "row_size" else self.extra.get(name)
            attached = () if name == "time" or name in own else (*own, *self.text, *scalars)
            put_variable(dataset, variable, np.concatenate([known, empty]), extra, attached)
        for name, variable in self.variables.items():
            shape = (0, self.dim) if len(variable.dims) > 1 else (0,)
            none = np.empty(shape, netcdf_type(variable))
            put_variable(dataset, variable, none, self.extra.get(name), (*space, *scalars))


def record_type(layout: RecordLayout, variables: Mapping[str, Variable], dim: int) -> np.dtype:
    """A record as NumPy type: a field for each variable, where it lies in the file, the most significant byte first."""
    formats = [
        (netcdf_type(v).newbyteorder(">"), (dim,) if len(v.dims) > 1 else ())
        for v in (variables[name] for name in layout.variables)
    ]
    sizes = list(layout.variables.values())
    offsets = [sum(sizes[:i]) for i in range(len(sizes))]
    return np.dtype({"names": list(layout.variables), "formats": formats, "offsets": offsets, "itemsize": layout.size})
