"""The only import of Taichi and the only `ti.init` of the package.

Every other module imports `ti` from here, so that a fork with the same interface can replace Taichi in one place.
"""

import contextlib
import io
import os
from dataclasses import dataclass
from typing import Any

# Taichi prints a banner to stdout on import, which would end up in the output of `lsm`.
os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")

import taichi as ti
from taichi.lang.ast import ast_transformer_utils

from .errors import InputError


class _LongLines:
    """Stands in for the text wrapper with which Taichi prepares the source of every node for error messages.

    Wrapping runs over every line of every kernel at every start and takes longer than the rest of the parsing.
    """

    def __init__(self, width: int) -> None:
        pass

    def wrap(self, text: str) -> list[str]:
        return [text] if text.strip() else []


ast_transformer_utils.TextWrapper = _LongLines  # pyright: ignore[reportAttributeAccessIssue]  # a stand-in by duck type


@dataclass(frozen=True)
class Runtime:
    """How this process computes.

    Parameters
    ----------
    arch
        "cpu" or "gpu".
    precision
        "f64" or "f32": number type of contact geometry, forces and history.
    threads
        Number of CPU threads.
    """

    arch: str
    precision: str
    threads: int

    @property
    def serial(self) -> bool:
        """Whether kernels run in the calling thread: handing a loop to a pool costs more than a small loop."""
        return self.arch == "cpu" and self.threads == 1

    @property
    def real(self) -> Any:
        """Taichi type of contact geometry, forces and history; positions, velocities and sums are always f64."""
        return ti.f64 if self.precision == "f64" else ti.f32


_current: Runtime | None = None


def check_arch(arch: str) -> None:
    """Raise InputError if this machine has no device `arch`, "cpu" or "gpu", on which Taichi can compute."""
    if arch != "cpu":
        _gpu()


def _gpu() -> Any:
    """Taichi arch of the GPU of this machine; InputError if there is none.

    Only CUDA and ROCm compute in f64, as positions need it. They are asked for by name: on a machine without a GPU
    Taichi's own search through all graphics drivers may end the process.
    """
    ti.set_logging_level(ti.ERROR)  # that a driver is missing is said below, not by Taichi
    library: Any = ti.__dict__["_lib"].core
    for arch, found in ((ti.cuda, library.with_cuda), (ti.amdgpu, library.with_amdgpu)):
        if found():
            return arch
    raise InputError("arch 'gpu': this machine has no GPU with CUDA or ROCm that Taichi can use, must be cpu")


def start(arch: str = "cpu", precision: str = "f64", threads: int = 1) -> Runtime:
    """Initialise Taichi once per process; a second call with the same settings does nothing.

    Parameters
    ----------
    arch, precision, threads
        As in `Runtime`.

    Raises
    ------
    InputError
        For a setting that does not exist, and for other settings than those with which Taichi already runs: a second
        `ti.init` would destroy the fields of the first.
    """
    global _current
    for name, value, allowed in (("arch", arch, ("cpu", "gpu")), ("precision", precision, ("f64", "f32"))):
        if value not in allowed:
            raise InputError(f"{name} {value!r}: allowed are {' | '.join(allowed)}")
    if threads < 1:
        raise InputError(f"threads {threads}: must be at least 1")
    wanted = Runtime(arch, precision, int(threads))
    if _current is None:
        device = ti.cpu if arch == "cpu" else _gpu()
        with contextlib.redirect_stdout(io.StringIO()):  # ti.init prints a line that would mix with our output
            ti.init(
                arch=device,
                default_fp=wanted.real,
                cpu_max_num_threads=wanted.threads,
                cfg_optimization=False,
                unrolling_limit=0,  # loops over the fields of a table are unrolled on purpose
                fast_math=False,  # it reorders sums: results would depend on the compiler, not on the equations
                log_level=ti.ERROR,  # clearing sparse nodes warns about index types inside Taichi itself
            )
        _current = wanted
    elif _current != wanted:
        raise InputError(f"Taichi already runs as {_current}; {wanted} needs a process of its own")
    return _current


def current() -> Runtime:
    """The settings of this process, which is started with the defaults if it runs no Taichi yet."""
    return _current or start()
