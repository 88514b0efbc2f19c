"""What patches gain over clumps: shape error, surface roughness, friction and cost at the same outline (2D).

Abe & Mora (2003) say that clumps of spheres tie the roughness of the surface to the number of spheres and patches do
not. Rounded polygons are represented by chains of arcs and by clumps of equal discs; both are compared with the
polygon, and sheared in the same layer.
"""

from __future__ import annotations

import functools
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

import taichi_lsm as lsm
from workflows import shear_gouge
from workflows.common import signals
from workflows.common.child_reports import child_reports
from workflows.common.fresh_processes import in_fresh_process
from workflows.common.metrics import Metric, metrics_of_estimate, number, write_summary
from workflows.common.parameter_files import CONFIG
from workflows.common.parameters import Params as BaseParams
from workflows.common.refusals import checked
from workflows.common.reports import Progress
from workflows.common.run_cost import RunCost, of_replicas
from workflows.common.run_folder import Existing
from workflows.common.run_table import Rows, write_runs
from workflows.plots.roughness import plot_roughness
from workflows.protocol.finished_parts import FinishedParts, folder_of_parts

if TYPE_CHECKING:
    import shapely
    import xarray

COUNTS = (12, 18, 30, 60, 120)  # patches or discs per grain
SIDES = 6
WIDTH = 6.0  # degrees: half-angle of a side's arc times (arcs of a corner + 1)
FLATTEST = 60.0  # radius of a side's arc, in diameters
COLUMNS = (
    lsm.Variable("elements", ("run",), "i32", "1", "patches or discs per grain"),
    lsm.Variable("shape_error", ("run",), "f64", "1", "greatest distance from the outline, in diameters"),
    lsm.Variable("roughness", ("run",), "f64", "1", "rms distance from the outline, in diameters"),
    lsm.Variable("friction_mean", ("run",), "f64", "1", "steady friction of the layer"),
    lsm.Variable("friction_se", ("run",), "f64", "1", "its standard error, nan if it is unknown"),
    lsm.Variable("friction_ess", ("run",), "f64", "1", "number of independent samples in it"),
    lsm.Variable("cost", ("run",), "f64", "s", "time per grain and step"),
)


FRICTION = ("friction_mean", "friction_se", "friction_ess")
FIT = 0.03  # time to fit an outline, per disc [s]
FARTHEST = 10.0  # times as many discs as are fitted to which the error is extrapolated


class Params(BaseParams):
    """Comparison of patches with clumps."""

    corner_radius: float = Field(
        default=0.05, ge=0.02, le=0.25, description="corner radius of the polygons [equivalent diameters]"
    )
    outlines: int = Field(default=4, ge=1, le=100, description="different polygons [1]")
    most_elements: int = Field(
        default=COUNTS[-1],
        ge=30,
        le=COUNTS[-1],
        description="most patches or discs per grain whose outlines are fitted [1]",
    )
    most_sheared: int = Field(
        default=60,
        ge=12,
        le=COUNTS[-1],
        description="most of those fitted of which layers are sheared [1]",
    )
    layer_thickness: float = Field(default=12.0, ge=8, le=1e4, description="thickness of the layer [mean diameters]")
    length: float = Field(default=14.0, ge=6, le=1e5, description="periodic length along the shear [mean diameters]")
    inertial_number: float = Field(default=5e-3, ge=1e-9, le=0.1, description="I = shear rate d sqrt(rho/P) [1]")
    strain: float = Field(
        default=3.0, ge=1.12, le=1e4, description="shear strain to reach, of which the part beyond 1 is averaged [1]"
    )

    presets: ClassVar[dict[str, dict]] = {
        "smoke": {
            "outlines": 1,
            "most_elements": 30,
            "most_sheared": 12,
            "layer_thickness": 8.0,
            "length": 8.0,
            "strain": 1.2,
            "inertial_number": 2e-2,
        },
        "demo": {"most_sheared": 30, "layer_thickness": 10.0, "length": 10.0, "strain": 2.0},
        "standard": {},
        "reference": {"most_sheared": 120, "length": 30.0, "strain": 5.0, "inertial_number": 1e-3},
    }


