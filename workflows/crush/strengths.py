"""Strengths of crushed grains: when each splits, their mean and their Weibull modulus; the file crush.nc."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from workflows.common.metrics import Metric, metrics_of_value
from workflows.common.run_table import write_result

if TYPE_CHECKING:
    import xarray

    from workflows.crush_grain import Params

FILE = "crush.nc"
SPLIT = 0.8  # of the mass of a grain: once its largest fragment has less, it has split; before, corners came off
LEAST_SPLIT = 5  # grains of which the Weibull modulus is told
CLOSED = 1e-3  # claimed of the energy residual over the work of the platen
ROWS = {  # of a row: unit, meaning
    "work": ("J", "work of the upper platen"),
    "elastic_energy": ("J", "energy in contacts and bonds"),
    "kinetic_energy": ("J", "kinetic energy"),
    "dissipated_energy": ("J", "energy dissipated by all effects"),
    "fracture_energy": ("J", "energy dissipated by broken bonds"),
    "energy_residual": ("J", "what the budget of these leaves open"),
}
OF_GRAINS = {  # of a grain in a row
    "force": ("N", "force on the upper platen"),
    "fragments": ("1", "number of fragments"),
    "largest_share": ("1", "share of the mass in the largest fragment"),
}


def section_of(params: Params) -> float:
    """Area [m2] by which a force F is divided: sigma = F/h^2 in 3D, 2 F/(pi h T) with T = h in 2D, h the height.

    Jaeger (1967), Int. J. Rock Mech. Min. Sci. 4, 219, for irregular grains; the Brazilian test for discs.
    """
    return params.height**2 * (1.0 if params.dim == 3 else 0.5 * float(np.pi))


def strengths_of(force: NDArray, largest_share: NDArray) -> tuple[NDArray, NDArray]:
    """Greatest force (grain,) [N] that each grain bears until it splits, and the row of it; nan and -1 if it does not.

    force [N], largest_share [1], of the mass in the largest fragment: (row, grain). Pieces that are left between the
    platens may bear more than the grain did: they do not count.
    """
    most = np.maximum.accumulate(force, axis=0)
    failed = largest_share < SPLIT
    row = np.where(failed.any(axis=0), np.argmax(failed, axis=0), -1)
    grains = np.arange(force.shape[1])
    peak = np.array([int(np.argmax(force[: r + 1, g])) if r >= 0 else -1 for g, r in zip(grains, row, strict=True)])
    return np.where(row >= 0, most[row, grains], np.nan), peak


class Weibull(NamedTuple):
    """Weibull's law of strengths, P(s) = 1 - exp(-(s/s_0)^m): modulus m [1] and mean [Pa] with errors, and s_0 [Pa]."""

    modulus: lsm.statistics.Estimate
    mean: lsm.statistics.Estimate
    scale: float


def weibull_of(strengths: NDArray, borne: NDArray | None = None) -> Weibull | None:
    """Weibull's law by maximum likelihood; None for fewer than 5 strengths, or if all are equal.

    Parameters
    ----------
    strengths
        Of the n grains that split (n,) [Pa].
    borne
        What the others bore without (k,) [Pa]; they are at least as strong.

    Notes
    -----
    With z = (s/s_0)^m and L = ln(s/s_0) of all n + k, m solves 1/m = sum z L/sum z - <ln(s/s_0)> of those that split,
    and sum z = n. The errors are those of the observed information of (ln s_0, m), [[m^2 n, -m sum z L], [., n/m^2 +
    sum z L^2]]. m is too large by about 1.4 m/n, which is taken off (Thoman, Bain & Antle 1969, Technometrics 11, 445).
    """
    from scipy.special import digamma, gamma
    from scipy.stats import CensoredData, weibull_min

    n, unit = len(strengths), float(np.mean(strengths)) if len(strengths) else 1.0
    if n < LEAST_SPLIT or np.ptp(strengths) < 1e-9 * unit:
        return None
    rest = np.zeros(0) if borne is None else borne / unit
    fitted: Any = weibull_min.fit(CensoredData(uncensored=strengths / unit, right=rest), floc=0.0)
    m, scale = float(fitted[0]), float(fitted[2])
    log = np.log(np.concatenate([strengths / unit, rest]) / scale)
    z = np.exp(m * log)
    cross = -m * float(z @ log)
    covariance = np.linalg.inv([[m**2 * n, cross], [cross, n / m**2 + float(z @ log**2)]])
    slope = np.array([1.0, -float(digamma(1.0 + 1.0 / m)) / m**2])  # of the logarithm of the mean
    mean = unit * scale * float(gamma(1.0 + 1.0 / m))
    less = 1.0 / (1.0 + 1.4 / n)
    return Weibull(
        lsm.statistics.Estimate(m * less, float(np.sqrt(covariance[1, 1])) * less, n, n - 1.0),
        lsm.statistics.Estimate(mean, mean * float(np.sqrt(slope @ covariance @ slope)), n, n - 1.0),
        unit * scale,
    )


