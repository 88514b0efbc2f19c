"""NetCDF files that appear whole or not at all."""

import os
from pathlib import Path


def write_atomically(path, fill):
    """Write the NetCDF file `path` so that a reader sees the old file or the new one, never a part.

    fill: called with an open, empty netCDF4.Dataset. If it raises, `path` is unchanged and nothing is left.
    One process per path. Not reentrant: a signal handler must set a flag, not write.
    """
    import netCDF4

    path = Path(path)
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
