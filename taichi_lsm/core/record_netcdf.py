"""NetCDF files that grow by records, each of which is counted only when it lies on the disk as a whole.

The file is one of the classic format with 64-bit offsets (CDF-2): a header, the variables of fixed size, then the
records one behind the other. A record holds one value, or one array, of every variable whose first dimension is
unlimited. The header counts the records; what lies behind the last counted one does not exist for a reader. So records
are written behind the end, brought to the disk, and then counted, by writing four bytes. A process that is killed at
any instant leaves a file with the records counted so far, and an append costs the same however many there are. Bringing
bytes to the disk takes milliseconds, which many appends may share. The netCDF library composes what precedes the
records; it does not append them, because it leaves open what reaches the disk first.

Format: NetCDF Classic Format Specification, docs.unidata.ucar.edu/netcdf-c/current/file_format_specifications.html
"""

import io
import math
import os
import struct
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

from .atomic_netcdf import FileFormat, compose
from .errors import SimulationError
from .whole_files import failures_named, replacing

if TYPE_CHECKING:
    import netCDF4

FORMAT: FileFormat = "NETCDF3_64BIT_OFFSET"
MAGIC = b"CDF\x02"
COUNT_AT = 4  # byte at which the header counts the records
LARGEST = 2**32 - 4  # bytes of one variable, in one record if it has them
COPIED = 2**22  # bytes of records that are copied at a time, or one record if it is larger
SPARE = 200.0  # times as long as a flush took until the next one, where appends share them: they take 0.5 % of the time
TEXT = 2  # number of the type of characters
WIDTHS = {1: 1, TEXT: 1, 3: 2, 4: 4, 5: 4, 6: 8}  # bytes of a value by the number of its type


@dataclass(frozen=True)
class RecordLayout:
    """Where things lie in a file.

    Attributes
    ----------
    count, whole
        Records that the header counts, and those of them that the file is long enough for.
    start, size
        Byte at which the records begin; bytes of each, 0 if there are none.
    variables
        {name: bytes in a record, a multiple of 4}, in the order of the file.
    fixed
        {variable of fixed size: byte at which it begins}.
    texts
        {global attribute of text: (byte at which it begins, bytes)}.
    """

    count: int
    whole: int
    start: int
    size: int
    variables: dict[str, int]
    fixed: dict[str, int]
    texts: dict[str, tuple[int, int]]

    @property
    def end(self) -> int:
        """Byte behind the last counted record."""
        return self.start + self.count * self.size


class RecordHead(NamedTuple):
    """What a file holds before its records.

    Parameters
    ----------
    layout
        Where things lie.
    content
        All bytes before the records, with a count of 0: a file of its own, without any record.
    """

    layout: RecordLayout
    content: bytes

    def text(self, name: str) -> str:
        """A global attribute of text, "" if there is none."""
        start, size = self.layout.texts.get(name, (0, 0))
        return self.content[start : start + size].rstrip(b"\0").decode()

    def is_of(self, file: io.FileIO) -> bool:
        """Whether an open file has the same header, whatever it counts; numbers of files are given away again."""
        end = min(self.layout.fixed.values(), default=self.layout.start)
        header = self.content[COUNT_AT + 4 : end]
        file.seek(COUNT_AT + 4)
        return file.read(len(header)) == header

    def continues(self, former: "RecordHead") -> bool:
        """Whether it has the records of a former file whose place it took: of the same run, made anew as it went on."""
        same_run = self.text("id") == former.text("id") != ""
        return same_run and list(self.layout.variables.items()) == list(former.layout.variables.items())


