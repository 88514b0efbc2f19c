"""accuracy.nc: errors and costs of all trials, by quantity, parameter, setting and replica."""

from __future__ import annotations

import os
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import taichi_lsm as lsm
from workflows.accuracy import Trial

if TYPE_CHECKING:
    import xarray

VARIABLES = {
    "value": (("parameter", "setting"), "1", "setting as a number, in the unit of the parameter"),
    "error": (("quantity", "parameter", "setting", "replica"), "1", "deviation from the reference, or standard error"),
    "cost": (
        ("quantity", "parameter", "setting"),
        "s",
        "core time of a second of a grain; of layers: of a unit of strain",
    ),
    "relative_cost": (("quantity", "parameter", "setting"), "1", "cost over that of discs at the default settings"),
}


def write_trials(path: Path, trials: Sequence[Trial], attributes: dict[str, Any]) -> xarray.Dataset:
    """Write the trials to the NetCDF file `path`, which appears whole or not at all; returns it opened.

    Combinations that were not measured are NaN.
    """
    import xarray  # not at the top, for `lsm --help` to answer at once

    names = {name: list(dict.fromkeys(getattr(t, name) for t in trials)) for name in ("quantity", "parameter")}
    settings = {
        parameter: sorted({t.value for t in trials if t.parameter == parameter}) for parameter in names["parameter"]
    }
    labels = {(t.parameter, t.value): t.setting for t in trials}
    sizes = {name: len(texts) for name, texts in names.items()}
    sizes["setting"] = max(len(values) for values in settings.values())
    sizes["replica"] = 1 + max(t.replica for t in trials)
    arrays = {name: np.full([sizes[d] for d in dims], np.nan) for name, (dims, _, _) in VARIABLES.items()}
    texts = np.full((sizes["parameter"], sizes["setting"]), "", dtype=object)
    for t in trials:
        q, k = names["quantity"].index(t.quantity), names["parameter"].index(t.parameter)
        s = settings[t.parameter].index(t.value)
        texts[k, s], arrays["value"][k, s] = labels[t.parameter, t.value], t.value
        arrays["error"][q, k, s, t.replica] = t.error
        arrays["cost"][q, k, s], arrays["relative_cost"][q, k, s] = t.cost, t.relative
    data = {
        name: (dims, arrays[name], {"units": units, "long_name": long_name, "_FillValue": np.nan})
        for name, (dims, units, long_name) in VARIABLES.items()
    }
    coordinates: dict[str, Any] = {
        f"{name}_name": ((name,), np.array(texts_of, dtype=object), {"long_name": f"name of the {name}"})
        for name, texts_of in names.items()
    }
    coordinates["setting_name"] = (("parameter", "setting"), texts, {"long_name": "name of the setting"})
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    dataset = xarray.Dataset(data, coordinates, attributes | {"run_status": "complete", "date_modified": now})
    partial = Path(path).with_suffix(".partial")
    dataset.to_netcdf(partial)
    os.replace(partial, path)
    return lsm.open_run(path)


def read_trials(path: Path) -> list[Trial]:
    """The trials of accuracy.nc, as they were written but for their order; InputError for a file of something else."""
    table = lsm.open_run(path)
    if "quantity_name" not in table.coords:
        raise lsm.InputError(f"{path}: holds no trials, must be an accuracy.nc that lsm accuracy-cost wrote")
    quantities, parameters = table.quantity_name.values, table.parameter_name.values
    trials = []
    for q, k, s, r in np.argwhere(~np.isnan(table.error.values)):
        where = (str(parameters[k]), str(table.setting_name.values[k, s]), float(table.value.values[k, s]))
        costs = float(table.cost.values[q, k, s]), float(table.relative_cost.values[q, k, s])
        trials.append(Trial(*where, str(quantities[q]), int(r), float(table.error.values[q, k, s, r]), *costs))
    return trials
