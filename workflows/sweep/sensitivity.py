"""The sensitivity of a sweep: indices of Sobol of its metrics, from its table, into sensitivity.nc."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError
from workflows.common.metrics import Metric
from workflows.common.parameter_files import SWEEP
from workflows.common.parameter_problems import nearest
from workflows.common.toml_reader import parsed
from workflows.sweep.factors import SALTELLI
from workflows.sweep.saltelli import Indices, indices_of

if TYPE_CHECKING:
    import xarray

FILE = "sensitivity.nc"
DEFAULT = "friction_mean"  # the metric that is analysed if none is asked for
DIM = "sample"
HOW = f'[sweep.sample] with method = "{SALTELLI}"'
REFERENCES = "Saltelli et al. (2010), doi:10.1016/j.cpc.2009.09.018; SALib: Iwanaga et al. (2022)"
LONG_NAMES = {
    "first": "index of first order: share of the variance that the parameter gives alone",
    "first_error": "half-width of its 95 % interval",
    "total": "total index: share of the variance that is left if all other parameters are known",
    "total_error": "half-width of its 95 % interval",
}


def sensitivity_of(folder: Path, metrics: Sequence[str] = ()) -> tuple[xarray.Dataset, dict[str, Indices]]:
    """Indices of metrics of a sweep.

    Parameters
    ----------
    folder
        Of the sweep, whose points are those of SALTELLI. A metric is the mean over the replicas that gave it.
    metrics
        Names of variables of sweep.nc; none: DEFAULT.

    Returns
    -------
    tuple
        The sweep as `lsm.open_sweep` gives it, and the indices of each metric.

    Raises
    ------
    InputError
        If the sweep is another one, has no such metric, or too few runs.
    """
    study = lsm.open_sweep(folder)
    names = parameters_of(study, folder)
    known = sorted(str(n) for n, v in study.data_vars.items() if v.dtype.kind == "f")
    wanted = list(metrics) or [DEFAULT]
    found = {}
    for metric in wanted:
        if metric not in known:
            hint = nearest(metric, known)
            raise InputError(
                f"--metric {metric}: {folder} has no such metric, must be one of {', '.join(known)}.{hint}"
            )
        values = study[metric]
        runs = values.transpose(DIM, ...).values.reshape(values.sizes[DIM], -1)  # the replicas of a point side by side
        counts = np.isfinite(runs).sum(axis=1)
        means = np.where(counts > 0, np.nansum(runs, axis=1) / np.maximum(counts, 1), np.nan)
        found[metric] = indices_of(means, len(names), seed=0, name=f"{folder}: {metric}")
    return study, found


def parameters_of(study: xarray.Dataset, folder: Path) -> list[str]:
    """Names of the parameters of a sweep whose points are those of SALTELLI, with nothing but replicas beside them."""
    content = parsed(str(study.attrs.get("config_toml", "")), folder)
    sample = content.get(SWEEP, {}).get(DIM, {})
    factors = {factor["dim"]: list(factor["names"]) for factor in json.loads(study.attrs["factors"])}
    if not isinstance(sample, Mapping) or sample.get("method") != SALTELLI:
        raise InputError(f"{folder}: has no blocks of points for indices of Sobol, must be a sweep of {HOW}")
    if more := sorted(set(factors) - {DIM, "seed"}):
        raise InputError(f"{folder}: {more[0]} varies beside the sample, must be a sweep of {HOW} and replicas alone")
    return factors[DIM]


def write_sensitivity(folder: Path, study: xarray.Dataset, found: Mapping[str, Indices]) -> xarray.Dataset:
    """Write `folder`/sensitivity.nc and return it: the indices along `metric` and `parameter`."""
    import xarray

    names, metrics = parameters_of(study, folder), list(found)
    dims = ("metric", "parameter")
    variables = {
        name: (dims, np.stack([getattr(found[m], name) for m in metrics]), {"units": "1", "long_name": long_name})
        for name, long_name in LONG_NAMES.items()
    }
    counts = {
        "blocks": ("metric", [found[m].blocks for m in metrics], {"units": "1", "long_name": "blocks of runs used"}),
        "left_out": (
            "metric",
            [found[m].left_out for m in metrics],
            {"units": "1", "long_name": "blocks left out, in which a run gave nothing"},
        ),
    }
    labels = {
        "metric": ("metric", np.array(metrics, dtype=object), {"long_name": "metric of summary.json"}),
        "parameter": ("parameter", np.array(names, dtype=object), {"long_name": "parameter that varies"}),
    }
    attributes = lsm.file_attributes(
        f"Sensitivity of {', '.join(metrics)} to {', '.join(names)}",
        f"Indices of Sobol from the runs of {study.attrs.get('experiment', 'a sweep')}.",
        str(study.attrs.get("config_toml", "")),
        int(study.attrs.get("seed", 0)),
        None,
        str(study.attrs.get("arch", "cpu")),
        str(study.attrs.get("precision", "f64")),
        REFERENCES,
    )
    dataset = xarray.Dataset(variables | counts, labels, attributes | {"run_status": "complete"})
    with lsm.replacing(folder / FILE) as new:
        dataset.to_netcdf(new, engine="netcdf4")
    return dataset


def metrics_of(names: Sequence[str], found: Mapping[str, Indices]) -> dict[str, Metric]:
    """The indices as metrics, for the printed table."""
    rows = {}
    for metric, of_metric in found.items():
        for i, name in enumerate(names):
            for word, value, half in (
                ("first", of_metric.first[i], of_metric.first_error[i]),
                ("total", of_metric.total[i], of_metric.total_error[i]),
            ):
                interval = (float(value - half), float(value + half))
                rows[f"{metric}_{word}_{name}"] = Metric(float(value), "1", interval=interval)
    return rows
