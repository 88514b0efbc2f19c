"""Where the work of a run went: shares of the dissipated energy by effect over a window of run.nc."""

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError
from .run_parts import part_of
from .steady_means import LEAST_SAMPLES, Estimate, steady_ratio

if TYPE_CHECKING:
    from xarray import DataArray, Dataset

    from .run_parts import Run

STORED = ("translational_energy", "rotational_energy", "elastic_energy")


def work_partition(run: "Run", from_strain: float = 0.0, to_strain: float = math.inf) -> "Dataset":
    """Energy that each effect dissipated within a window of shear strain, and its share of all that was dissipated.

    Parameters
    ----------
    run
        What `open_run` gives of the folder, or of the run.nc, of a run, or its rows of one stage or event.
    from_strain, to_strain
        First and last shear strain [1] of the window.

    Returns
    -------
    Dataset
        Along effect: dissipated_energy [J], share [1] of the sum over the effects, share_error [1] (standard error with
        the autocorrelation of the rows, nan where the window does not show it). Scalars [J]: total_dissipated,
        external_work, stored_energy (change of kinetic and elastic energy), energy_residual, which is what is left of
        the work. All are differences between the last and the first row of the window.

    Raises
    ------
    InputError
        If a variable is missing, the window holds fewer than 2 rows, or nothing was dissipated in it.
    """
    import xarray

    needed = ("dissipated_energy", "external_work", "shear_strain", *STORED)
    run = part_of(run, "run")
    missing = [name for name in needed if name not in run.variables]
    if missing:
        raise InputError(f"run: has no {', '.join(missing)}, must be the run.nc of a layer")
    strain = np.asarray(run.shear_strain, float)
    if math.isnan(from_strain) or math.isnan(to_strain) or not from_strain < to_strain:
        raise InputError(f"from_strain, to_strain: {from_strain}, {to_strain}, the first must be below the second")
    rows = run.isel(time=np.flatnonzero((strain >= from_strain) & (strain <= to_strain)))
    if rows.sizes["time"] < 2:
        raise InputError(f"from_strain, to_strain: {rows.sizes['time']} rows between them, at least 2 are needed")
    change = {name: _change(rows[name]) for name in needed if name != "shear_strain"}
    lost, names = change["dissipated_energy"], np.asarray(rows.effect_name if "effect_name" in rows else rows.effect)
    total = float(lost.sum())
    if not total > 0.0:
        raise InputError(f"run: {total:g} J dissipated in the window, must be > 0 J to have shares")
    stored = float(sum(change[name].item() for name in STORED))
    work = change["external_work"].item()
    joule = {"units": "J"}
    return xarray.Dataset(
        {
            "dissipated_energy": ("effect", lost, joule | {"long_name": "energy dissipated in the window"}),
            "share": ("effect", lost / total, {"units": "1", "long_name": "share of the dissipated energy"}),
            "share_error": ("effect", [e.standard_error for e in _shares(rows)], {"units": "1"}),
            "total_dissipated": ((), total, joule),
            "external_work": ((), work, joule),
            "stored_energy": ((), stored, joule | {"long_name": "change of kinetic and elastic energy"}),
            "energy_residual": ((), work - stored - total, joule),
        },
        {"effect": names},
    )


def work_by_stage(run: "Run") -> "Dataset":
    """Where the work went in each stage of a run: energies by its name, over all passages through it.

    Parameters
    ----------
    run
        What `open_run` gives of the folder, or of the run.nc, of a run through stages; or its rows since shear began.

    Returns
    -------
    Dataset
        Along stage and effect: dissipated_energy [J] and share [1] of it. The share is nan in a stage without losses.

    Raises
    ------
    InputError
        If the run has no stages or no dissipated energy.
    """
    import xarray

    run = part_of(run, "run")
    missing = [name for name in ("stage", "dissipated_energy") if name not in run.variables]
    if missing or run.sizes["time"] < 2:
        raise InputError(f"run: has no {', '.join(missing) or 'two rows'}, must be the run.nc of a layer")
    # What a row lost is its energy less that of the row before, which may be of another stage.
    lost, stage = np.diff(np.asarray(run.dissipated_energy, float), axis=0), np.asarray(run.stage)[1:]
    names = list(dict.fromkeys(stage.tolist()))
    sums = np.stack([lost[stage == name].sum(axis=0) for name in names])
    total = sums.sum(axis=1, keepdims=True)
    share = np.divide(sums, total, out=np.full_like(sums, np.nan), where=total > 0.0)
    return xarray.Dataset(
        {
            "dissipated_energy": (("stage", "effect"), sums, {"units": "J", "long_name": "energy dissipated in it"}),
            "share": (("stage", "effect"), share, {"units": "1", "long_name": "share of the dissipated energy"}),
        },
        {"stage": names, "effect": np.asarray(run.effect_name if "effect_name" in run else run.effect)},
    )


def _change(values: "DataArray") -> npt.NDArray[np.float64]:
    """Last row less first row."""
    array = np.asarray(values, float)
    return array[-1] - array[0]


def _shares(rows: "Dataset") -> list[Estimate]:
    """The share of each effect as the ratio of the means of what rows dissipated, with its error."""
    lost = rows.dissipated_energy.diff("time")
    if lost.sizes["time"] < LEAST_SAMPLES:
        return [Estimate(math.nan, math.nan)] * lost.sizes["effect"]
    total, first = lost.sum("effect"), float(lost.shear_strain.min())
    return [steady_ratio(lost.isel(effect=i), total, first) for i in range(lost.sizes["effect"])]
