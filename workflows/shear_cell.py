"""Shear a periodic cell of grains homogeneously, without walls, at constant normal stress or constant volume.

The cell deforms affinely: its images move with the shear, and a servo moves its height, and the grains with it, to keep
the normal stress. What is measured belongs to the bulk: there are no platens, no profile and no layering at a wall.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from workflows.cell import cell_scene
from workflows.cell.cell_metrics import BOUNDS, REMEDIES, analyse
from workflows.cell.cell_run import Cell
from workflows.cell.cell_scene import build
from workflows.cell.parameters import CellParams as Params
from workflows.common.metrics import Metric
from workflows.common.reports import Progress
from workflows.common.run_folder import Existing
from workflows.gouge.layer_cost import layer_cost
from workflows.gouge.layer_run import LayerExperiment, run_layer
from workflows.gouge.layer_scene import effects_of
from workflows.plots import cell_plots

if TYPE_CHECKING:
    import xarray

__all__ = ["BOUNDS", "REMEDIES", "Params", "analyse", "build", "check", "effects_of", "estimate", "run"]


def _conclude(dataset: xarray.Dataset, params: Params, out: Path) -> dict[str, Metric]:
    """Metrics and picture of a run whose rows are all written."""
    metrics = analyse(dataset, params)
    cell_plots.plot_cell(out, params.format)
    return metrics


SHEAR = LayerExperiment("shear-cell", _conclude, frozenset({"strain"}), frozenset({"steady_from"}), Cell())
RESUMABLE = SHEAR.resumable  # parameters that may change in a run that goes on
check, estimate = cell_scene.check, layer_cost


def run(
    params: Params, out: str | os.PathLike[str], progress: Progress | None = None, existing: Existing = "refuse"
) -> xarray.Dataset:
    """As `shear_gouge.run`, of a cell; writes run.nc, grains.nc, run.png, summary.json; returns run.nc."""
    check(params)
    return run_layer(SHEAR, None, params, out, progress, existing)
