"""When the fields of a simulation are allocated, and how values get into them and out again.

Taichi compiles a kernel for every field that Python writes or reads, and one more for every number of a small field.
With thirty fields that takes longer than the kernels of a step. Here the values of many fields are collected and
written by one kernel, to which the field is an argument; what is written to the same fields later is written by it as
well, and a second kernel reads any of them.
"""

import contextlib
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import InputError
from .field_copies import NUMPY_TYPES, FieldCopies
from .runtime import ti

MOST_NODES = 1024  # of a process, all fields together; fixed in Taichi

_waiting: list[Callable[[], object]] | None = None  # until all fields are declared
_collected: "dict[int, tuple[Any, npt.NDArray]] | None" = None  # by the identity of the field: the field, its values


@contextlib.contextmanager
def allocating() -> Iterator[None]:
    """Within this block fields are only declared; what is to be written to them waits until it ends.

    Taichi closes a memory tree at the first access to any field. A process has room for 512 trees and 1024 nodes and
    every tree is compiled, so that a simulation should declare all its fields before it touches one.

    Raises
    ------
    InputError
        At the end of the block, if the fields of this process overflow Taichi's table of nodes.
    """
    global _waiting
    _waiting = []
    try:
        yield
        _refuse_overflow()
        waiting, _waiting = _waiting, None
        with writing_together():
            for begin in waiting:
                begin()
    finally:
        _waiting = None


def _refuse_overflow() -> None:
    """Raise InputError if the declared fields overflow Taichi's table of nodes: it would write past its end."""
    last = ti.field(ti.i32, ()).snode.ptr.id
    if last >= MOST_NODES:
        raise InputError(
            f"this process has declared {last} Taichi nodes of {MOST_NODES}: there is no room for another simulation; "
            "make it in another process, such as one for each run, or use Simulation.reset for a scene without platens "
            "that has the same KernelSpec"
        )


def when_allocated(begin: Callable[[], object]) -> None:
    """Call `begin()`, which writes first values, at the end of the surrounding `allocating` block, or now."""
    if _waiting is None:
        begin()
    else:
        _waiting.append(begin)


@contextlib.contextmanager
def writing_together() -> Iterator[None]:
    """Within this block `write` only collects; all values are written at its end, and none if it raises.

    No kernel may run in the block, as it would not see them; `read` does.
    """
    global _collected
    _collected = {}
    try:
        yield
        collected = _collected
    finally:
        _collected = None
    share_kernels(field for field, _ in collected.values())
    for field, values in collected.values():
        _write_now(field, values)


def write(field: Any, values: npt.ArrayLike) -> None:
    """Write the first rows of a Taichi field; the others keep what they hold.

    Parameters
    ----------
    field
        Scalar or vector field of any shape, a row for each of its elements, and of any type but 64-bit integers.
    values
        A number for each component of each row that is written, rows in the order of the indices.

    Raises
    ------
    InputError
        If there are more values than the field has room for, or not whole rows.
    """
    flat = np.array(values, dtype=np.float64).reshape(-1)  # a copy: the caller may change its own before it is written
    room = _numbers(field)
    if flat.size > room or flat.size % int(np.prod(_width(field))):
        raise InputError(f"values: {flat.size} numbers for a field of {room}, must be whole rows and no more than that")
    if _collected is None:
        _write_now(field, flat)
    else:
        before = _collected.get(id(field), (field, flat))[1]
        _collected[id(field)] = (field, np.concatenate([flat, before[flat.size :]]))


def read(field: Any, rows: int | None = None) -> npt.NDArray:
    """The first rows of a Taichi field along its first axis, or all, also where their values are only collected yet.

    Returns
    -------
    ndarray
        (rows, ...) of the type of the field.
    """
    shape = (*field.shape, *_width(field)) if rows is None else (rows, *row_shape(field))
    size, collected = int(np.prod(shape)), np.empty(0)
    if _collected is not None and id(field) in _collected:
        collected = _collected[id(field)][1][:size]
    if collected.size == size:  # 0 if there are no rows
        flat = collected.copy()
    else:
        share_kernels([field])
        flat, (copies, number) = np.empty(size), field.host_copies
        copies.read(number, size // int(np.prod(_width(field))), flat)
        flat[: collected.size] = collected
    return flat.reshape(shape).astype(NUMPY_TYPES[field.dtype], copy=False)


def share_kernels(fields: Iterable[Any]) -> None:
    """Let those of these fields that no kernel writes or reads yet be written by one kernel, and read by another."""
    new = [field for field in fields if not hasattr(field, "host_copies")]
    if new:
        FieldCopies(new)


def _numbers(field: Any) -> int:
    """How many numbers a field holds."""
    return int(np.prod((*field.shape, *_width(field))))


def row_shape(field: Any) -> tuple[int, ...]:
    """Shape of one of the rows along the first axis of a field: () for a scalar field of one axis."""
    return (*field.shape[1:], *_width(field))


def _width(field: Any) -> tuple[int, ...]:
    """Components of an element: () for a scalar field."""
    return (field.n,) if isinstance(field, ti.MatrixField) else ()


def _write_now(field: Any, flat: npt.NDArray) -> None:
    """Write by the kernel that knows the field, which is made for it alone if there is none."""
    share_kernels([field])
    copies, number = field.host_copies
    if flat.size:
        copies.write(number, flat.size // int(np.prod(_width(field))), flat)
