"""NetCDF files that appear whole or not at all."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from .errors import InputError

if TYPE_CHECKING:
    import netCDF4


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

    Notes
    -----
    Not reentrant: a signal handler must set a flag, not write.
    """
    import netCDF4  # not at the top: a program that writes no file does not wait for it

    path = Path(path)
    if not path.parent.is_dir():
        raise InputError(f"{path}: cannot be written, there is no folder {path.parent}; make it first")
    # One fixed name: what a killed process leaves is overwritten by the next write instead of piling up.
    temporary = path.with_name(f".{path.name}.part")
    try:
        with netCDF4.Dataset(temporary, "w", format="NETCDF4") as dataset:
            fill(dataset)
        # Without this a power failure soon after the rename may leave an empty file under the final name.
        with open(temporary, "rb+") as file:
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
