"""What a layer does in a hold and after it: relaxation, compaction, peak; and how these grow with its time."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from workflows.gouge.layer_metrics import sheared_rows

if TYPE_CHECKING:
    import xarray

RUN_IN, HOLD, RELOAD = "run-in", "hold", "reload"
STEADY_FROM = 0.5  # of the strain of the run-in, from which on it counts as steady
SMOOTH = 0.05  # slip over which friction is averaged where its peak is looked for [d]
POINTS = 10  # of such a slip, on which it is

COLUMNS = [
    lsm.Variable("seed", ("run",), "i32", "1", "seed of the packing"),
    lsm.Variable("hold_time", ("run",), "f64", "s", "time of the hold; 0 of the run without one"),
    lsm.Variable("hold_inertial_times", ("run",), "f64", "1", "the same in inertial times"),
    lsm.Variable("steady_friction", ("run",), "f64", "1", "friction at the platen before the hold"),
    lsm.Variable("peak_friction", ("run",), "f64", "1", "greatest friction at the platen after the hold"),
    lsm.Variable("peak_slip", ("run",), "f64", "m", "slip after the hold at which that is"),
    lsm.Variable("healing", ("run",), "f64", "1", "peak_friction less steady_friction"),
    lsm.Variable("held_friction", ("run",), "f64", "1", "friction at the platen at the end of the hold"),
    lsm.Variable("relaxation", ("run",), "f64", "1", "steady_friction less held_friction"),
    lsm.Variable("compaction", ("run",), "f64", "1", "porosity at the begin of the hold less that at its end"),
]


class Healing(NamedTuple):
    """How the response grows with the hold.

    Parameters
    ----------
    hold
        (hold,) times [t_i].
    mean, error
        (hold,) healing, mean over the seeds [1], and its standard error without what is common to all holds of a seed.
    without_hold
        Mean healing of the runs without a hold [1]: what the peak of noise is.
    line
        Line through healing against the logarithm of the hold.
    others
        Name -> (estimate [1], words) of what else is told.
    """

    hold: NDArray
    mean: NDArray
    error: NDArray
    without_hold: float
    line: lsm.statistics.Healing
    others: dict[str, tuple[lsm.statistics.Estimate, str]]


def response_to_hold(dataset: xarray.Dataset, diameter: float, within: float) -> dict[str, float]:
    """{column: value} of one run; nan where it has not come so far.

    The peak is looked for within a slip after the hold, in diameters [m]: later ones are those of noise.
    """
    run = sheared_rows(dataset)
    found = dict.fromkeys([c.name for c in COLUMNS if c.dtype == "f64" and not c.name.startswith("hold")], np.nan)
    friction = (run.platen_shear_stress / run.platen_normal_stress).values
    stage = run.stage.values
    if not (stage == RELOAD).any() or dataset.run_status != "complete":
        return found
    strain = run.shear_strain.values
    before = (stage == RUN_IN) & (strain >= STEADY_FROM * strain[stage == RUN_IN].max())
    found["steady_friction"] = steady = float(
        run.platen_shear_stress.values[before].sum() / run.platen_normal_stress.values[before].sum()
    )
    slip, curve = reload_curve(run, diameter)
    peak = int(np.argmax(curve[slip <= within * diameter]))
    found |= {
        "peak_friction": float(curve[peak]),
        "peak_slip": float(slip[peak]),
        "healing": float(curve[peak]) - steady,
    }
    if (stage == HOLD).any():
        held, porosity = float(friction[stage == HOLD][-1]), run.porosity.values
        begin = int(np.flatnonzero(stage == HOLD)[0]) - 1
        found |= {"held_friction": held, "relaxation": steady - held}
        found["compaction"] = float(porosity[begin] - porosity[stage == HOLD][-1])
    return found


def reload_curve(run: xarray.Dataset, diameter: float) -> tuple[NDArray, NDArray]:
    """(slip since the hold [m], friction at the platen averaged over a small slip) of the rows after the hold."""
    own = np.flatnonzero(run.stage.values == RELOAD)
    moved = run.displacement.values - run.displacement.values[own[0] - 1]
    middle = 0.5 * (moved[own] + moved[own - 1])
    friction = (run.platen_shear_stress / run.platen_normal_stress).values[own]
    far = float(moved[own].max())
    slip = np.linspace(0.0, far, max(2, round(POINTS * far / (SMOOTH * diameter))))
    curve = np.interp(slip, *_rising(middle, friction))
    width = max(1, round(SMOOTH * diameter / (slip[1] - slip[0])))
    kernel = np.ones(width)
    return slip, np.convolve(curve, kernel, "same") / np.convolve(np.ones(slip.size), kernel, "same")


def _rising(slip: NDArray, friction: NDArray) -> tuple[NDArray, NDArray]:
    """Rows in the order of their slip, which a spring may turn back for a moment."""
    order = np.argsort(slip, kind="stable")
    return slip[order], friction[order]


def healing_of(table: xarray.Dataset) -> Healing | None:
    """How the response grows with the hold, from the seeds all of whose runs are complete; None for fewer than two."""
    seeds = np.unique(table.seed.values)
    holds = np.unique(table.hold_inertial_times.values)
    columns = ("healing", "relaxation", "compaction", "steady_friction")
    values = {name: _by_seed(table, name, seeds, holds) for name in columns}
    whole = np.isfinite(values["healing"]).all(axis=1)
    if whole.sum() < 2:
        return None
    healing, times = values["healing"][whole], holds[holds > 0.0]
    held = healing[:, holds > 0.0]
    # What all holds of a seed share, such as its steady friction, does not blur how healing grows with the hold.
    rest = held - held.mean(axis=1, keepdims=True) - held.mean(axis=0) + held.mean()
    count, freedom = len(held), (len(held) - 1) * (held.shape[1] - 1)
    error = float(np.sqrt((rest**2).sum() / freedom / count))
    line = lsm.statistics.healing_rate(times, held.mean(axis=0), np.full(len(times), error))
    # The error is that of a scatter with so many degrees of freedom, by which the intervals are wider.
    line = line._replace(
        **{
            name: getattr(line, name)._replace(degrees_of_freedom=float(freedom))
            for name in ("per_e_fold", "per_decade", "at_unit_time")
        }
    )
    decades = np.log10(times)
    others = {}
    for name, words in (
        ("relaxation", "friction lost in a hold, per factor of ten of it"),
        ("compaction", "porosity lost in a hold, per factor of ten of it"),
    ):
        slopes = np.polyfit(decades, values[name][whole][:, holds > 0.0].T, 1)[0]
        others[f"{name}_per_decade"] = _over_seeds(slopes), words
    steady = _over_seeds(values["steady_friction"][whole][:, 0])
    others["steady_friction"] = steady, "friction at the platen before the hold, mean over the seeds"
    slopes = _over_seeds(np.polyfit(decades, held.T, 1)[0])
    others["healing_per_decade_of_seeds"] = slopes, "mean of the slopes of the seeds, with the error of their scatter"
    alone = healing[:, holds == 0.0]
    return Healing(times, held.mean(axis=0), np.full(len(times), error), float(alone.mean()), line, others)


def _over_seeds(values: NDArray) -> lsm.statistics.Estimate:
    """Mean over the seeds (n,), whose own errors are not known: that two of them agree may be chance."""
    return lsm.statistics.combine_replicas(values, np.full(len(values), np.nan))


def _by_seed(table: xarray.Dataset, name: str, seeds: NDArray, holds: NDArray) -> NDArray:
    """(seed, hold) values of a column; nan where there is none."""
    found = np.full((len(seeds), len(holds)), np.nan)
    rows = np.searchsorted(seeds, table.seed.values), np.searchsorted(holds, table.hold_inertial_times.values)
    found[rows] = table[name].values
    return found
