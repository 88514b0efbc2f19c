"""posterior.nc: draws of the posterior and of the prior, in the layout of ArviZ (groups of an xarray.DataTree)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from workflows.calibrate.design import first_design
from workflows.calibrate.emulator import Emulators, Predicted
from workflows.calibrate.loop import Calibration
from workflows.calibrate.posterior import variances_of
from workflows.calibrate.study import Study
from workflows.calibrate.targets import Target
from workflows.common.libraries import library
from workflows.common.parameter_coordinates import RENAMED, unit_and_name

if TYPE_CHECKING:
    import xarray

FILE = "posterior.nc"
DRAWS = 4096
REFERENCES = (
    "Kennedy and O'Hagan (2001), doi:10.1111/1467-9868.00294; Rasmussen and Williams (2006), Gaussian processes for "
    "machine learning"
)


def write_posterior(study: Study, found: Calibration, out: Path) -> xarray.DataTree:
    """Write `out`/posterior.nc and return it.

    Groups: `posterior` and `prior`, draws of the parameters (chain 1, draw) in their units; `posterior_predictive` and
    `prior_predictive`, draws of what would be measured, with all errors; `observed_data`, the targets, and
    `constant_data`, their errors.
    """
    problem, priors = study.problem, study.problem.priors
    numbers = found.posterior.draws(DRAWS, problem.seed)
    prior_shares = first_design(DRAWS, len(priors), problem.seed)
    rng = np.random.default_rng(problem.seed)
    at_draws = Predicted(found.posterior.predicted.mean[numbers], found.posterior.predicted.variance[numbers])
    at_prior = found.emulators.predict(prior_shares)
    posterior = {name_in_files(p.name): p.at(found.posterior.shares[numbers, i]) for i, p in enumerate(priors)}
    prior = {name_in_files(p.name): p.at(prior_shares[:, i]) for i, p in enumerate(priors)}
    groups: dict[str, dict[str, Any]] = {
        "posterior": _chain(posterior),
        "posterior_predictive": _chain(measured(at_draws, found.emulators, problem.targets, rng)),
        "prior": _chain(prior),
        "prior_predictive": _chain(measured(at_prior, found.emulators, problem.targets, rng)),
        "observed_data": {t.metric: np.array(t.value) for t in problem.targets},
        "constant_data": {f"{n}_error": np.array(e) for n, e in errors_of(found.emulators, problem.targets).items()},
    }
    tree = library("arviz_base", "calibrate").from_dict(groups)
    _describe(tree, study, found)
    with lsm.replacing(out / FILE) as new:
        tree.to_netcdf(new, engine="netcdf4", format="NETCDF4")
    return tree


def name_in_files(parameter: str) -> str:
    """Name of a parameter in files, where friction, for one, is a measured quantity."""
    return RENAMED.get(parameter, parameter)


def _chain(variables: Mapping[str, NDArray]) -> dict[str, NDArray]:
    """Draws (n,) as those of one chain, (1, n)."""
    return {name: values[np.newaxis] for name, values in variables.items()}


def errors_of(emulators: Emulators, targets: tuple[Target, ...]) -> dict[str, float]:
    """Standard deviation of each target about what the best parameters give: all errors but that of the emulator."""
    own, apart = variances_of(emulators, targets)
    return {target.metric: math.sqrt(own[i] + apart[i]) for i, target in enumerate(targets)}


def measured(
    predicted: Predicted, emulators: Emulators, targets: tuple[Target, ...], rng: np.random.Generator
) -> dict[str, NDArray]:
    """(n,) draws of each metric as it would be measured, with the errors of its target and of the emulator."""
    own, apart = variances_of(emulators, targets)
    together = np.sqrt(predicted.variance + own)
    factor = np.linalg.cholesky(emulators.correlation + 1e-9 * np.eye(len(targets)))
    shared = rng.standard_normal(predicted.mean.shape) @ factor.T * together
    values = predicted.mean + shared + rng.standard_normal(predicted.mean.shape) * np.sqrt(apart)
    return {target.metric: values[:, i] for i, target in enumerate(targets)}


def _describe(tree: Any, study: Study, found: Calibration) -> None:
    """Units and long names of all variables, and the global attributes."""
    units = {name: unit for sample in found.samples for name, unit in sample.units.items()}
    described = {name_in_files(p.name): unit_and_name(type(study.base), p.name) for p in study.problem.priors}
    for group in tree.children:
        for name, variable in tree[group].data_vars.items():
            if group in ("posterior", "prior"):
                unit, long_name = described[name]
            else:
                metric = name.removesuffix("_error") if group == "constant_data" else name
                unit, long_name = units.get(metric, "1"), name.replace("_", " ")
            variable.attrs |= {"units": unit, "long_name": long_name}
    base, targets = study.base, study.problem.targets
    words = ", ".join(f"{t.metric} = {t.value:.6g}" for t in targets)
    tree.attrs |= lsm.file_attributes(
        f"Posterior of {', '.join(p.name for p in study.problem.priors)} of {study.experiment}",
        f"Parameters that give {words}, from {len(found.emulators.residuals)} runs.",
        study.text,
        study.problem.seed,
        None,
        base.arch,
        base.precision,
        REFERENCES,
    ) | {"run_status": "complete"}
