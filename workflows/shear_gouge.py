"""Shear a layer of gouge between rough platens at constant normal stress, and measure its friction.

Stages: generate (a loose packing between two platens of glued grains), consolidate (the servo presses the top
platen down to the normal stress), shear (the top platen moves at a constant velocity).
"""

import time
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

import taichi_lsm as lsm
from workflows.common.metrics import Metric, write_summary
from workflows.common.parameters import Params as BaseParams
from workflows.common.parameters import to_toml
from workflows.gouge.initial_grains import breakable_grains, initial_orientations, loose_grains
from workflows.gouge.target_runs import run_to_target
from workflows.plots import run_plots

SAMPLES_PER_ROW = 5  # with more, diagnostics would not stay below 3 % of a run: benchmarks/output_cost.py
SETTLE_TIMES = 300.0  # inertial times d sqrt(rho/P) that consolidation may take after the platen has come down
PACKED = {2: 0.80, 3: 0.59}  # filled part of a consolidated layer, to choose the number of grains
BOND_WIDTH = 0.55  # of the bonds between pieces, in their diameter: about the side that two tiles share
BOND_POISSON = 0.25
BOND_ANGLE = float(np.arctan(0.75))  # internal friction of rock
LEAST_INERTIA = 0.05  # of the servo, in layer masses; docs/decisions/0007
LARGEST_SPEED = 0.1  # of the servo, in diameters per inertial time
LEAST_ROWS = 12  # of the steady state: fewer do not show their own correlation
STICK_SLIP = 4  # times as much strain lies between two rows while a layer on a spring slips
BOUNDS = {  # what is claimed of the figures of a run, as absolute values
    "platen_bulk_difference": 0.02,
    "energy_residual": 0.01,
    "normal_stress_error": 0.005,
    "normal_stress_rms": 0.05,
}