def check(params: Params) -> None:
    """Refuse parameters that are sure to fail, before any layer is made.

    Raises
    ------
    InputError
        With the option, its value, what is allowed and what to do.
    """
    shear_gouge.check(layer_params(params))


def estimate(params: Params) -> RunCost:
    """Expected steps, time and memory of the fits and of the layers, which run one after the other."""
    layers = of_replicas([shear_gouge.estimate(layer_params(params))] * (2 * len(sheared_counts(params))), 1)
    return replace(layers, seconds=layers.seconds + FIT * params.outlines * sum(counts(params)))


def counts(params: Params) -> list[int]:
    """Patches or discs per grain whose outlines are fitted [1]."""
    return [count for count in COUNTS if count <= params.most_elements]


def sheared_counts(params: Params) -> list[int]:
    """Those of which layers are sheared [1]."""
    return [count for count in counts(params) if count <= params.most_sheared]


def layer_params(params: Params) -> shear_gouge.Params:
    """Parameters of the sheared layers, whose grains get other shapes."""
    return checked(
        shear_gouge.Params,
        shape="angular",
        seed=params.seed,
        corner_radius=params.corner_radius,
        layer_thickness=params.layer_thickness,
        length=params.length,
        inertial_number=params.inertial_number,
        strain=params.strain,
        arch=params.arch,
        precision=params.precision,
        threads=params.threads,
        format=params.format,
    )


def polygons(params: Params) -> list[tuple[NDArray, shapely.Polygon]]:
    """Vertices (SIDES, 2) of convex polygons of equivalent diameter about 1, and their rounded outlines (shapely)."""
    import shapely

    rng = np.random.default_rng(params.seed)
    result = []
    for _ in range(params.outlines):
        angle = (np.arange(SIDES) + rng.uniform(-0.25, 0.25, SIDES)) * 2.0 * np.pi / SIDES
        vertices = 0.55 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        r = params.corner_radius
        body = shapely.Polygon(vertices).buffer(-r, join_style="mitre", mitre_limit=50).buffer(r, quad_segs=256)
        result.append((vertices, body))
    return result


def patch_shape(vertices: NDArray, elements: int, corner_radius: float) -> Any:
    """The polygon as a chain of `elements` arcs; not rescaled."""
    per_corner = elements // SIDES - 1
    return lsm.shapes.from_polygon(
        vertices,
        corner_radius,
        np.radians(WIDTH / (per_corner + 1)),
        per_corner,
        largest_radius=FLATTEST,
        normalise=False,
        name=f"{elements} patches",
    )


@functools.lru_cache(maxsize=32)
def clump_shape(vertices: tuple[tuple[float, float], ...], elements: int, corner_radius: float) -> Any:
    """The polygon as a clump of `elements` equal discs; remembered, as a fit takes seconds; not rescaled."""
    return lsm.shapes.equal_clump(patch_shape(np.array(vertices), 120, corner_radius), elements)


def deviation(outline: NDArray, body: shapely.Polygon) -> tuple[float, float]:
    """(greatest, rms) distance of the closed outline (k, 2) from that of the shapely body, centroids laid together."""
    import shapely
    from shapely.affinity import translate

    own = shapely.Polygon(outline)
    shift = np.array(body.centroid.coords[0]) - np.array(own.centroid.coords[0])
    ring = shapely.get_exterior_ring(translate(own, *shift))
    points = shapely.points(shapely.get_coordinates(shapely.segmentize(ring, 0.002)))
    distance = shapely.distance(points, body.exterior)
    return float(shapely.hausdorff_distance(ring, body.exterior)), float(np.sqrt((distance**2).mean()))


def shapes_of(params: Params, kind: str, elements: int) -> tuple[list[Any], float, float]:
    """(shapes of equivalent diameter 1, shape error, roughness) of one kind of grain, means over the outlines."""
    import shapely

    shapes, errors = [], []
    for vertices, body in polygons(params):
        exact = patch_shape(vertices, 120, params.corner_radius)
        if kind == "patches":
            shape = patch_shape(vertices, elements, params.corner_radius)
            outline = shape.outline(4000)
        else:
            shape = clump_shape(tuple(map(tuple, vertices)), elements, params.corner_radius)
            discs = shapely.buffer(shapely.points(shape.centre), shape.radius, quad_segs=64)
            outline = shapely.get_coordinates(shapely.get_exterior_ring(shapely.union_all(discs)))
        errors.append(deviation(outline, body))
        size = np.sqrt(4.0 * exact.measure / np.pi)
        shapes.append(lsm.shapes.rescaled(shape, 1.0 / size))
    return shapes, *np.mean(errors, axis=0)


