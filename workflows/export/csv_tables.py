"""CSV: a file for each table of a run, with units in the header."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import taichi_lsm as lsm
from workflows.export.snapshots import Frame, Snapshots

if TYPE_CHECKING:
    import pandas
    import xarray

NO_TABLES = ("grains", "contacts", "stopped", "checkpoint", "checkpoint.previous", "checkpoint.new")


def write_tables(folder: Path, out: Path) -> list[Path]:
    """Write the tables of the folder of a run, such as run.csv of run.nc, to the folder `out`; returns their paths.

    Variables along the first dimension of a file are columns; of a second dimension every label has a column. Further
    dimensions that have values of their own have files of their own, such as run_effect_parameter.csv.
    """
    written = []
    for path in sorted(folder.glob("*.nc")):
        if path.stem in NO_TABLES:
            continue
        for place, (dimension, table) in enumerate(tables_of(lsm.open_run(path)).items()):
            written.append(out / f"{path.stem}{f'_{dimension}' if place else ''}.csv")
            with lsm.replacing(written[-1]) as new:
                table.to_csv(new, index=False)
    return written


def write_grains(snapshots: Snapshots, out: Path) -> Path:
    """Write grains.csv to the folder `out`, a row for each grain of each snapshot; returns its path.

    Positions are those of the file, which are not wrapped into the cell.
    """
    with lsm.replacing(out / "grains.csv") as new, open(new, "w", encoding="utf-8", newline="") as file:
        for place, frame in enumerate(snapshots):
            _table_of(frame).to_csv(file, index=False, header=place == 0)
    return out / "grains.csv"


def tables_of(dataset: xarray.Dataset) -> dict[str, pandas.DataFrame]:
    """{dimension: the table of what has it as its first one}: that along time first, then those of most columns."""
    import pandas

    columns: dict[str, dict[str, Any]] = {}
    for name, variable in [*dataset.data_vars.items(), *dataset.coords.items()]:
        if len(variable.dims) in (1, 2) and name != f"{variable.dims[0]}_name":
            columns.setdefault(str(variable.dims[0]), {}).update(_columns(dataset, str(name)))
    tables = {dimension: pandas.DataFrame(_first(found, dimension)) for dimension, found in columns.items()}
    return dict(sorted(tables.items(), key=lambda item: (item[0] != "time", -item[1].shape[1])))


def _first(columns: dict[str, Any], dimension: str) -> dict[str, Any]:
    """The columns with that of the dimension itself in front."""
    own = {header: values for header, values in columns.items() if header.split(" ")[0] == dimension}
    return own | columns


def _columns(dataset: xarray.Dataset, name: str) -> Iterator[tuple[str, Any]]:
    """(header, values) of a variable of one or two dimensions: `name [unit]`, or `name.label [unit]` for each label."""
    variable = dataset[name]
    unit = f" [{variable.attrs['units']}]" if "units" in variable.attrs else ""
    if variable.ndim == 1:
        yield f"{name}{unit}", variable.values
        return
    second = variable.dims[1]
    labels = dataset[f"{second}_name"].values if f"{second}_name" in dataset else range(variable.shape[1])
    for label, values in zip(labels, variable.values.T, strict=True):
        yield f"{name}.{label}{unit}", values


def _table_of(frame: Frame) -> pandas.DataFrame:
    """The grains of one snapshot, with time, stage and id in front."""
    table = tables_of(frame.dataset)["grain"]
    table.insert(0, "grain", frame.grain)
    if "stage" in frame.dataset:
        table.insert(0, "stage", str(frame.dataset.stage.values))
    table.insert(0, "time [s]", frame.time)
    return table
