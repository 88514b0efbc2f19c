"""Data files of the package: where they lie, installed or in a source tree, and the published friction values."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TypedDict

from .errors import InputError

PACKAGE = Path(__file__).resolve().parents[1]
FRICTION_TABLE = "friction_references.csv"


class PublishedFriction(TypedDict):
    """One row of data/friction_references.csv."""

    source: str
    year: int
    conditions: str
    dimension: int
    shape: str
    mu: float
    kind: str
    reference: str
    note: str


def data_path(name: str, folders: Sequence[Path] = (PACKAGE / "data", PACKAGE.parent / "data")) -> Path:
    """Path of the data file `name`, such as "mair2002.toml".

    Parameters
    ----------
    name
        File name without folder.
    folders
        Where to look, in this order: by default the installed package, then the root of the source tree.

    Raises
    ------
    InputError
        If there is no such file; the message lists those there are.
    """
    if Path(name).name != name:
        raise InputError(f"data file {name!r}: must be the name of a file, without a folder")
    for folder in folders:
        if (folder / name).is_file():
            return folder / name
    there = sorted({file.name for folder in folders if folder.is_dir() for file in folder.iterdir()})
    raise InputError(f"data file {name!r}: not found; available are {', '.join(there) or 'none'}")


def published_friction() -> list[PublishedFriction]:
    """Published friction coefficients, one dict per row of data/friction_references.csv.

    Returns
    -------
    list of dict
        source, conditions, shape, reference, note: text; kind: "laboratory" or "simulation"; year, dimension (1, 2 or
        3): int; mu [1]: float, shear stress over normal stress in steady sliding.

    Notes
    -----
    A row with the note "unchecked" was not compared with the paper and must not be cited.
    """
    with open(data_path(FRICTION_TABLE), encoding="utf-8", newline="") as file:
        return [_converted(row) for row in csv.DictReader(file)]


def _converted(row: dict[str, str]) -> PublishedFriction:
    """The row with its numbers as numbers; the other columns stay text, in the order of the file."""
    return PublishedFriction(
        source=row["source"],
        year=int(row["year"]),
        conditions=row["conditions"],
        dimension=int(row["dimension"]),
        shape=row["shape"],
        mu=float(row["mu"]),
        kind=row["kind"],
        reference=row["reference"],
        note=row["note"],
    )