class Params(BaseParams):
    """One shear experiment on a layer of gouge."""

    dim: int = Field(2, ge=2, le=3, description="dimension of space [1]")
    shape: Literal["sphere", "angular"] = Field("sphere", description="grain shape: discs or spheres, or angular")
    smallest_diameter: float = Field(105e-6, gt=0, description="least equivalent diameter [m]")
    largest_diameter: float = Field(149e-6, gt=0, description="greatest equivalent diameter [m]")
    density: float = Field(2500.0, gt=0, description="density of the grains [kg m-3]")
    normal_stress: float = Field(5e6, gt=0, description="normal stress on the layer [Pa]")
    layer_thickness: float | None = Field(
        None, ge=8, description="thickness of the layer; none: 24 in 2D, 15 in 3D [mean diameters]"
    )
    length: float | None = Field(
        None, ge=6, description="periodic length along the shear; none: 30 in 2D, 20 in 3D [mean diameters]"
    )
    width: float = Field(7.0, ge=4, description="periodic width, 3D only [mean diameters]")
    grains: int | None = Field(None, ge=20, description="mobile grains; none: from thickness and length [1]")
    friction: float = Field(0.5, ge=0, description="Coulomb coefficient between grains [1]")
    tangential_ratio: float = Field(0.5, gt=0, le=1, description="tangential over normal stiffness [1]")
    restitution: float = Field(0.5, ge=0.01, le=1, description="restitution of a normal impact [1]")
    stiffness_number: float = Field(1000.0, ge=100, description="kappa = k/(P b) in 2D, k/(P d) in 3D [1]")
    inertial_number: float = Field(1e-3, gt=0, le=0.1, description="I = shear rate d sqrt(rho/P) [1]")
    platen_diameter: float = Field(
        1.0, ge=0.3, le=3.0, description="grains of the platens over mobile ones: the roughness of the walls [1]"
    )
    corner_radius: float = Field(0.05, ge=0.01, le=0.25, description="of angular grains [equivalent diameters]")
    breakable: bool = Field(False, description="angular grains are bonded pieces that can break, 2D only")
    pieces: int = Field(7, ge=2, le=40, description="pieces of a breakable grain [1]")
    bond_strength: float = Field(20.0, gt=0, description="tensile strength of the bonds over the normal stress [1]")
    load_stiffness: float | None = Field(
        None, gt=0, description="spring that pulls the top platen; none: its velocity is imposed [N m-1]"
    )
    strain: float = Field(5.0, gt=0, description="shear strain to reach [1]")
    steady_from: float = Field(1.0, ge=0, description="strain from which the steady state is averaged [1]")
    rows_per_strain: int = Field(100, ge=10, description="rows of run.nc per unit of shear strain [1]")
    profile: bool = Field(False, description="print where the time of the run went")
    effects: list[dict] = Field(
        [],
        description="laws beside elasticity, damping and friction, or in place of those of the same kind: tables with "
        "law = NAME and its parameters in SI units, see lsm list --effects",
    )
    target_error: float | None = Field(
        None,
        gt=0,
        description="half-width of the 95 % interval that the mean friction shall have; sets strain, seeds and step; "
        "none: as given [1]",
    )
    step_safety: float = Field(0.4, gt=0, le=0.8, description="time step over the largest stable one [1]")

    presets: ClassVar[dict[str, dict]] = {
        "smoke": {"length": 20.0, "layer_thickness": 12.0, "inertial_number": 5e-3, "strain": 2.0},
        "demo": {"strain": 3.0},
        "standard": {},
        "reference": {"length": 60.0, "inertial_number": 3e-4, "strain": 10.0, "stiffness_number": 1e4},
    }

    @model_validator(mode="after")
    def _consistent(self):
        problems = []
        if self.smallest_diameter > self.largest_diameter:
            low, high = self.smallest_diameter, self.largest_diameter
            problems.append(f"--smallest-diameter {low:g} m is above --largest-diameter {high:g} m: no size is left")
        least = LEAST_ROWS / self.rows_per_strain * (STICK_SLIP if self.load_stiffness else 1)
        if self.strain < self.steady_from + least:
            problems.append(
                f"--strain {self.strain:g} must be >= --steady-from {self.steady_from:g} + {least:g}: "
                f"the steady state needs {LEAST_ROWS} rows"
            )
        if self.breakable and (self.shape != "angular" or self.dim != 2):
            problems.append(f"--breakable needs --shape angular --dim 2, not --shape {self.shape} --dim {self.dim}")
        if self.target_error and (self.breakable or self.load_stiffness or self.effects):
            problems.append("--target-error knows layers of whole grains at an imposed velocity, with the usual laws")
        if self.dim == 3 and self.platen_diameter > 1.0:
            problems.append(f"--platen-diameter {self.platen_diameter:g} must be <= 1 in 3D: mobile grains would pass")
        least_kappa = 5.0 / self.corner_radius * (self.pieces**0.5 if self.breakable else 1.0)
        if self.shape == "angular" and self.stiffness_number < least_kappa:
            problems.append(
                f"--stiffness-number {self.stiffness_number:g} must be >= {least_kappa:g} with --corner-radius "
                f"{self.corner_radius:g}: overlaps would exceed a tenth of what the corners can carry"
            )
        if problems:
            raise ValueError("; ".join(problems))
        return self

    @property
    def layer(self):
        """(thickness, periodic lengths) of the layer [m]; as given or by dimension."""
        thickness = self.layer_thickness or (24.0 if self.dim == 2 else 15.0)
        length = self.length or (30.0 if self.dim == 2 else 20.0)
        across = () if self.dim == 2 else (self.width * self.diameter,)
        return thickness * self.diameter, (length * self.diameter, *across)

    @property
    def diameter(self):
        """Mean diameter d [m]."""
        return 0.5 * (self.smallest_diameter + self.largest_diameter)

    @property
    def inertial_time(self):
        """d sqrt(rho/P) [s]: how long the stress takes to push a grain by its own size."""
        return self.diameter * np.sqrt(self.density / self.normal_stress)

    @property
    def stiffness(self):
        """Normal stiffness k [N m-1] of the stiffness number; in 2D the out-of-plane depth b is d."""
        return self.stiffness_number * self.normal_stress * self.diameter


def build(params) -> "lsm.Scene":
    """The scene before consolidation: bottom platen, loose grains, top platen."""
    p, d, dim = params, params.diameter, params.dim
    rng = np.random.default_rng(p.seed)
    thickness, lengths = p.layer
    area = float(np.prod(lengths)) * (d if dim == 2 else 1.0)
    one = lsm.disc() if dim == 2 else lsm.sphere()
    count = p.grains or round(PACKED[dim] * thickness * float(np.prod(lengths)) / (one.measure * d**dim))
    make = breakable_grains if p.breakable else loose_grains
    shapes, shape, loose, scale, turns, top, bonds = make(p, rng, count, lengths, [one])

    smallest, largest = p.platen_diameter * p.smallest_diameter, p.platen_diameter * p.largest_diameter
    platens = [lsm.rough_platen(rng, smallest, largest, lengths, dim) for _ in range(2)]
    (low, low_size), (high, high_size) = platens
    low[:, 1] -= (low[:, 1] + 0.5 * low_size).max()
    high[:, 1] += top - (high[:, 1] - 0.5 * high_size).min()
    position = np.concatenate([loose, low, high])
    glued = np.repeat([0, 1], [len(low), len(high)])

    scene_size = np.concatenate([scale, low_size, high_size])
    layer_mass = p.density * one.measure * (scale**dim).sum() * (d if dim == 2 else 1.0)
    glued_mass = p.density * one.measure * (high_size**dim).sum() * (d if dim == 2 else 1.0)
    servo = lsm.ServoStress(
        stress=p.normal_stress,
        outward=1,
        stiffness=p.stiffness * float(np.prod(lengths)) / d ** (dim - 2) / thickness,
        inertia=max(glued_mass, LEAST_INERTIA * layer_mass),
        speed_limit=LARGEST_SPEED * d / p.inertial_time,
    )
    still = [lsm.Fixed()] * (dim - 2)
    return lsm.Scene(
        dim=dim,
        lengths=(lengths[0], np.inf, *lengths[1:]),
        periodic=(True, False, True)[:dim],
        shapes=shapes,
        shape_index=np.concatenate([shape, np.zeros(len(glued), int)]),
        position=position,
        diameter=scene_size,
        **initial_orientations(turns, len(glued)),
        density=p.density,
        platen_index=np.concatenate([np.full(len(scale), -1), glued]),
        platens=[
            lsm.Platen("bottom", [lsm.Fixed()] * dim),
            lsm.Platen("top", [_driven(p, 0.0, servo.inertia), servo, *still]),
        ],
        effects=effects_of(p),
        bonds=bonds,
        thickness=d,
        area=area,
        safety=p.step_safety,
    )


