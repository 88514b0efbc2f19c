"""Levels of the normal stress of a layer that is compressed: void ratio, breakage, and where it yields."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from workflows.common.run_table import write_result
from workflows.protocol.stage_tables import RESERVED

if TYPE_CHECKING:
    import xarray

FILE = "compression.nc"
LEAST_LEVELS = 7  # through which two straight lines are laid
MEETINGS = 400  # stresses at which two lines may meet, which are tried
STEEPER = 1.5  # how much steeper than the first line the second one must be
LEAST_FALL = 0.01  # of the second line per unit of x
ONE_LINE = 0.01  # chance by the F test, with the meeting as a free number, at which one line is taken to do as well
COLUMNS = {  # name: (unit, meaning)
    "normal_stress": ("Pa", "normal stress on the top platen, mean of the last quarter of the level"),
    "void_ratio": ("1", "volume of voids over that of mobile grains, mean of the last quarter of the level"),
    "layer_thickness": ("m", "distance between the platens, likewise"),
    "broken_share": ("1", "share of the bonds that have broken"),
    "fragment_count": ("1", "fragments of the mobile grains"),
    "fracture_area": ("m2", "area of the broken bonds"),
    "external_work": ("J", "work of the drives since the start"),
}


class NeverYields(ValueError):
    """Void ratios that do not fall on two lines, the second one steeper."""


def levels_of(run: xarray.Dataset) -> xarray.Dataset:
    """Dimension level: the consolidation, then each stage; what has no bonds has no columns of them.

    run: what `open_run` gives of the run.nc of a layer.
    """
    import xarray

    names = [name for name in dict.fromkeys(run.stage.values.tolist()) if name != RESERVED[0]]
    rows = [_level(run.isel(time=run.stage.values == name), run) for name in names]
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    data = {n: ("level", columns[n], {"units": u, "long_name": w}) for n, (u, w) in COLUMNS.items() if n in columns}
    number = (
        "level",
        np.arange(len(names)),
        {"units": "1", "long_name": "number of the level, 0 of the consolidation"},
    )
    return xarray.Dataset(data, {"level": number})


def _level(stage: xarray.Dataset, run: xarray.Dataset) -> dict[str, Any]:
    """Columns of one level."""
    last = stage.isel(time=slice(-max(1, stage.sizes["time"] // 4), None))
    porosity = float(last.porosity.mean())
    found = {
        "normal_stress": float(last.platen_normal_stress.mean()),
        "void_ratio": porosity / (1.0 - porosity),
        "layer_thickness": float(last.layer_thickness.mean()),
        "external_work": float(stage.external_work[-1]),
    }
    if "bond_count" in run:
        found["broken_share"] = 1.0 - float(stage.bond_count[-1]) / float(run.bond_count[0])
        found |= {name: float(stage[name][-1]) for name in ("fragment_count", "fracture_area")}
    return found


def write_levels(out: Path, levels: xarray.Dataset, params: Any) -> None:
    """Write compression.nc."""
    title = "Compression of a layer that cannot widen"
    summary = "One row per level of the normal stress, the first of the consolidation: void ratio and breakage."
    write_result(out / FILE, levels, params, title, summary)


class TwoLines(NamedTuple):
    """Two straight lines that meet at an x: the meeting, and the slopes before and after it, with their errors."""

    meeting: lsm.statistics.Estimate
    before: lsm.statistics.Estimate
    after: lsm.statistics.Estimate


def yield_of(levels: xarray.Dataset) -> TwoLines:
    """The two lines of the void ratio against the decimal logarithm of the normal stress [Pa].

    Raises
    ------
    NeverYields
        As `two_lines`, and for layers in which no bond broke: contacts that are pressed together also bend the curve.
    """
    if "broken_share" not in levels:
        raise NeverYields("grains that are not --breakable do not yield")
    if not levels.broken_share.values[-1] > levels.broken_share.values[0]:
        raise NeverYields("no bond broke in the levels: raise --stress-ratio, or lower --bond-strength")
    return two_lines(np.log10(levels.normal_stress.values), levels.void_ratio.values)


def two_lines(x: NDArray, y: NDArray) -> TwoLines:
    """Where two straight lines through points meet, and their slopes.

    y = y_0 + a min(0, x - x_0) + b max(0, x - x_0), by least squares for each of many x_0; the best of them is taken.
    Errors are those of least squares in all four, with the scatter about the lines and n - 4 degrees of freedom.

    Raises
    ------
    NeverYields
        For fewer than 7 points; if one line does as well, by the F test; if the lines meet within the first or the
        last interval; and if the second falls by less than 0.01 per unit, or less than 1.5 times as steeply as the
        first.
    """
    from scipy.stats import f

    def fitted(meeting: float) -> tuple[float, NDArray, NDArray]:
        below, beyond = np.minimum(x - meeting, 0.0), np.maximum(x - meeting, 0.0)
        design = np.stack([np.ones(n), below, beyond], axis=1)
        found = np.linalg.lstsq(design, y)[0]
        return float(np.sum((design @ found - y) ** 2)), found, design

    n, inner = len(x), np.sort(x)[1:-1]
    if n < LEAST_LEVELS:
        raise NeverYields(f"{n} levels with the consolidation, at least {LEAST_LEVELS} are needed")
    tried = np.linspace(inner[0], inner[-1], MEETINGS)
    meeting = min(tried.tolist(), key=lambda trial: fitted(trial)[0])
    scatter, found, design = fitted(meeting)
    _, before, after = found
    straight = float(np.sum((np.polyval(np.polyfit(x, y, 1), x) - y) ** 2))
    one_line = straight - scatter < scatter * 3.0 / (n - 4) * f.isf(ONE_LINE, 3, n - 4)
    if one_line or not after < min(-LEAST_FALL, STEEPER * before):
        raise NeverYields("the void ratio does not fall faster from some stress on: raise --stress-ratio or --levels")
    if not inner[0] < meeting < inner[-1]:
        raise NeverYields("it bends in the first or the last interval: change --normal-stress or --stress-ratio")
    # One step of Gauss and Newton in all four moves the meeting from the best trial to where the scatter is least.
    jacobian = np.column_stack([design, np.where(x < meeting, -before, -after)])
    meeting += float(np.linalg.lstsq(jacobian, y - design @ found)[0][3])
    scatter, (_, before, after), _ = fitted(meeting)
    errors = np.sqrt(scatter / (n - 4) * np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    values = zip((meeting, before, after), errors[[3, 1, 2]], strict=True)
    return TwoLines(*(lsm.statistics.Estimate(float(v), float(e), n, n - 4.0) for v, e in values))
