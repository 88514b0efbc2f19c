"""Where the data files of the package lie, installed or in a source tree."""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]


def data_path(name, folders=(PACKAGE / "data", PACKAGE.parent / "data")):
    """Path of the data file `name`, such as "mair2002.toml".

    Looks in the installed package first, then at the root of the source tree.
    Raises FileNotFoundError that lists the files there are.
    """
    for folder in folders:
        if (folder / name).is_file():
            return folder / name
    there = sorted({file.name for folder in folders if folder.is_dir() for file in folder.iterdir()})
    raise FileNotFoundError(f"data file {name!r} not found; available are {', '.join(there) or 'none'}")
