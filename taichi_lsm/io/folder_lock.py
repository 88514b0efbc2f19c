"""One process at a time writes to the folder of a run."""

import errno
import os
import socket
import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path

from ..core.errors import InputError

NAME = ".lock"
WITHOUT_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP)
PATIENCE_S = 0.2  # for which a lock is tried: `holder_of` has it for an instant
LOCKED_BYTE = 2**30  # far behind the text of the file: what Windows locks can be read by nobody


@contextmanager
def locked(folder: str | PathLike[str]) -> Iterator[None]:
    """Hold the lock of a folder, the file .lock in it, during the block.

    The system releases the lock when the process ends, however it ends; a file that a killed process leaves locks
    nothing. Processes that were forked inside the block hold the lock as well, until they end.

    Parameters
    ----------
    folder
        An existing folder.

    Raises
    ------
    InputError
        If another process, or this one, holds the lock, naming it and what to do; if there is no folder, or no file can
        be made in it.

    Notes
    -----
    Locks the whole file by flock, on Windows one byte of it by msvcrt. A file system that has no locks, such as that of
    some clusters, gives a warning, and nothing is excluded.
    """
    path = Path(folder) / NAME
    try:
        lock = _acquired(path)
    except OSError as error:
        raise InputError(f"{folder}: cannot be locked ({error.strerror}), must be a writable folder") from None
    if lock is None:
        raise InputError(
            f"{folder}: is in use by {_holder(path)}; wait for it to end, stop it, or choose another folder"
        )
    try:
        yield
    finally:
        _release(lock, path)


def holder_of(folder: str | PathLike[str]) -> str | None:
    """Who holds the lock of a folder, such as "process 7 on host"; None if nobody does.

    On a file system without locks, whoever wrote the file last counts as the holder.
    """
    path = Path(folder) / NAME
    try:
        lock = os.open(path, os.O_RDONLY)
    except OSError:  # there is none
        return None
    try:
        return None if _is_free(lock) else _holder(path)
    finally:
        os.close(lock)


def _acquired(path: Path) -> int | None:
    """An open file that holds the lock, None if another one does."""
    refused_at = time.monotonic() + PATIENCE_S
    while True:
        lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        if not _try_lock(lock):
            os.close(lock)
            if time.monotonic() > refused_at:
                return None
            time.sleep(0.01)
            continue
        # The former holder removes the file before it lets go: the lock of a file without a name excludes nobody.
        with suppress(FileNotFoundError):
            if os.path.samestat(os.stat(path), os.fstat(lock)):
                with suppress(OSError):  # on a full disk it stays empty
                    os.ftruncate(lock, 0)
                    os.write(lock, f"process {os.getpid()} on {socket.gethostname()}\n".encode())
                return lock
        os.close(lock)


def _holder(path: Path) -> str:
    """What the holder wrote about itself."""
    with suppress(OSError):
        return path.read_text(encoding="utf-8").strip() or "another process"
    return "another process"


if sys.platform == "win32":
    import msvcrt

    def _try_lock(lock: int) -> bool:
        """Lock one byte; False if it is locked."""
        os.lseek(lock, LOCKED_BYTE, os.SEEK_SET)
        try:
            msvcrt.locking(lock, msvcrt.LK_NBLCK, 1)
        except PermissionError:
            return False
        os.lseek(lock, 0, os.SEEK_SET)
        return True

    def _is_free(lock: int) -> bool:
        """Whether nobody holds the lock, as far as can be known."""
        with suppress(OSError):
            return _try_lock(lock)
        return False

    def _release(lock: int, path: Path) -> None:
        """Close the file, which ends the lock, then remove it unless another process has it open."""
        os.close(lock)
        with suppress(OSError):
            path.unlink()

else:
    import fcntl

    def _try_lock(lock: int) -> bool:
        """Lock the file; False if it is locked."""
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError as error:
            if error.errno not in WITHOUT_LOCKS:
                raise
            lacking = f"the file system has no locks ({error.strerror}): start no second run in this folder"
            warnings.warn(lacking, stacklevel=4)
        return True

    def _is_free(lock: int) -> bool:
        """Whether nobody holds the lock, as far as can be known: a shared one needs no right to write."""
        try:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return False
        return True

    def _release(lock: int, path: Path) -> None:
        """Remove the file, then close it, which ends the lock."""
        with suppress(OSError):
            path.unlink()
        os.close(lock)
