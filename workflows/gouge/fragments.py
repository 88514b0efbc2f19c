"""What has become of breakable grains in a run: the file fragments.nc, its metrics, and the figure of both."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import taichi_lsm as lsm
from workflows.common.metrics import Metric, metrics_of_value
from workflows.common.run_table import write_result
from workflows.gouge.layer_metrics import sheared_rows
from workflows.gouge.layer_parameters import LayerParams
from workflows.plots.fragments import UNLIKELY, plot_fragments

if TYPE_CHECKING:
    import xarray

FILE = "fragments.nc"


def conclude_fragments(dataset: xarray.Dataset, params: LayerParams, out: Path) -> dict[str, Metric]:
    """Write fragments.nc and draw fragments.png of a run of breakable grains; returns their metrics.

    dataset: its run.nc; {} for whole grains, and for files of a version that did not store the areas of bonds.
    """
    if "fracture_area" not in dataset:
        return {}
    fragments = lsm.fragment_catalogue(lsm.open_run(out / "grains.nc"))
    write_fragments(out / FILE, fragments, params)
    plot_fragments(out / f"fragments.{params.format}", dataset, fragments, size_range(params))
    return fragment_metrics(dataset, fragments, params)


def write_fragments(path: Path, fragments: xarray.Dataset, params: LayerParams) -> None:
    """Write fragments.nc."""
    summary = "One row per fragment and snapshot: mass, size, shape, and the surface that broken bonds have left on it."
    write_result(path, fragments, params, "Fragments of breakable grains", summary)


def size_range(params: LayerParams) -> tuple[float, float]:
    """Sizes [m] between which fragments may follow a power law: from a mean piece to the largest grain."""
    return params.diameter / params.pieces_across, params.largest_diameter


def fragment_metrics(run: xarray.Dataset, fragments: xarray.Dataset, params: LayerParams) -> dict[str, Metric]:
    """Metrics of the last snapshot and of the new surface, in docs/breakable-grains.md."""
    last = fragments.isel(fragment=fragments.snapshot.values == fragments.snapshot.values[-1])
    sizes = last.diameter.values
    metrics = {
        "fragment_diameter": Metric(
            float(np.average(sizes, weights=last.mass.values)) / params.diameter,
            "1",
            note="mean size of the fragment to which mass belongs, in mean diameters of the grains, at the end",
        ),
        "fragment_elongation": Metric(
            float(last.elongation.mean()),
            "1",
            note=f"mean of {'intermediate' if 'flatness' in last else 'shortest'} over longest axis at the end",
        ),
        **_dimension(sizes, params),
    }
    sheared = sheared_rows(run)
    area, lost = sheared.fracture_area.values, _lost_in_bonds(sheared)
    surface = 2.0 * float(area[-1] - area[0])
    metrics["new_surface"] = Metric(surface, "m2", note="both sides of the bonds broken since shear began")
    metrics["surface_energy"] = Metric(
        lost / surface if surface else None,
        "J m-2",
        note="dissipated by the bonds broken since shear began over the new surface" + "; none broke" * (not surface),
    )
    work = float(sheared.work_throughput[-1])
    metrics["fracture_share"] = Metric(
        lost / work if work else None, "1", note="of the throughput of work since shear began"
    )
    return metrics


def _dimension(sizes: np.ndarray, params: LayerParams) -> dict[str, Metric]:
    """Fractal dimension of the sizes at the end, or why it is unknown."""
    note = "of N(>d) ~ d^-D from a mean piece to the largest grain, at the end"
    try:
        found = lsm.statistics.fragment_dimension(sizes, *size_range(params))
    except lsm.InputError as error:
        return {"fractal_dimension": Metric(None, "1", note=f"unknown: {error}")}
    return metrics_of_value("fractal_dimension", found.dimension, "1", note) | {
        "fractal_misfit": Metric(
            found.distance,
            "1",
            note=f"Kolmogorov's distance to that law; above {UNLIKELY / np.sqrt(found.fragments):.2g} it does not hold",
        )
    }


def _lost_in_bonds(sheared: xarray.Dataset) -> float:
    """Energy [J] that bonds dissipated since shear began, less that of the contacts which began as they broke."""
    of_bonds = {row.effect for row in lsm.read_effects(sheared) if row.role == "bonds"}
    column = [str(name) in of_bonds for name in sheared.effect_name.values]
    lost = sheared.dissipated_energy.values[:, column].sum(axis=1)
    return float(lost[-1] - lost[0])
