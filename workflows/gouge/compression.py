"""Levels of the normal stress of a layer that is compressed: void ratio, breakage, and where it yields."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflows.common.run_table import write_result
from workflows.protocol.stage_tables import RESERVED

if TYPE_CHECKING:
    import xarray

FILE = "compression.nc"
LEAST_LEVELS = 5  # through which two straight lines are laid
MEETINGS = 400  # stresses at which two lines may meet, which are tried
STEEPER = 1.5  # how much steeper than the first line the second one must be
LEAST_FALL = 0.01  # of the second line per unit of x
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


def two_lines(x: NDArray, y: NDArray) -> tuple[float, float, float]:
    """Where two straight lines through points meet, and their slopes: (x of the meeting, first slope, second slope).

    y = y_0 + a (x - x_0) + (b - a) max(0, x - x_0), by least squares for each of many x_0; the best of them is taken.

    Raises
    ------
    NeverYields
        For fewer than 5 points, and if the second line falls by less than 0.01 per unit, or is less than 1.5 times as
        steep as the first.
    """
    if len(x) < LEAST_LEVELS:
        raise NeverYields(f"{len(x)} levels with the consolidation, at least {LEAST_LEVELS} are needed")
    inner = np.sort(x)[1:-1]
    fits = []
    for meeting in np.linspace(inner[0], inner[-1], MEETINGS):
        design = np.stack([np.ones_like(x), np.minimum(x - meeting, 0.0), np.maximum(x - meeting, 0.0)], axis=1)
        coefficients = np.linalg.lstsq(design, y)[0]
        fits.append((float(np.sum((design @ coefficients - y) ** 2)), meeting, coefficients))
    _, meeting, (_, before, after) = min(fits, key=lambda fit: fit[0])
    if not after < min(-LEAST_FALL, STEEPER * before):
        raise NeverYields("the void ratio does not fall faster from some stress on: raise --stress-ratio")
    return float(meeting), float(before), float(after)
