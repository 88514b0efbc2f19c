"""Contacts of a contacts.nc, one moment at a time: as lines for VTK, as rows for CSV."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import taichi_lsm as lsm
from workflows.common.libraries import library
from workflows.export.csv_tables import tables_of
from workflows.export.selection import chosen
from workflows.export.snapshots import in_space
from workflows.export.vtk_series import write_series

if TYPE_CHECKING:
    import xarray
    from pyvista import PolyData

CONTACTS = "contacts.nc"
VALUES = (  # of a line
    *("first_id", "second_id", "sliding", "bonded", "overlap", "normal_force"),
    *("elastic_energy", "dissipated_power"),
)


class Moment(NamedTuple):
    """The contacts of one moment: its place in the file from 0 on, its time [s], and its rows in memory."""

    number: int
    time: float
    rows: xarray.Dataset


class ContactMoments:
    """Those moments of a contacts.nc that are wanted; each is read when it is its turn.

    Parameters
    ----------
    dataset
        The file, as `lsm.opened_run` gives it.
    times, every
        Which moments, see `selection.chosen`; none if no moment lies there.
    """

    def __init__(self, dataset: xarray.Dataset, times: str = "all", every: int = 1) -> None:
        self.dataset = dataset
        self.digits = len(str(max(0, dataset.sizes["time"] - 1)))
        self.numbers = np.zeros(0, int)
        if dataset.sizes["time"]:
            with suppress(lsm.InputError):  # of times at which there are snapshots of the grains alone
                self.numbers = chosen(dataset.time.values, times, every)

    def __len__(self) -> int:
        return len(self.numbers)

    def __iter__(self) -> Iterator[Moment]:
        for number in map(int, self.numbers):
            now = lsm.contacts_at(self.dataset, index=number)
            yield Moment(number, float(now.time), now)


def write_lines(moments: ContactMoments, out: Path) -> Path:
    """Write contacts.pvd and its files to the folder `out`; returns its path."""
    return write_series(out, "contacts", ((m.number, m.time, lines_of(m.rows)) for m in moments), moments.digits)


def write_rows(moments: ContactMoments, out: Path) -> Path:
    """Write contacts.csv to the folder `out`, a row for each contact of each moment; returns its path.

    Points are those of the file, which are not wrapped into the cell.
    """
    with lsm.replacing(out / "contacts.csv") as new, open(new, "w", encoding="utf-8", newline="") as file:
        for place, moment in enumerate(moments):
            table = tables_of(moment.rows)["contact"]
            for name in ("shear_strain", "stage"):
                table.insert(0, f"{name}{' [1]' * (name != 'stage')}", moment.rows[name].item())
            table.insert(0, "time [s]", moment.time)
            table.to_csv(file, index=False, header=place == 0)
    return out / "contacts.csv"


def lines_of(now: xarray.Dataset) -> PolyData:
    """The contacts of one moment as lines from the first centre to that of the nearest image of the second.

    Lines begin within the periodic cell and may reach over its border, as the surfaces of grains do; at a wall they end
    at the contact. Cells have the values of VALUES, in SI units, and tangential_force [N], its magnitude.
    """
    pyvista = library("pyvista", "lsm export --format vtk", "export")
    inside, _ = lsm.statistics.into_cell(lsm.statistics.cell_of(now), (now.point - now.arm).values)
    begin = in_space(inside)
    count = len(begin)
    points = np.concatenate([begin, begin + in_space(now.branch.values)])
    cells = np.stack([np.full(count, 2), np.arange(count), count + np.arange(count)], axis=1)
    mesh = pyvista.PolyData(points, lines=cells.ravel()) if count else pyvista.PolyData()
    for name in VALUES:
        mesh.cell_data[name] = now[name].values
    mesh.cell_data["tangential_force"] = np.linalg.norm(now.tangential_force.values, axis=1)
    mesh.field_data["TimeValue"] = [float(now.time)]
    return mesh
