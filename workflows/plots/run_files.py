"""The files of one run, opened when a figure needs them, and the moments of which they tell."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from workflows.export.selection import chosen
from workflows.export.snapshots import Frame, Snapshots
from workflows.gouge.layer_metrics import sheared_rows
from workflows.plots.course import Course, course_of
from workflows.plots.run_titles import params_of, title_of

if TYPE_CHECKING:
    import xarray

WRITES = {  # what makes a run write a file
    "run": "which every run of a layer or a cell writes from its start",
    "grains": "which every run of a layer or a cell writes from its start",
    "contacts": "which a run with --contacts end, events or every=0.1 writes",
}
SAME = 1e-6  # of the time step: times that differ by less are one moment


class RunFiles:
    """The files of the folder of a run; close it at the end, or use it in a `with` block.

    Parameters
    ----------
    folder
        Of a run, which may go on or have been killed: what is in its files when they are opened counts.

    Notes
    -----
    Every attribute raises an InputError if the file that it needs is not there, or holds nothing yet.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.drawn_shapes: dict[int, Any] = {}  # what pictures keep of the shapes of grains
        self._open = ExitStack()

    def __enter__(self) -> RunFiles:
        return self

    def __exit__(self, *failure: object) -> None:
        self._open.close()

    def path(self, stem: str) -> Path:
        """Path of run.nc, grains.nc or contacts.nc, by its stem; InputError with what makes a run write it."""
        path = self.folder / f"{stem}.nc"
        if not path.is_file():
            raise lsm.InputError(f"needs {path.name}, {WRITES[stem]}")
        return path

    @cached_property
    def table(self) -> xarray.Dataset:
        """run.nc."""
        return lsm.open_run(self.path("run"))

    @cached_property
    def sheared(self) -> xarray.Dataset:
        """Rows of run.nc since shear began that have a strain, at least two."""
        rows = sheared_rows(self.table)
        rows = rows.isel(time=np.isfinite(rows.shear_strain.values))  # a run that failed may have lost it
        if rows.sizes["time"] < 2:
            raise lsm.InputError(f"needs two rows of run.nc since shear began, there are {rows.sizes['time']}")
        return rows

    def rows(self, *names: str) -> xarray.Dataset:
        """`sheared`, which has these variables."""
        missing = [name for name in names if name not in self.sheared]
        if missing:
            raise lsm.InputError(f"needs {', '.join(missing)}, which run.nc does not have")
        return self.sheared

    @cached_property
    def params(self) -> Any:
        """The parameters of the run, as attributes."""
        return params_of(self.table)

    @cached_property
    def course(self) -> Course:
        """What its curves are drawn against."""
        return course_of(self.sheared, self.params)

    @cached_property
    def snapshots(self) -> Snapshots:
        """All of grains.nc, of which each is read when it is used."""
        dataset = self._open.enter_context(lsm.opened_run(self.path("grains")))
        if not dataset.sizes["time"]:
            raise lsm.InputError("needs a snapshot, and grains.nc holds none yet")
        return Snapshots(dataset, np.arange(dataset.sizes["time"]))

    @cached_property
    def contacts(self) -> xarray.Dataset:
        """contacts.nc."""
        dataset = self._open.enter_context(lsm.opened_run(self.path("contacts")))
        if not np.isfinite(dataset.time.values).any():
            raise lsm.InputError("needs a moment of contacts, and contacts.nc holds none yet")
        return dataset

    @cached_property
    def title(self) -> str:
        """What ran, in words; the title of its file where the words are not known."""
        try:
            return " ".join(title_of(self.table).split())
        except (lsm.InputError, AttributeError, KeyError, ValueError):  # a run that is no layer, or has no row yet
            dataset = self.snapshots.dataset if (self.folder / "grains.nc").is_file() else self.table
            return str(dataset.attrs.get("title", self.folder.name))


