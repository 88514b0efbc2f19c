"""The verification of Abe & Mora (2003): an elastic gas of random grains must keep its energy.

Grains of about 30 patches fill the tiles of a periodic square, start with random velocities and no rotation, and
collide elastically. The drift of the total energy is measured against the step for several integrators; the scheme of
the paper kept it within 2.5 %.
"""

from __future__ import annotations

import functools
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

import taichi_lsm as lsm
from workflows.common import signals
from workflows.common.child_reports import SILENT, child_reports
from workflows.common.metrics import write_summary
from workflows.common.parameters import Params as BaseParams
from workflows.common.refusals import check_idle, in_terms_of
from workflows.common.reports import Progress
from workflows.common.run_cost import RunCost
from workflows.common.run_folder import Existing
from workflows.common.run_table import Rows, attributes_of, write_runs
from workflows.energy.gas_metrics import PUBLISHED_DRIFT, analyse
from workflows.energy.gas_runs import CONES, SCHEMES, gas_cost, runs_of, schemes_of
from workflows.plots.energy_figure import plot_energy
from workflows.protocol.finished_parts import FinishedParts, folder_of_parts

if TYPE_CHECKING:
    import xarray

TERMS = ("translational_energy", "rotational_energy", "elastic_energy")
MEASURED = {  # by the purpose of a run
    "drift": "the drift",
    "long": "the drift of a long run",
    "order": "the order",
    "plateau": "the plateau of cones",
}

Series = dict[str, NDArray]  # time [s] and energies [J] of the samples of a run
MOST_PROBED = 400  # grains, which are made in a second or two
MOST_STEPS = 500_000_000  # of a run; runs for the order are up to four times as long, and counts have 32 bits


class Params(BaseParams):
    """The verification test of Abe & Mora (2003), in 2D or 3D."""

    dim: int = Field(default=2, ge=2, le=3, description="dimension of space [1]")
    grains: int = Field(default=900, ge=16, le=1_000_000, description="number of grains [1]")
    tile: float = Field(default=1e-3, ge=1e-9, le=1e3, description="mean width of a tile [m]")
    corner_radius: float = Field(default=0.08, ge=1e-6, le=0.3, description="least patch radius [tiles]")
    gap: float = Field(
        default=0.02, ge=1e-6, le=0.2, description="distance of a grain from the sides of its tile [tiles]"
    )
    arcs_per_corner: int = Field(
        default=4, ge=1, le=100, description="patches per corner; about 30 per grain with 4 [1]"
    )
    chamfers: int = Field(
        default=11, ge=0, le=20, description="corners cut per tile, 3D; 20 faces per grain with 11 [1]"
    )
    density: float = Field(default=2500.0, ge=1e-3, le=1e6, description="density of the grains [kg m-3]")
    stiffness: float = Field(default=5e4, ge=1e-6, le=1e15, description="normal stiffness k [N m-1]")
    speed: float = Field(default=1.0, ge=1e-9, le=1e6, description="root mean square velocity at the start [m s-1]")
    steps: int = Field(default=5000, ge=100, le=MOST_STEPS, description="steps of each run [1]")
    long_steps: int = Field(default=50_000, ge=100, le=MOST_STEPS, description="steps of the long run [1]")
    seeds: int = Field(default=3, ge=1, le=1000, description="packings in which the drift is measured [1]")
    order_seeds: int = Field(default=8, ge=1, le=1000, description="packings in which the order is measured [1]")
    missed_seam: float = Field(
        default=1e-4, ge=1e-12, le=0.1, description="gap of each cone in the runs with cones, 2D [rad]"
    )
    order_grains: int = Field(
        default=225, ge=16, le=1_000_000, description="grains of the runs that measure the order [1]"
    )
    samples: int = Field(default=250, ge=10, le=1_000_000, description="energies recorded per run [1]")

    presets: ClassVar[dict[str, dict]] = {
        "smoke": {  # as many grains for the order: one simulation of each scheme compiles for both
            "grains": 100,
            "steps": 1000,
            "long_steps": 2000,
            "order_seeds": 2,
            "order_grains": 100,
            "samples": 20,
            "seeds": 2,
        },
        "demo": {"order_seeds": 4, "order_grains": 100, "samples": 100},
        "standard": {},
        "reference": {"seeds": 8, "long_steps": 500_000, "order_seeds": 16},
    }

    def idle(self) -> dict[str, str]:
        """Fields of grains and runs that only the other dimension has."""
        if self.dim == 2:
            return {"chamfers": "with --dim 2"}
        return dict.fromkeys(("arcs_per_corner", "missed_seam", "order_seeds", "order_grains"), "with --dim 3")

    @model_validator(mode="after")
    def _seeds_fit_their_column(self) -> Self:
        most = max(self.seeds, self.order_seeds) if self.dim == 2 else self.seeds
        last = self.seed + 100 + most  # velocities have seeds 100 higher
        if last >= 2**31:
            raise ValueError(f"--seed {self.seed}: must be <= {2**31 - 1 - (last - self.seed)} for this many seeds")
        return self


