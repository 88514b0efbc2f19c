"""Variables of a file of records (`core.record_netcdf`) that are read when their values are used.

No file stays open, nothing is locked and nothing is kept: each use opens the file, reads the records that are asked
for, of those that were counted when the dataset was made, and closes it. A run may append to the file meanwhile.
"""

import math
import os
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray
from xarray.backends import BackendArray, NetCDF4DataStore
from xarray.core import indexing

from ..core.errors import InputError, reason
from ..core.netcdf_input import opened_content
from ..core.record_netcdf import RecordHead, read_head

SMALL_RECORD = 2**12  # bytes: records below are read as a whole, for their neighbours come along anyway
AT_ONCE = 2**24  # bytes that are read together
TRIES = 5  # where a file is replaced while it is read


class RecordArray(BackendArray):
    """One variable along the records of a file; see xarray's guide to backends.

    Parameters
    ----------
    path, head
        The file, and what it held before its records when it was opened.
    name
        Of the variable.
    dtype
        Type of its values in memory.
    inner
        Its shape within a record.
    """

    def __init__(self, path: Path, head: RecordHead, name: str, dtype: npt.DTypeLike, inner: tuple[int, ...]) -> None:
        layout = head.layout
        self.path, self.head, self.record_size = path, head, layout.size
        names = list(layout.variables)
        self.offset = sum(layout.variables[before] for before in names[: names.index(name)])
        self.dtype, self.shape = np.dtype(dtype), (layout.count, *inner)
        self.width = self.dtype.itemsize * math.prod(inner)  # bytes in a record
        if not 0 <= layout.variables[name] - self.width < 4:
            raise ValueError(f"its header is damaged ({name}: {layout.variables[name]} bytes for {self.width})")

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.BASIC, self._read)

    def _read(self, key: tuple[int | slice, ...]) -> npt.NDArray:
        """Values by one integer or rising slice for each dimension."""
        chosen = key[0]
        if isinstance(chosen, slice):
            return self._records(range(*chosen.indices(self.shape[0])))[(slice(None), *key[1:])]
        return self._records(range(chosen, chosen + 1))[(0, *key[1:])]

    def _records(self, records: range) -> npt.NDArray:
        """Values (records, ...) of records with rising numbers."""
        try:
            for _ in range(TRIES):
                head = self.head  # another thread may take over meanwhile
                with open(self.path, "rb", buffering=0) as file:
                    if head.is_of(file):
                        return self._values(file.fileno(), head.layout.start, records)
                self._take_over()
        except InputError:
            raise
        except (OSError, ValueError) as error:
            raise InputError(f"{self.path}: cannot be read any more ({reason(error)})") from None
        raise InputError(f"{self.path}: is replaced all the time, try again")

    def _take_over(self) -> None:
        """Go on with a file that has taken the place of the former one, if it has the same records and perhaps more."""
        head = read_head(self.path)
        if not head.continues(self.head) or head.layout.count < self.shape[0]:
            raise InputError(f"{self.path}: was replaced since it was opened, open it again")
        self.head = head

    def _values(self, file: int, start: int, records: range) -> npt.NDArray:
        """Values of records of the open file, whose records begin at byte `start`."""
        size, width = self.record_size, self.width
        found = np.empty((len(records), width), np.uint8)
        if size > SMALL_RECORD:
            for row, number in zip(found, records, strict=True):
                row[:] = self._bytes(file, start + number * size + self.offset, width)
        else:
            many = max(1, AT_ONCE // (size * records.step))
            for first in range(0, len(records), many):
                some = records[first : first + many]
                span = some[-1] - some[0] + 1
                block = self._bytes(file, start + some[0] * size, span * size).reshape(span, size)
                found[first : first + len(some)] = block[:: some.step, self.offset : self.offset + width]
        values = found.view(self.dtype.newbyteorder(">")).astype(self.dtype)
        return values.reshape(len(records), *self.shape[1:])

    def _bytes(self, file: int, start: int, size: int) -> npt.NDArray[np.uint8]:
        """`size` bytes from `start` on; InputError where the file ends before."""
        pieces = bytearray()
        while len(pieces) < size:
            piece = os.pread(file, size - len(pieces), start + len(pieces))
            if not piece:
                raise InputError(f"{self.path}: has become shorter since it was opened, open it again")
            pieces += piece
        return np.frombuffer(pieces, np.uint8)


def record_dataset(path: Path) -> "xarray.Dataset":
    """The file `path` as a dataset: what has no records is in memory, the rest is read when it is used.

    Raises
    ------
    ValueError, OSError, RuntimeError, AttributeError
        If it is damaged or holds fewer records than it counts.
    """
    head = read_head(path)
    layout = head.layout
    if layout.whole < layout.count:  # the library would give zeros for what is missing
        raise ValueError(f"it counts {layout.count} snapshots and holds {layout.whole}")
    with opened_content(head.content) as file:
        empty = xarray.open_dataset(NetCDF4DataStore(file), decode_cf=False, cache=False).load()
        empty.set_close(None)  # the file is closed here
    variables = {}
    for name, variable in empty.variables.items():
        if str(name) in layout.variables:
            lazy = RecordArray(path, head, str(name), variable.dtype, variable.shape[1:])
            data = indexing.CopyOnWriteArray(indexing.LazilyIndexedArray(lazy))  # pyright: ignore[reportArgumentType]
            variable = xarray.Variable(variable.dims, data, variable.attrs)
        variables[name] = variable
    return xarray.decode_cf(xarray.Dataset(variables, attrs=empty.attrs))
