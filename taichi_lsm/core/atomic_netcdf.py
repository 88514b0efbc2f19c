"""NetCDF files that appear whole or not at all."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from .whole_files import replacing

if TYPE_CHECKING:
    import netCDF4

FIRST_BYTES = 2**16  # of memory, which grows in such steps
PROBE = 2**20  # bytes
FileFormat = Literal["NETCDF4", "NETCDF3_64BIT_OFFSET"]


def write_atomically(path: str | os.PathLike[str], fill: "Callable[[netCDF4.Dataset], None]") -> None:
    """Write the NetCDF file `path` so that a reader sees the old file or the new one, never a part.

    Parameters
    ----------
    path
        The file, replaced if it exists. One process per path.
    fill
        Called with an open, empty dataset. If it raises, `path` is unchanged and nothing is left behind.

    Raises
    ------
    InputError
        If there is no folder to write to.
    SimulationError
        If the file cannot be written: the disk is full, read-only or gone. The message names the file, the reason, the
        free space and what to do; the file that was there stays.

    Notes
    -----
    Not reentrant: a signal handler must set a flag, not write.
    """
    import netCDF4  # not at the top: a program that writes no file does not wait for it

    with replacing(Path(path)) as temporary:
        try:
            with netCDF4.Dataset(temporary, "w", format="NETCDF4") as dataset:
                fill(dataset)
        except (OSError, RuntimeError) as error:
            reason = _refusal(temporary)
            if reason is None and str(error).startswith("NetCDF:"):
                reason = OSError(str(error))
            raise reason or error from error


def _refusal(path: Path) -> OSError | None:
    """Why the system refuses to write on behind what the library left at `path`; None if it does not.

    HDF5 tells no reason, and calls a full disk a lack of permission.
    """
    try:
        with open(path, "ab", buffering=0) as file:
            rest = memoryview(bytes(PROBE))
            while rest:
                rest = rest[file.write(rest) :]
            os.fsync(file.fileno())
    except OSError as error:
        return error
    return None


def compose(fill: "Callable[[netCDF4.Dataset], None]", file_format: FileFormat = "NETCDF4") -> memoryview:
    """The NetCDF file that `fill` makes of an open, empty dataset, in memory, to be read; zeros follow its end.

    Of the classic format it may be written to the disk as it is. One of HDF5 could not be changed then, and would list
    its variables in alphabetical order.
    """
    import netCDF4

    dataset = netCDF4.Dataset("composed.nc", "w", format=file_format, memory=FIRST_BYTES)
    try:
        fill(dataset)
    except BaseException:
        dataset.close()
        raise
    return memoryview(dataset.close())
