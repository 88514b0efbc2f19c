"""Tables of an experiment with one row for each run, event, hold, level or case, and the runs it consists of."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import taichi_lsm as lsm
from taichi_lsm.core.errors import reason
from workflows.common.metrics import shown
from workflows.common.run_contents import MALFORMED, attributes_of
from workflows.report.metric_table import claims_not_met
from workflows.report.parts import Section, Table, split_columns, with_unit, without_empty_columns

if TYPE_CHECKING:
    import xarray

MOST_ROWS = 50
MOST_RUNS = 300
MOST_LABELS = 8  # of a second dimension, each of which becomes a column
MOST_COLUMNS = 8  # of one table on a page
LONGEST_NAME = 40  # letters of what names a row
OF_A_RUN = ("run", "grains", "contacts", "stopped")  # whose rows are moments of one run
ALONG = ("run", "event", "level", "grain", "case", "metric", "fragment")  # dimensions that have rows


def row_tables(folder: Path, files: list[Path]) -> Section:
    """All such tables in the files of a folder."""
    section = Section("rows", "Results, row by row")
    for path in files:
        if path.suffix != ".nc" or path.stem in OF_A_RUN or path.stem.startswith("checkpoint"):
            continue
        try:
            with lsm.opened_run(path) as dataset:
                _add(section, path.name, dataset)
        except MALFORMED as error:
            section.texts.append(f"{path.name} cannot be read: {reason(error)}.")
    return section


def _add(section: Section, name: str, dataset: xarray.Dataset) -> None:
    """Add the table of a file, with what is the same in all of its rows."""
    dim = next((dim for dim in ALONG if dim in dataset.sizes), None)
    if dim is None or not dataset.sizes[dim]:
        return
    count = dataset.sizes[dim]
    columns, same = _columns(dataset.isel({dim: slice(MOST_ROWS)}), dim)
    rows = list(zip(*columns.values(), strict=True))
    if _names(columns) is None:
        columns = {dim: [], **columns}
        rows = [(str(i), *row) for i, row in enumerate(rows)]
    texts = frozenset(i for i, cells in enumerate(columns.values()) if not _are_numbers(cells))
    of = f", the first {MOST_ROWS} of {count} rows" if count > MOST_ROWS else ""
    note = f"The same in all rows: {'; '.join(same)}." if same and count > 1 else ""
    caption = f"{name}: {dataset.attrs.get('title', '')}{of}"
    section.tables.extend(split_columns(Table(caption, tuple(columns), rows, texts=texts, note=note), MOST_COLUMNS))


def _columns(dataset: xarray.Dataset, dim: str) -> tuple[dict[str, list[str]], list[str]]:
    """Cells by the title of their column, the one that names the rows first; and what is the same in all of them."""
    columns: dict[str, list[str]] = {}
    same: list[str] = []
    for name in (*dataset.coords, *dataset.data_vars):  # what a row is of comes before what it gave
        variable = dataset[name]
        if variable.dims[:1] != (dim,) or name == dim or str(name).endswith("_name"):
            continue
        unit = str(variable.attrs.get("units", ""))
        for label, values in _along(dataset, str(name), variable):
            cells = [_cell(value) for value in values]
            title = with_unit(f"{name}{label}", unit)
            if len(set(cells)) > 1 or len(cells) == 1:
                columns[title] = cells
            elif cells[0] not in ("unknown", "none", ""):
                same.append(f"{title} {cells[0]}")
    if named := _names(columns):
        columns = {named: columns.pop(named)} | columns
    return columns, same


def _names(columns: dict[str, list[str]]) -> str | None:
    """The column of different short texts, which names the rows; None if there is none."""
    return next(
        (
            title
            for title, cells in columns.items()
            if len(set(cells)) == len(cells) and not _are_numbers(cells) and max(map(len, cells)) <= LONGEST_NAME
        ),
        None,
    )


def _along(dataset: xarray.Dataset, name: str, variable: Any) -> list[tuple[str, Any]]:
    """(label, values) of the columns of a variable: one, or one for each label of a second dimension."""
    if variable.ndim == 1:
        return [("", variable.values)]
    second = str(variable.dims[1])
    if variable.ndim > 2 or not 0 < dataset.sizes[second] <= MOST_LABELS:
        return []
    labels = next((dataset[key].values for key in (f"{second}_name", second) if key in dataset.variables), None)
    if labels is None:
        return []
    return [(f" {label}", variable.values[:, i]) for i, label in enumerate(labels)]


def _cell(value: Any) -> str:
    """A value as a cell shows it."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, np.floating | float):
        return shown(float(value))
    return str(value)


def _are_numbers(cells: list[str]) -> bool:
    try:
        [float(cell) for cell in cells if cell != "unknown"]
    except ValueError:
        return False
    return True


def table_of_runs(folder: Path, runs: list[Path]) -> Section:
    """The runs that an experiment consists of: how each ended, and its claims."""
    section = Section("runs", "Runs")
    rows, failing = [], set()
    for path in runs[:MOST_RUNS]:
        status = attributes_of(path, ("run_status",)).get("run_status", "unknown")
        holder = lsm.holder_of(path)
        missed = claims_not_met(path)
        if status == "failed" or missed:
            failing.add(len(rows))
        told = f"{status}, {holder} writes to it" if holder else status
        rows.append((path.relative_to(folder).as_posix(), told, ", ".join(missed)))
    if rows:
        texts = frozenset({1, 2})
        head = ("folder", "status", "claims not met")
        table = Table("How each run ended", head, rows, frozenset(failing), texts)
        section.tables.append(without_empty_columns(table))
    if len(runs) > MOST_RUNS:
        section.texts.append(f"Only the first {MOST_RUNS} of {len(runs)} runs are shown.")
    return section
