"""Files that appear whole or not at all, and what is said when one cannot be written."""

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .errors import InputError, SimulationError

FULL = (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC))


def require_folder(path: Path) -> None:
    """Raise InputError unless there is a folder for the new file `path`."""
    if not path.parent.is_dir():
        raise InputError(f"{path}: cannot be written, there is no folder {path.parent}; make it first")


def require_folder_still(path: Path) -> None:
    """Raise SimulationError if the folder of the file `path`, which a run has begun, has been removed."""
    if not path.parent.is_dir():
        raise SimulationError(f"{path}: cannot be written, the folder {path.parent} is gone; the run lost its files")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give the path of a temporary file to be written; it takes the place of `path` at the end of the block.

    A reader sees the old file or the new one, never a part. If the block raises, `path` is unchanged and nothing is
    left behind. One process per path.

    Raises
    ------
    InputError
        If there is no folder to write to.
    SimulationError
        If the file cannot be written, see `failures_named`.
    """
    require_folder(path)
    # One fixed name: what a killed process leaves is overwritten by the next write instead of piling up.
    temporary = path.with_name(f".{path.name}.part")
    with failures_named(path):
        try:
            yield temporary
            # Without this a power failure soon after the rename may leave an empty file under the final name.
            with open(temporary, "rb+") as file:
                os.fsync(file.fileno())
            os.replace(temporary, path)
        except BaseException:
            with suppress(OSError):
                os.truncate(temporary, 0)  # its space is free at once, though HDF5 may keep it open after a failure
            with suppress(OSError):
                temporary.unlink()
            raise
        _sync_folder(path.parent)


@contextmanager
def failures_named(path: Path) -> Iterator[None]:
    """Turn a failure of the system to write `path` into a SimulationError.

    Its message names the file, the reason, the free space and what to do.
    """
    try:
        yield
    except OSError as error:
        raise SimulationError(_failure(path, error)) from error


def _failure(path: Path, error: OSError) -> str:
    """What is said of a failure to write `path`."""
    folder = path.parent
    if not folder.is_dir():
        return f"{path}: cannot be written, the folder {folder} is gone; the run lost its files"
    free = shutil.disk_usage(folder).free
    space = f"{free / 1e6:.1f} MB free in {folder}" if free < 1e9 else f"{free / 1e9:.1f} GB free in {folder}"
    if error.errno in FULL:
        return f"{path}: cannot be written, disk full: {space}; make room and resume"
    reason = error.strerror or str(error)
    return f"{path}: cannot be written ({reason}; {space}); make the file and its folder writable and resume"


def _sync_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk, so that a rename survives a power failure, where the system can."""
    if os.name == "nt":  # folders cannot be opened
        return
    opened = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # some network file systems refuse it
            os.fsync(opened)
    finally:
        os.close(opened)