def check(params: Params) -> None:
    """Refuse options without effect, and grains that do not fit into the tiles of the smaller gas, if quickly checked.

    Larger packings are refused by the run itself, before it compiles.

    Raises
    ------
    InputError
        With the options, their values and what fits.
    """
    check_idle(params)
    if params.dim == 2 and params.order_grains <= MOST_PROBED:
        probed = params.model_copy(update={"arcs_per_corner": 1})  # many take seconds, and need no more space
        build(probed, params.order_grains, params.seed, 50, "onset_verlet", "--order-grains")


def estimate(params: Params) -> RunCost:
    """Expected steps, time and memory of all runs, two schemes at a time."""
    return gas_cost(params)


def build(
    params: Params, grains: int, seed: int, steps_per_contact: float, scheme: str, option: str | None = None
) -> lsm.Scene:
    """One elastic gas.

    Parameters
    ----------
    params
        Of the experiment.
    grains, seed
        Number of grains; seed of packing and velocities.
    steps_per_contact
        Contact duration pi sqrt(m/(2k)) over the time step [1].
    scheme
        Key of SCHEMES or CONES.
    option
        Option that gave `grains`, for the message of a refusal; None finds it by the value.

    Raises
    ------
    InputError
        If no grain fits into a tile with this corner radius and gap.
    """
    p = params
    option = option or ("--grains" if grains == p.grains else "--order-grains")
    side = grains ** (1.0 / p.dim)
    of_grains = f"--corner-radius {p.corner_radius:g}, --gap {p.gap:g}, {option} {grains}, --seed {seed}"
    with in_terms_of(of_grains, "lower the corner radius or the gap, or take another seed"):
        packing: Any = _packing(p.dim, grains, seed, p.corner_radius, p.gap, _detail(p))
    shapes, position, diameter, orientations = packing
    if scheme in CONES:
        shapes = [lsm.shapes.from_chain(s, CONES[scheme] * p.missed_seam) for s in shapes]
    rng = np.random.default_rng(seed + 100)
    velocity = rng.normal(size=(grains, p.dim)) * p.speed / np.sqrt(p.dim)
    scene = lsm.Scene(
        dim=p.dim,
        lengths=(side * p.tile,) * p.dim,
        periodic=(True,) * p.dim,
        shapes=shapes,
        **orientations,
        shape_index=np.arange(grains),
        position=position * p.tile,
        diameter=diameter * p.tile,
        density=p.density,
        thickness=p.tile,
        velocity=velocity,
        effects=[lsm.LinearElastic(p.stiffness)],
        integrator=getattr(lsm, SCHEMES.get(scheme, "OnsetVerlet")),
        track_dissipation=False,
        guards=lsm.Guards(energy=None),  # the drift of the energy is what is measured
        dt=1.0,
    )
    mass, _ = scene.masses()
    scene.velocity -= (mass[:, None] * velocity).sum(axis=0) / mass.sum()
    scene.dt = np.pi * np.sqrt(mass.mean() / (2.0 * p.stiffness)) / steps_per_contact
    return scene


def _detail(params):
    """Parameter that sets the number of patches: arcs per corner in 2D, cut corners per tile in 3D."""
    return params.arcs_per_corner if params.dim == 2 else params.chamfers


@functools.lru_cache(maxsize=64)
def _packing(dim, grains, seed, corner_radius, gap, detail):
    """(shapes, positions, sizes, orientations by name) of one packing, lengths in tiles; kept for all time steps."""
    if dim == 2:
        return *lsm.shapes.voronoi_packing(grains, np.sqrt(grains), seed, corner_radius, gap, detail), {}
    packing = lsm.shapes.laguerre_packing(grains, np.cbrt(grains), seed, corner_radius, gap, chamfers=detail)
    shapes, position, diameter, orientation = packing
    return shapes, position, diameter, {"orientation": orientation}