def is_record_file(path: Path) -> bool:
    """Whether the file begins as one of this format."""
    with open(path, "rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def read_layout(path: Path) -> RecordLayout:
    """Layout of the file `path`; ValueError if it is none of this format, or truncated before its records."""
    with open(path, "rb") as file:
        return _layout(file)


def read_head(path: Path) -> RecordHead:
    """What the file `path` holds before its records; ValueError as of `read_layout`."""
    with open(path, "rb") as file:
        layout = _layout(file)
        file.seek(0)
        content = bytearray(file.read(layout.start))
        content[COUNT_AT : COUNT_AT + 4] = bytes(4)
        return RecordHead(layout, bytes(content))


def layout_of(image: memoryview | bytearray) -> RecordLayout:
    """Layout of a file in memory."""
    return _layout(io.BytesIO(image))


def _layout(file: BinaryIO) -> RecordLayout:
    try:
        return _Header(file).layout()
    except (KeyError, IndexError) as error:
        raise ValueError(f"its header is damaged ({error!r})") from None


def create_record_file(
    path: Path,
    fill: "Callable[[netCDF4.Dataset], None]",
    texts: Mapping[str, str],
    records: Iterable[bytes] = (),
) -> RecordLayout:
    """Make the file `path`, which appears whole or not at all.

    Parameters
    ----------
    path
        The file, replaced if it exists.
    fill
        Called with an open, empty dataset: creates everything, and writes what has no records.
    texts
        Global attributes that `replace_texts` will replace; `fill` gives them the longest value that they will have.
    records
        Whole records to begin with, one or many in each piece, as another file of the same layout holds them.

    Raises
    ------
    InputError
        If there is no folder to write to.
    SimulationError
        If the file cannot be written.
    """
    image = bytearray(compose(fill, FORMAT))
    layout = layout_of(image)
    for name, text in texts.items():
        start, room = layout.texts[name]
        image[start : start + room] = _in_room(name, text, room)
    count = 0
    with replacing(path) as temporary, open(temporary, "wb") as file:
        file.write(image[: layout.start])
        for record in records:
            file.write(record)
            count += len(record) // layout.size
        file.seek(COUNT_AT)
        file.write(struct.pack(">I", count))
    return replace(layout, count=count, whole=count)


def record_bytes(layout: RecordLayout, arrays: Mapping[str, npt.NDArray]) -> list[bytes]:
    """One record as it lies on file, in parts.

    arrays: {name: array without the first dimension}, of the types on file, for all variables; texts are S1.
    """
    return [_on_file(name, arrays[name], size) for name, size in layout.variables.items()]


class RecordAppender:
    """Writes records behind those that a file counts, and counts them once they lie on the disk.

    Parameters
    ----------
    path, layout
        The file and its present layout.
    shares
        Whether appends share their way to the disk: `due` then says no until SPARE times as long as it took has passed.

    Attributes
    ----------
    layout, pending
        The present one, with what is counted; records that are written and not yet counted, which a kill loses.
    """

    def __init__(self, path: Path, layout: RecordLayout, shares: bool = False) -> None:
        self.path, self.layout, self.pending = path, layout, 0
        self._shares, self._flushed, self._took = shares, -math.inf, 0.0

    def append(self, parts: Iterable[bytes], count: int = 1) -> None:
        """Write `count` whole records.

        Raises
        ------
        SimulationError
            If they cannot be written, or the file is not the one that was left here; it then holds what it held.
        """
        end = self.layout.end + self.pending * self.layout.size
        with failures_named(self.path), open(self.path, "rb+", buffering=0) as file:
            file.seek(COUNT_AT)
            if file.read(4) != struct.pack(">I", self.layout.count):
                raise SimulationError(f"{self.path}: was changed by another process; nothing can be appended")
            try:
                _write_at(file, end, parts)
            except BaseException:
                with suppress(OSError):
                    file.truncate(end)
                raise
        self.pending += count

    @property
    def due(self) -> bool:
        """Whether it is time to flush."""
        return not self._shares or time.monotonic() - self._flushed >= SPARE * self._took

    def flush(self) -> None:
        """Bring what is written to the disk, then count it.

        Raises
        ------
        SimulationError
            If that fails; the file then counts the records that it counted.
        """
        if not self.pending:
            return
        began, count = time.monotonic(), self.layout.count + self.pending
        with failures_named(self.path), open(self.path, "rb+", buffering=0) as file:
            os.fsync(file.fileno())
            _write_at(file, COUNT_AT, [struct.pack(">I", count)])
            os.fsync(file.fileno())
        self.layout, self.pending = replace(self.layout, count=count, whole=count), 0
        self._flushed = time.monotonic()
        self._took = self._flushed - began


def write_entries(path: Path, layout: RecordLayout, first: int, arrays: Mapping[str, npt.NDArray]) -> None:
    """Write entries of variables of fixed size, in the order of `arrays`, and bring them to the disk.

    Parameters
    ----------
    path, layout, first
        The file, its layout, and the index of the first entry along the first dimension.
    arrays
        {name: entries (m, ...)}, of the types on file.

    Raises SimulationError if they cannot be written.
    """
    with failures_named(path), open(path, "rb+", buffering=0) as file:
        for name, array in arrays.items():
            data = np.ascontiguousarray(array, array.dtype.newbyteorder(">")).tobytes()
            _write_at(file, layout.fixed[name] + first * (len(data) // len(array)), [data])
        os.fsync(file.fileno())


def read_records(path: Path, layout: RecordLayout, count: int) -> Iterable[bytes]:
    """The first `count` records as bytes, in pieces of one or many."""
    many = max(1, COPIED // layout.size)
    with open(path, "rb") as file:
        file.seek(layout.start)
        for first in range(0, count, many):
            yield file.read(min(many, count - first) * layout.size)


def replace_texts(path: Path, layout: RecordLayout, texts: Mapping[str, str]) -> None:
    """Replace global attributes in the room that they have.

    Raises
    ------
    SimulationError
        If the file cannot be written.
    """
    with failures_named(path), open(path, "rb+", buffering=0) as file:
        for name, text in texts.items():
            start, room = layout.texts[name]
            _write_at(file, start, [_in_room(name, text, room)])
        os.fsync(file.fileno())


def _in_room(name: str, text: str, room: int) -> bytes:
    """A text filled up with NUL, which readers leave out at the end of an attribute."""
    data = text.encode()
    if len(data) > room:
        raise ValueError(f"{name}: {text!r} has no room in {room} bytes")
    return data.ljust(room, b"\0")


def _on_file(name: str, array: npt.NDArray, size: int) -> bytes:
    """Values as they lie in a record: the most significant byte first, filled up to a multiple of 4 bytes."""
    data = np.ascontiguousarray(array, array.dtype.newbyteorder(">")).tobytes()
    if not size - 4 < len(data) <= size:
        raise ValueError(f"{name}: {len(data)} bytes, a record has {size}")
    return data.ljust(size, b"\0")


def _write_at(file: io.FileIO, start: int, parts: Iterable[bytes]) -> None:
    """Write bytes to an unbuffered file; a write may take less than it is given."""
    file.seek(start)
    for part in parts:
        rest = memoryview(part)
        while rest:
            rest = rest[file.write(rest) :]


class _Header:
    """Reads the header of a file from its beginning."""

    def __init__(self, file: BinaryIO) -> None:
        self.length = file.seek(0, os.SEEK_END)
        file.seek(0)
        self.file = file
        if file.read(len(MAGIC)) != MAGIC:
            raise ValueError(f"does not begin with {MAGIC!r}")

    def layout(self) -> RecordLayout:
        """What the header says, and how many records there are."""
        count = self._number()
        lengths = [(self._name(), self._number())[1] for _ in self._list()]
        texts = dict(self._attributes())
        variables, fixed, ends = [], {}, []
        for _ in self._list():
            name = self._name()
            dims = [self._number() for _ in range(self._number())]
            list(self._attributes())
            width, stated = WIDTHS[self._number()], self._number()
            (begin,) = struct.unpack(">Q", self._bytes(8))
            if dims and lengths[dims[0]] == 0:
                variables.append((begin, name, stated))
            else:
                values = math.prod(lengths[d] for d in dims)
                fixed[name] = begin
                ends.append(begin + _rounded(width * values))
        ends.append(self.file.tell())
        variables.sort()
        start, size = variables[0][0] if variables else max(ends), sum(v[2] for v in variables)
        if start < max(ends):
            raise ValueError("its header is damaged (records begin before other variables end)")
        # After the count: a writer that appends meanwhile makes the file longer before it counts.
        length = self.file.seek(0, os.SEEK_END)
        if length < max(start, *ends):
            raise ValueError("it is truncated")
        whole = min(count, (length - start) // size) if size else count
        return RecordLayout(count, whole, start, size, {v[1]: v[2] for v in variables}, fixed, texts)

    def _bytes(self, size: int) -> bytes:
        if size > self.length - self.file.tell():  # before anything is allocated
            raise ValueError("it is truncated")
        return self.file.read(size)

    def _number(self) -> int:
        return struct.unpack(">I", self._bytes(4))[0]

    def _list(self) -> range:
        """A range over the entries of a list; its kind needs no check, for the order is fixed."""
        self._number()
        return range(self._number())

    def _name(self) -> str:
        size = self._number()
        return self._bytes(_rounded(size))[:size].decode()

    def _attributes(self) -> Iterable[tuple[str, tuple[int, int]]]:
        """Name, place and bytes of every attribute of text; the others are passed over."""
        for _ in self._list():
            name, kind, count = self._name(), self._number(), self._number()
            start = self.file.tell()
            self._bytes(_rounded(WIDTHS[kind] * count))
            if kind == TEXT:
                yield name, (start, count)


def _rounded(size: int) -> int:
    """The next multiple of 4."""
    return -(-size // 4) * 4