def shear_silently(*of_layer: Any) -> dict[str, float]:
    """As `shear`, in a process of its own, whose output is dropped: a run that reports also prints its summary."""
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    return shear(*of_layer)


def shear(params: Params, kind: str, elements: int, out: Path, report: Progress | None = None) -> dict[str, float]:
    """{column: value} of friction and cost of a layer, measured in the calling process; `report` takes its reports."""
    shapes, *_ = shapes_of(params, kind, elements)
    of_run = layer_params(params)
    # A layer that is there was begun by this experiment, before it was stopped.
    existing = "resume" if (out / CONFIG).is_file() else "refuse"
    scene = shear_gouge.build(of_run, report, shapes=shapes)
    dataset = shear_gouge.simulate(scene, of_run, out, report, existing=existing)
    metrics = shear_gouge.analyse(dataset, of_run)
    found = {name: number(metrics[name]) for name in FRICTION}
    return found | {"cost": 1.0 / rate_of(out)}


def rate_of(out: str | os.PathLike[str]) -> float:
    """Grains times steps per second of the run in the folder `out`; nan if it was too short to measure."""
    value = json.loads((Path(out) / "summary.json").read_text())["metrics"]["grain_steps_per_second"]["value"]
    return np.nan if value is None else value


def measure(
    params: Params, out: Path, parts: FinishedParts, progress: Progress | None = None
) -> tuple[Rows, signals.Interrupted | None]:
    """Rows of the table, one per kind and number of elements, and the signal that came before all were measured.

    Layers run one after the other, as they are timed.
    """
    rows: Rows = []
    try:
        _measure(params, out, parts, rows, progress)
    except signals.Interrupted as stop:
        return rows, stop
    return rows, None


def _measure(params: Params, out: Path, parts: FinishedParts, rows: Rows, progress: Progress | None) -> None:
    """Add the rows one by one."""
    for kind in ("patches", "clump"):
        for elements in counts(params):
            label = f"{kind}-{elements}"
            known = parts.get(label)
            if known is not None:
                rows.append(known)
                continue
            if progress:
                progress({"label": label, "stage": "fitting outlines"})
            _, error, roughness = shapes_of(params, kind, elements)
            row = {"kind": kind, "elements": elements, "shape_error": error, "roughness": roughness}
            values = dict.fromkeys((*FRICTION, "cost"), np.nan)
            if elements in sheared_counts(params):
                if progress:
                    progress({"label": label, "stage": "starting the process of a layer"})
                with child_reports(progress) as reports:
                    folder = out / "runs" / label
                    values = in_fresh_process(shear_silently, params, kind, elements, folder, reports.of(label))
            rows.append(parts.put(label, row | values))
            if progress:
                progress({"label": label, "state": f"shape error {error:.2e} diameters", "ended": True})


def analyse(rows: Rows) -> dict[str, Metric]:
    """Metrics: errors at 30 elements, and the cost of a clump with the same error as 30 patches."""

    def column(kind, name):
        return np.array([r[name] for r in rows if r["kind"] == kind])

    metrics = {}
    elements = column("patches", "elements")
    at = list(elements).index(30)
    for kind in ("patches", "clump"):
        metrics[f"shape_error_{kind}_30"] = Metric(float(column(kind, "shape_error")[at]), "1")
        metrics[f"roughness_{kind}_30"] = Metric(float(column(kind, "roughness")[at]), "1")
    slope, offset = np.polyfit(np.log(elements), np.log(column("clump", "shape_error")), 1)
    needed = float(np.exp((np.log(metrics["shape_error_patches_30"].value) - offset) / slope))
    far = needed > FARTHEST * elements.max()
    beyond = f"unknown: more than {FARTHEST:g} times the {elements.max()} discs that were fitted" if far else None
    metrics["discs_at_equal_error"] = Metric(None if far else needed, "1", note=beyond)
    patches, clumps = column("patches", "cost"), column("clump", "cost")
    known = np.isfinite(clumps) & np.isfinite(patches)
    per_disc = np.polyfit(elements[known], clumps[known], 1) if known.sum() > 1 else (clumps[0] / elements[0], 0.0)
    cost = float(np.nanmax(patches[: at + 1])) if np.isfinite(patches[: at + 1]).any() else np.nan
    ratio = float(np.polyval(per_disc, needed) / cost)
    metrics["cost_ratio_equal_error"] = Metric(None if far else ratio, "1", note=beyond)
    last = int(np.flatnonzero(np.append(True, known))[-1]) - 1 if known.any() else 0
    for kind in ("patches", "clump"):
        name = f"friction_{kind}_{elements[last]}"
        one_run = (column(kind, of_friction)[[last]] for of_friction in FRICTION)
        metrics |= metrics_of_estimate(name, f"{name}_se", lsm.statistics.combine_replicas(*one_run))
    return {name: replace(metric, note=metric.note or note_of(name, elements)) for name, metric in metrics.items()}