def effects_of(p):
    """The laws of the contacts: elastic, damped, frictional; a law of `effects` takes the place of one of its kind."""
    usual = [
        lsm.LinearElastic(p.stiffness),
        lsm.ViscousDamping(restitution=p.restitution),
        lsm.CoulombFriction(p.friction, p.tangential_ratio * p.stiffness),
    ]
    given = lsm.make_effects(p.effects)
    taken = {effect.role or effect.phase for effect in given}
    usual += [_bond(p)] if p.breakable else []
    return [effect for effect in usual if (effect.role or effect.phase) not in taken] + given


def _bond(p):
    """Bonds about as stiff as a contact, k_n = E (width R T)/(2 R) = k; of the strength asked for."""
    return lsm.ElasticBrittleBond(
        youngs_modulus=p.stiffness / (BOND_WIDTH * p.diameter),
        poissons_ratio=BOND_POISSON,
        cohesion=p.bond_strength * p.normal_stress * np.tan(BOND_ANGLE),
        friction_angle=BOND_ANGLE,
        radius_ratio=BOND_WIDTH,
    )


def _driven(p, velocity, inertia):
    """The shear drive: a load point with its spring, or the platen brought up to speed over one inertial time."""
    if p.load_stiffness:
        return lsm.SpringLoadPoint(velocity, p.load_stiffness, inertia)
    return lsm.ConstantVelocity(velocity, acceleration=max(abs(velocity), 1e-3 * p.diameter) / p.inertial_time)