class Moment(NamedTuple):
    """What is known of a run at one time.

    Attributes
    ----------
    run
        Its files.
    time
        [s].
    frame
        Snapshot of the grains; None for a figure that needs none.
    contacts
        Rows of contacts.nc of this time; None for a figure that needs none.
    """

    run: RunFiles
    time: float
    frame: Frame | None
    contacts: xarray.Dataset | None

    @property
    def grains(self) -> Frame:
        """The snapshot, which the figure has asked for."""
        assert self.frame is not None
        return self.frame

    @property
    def all_grains(self) -> xarray.Dataset:
        """The snapshot as it is on file, with grains that are nowhere, so that ids are places."""
        return self.run.snapshots.dataset.isel(time=self.grains.number)

    @property
    def touching(self) -> xarray.Dataset:
        """The contacts, which the figure has asked for."""
        assert self.contacts is not None
        return self.contacts

    @property
    def words(self) -> str:
        """`strain 1.24, friction 0.31`; before shear the stage and the time."""
        recorded = self.contacts if self.frame is None else self.frame.dataset
        assert recorded is not None
        strain = float(recorded.shear_strain)
        if not strain > 0.0:
            stage = f"{recorded.stage.item()}, " if "stage" in recorded.variables else ""
            return f"{stage}{1e3 * self.time:.3g} ms"
        return f"strain {strain:.3g}{self._friction()}"

    def _friction(self) -> str:
        """`, friction 0.31`, by the row of run.nc of this time; nothing where the run has not come to write it."""
        try:
            rows = self.run.sheared
        except lsm.InputError:
            return ""
        apart = np.abs(rows.time.values - self.time)
        friction = float(rows.friction[int(np.argmin(apart))])
        known = apart.min() <= np.diff(rows.time.values).max() and np.isfinite(friction)
        return f", friction {friction:.2f}" if known else ""


class Moments:
    """The moments of a run of which all that a figure needs was recorded; each is read when it is its turn.

    Parameters
    ----------
    run
        Files of the run.
    needs
        Stems of the files: "grains", "contacts" or both.
    wanted, every
        Which of the moments, see `selection.chosen`.

    Raises
    ------
    InputError
        If a file is missing, no moment has all, or a selection is wrong.

    Attributes
    ----------
    places : ndarray of int
        Numbers of the chosen ones among all.
    digits : int
        Of such a number.
    """

    def __init__(self, run: RunFiles, needs: tuple[str, ...], wanted: str = "last", every: int = 1) -> None:
        self.run, self.needs = run, needs
        moments = self._common()
        self.places = chosen(np.array([time for time, _, _ in moments]), wanted, every)
        self.digits = len(str(len(moments) - 1))
        self._moments = [moments[i] for i in self.places]

    def _common(self) -> list[tuple[float, int, int]]:
        """(time, number of the snapshot, number among the moments of contacts) of all moments; -1 where not needed."""
        snapshots = self.run.snapshots.dataset.time.values if "grains" in self.needs else None
        contacts = _finite(self.run.contacts.time.values) if "contacts" in self.needs else None
        if contacts is None:
            assert snapshots is not None
            return [(float(t), i, -1) for i, t in enumerate(snapshots)]
        if snapshots is None:
            return [(float(t), -1, i) for i, t in enumerate(contacts)]
        slack = SAME * float(self.run.contacts.attrs.get("dt", 0.0))
        nearest = [int(np.argmin(np.abs(contacts - t))) for t in snapshots]
        found = [
            (float(t), i, j)
            for i, (t, j) in enumerate(zip(snapshots, nearest, strict=True))
            if abs(contacts[j] - t) <= slack
        ]
        if not found:
            raise lsm.InputError(
                "needs grains and contacts of the same time, and none were recorded; give --snapshots and --contacts "
                "the same value"
            )
        return found

    def __len__(self) -> int:
        return len(self._moments)

    def __iter__(self) -> Iterator[Moment]:
        return (self.at(number) for number in range(len(self)))

    def at(self, number: int) -> Moment:
        """One of the chosen moments, from 0 on."""
        time, snapshot, contacts = self._moments[number]
        frame = self.run.snapshots.frame(snapshot) if snapshot >= 0 else None
        rows = lsm.contacts_at(self.run.contacts, index=contacts) if contacts >= 0 else None
        return Moment(self.run, time, frame, rows)


def _finite(times: NDArray) -> NDArray:
    """The times (n,) of what was recorded: a run that goes on may have room for more."""
    return times[np.isfinite(times)]