def note_of(name: str, elements: NDArray) -> str | None:
    """What a metric of `analyse` is; elements: numbers of patches or discs whose outlines are fitted [1]."""
    grain, _, number = name.removesuffix("_se").partition("_")[2].rpartition("_")
    of_grain = f"of grains of {number} {'discs' if grain.endswith('clump') else 'patches'}"
    if name.startswith("friction"):
        return f"{'standard error of the' if name.endswith('_se') else 'steady'} friction of a layer {of_grain}"
    if name.startswith("shape_error"):
        return f"greatest distance from the outline, in diameters, {of_grain}"
    if name.startswith("roughness"):
        return f"root mean square distance from the outline, in diameters, {of_grain}"
    beyond = f"; extrapolated from {elements.min()} to {elements.max()} discs, at most {FARTHEST:g} times as many"
    return {
        "discs_at_equal_error": f"discs of a clump with the shape error of 30 patches{beyond}",
        "cost_ratio_equal_error": f"time per grain and step of such a clump over that of 30 patches{beyond}",
    }.get(name)


def run(
    params: Params, out: str | os.PathLike[str], progress: Progress | None = None, existing: Existing = "refuse"
) -> xarray.Dataset:
    """Make all measurements; writes roughness.nc, roughness.png, runs/ and summary.json; returns roughness.nc.

    An interrupted run writes roughness.nc of what is measured.

    existing: what becomes of a run that is there: it makes `run` refuse the folder, is removed, or goes on.
    Raises InputError for a folder or a run in it that does not suit.
    """
    check(params)
    with folder_of_parts(params, "shape-roughness", out, existing) as (folder, parts):
        return _run(params, folder, parts, progress)


def _run(params: Params, out: Path, parts: FinishedParts, progress: Progress | None) -> xarray.Dataset:
    """The experiment in its folder."""
    rows, stop = measure(params, out, parts, progress)
    if stop and not rows:
        raise stop
    table = write_runs(
        out / "roughness.nc",
        rows,
        COLUMNS,
        params,
        "Grains of patches and clumps of discs at the same outline",
        "Shape error, friction and cost.",
        run_status="interrupted" if stop else "complete",
        parameters=("kind", "elements"),
        text={"kind": "patches or clump"},
    )
    if stop:
        raise stop
    metrics = analyse(rows)
    plot_roughness(out / f"roughness.{params.format}", rows, *example_outlines(params))
    metrics |= parts.watch.metrics()
    write_summary(out, "shape-roughness", params.preset_name, metrics, quiet=progress is None)
    parts.clear()
    return table


def example_outlines(params: Params) -> tuple[NDArray, NDArray]:
    """Outlines (k, 2) of one polygon as 30 discs and as 30 patches, in equivalent diameters."""
    import shapely

    vertices, _ = polygons(params)[0]
    clump = clump_shape(tuple(map(tuple, vertices)), 30, params.corner_radius)
    discs = shapely.union_all(shapely.buffer(shapely.points(clump.centre), clump.radius, quad_segs=64))
    chain = patch_shape(vertices, 30, params.corner_radius).outline(2000)
    return shapely.get_coordinates(shapely.get_exterior_ring(discs)), chain