def split_and_borne(dataset: xarray.Dataset, params: Params) -> tuple[NDArray, NDArray]:
    """Strengths [Pa] of the grains that split, and the greatest stress [Pa] that each other one bore until the end."""
    strength, most = dataset.strength.values, dataset.force.values.max(axis=0) / section_of(params)
    split = np.isfinite(strength)
    return strength[split], most[~split]


def write_crushing(out: Path, columns: dict[str, NDArray], params: Params, dt: float) -> xarray.Dataset:
    """Write crush.nc and return it; columns: rows as `crush_grain.press` gives them, dt: time step [s]."""
    import xarray

    along = columns["time"] * params.speed * np.sqrt(params.youngs_modulus / params.density) / params.height
    strength, peak = strengths_of(columns["force"], columns["largest_share"])
    data = {n: ("row", columns[n], {"units": u, "long_name": w}) for n, (u, w) in ROWS.items()}
    data |= {n: (("row", "grain"), columns[n], {"units": u, "long_name": w}) for n, (u, w) in OF_GRAINS.items()}
    words = "greatest force until the grain split, over its section; nan if it did not"
    data["strength"] = ("grain", strength / section_of(params), {"units": "Pa", "long_name": words})
    data["peak_row"] = ("grain", peak, {"units": "1", "long_name": "row of that force, -1 if the grain did not split"})
    coords = {
        "time": ("row", columns["time"], {"units": "s", "long_name": "time"}),
        "compression": ("row", along, {"units": "1", "long_name": "way of the platen over the height of a grain"}),
    }
    title = "Crushing of single grains"
    summary = "Each grain on its own between two platens, the upper one moving down."
    write_result(out / FILE, xarray.Dataset(data, coords), params, title, summary, dt)
    return lsm.open_run(out / FILE)


def analyse(dataset: xarray.Dataset, params: Params) -> dict[str, Metric]:
    """Metrics of crushed grains, in docs/breakable-grains.md."""
    failed, borne = split_and_borne(dataset, params)
    metrics = {
        "grains_split": Metric(len(failed), "1", note=f"of {len(failed) + len(borne)}"),
        **_strengths(failed, borne, params),
        "fragments": Metric(float(dataset.fragments.values[-1].mean()), "1", note="mean of a grain at the end"),
        "fracture_share": Metric(
            float(dataset.fracture_energy.values[-1] / dataset.work.values[-1]),
            "1",
            note="of broken bonds over the work of the platen, at the end",
        ),
    }
    closed = float(np.abs(dataset.energy_residual.values).max() / np.abs(dataset.work.values).max())
    remedy = "work, storage and losses do not balance: lower --step-safety"
    note = "greatest residual over the work of the platen"
    return metrics | {"energy_residual": Metric(closed, "1", CLOSED, closed < CLOSED, note=note, remedy=remedy)}


def _strengths(failed: NDArray, borne: NDArray, params: Params) -> dict[str, Metric]:
    """Mean strength, also over that of the bonds, and the Weibull modulus, with their errors."""
    n, law = len(failed), weibull_of(failed, borne)
    few = f"unknown: {n} split, at least {{}} are needed: raise --grains or --compression"
    if n < 2 or (len(borne) and law is None):
        few = few.format(2 if n < 2 else f"{LEAST_SPLIT} of unequal strengths, or all,")
        units = {"strength": "Pa", "strength_ratio": "1", "weibull_modulus": "1"}
        return {name: Metric(None, unit, note=few) for name, unit in units.items()}
    found = lsm.statistics.Estimate(float(failed.mean()), float(failed.std(ddof=1) / np.sqrt(n)), n, n - 1.0)
    words = "mean of the grains"
    if len(borne) and law:  # the mean of those that split would be that of the weaker ones
        found, words = law.mean, f"mean of Weibull's law, of which {len(borne)} grains that did not split are a part"
    ratio = found._replace(
        mean=found.mean / params.tensile_strength, standard_error=found.standard_error / params.tensile_strength
    )
    return {
        **metrics_of_value("strength", found, "Pa", words),
        **metrics_of_value("strength_ratio", ratio, "1", "the same over the tensile strength of the bonds"),
        **(
            metrics_of_value("weibull_modulus", law.modulus, "1", "of the strengths of the grains")
            if law
            else {"weibull_modulus": Metric(None, "1", note=few.format(f"{LEAST_SPLIT} of unequal strengths"))}
        ),
    }