def consolidate(sim, layer, recorder, params):
    """Press the layer until the platen carries the normal stress and the thickness no longer changes."""
    chunk = max(1, int(2.0 * params.inertial_time / sim.dt))
    quiet = 0
    allowed = SETTLE_TIMES + layer.thickness / (LARGEST_SPEED * params.diameter)
    for _ in range(int(allowed / 2.0)):
        before = layer.thickness
        for _ in range(4):
            sim.run(-(-chunk // 4))
            layer.sample()
        row = recorder.row(1)
        still = abs(layer.thickness / before - 1.0) < 2e-4
        loaded = abs(row["platen_normal_stress"] / params.normal_stress - 1.0) < 0.02
        quiet = quiet + 1 if still and loaded else 0
        if quiet == 3:
            return
    raise lsm.SimulationError(
        f"step {sim.step}: the layer did not settle within {allowed:.0f} inertial times: "
        f"normal stress {row['platen_normal_stress']:g} Pa of {params.normal_stress:g} Pa"
    )


def shear(sim, layer, recorder, params, report):
    """Move the top platen at the velocity of the inertial number until the strain is reached.

    Returns grain steps per second [s-1] after the first row, in which kernels are compiled; nan if there is one row.
    """
    velocity = params.inertial_number / params.inertial_time * layer.thickness
    sim.platens.set("top", 0, _driven(params, velocity, sim.platens.drives[1][1].inertia))
    layer.begin_shear()
    steps_per_row = params.inertial_time / (params.inertial_number * params.rows_per_strain * sim.dt)
    chunk = max(1, round(steps_per_row / SAMPLES_PER_ROW))
    unit, began = 1, None
    while layer.strain < params.strain:
        for _ in range(SAMPLES_PER_ROW):
            sim.run(chunk)
            layer.sample()
        report(recorder.row(2))
        began = began or (time.perf_counter(), sim.step)
        if layer.strain >= unit:
            recorder.snapshot()
            unit += 1
    if unit - 1 < params.strain:  # the last snapshot is older than the end
        recorder.snapshot()
    steps = sim.step - began[1]
    return steps * len(sim) / (time.perf_counter() - began[0]) if steps else np.nan


def run(params, out, progress=None):
    """Run the experiment; writes run.nc, grains.nc, run.png and summary.json to `out`, returns run.nc.

    With a target error it makes as many runs as that needs, in `out`/runs, and returns target.nc.
    """
    if params.target_error is not None:
        return run_to_target(params, out, progress, __name__, analyse)
    return simulate(build(params), params, out, progress)


def simulate(scene, params, out, progress=None):
    """As `run`, for a scene that may have been changed after `build`."""
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    (out / "config.toml").write_text(to_toml(params), encoding="utf-8")
    began = time.perf_counter()
    sim = lsm.Simulation(scene, params.arch, params.precision, params.threads)
    layer = lsm.ShearedLayer(sim, params.normal_stress, params.diameter)
    progress_from = []

    def report(row):
        if progress:
            progress_from.append((time.perf_counter(), sim.step, row["shear_strain"]))
            progress(_progress(row, params, layer, progress_from[0], progress_from[-1]))

    try:
        rate = _record(sim, layer, out, params, report)
    except lsm.SimulationError as error:
        run_plots.plot_stopped(out, error)
        raise
    if params.profile:
        print(lsm.profile_text(sim))
    dataset = lsm.open_run(out / "run.nc")
    metrics = analyse(dataset, params)
    metrics["grain_steps_per_second"] = Metric(rate, "s-1")
    metrics["seconds"] = Metric(time.perf_counter() - began, "s")
    run_plots.plot_run(out)
    write_summary(out, "shear-gouge", params.preset_name, metrics, quiet=progress is None)
    return dataset


def _record(sim, layer, out, params, report):
    """All stages of the run, with their files; returns grain steps per second of the shear."""
    title = f"Shear of a layer of {params.shape} grains in {params.dim}D"
    summary = "Generated loose, consolidated under servo-controlled normal stress, sheared at constant velocity."
    with lsm.LayerRecorder(out, layer, title, summary, to_toml(params), params.seed) as recorder:
        recorder.row(0)
        recorder.snapshot()
        consolidate(sim, layer, recorder, params)
        recorder.snapshot()
        recorder.run.flush()
        return shear(sim, layer, recorder, params, report)


def _progress(row, params, layer, first, last):
    """What the progress line shows; speed and remaining time are known from the second row on."""
    report = {
        "strain": row["shear_strain"],
        "strain_total": params.strain,
        "friction": row["friction"],
        "normal_stress": row["platen_normal_stress"],
        "energy_residual": layer.residual_fraction(),
    }
    spent, steps, strain = (b - a for a, b in zip(first, last))
    if strain > 0:
        report["steps_per_second_grain"] = steps * len(layer.sim) / spent
        report["eta"] = spent / strain * (params.strain - row["shear_strain"])
    return report


def analyse(dataset, params):
    """Figures of the steady state, as `docs/conventions.md` defines them."""
    sheared = dataset.isel(time=dataset.stage.values == 2)
    steady = sheared.isel(time=sheared.shear_strain.values >= params.steady_from)
    friction = lsm.steady_ratio(sheared.shear_stress, sheared.normal_stress, params.steady_from)
    platen = lsm.steady_ratio(sheared.platen_shear_stress, sheared.platen_normal_stress, params.steady_from)
    residual = np.abs(sheared.energy_residual - sheared.energy_residual[0]).max() / sheared.work_throughput[-1]
    normal = float(steady.platen_normal_stress.mean()) / params.normal_stress - 1.0
    rms = float(np.sqrt((steady.platen_normal_rms**2).mean())) / params.normal_stress
    apart = abs(platen.mean / friction.mean - 1.0)
    metrics = {
        "friction_mean": Metric(friction.mean, "1"),
        "friction_se": Metric(friction.standard_error, "1"),
        "friction_ess": Metric(friction.effective_samples, "1"),
        "platen_friction_mean": Metric(platen.mean, "1"),
        "platen_bulk_difference": Metric(apart, "1"),
        "inertial_number": Metric(float(steady.inertial_number.mean()), "1"),
        "stiffness_number": Metric(params.stiffness_number, "1"),
        "energy_residual": Metric(float(residual), "1"),
        "normal_stress_error": Metric(normal, "1"),
        "normal_stress_rms": Metric(rms, "1"),
        "layer_thickness": Metric(float(steady.layer_thickness.mean()), "m"),
        "porosity": Metric(float(steady.porosity.mean()), "1"),
        "coordination_number": Metric(float(steady.coordination_number.mean()), "1"),
        "sliding_fraction": Metric(float(steady.sliding_fraction.mean()), "1"),
        "deepest_overlap": Metric(float(dataset.deepest_overlap.max()), "1"),
    }
    for name, bound in BOUNDS.items():
        value = metrics[name].value
        metrics[name] = Metric(value, "1", bound, abs(value) < bound)
    return metrics
