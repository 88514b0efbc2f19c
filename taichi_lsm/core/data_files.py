"""Where the data files of the package lie, installed or in a source tree."""

import csv
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


def published_friction():
    """Published friction coefficients: a list of dicts, one per row of data/friction_references.csv.

    source, conditions, shape, kind (laboratory | simulation), reference, note: text; year, dimension: int;
    mu [1]: float, shear stress over normal stress in steady sliding. A note "unchecked" must not be cited.
    """
    with open(data_path("friction_references.csv"), encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        row.update(year=int(row["year"]), dimension=int(row["dimension"]), mu=float(row["mu"]))
    return rows