class Gas:
    """Runs many scenes of one scheme and size through one compiled simulation."""

    def __init__(self, params: Params, scheme: str) -> None:
        self.params, self.scheme, self.sims = params, scheme, {}

    def run(self, grains: int, seed: int, steps_per_contact: float, steps: int) -> Series:
        """Energies of one run: dict of arrays over the samples, time [s] and energies [J]."""
        p = self.params
        scene = build(p, grains, seed, steps_per_contact, self.scheme)
        if grains in self.sims:
            sim, _ = self.sims[grains]
            sim.reset(scene)
        else:
            sim = lsm.Simulation(scene, p.arch, p.precision, p.threads)
            self.sims[grains] = (sim, lsm.ShadowEnergy(sim))
        sim, shadow = self.sims[grains]
        rows = []
        every = max(1, steps // p.samples)
        for _ in range(steps // every + 1):
            sums = sim.measure.sums()
            rows.append({"time": sim.time, "shadow_correction": shadow.correction(), **{n: sums[n] for n in TERMS}})
            try:
                sim.run(every)
            except lsm.SimulationError:
                if self.scheme not in ("explicit_euler", *CONES):
                    raise
                break  # the gas is heated until grains overlap beyond any contact: that is the scheme's result
        return {name: np.array([r[name] for r in rows]) for name in rows[0]}


def drift(series: Series, shadow: bool = False) -> float:
    """Greatest abs(E/E0 - 1) of a run, of the energy or of the shadow energy [1]."""
    total = np.sum([series[n] for n in TERMS], axis=0)
    if shadow:
        total = total + series["shadow_correction"]
    return float(np.abs(total / total[0] - 1.0).max())


def measure_scheme(params: Params, scheme: str, report: Progress = SILENT) -> tuple[Rows, Series]:
    """All runs of one scheme: (rows, series), see `measure`; `report` takes a report at the beginning of each."""
    gas, rows, series = Gas(params, scheme), [], []
    runs = runs_of(params, scheme)
    for number, run in enumerate(runs, start=1):
        compiling = "" if run.grains in gas.sims else "making a packing, compiling; "
        report({"stage": f"{compiling}run to measure {MEASURED[run.purpose]}", "done": number, "total": len(runs)})
        energies = gas.run(run.grains, run.seed, run.steps_per_contact, run.steps)
        drifts = {"drift": drift(energies), "shadow_drift": drift(energies, True)}
        rows.append({"scheme": scheme, **run._asdict(), **drifts})
        series.append(energies)
    return rows, series[0]


def measure(
    params: Params, parts: FinishedParts, progress: Progress | None = None
) -> tuple[Rows, dict[str, Series], signals.Interrupted | None]:
    """Make all runs of the experiment, two schemes at a time, each in a process of its own.

    Returns (rows, series, stop): rows, a list of dicts with scheme, purpose (drift | long | order | plateau), grains,
    seed, steps_per_contact, steps, drift, shadow_drift; series, the energies of the first run of each scheme; stop, the
    signal that came before all schemes were done, or None.
    """
    rows, series = [], {}
    schemes = schemes_of(params)
    try:
        with child_reports(progress) as reports:
            reports.show({"stage": f"starting the processes of {len(schemes)} schemes, two at a time"})
            calls = {scheme: (measure_scheme, params, scheme, reports.of(scheme)) for scheme in schemes}
            with parts.made_in_processes(calls) as made:
                for scheme, (own, series[scheme]) in made:
                    rows += own
                    reports.show({"label": scheme, "state": f"{len(own)} runs done", "ended": True})
    except signals.Interrupted as stop:
        return rows, series, stop
    return rows, series, None


def run(
    params: Params, out: str | os.PathLike[str], progress: Progress | None = None, existing: Existing = "refuse"
) -> xarray.Dataset:
    """Run everything; writes energy.nc, drift.nc, energy.png and summary.json, returns drift.nc as a Dataset.

    An interrupted run writes drift.nc of the schemes that are done, and energy.nc if that of the default scheme is.

    existing: what becomes of a run that is there: it makes `run` refuse the folder, is removed, or goes on.
    Raises InputError for a folder or a run in it that does not suit.
    """
    check(params)
    with folder_of_parts(params, "energy-conservation", out, existing) as (folder, parts):
        return _run(params, folder, parts, progress)


def _run(params: Params, out: Path, parts: FinishedParts, progress: Progress | None) -> xarray.Dataset:
    """The experiment in its folder."""
    rows, series, stop = measure(params, parts, progress)
    if stop and not rows:
        raise stop
    first = next(iter(series.values()))["time"]
    dt = float(np.diff(first[:2])[0]) / max(1, params.steps // params.samples)
    title = "Energy of an elastic gas of random grains"
    summary = "Verification test of Abe & Mora (2003) for several integrators."
    numbers = [
        lsm.Variable("grains", ("run",), "i32", "1", "number of grains"),
        lsm.Variable("seed", ("run",), "i32", "1", "seed of packing and velocities"),
        lsm.Variable("steps", ("run",), "i32", "1", "number of steps"),
        lsm.Variable("steps_per_contact", ("run",), "i32", "1", "contact duration over step"),
        lsm.Variable("drift", ("run",), "f64", "1", "greatest relative deviation of the energy"),
        lsm.Variable("shadow_drift", ("run",), "f64", "1", "greatest relative deviation of the shadow energy"),
    ]
    table = write_runs(
        out / "drift.nc",
        rows,
        numbers,
        params,
        title,
        summary,
        run_status="interrupted" if stop else "complete",
        parameters=("scheme", "purpose", "grains", "seed", "steps", "steps_per_contact"),
        text={"scheme": "time integration", "purpose": "what the run is for"},
    )
    if "onset_verlet" in series:
        attributes = attributes_of(params, title, summary, params.seed, dt)
        lsm.write_energies(out / "energy.nc", series["onset_verlet"], attributes)
    if stop:
        raise stop
    metrics = analyse(rows, params.dim)
    plot_energy(out / f"energy.{params.format}", rows, series, PUBLISHED_DRIFT)
    metrics |= parts.watch.metrics()
    write_summary(out, "energy-conservation", params.preset_name, metrics, quiet=progress is None)
    parts.clear()
    return table
