"""NetCDF files that anyone may have written: what is checked before the library below reads or allocates anything.

A file of HDF5 guards its structure by checksums, but for the heaps of texts of any length: in a damaged one the library
(HDF5 2.2) follows sizes that lead nowhere, and never returns. And a file of some kilobytes may declare more values than
any memory holds.

Format: HDF5 File Format Specification 3.0, III.E, Disk Format: Level 1E, Global Heap.
"""

import mmap
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Union

from .memory import machine_memory

if TYPE_CHECKING:
    import netCDF4

HEAP = b"GCOL\x01\0\0\0"  # signature, version, three reserved bytes; then 8 bytes: the size
HEAP_HEADER, OBJECT_HEADER = 16, 16  # bytes
MOST_PACKED = 1100  # bytes that deflate makes of one, at most 1032, and a margin
CLASSIC = b"CDF"  # begin of a file of the classic format
WINDOW = 2**13  # bytes that the library reads of its header at a time; in memory it refuses one that ends before
IN_MEMORY = 2**28  # bytes of a file that is read as a whole
SMALL = 2**24  # bytes that any file may declare
MUCH = 0.5  # share of the machine's memory
OF_TEXT = 16  # bytes of a text, or another value of any length, in its variable


@contextmanager
def opened_netcdf(path: Path) -> "Iterator[netCDF4.Dataset]":
    """The NetCDF file `path`, open for reading, values as they are on file.

    Raises
    ------
    ValueError
        If it is damaged, or declares more than it can hold or the machine has memory for.
    OSError, RuntimeError, AttributeError
        If the library cannot read it, or within the block a variable or an attribute.
    """
    import netCDF4

    _require_whole_heaps(path)
    # By its content and not by its name: the library crashes where a file that is open elsewhere in the process, as by
    # xarray, is opened and closed again.
    content = path.read_bytes() if path.stat().st_size <= IN_MEMORY else None
    if content is not None and content.startswith(CLASSIC):
        content += bytes(WINDOW)
    with netCDF4.Dataset(path, memory=content) as dataset:
        dataset.set_auto_mask(False)
        _require_moderate(dataset, path.stat().st_size)
        yield dataset


@contextmanager
def opened_content(content: bytes) -> "Iterator[netCDF4.Dataset]":
    """A file of the classic format in memory, as `opened_netcdf` opens one on the disk."""
    import netCDF4

    with netCDF4.Dataset("in memory", memory=content + bytes(WINDOW)) as dataset:
        dataset.set_auto_mask(False)
        _require_moderate(dataset, len(content))
        yield dataset


def require_memory(size: float) -> None:
    """ValueError if so many bytes are more than half of the memory."""
    if size > MUCH * machine_memory():
        raise ValueError(
            f"it declares {size:.3g} bytes of values, must be at most half of the memory, {machine_memory():.3g}"
        )


def _require_whole_heaps(path: Path) -> None:
    """ValueError if the objects of a heap do not follow each other up to its end."""
    size = path.stat().st_size
    if size < HEAP_HEADER:
        return
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        begin = data.find(HEAP)
        while begin >= 0:
            (length,) = struct.unpack_from("<Q", data, begin + len(HEAP)) if begin + HEAP_HEADER <= size else (0,)
            if not HEAP_HEADER < length <= size - begin:
                raise ValueError(f"a heap at byte {begin} has {length} bytes, more than the file")
            _require_whole_heap(data, begin, begin + length)
            begin = data.find(HEAP, begin + length)


def _require_whole_heap(data: mmap.mmap, begin: int, end: int) -> None:
    at = begin + HEAP_HEADER
    while at + OBJECT_HEADER <= end:
        number, _, _, length = struct.unpack_from("<HHIQ", data, at)
        # Object 0 is the free space, whose size holds its own header; others are filled up to a multiple of 8 bytes.
        length = length if number == 0 else OBJECT_HEADER + -(-length // 8) * 8
        if not 0 < length <= end - at:
            raise ValueError(f"the heap at byte {begin} is damaged at byte {at}")
        at += length


def _require_moderate(dataset: "netCDF4.Dataset", size: int) -> None:
    """ValueError if the variables of a file of `size` bytes are declared larger than it can hold or memory allows."""
    declared = sum(_bytes_of(dataset))
    packed = dataset.data_model.startswith("NETCDF4")
    if declared > SMALL + size * (MOST_PACKED if packed else 1):
        raise ValueError(f"it declares {declared:.3g} bytes of values and has {size}")
    require_memory(declared)


def _bytes_of(group: Union["netCDF4.Dataset", "netCDF4.Group"]) -> Iterator[int]:
    """Bytes that each variable takes in memory, those of inner groups too."""
    for variable in group.variables.values():
        count = 1
        for length in variable.shape:
            count *= int(length)  # of any size
        yield count * getattr(variable.dtype, "itemsize", OF_TEXT)
    for inner in group.groups.values():
        yield from _bytes_of(inner)
