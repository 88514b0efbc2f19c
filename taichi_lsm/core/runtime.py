"""The only import of Taichi and the only `ti.init` of the package.

Every other module writes `from .runtime import ti`, so that a fork with the same interface can replace Taichi here.
"""

import contextlib
import io
import os
from contextlib import contextmanager
from dataclasses import dataclass

# Taichi prints a banner to stdout on import, which would end up in the output of `lsm`.
os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")

import taichi as ti  # noqa: E402
from taichi.lang.ast import ast_transformer_utils  # noqa: E402

from .errors import InputError  # noqa: E402


class _LongLines:
    """Takes the place of the text wrapper that Taichi runs over the source of every node it reads, to quote it if there
    is an error, at every start."""

    def __init__(self, width):
        pass

    def wrap(self, text):
        return [text] if text.strip() else []


ast_transformer_utils.TextWrapper = _LongLines


@dataclass(frozen=True)
class Runtime:
    """How this process computes: arch "cpu" | "gpu", precision "f64" | "f32", number of CPU threads."""

    arch: str
    precision: str
    threads: int

    @property
    def serial(self):
        """Should kernels run in the calling thread? Handing a loop to a pool costs more than a small loop."""
        return self.arch == "cpu" and self.threads == 1

    @property
    def real(self):
        """Taichi type of contact geometry, forces and history; positions, velocities and sums are always f64."""
        return ti.f64 if self.precision == "f64" else ti.f32


_current: Runtime | None = None


def start(arch="cpu", precision="f64", threads=1) -> Runtime:
    """Initialise Taichi once per process; a second call with the same settings does nothing.

    A second `ti.init` would destroy the fields of the first, so other settings raise InputError.
    """
    global _current
    for name, value, allowed in (("arch", arch, ("cpu", "gpu")), ("precision", precision, ("f64", "f32"))):
        if value not in allowed:
            raise InputError(f"{name} {value!r}: allowed are {' | '.join(allowed)}")
    if threads < 1:
        raise InputError(f"threads {threads}: must be at least 1")
    wanted = Runtime(arch, precision, int(threads))
    if _current is None:
        with contextlib.redirect_stdout(io.StringIO()):  # ti.init prints a line that would mix with our output
            ti.init(
                arch=ti.cpu if arch == "cpu" else ti.gpu,
                default_fp=wanted.real,
                cpu_max_num_threads=wanted.threads,
                cfg_optimization=False,
                fast_math=False,  # it reorders sums: results would depend on the compiler, not on the equations
                log_level=ti.ERROR,  # clearing sparse nodes warns about index types inside Taichi itself
            )
        _current = wanted
    elif _current != wanted:
        raise InputError(f"Taichi already runs as {_current}; {wanted} needs a process of its own")
    return _current


def current() -> Runtime:
    """The settings of this process, started with the defaults if nobody has chosen."""
    return _current or start()


MOST_NODES = 1024  # of a process, all fields together; fixed in Taichi

_pending: list | None = None


@contextmanager
def allocating():
    """Within this block fields are only declared; what is to be written to them waits until it ends.

    Taichi closes a memory tree at the first access to any field. A process has room for 512 trees and 1024 nodes and
    every tree is compiled, so that a simulation should declare all its fields before it touches one.
    """
    global _pending
    _pending = []
    try:
        yield
        _refuse_overflow()
        waiting, _pending = _pending, None
        for write in waiting:
            write()
    finally:
        _pending = None


def _refuse_overflow():
    """Raise InputError if the declared fields overflow Taichi's table of nodes: it would write past its end."""
    last = ti.field(ti.i32, ()).snode.ptr.id
    if last >= MOST_NODES:
        raise InputError(
            f"this process has declared {last} Taichi nodes of {MOST_NODES}: there is no room for another simulation; "
            "use Simulation.reset for scenes of the same make-up, or a process of its own"
        )


def when_allocated(write):
    """Call `write()` at the end of the surrounding `allocating` block, or now if there is none."""
    if _pending is None:
        write()
    else:
        _pending.append(write)
