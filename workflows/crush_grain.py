"""Crush single breakable grains between two platens, as in the Brazilian test, and measure how strong they are.

Many grains stand side by side, each on its own: the lower platen is at rest, the upper one comes down slowly. Force and
fragments of each grain give its strength; the strengths give their mean and their Weibull modulus, to which the bonds
of breakable gouge are calibrated.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm
from workflows.common import signals
from workflows.common.metrics import Metric, write_summary
from workflows.common.parameters import Params as BaseParams
from workflows.common.refusals import in_terms_of
from workflows.common.reports import Progress
from workflows.common.run_cost import PROCESS_BYTES, RunCost
from workflows.common.run_folder import Existing, run_folder
from workflows.common.small_scenes import scene_of
from workflows.common.stopwatch import Stopwatch
from workflows.crush.strengths import analyse, write_crushing
from workflows.gouge.initial_grains import initial_orientations, placed_pieces
from workflows.gouge.layer_cost import GRAIN_BYTES, price_of
from workflows.gouge.layer_scene import BOND_ANGLE, BOND_POISSON, bond_length, stand_in
from workflows.plots.crush_grain import plot_crushing

if TYPE_CHECKING:
    import xarray

    from taichi_lsm.shapes import Aggregate

BASE, RAM = 0, 1  # walls: the lower platen, and the upper one that comes down
PITCH = 3.0  # distance of two grains, in their heights, without the flight of their fragments
STEP = 0.7  # time step of pieces over that of the cubes that stand in, for the estimate
SIMULATION = 30.0  # [s] to make grains and to compile
TANGENTIAL_RATIO = 0.5


class Params(BaseParams):
    """Grains of one height between two platens, what holds them together, and how they are pressed."""

    dim: int = Field(default=3, ge=2, le=3, description="dimension of space [1]")
    grains: int = Field(default=30, ge=1, le=10_000, description="grains, each of another shape [1]")
    pieces: int = Field(default=12, ge=2, le=40, description="pieces of a grain [1]")
    height: float = Field(default=125e-6, ge=1e-9, le=1e3, description="distance of the platens as they touch [m]")
    density: float = Field(default=2500.0, ge=1e-3, le=1e6, description="density of the grains [kg m-3]")
    corner_radius: float = Field(
        default=0.05, ge=0.01, le=0.25, description="corner radius of the pieces [equivalent diameters]"
    )
    youngs_modulus: float = Field(default=5e10, ge=1.0, le=1e15, description="Young's modulus of the bonds [Pa]")
    tensile_strength: float = Field(default=1e8, ge=1e-3, le=1e12, description="mean tensile strength of bonds [Pa]")
    weibull_modulus: float | None = Field(
        default=None, ge=1, le=1e3, description="Weibull modulus of the strengths of bonds; none: no scatter [1]"
    )
    friction: float = Field(default=0.5, ge=0, le=100, description="Coulomb coefficient of pieces and platens [1]")
    restitution: float = Field(default=0.5, ge=0.01, le=1, description="coefficient of restitution of contacts [1]")
    speed: float = Field(
        default=3e-5, ge=1e-8, le=1e-2, description="velocity of the platen over sqrt(Young's modulus/density) [1]"
    )
    compression: float = Field(
        default=0.03, ge=1e-3, le=0.3, description="way of the platen to the end, in heights of a grain [1]"
    )
    rows: int = Field(
        default=400, ge=50, le=100_000, description="rows of crush.nc, of which each has a step at least [1]"
    )
    step_safety: float = Field(default=0.4, ge=1e-3, le=0.8, description="time step over the largest stable one [1]")

    presets: ClassVar[dict[str, dict]] = {
        "smoke": {"grains": 3, "pieces": 5, "speed": 3e-4, "compression": 0.015, "rows": 60},
        "demo": {"grains": 10, "speed": 1e-4},
        "standard": {},
        "reference": {"grains": 100, "pieces": 30, "youngs_modulus": 1e11, "speed": 1e-5},
    }

    @model_validator(mode="after")
    def _stiff_enough(self) -> Self:
        """A platen that breaks a grain, at a force of at most strength times height^2, must not flatten a corner."""
        across = self.pieces ** (1.0 / self.dim)
        least = self.tensile_strength * self.height / bond_length(self.height, self.dim, self.pieces)
        least *= across / self.corner_radius
        if self.youngs_modulus < least:
            raise ValueError(
                f"--youngs-modulus {self.youngs_modulus:g} Pa: must be >= {least:.3g} Pa with --tensile-strength "
                f"{self.tensile_strength:g} Pa, or contacts would be deeper than a corner before a grain breaks; "
                "raise it or --corner-radius, or lower --tensile-strength or --pieces"
            )
        return self


def effects_of(params: Params) -> list[lsm.effects.Effect]:
    """Elastic, damped and frictional contacts, as stiff as those of a layer beside bonds of this modulus; and bonds."""
    p = params
    stiffness = p.youngs_modulus * bond_length(p.height, p.dim, p.pieces)
    return [
        lsm.LinearElastic(stiffness),
        lsm.ViscousDamping(restitution=p.restitution),
        lsm.CoulombFriction(p.friction, TANGENTIAL_RATIO * stiffness),
        lsm.effects.ElasticBrittleBond(
            youngs_modulus=p.youngs_modulus,
            poissons_ratio=BOND_POISSON,
            cohesion=p.tensile_strength * float(np.tan(BOND_ANGLE)),
            friction_angle=BOND_ANGLE,
            weibull_modulus=np.inf if p.weibull_modulus is None else p.weibull_modulus,
            weibull_seed=0 if p.weibull_modulus is None else p.seed,
        ),
    ]


def velocity_of(params: Params) -> float:
    """Velocity [m s-1] of the upper platen."""
    return params.speed * float(np.sqrt(params.youngs_modulus / params.density))


def check(params: Params) -> None:
    """Refuse nothing beyond what parameters refuse themselves; grains that cannot be made are refused by the run."""


def estimate(params: Params) -> RunCost:
    """Expected steps, time and memory."""
    p = params
    size = p.height / p.pieces ** (1.0 / p.dim)
    two = scene_of(
        2.0 * size * np.eye(2, p.dim),
        effects_of(p),
        shapes=[stand_in("angular", p.dim)],
        diameter=size,
        density=p.density,
        thickness=p.height,
        bonds=np.array([[0, 1]]),
        safety=p.step_safety,
    )
    steps, pieces = p.compression * p.height / velocity_of(p) / (STEP * two.chosen_dt()), p.grains * p.pieces
    seconds = SIMULATION + 0.1 * pieces + price_of("angular", p.dim)["grain_step_seconds"] * steps * pieces
    return RunCost(steps, seconds, PROCESS_BYTES + GRAIN_BYTES["angular", p.dim] * pieces)


def build(params: Params, progress: Progress | None = None) -> lsm.Scene:
    """Grains between the platens, which both touch each of them: all are of one height.

    A grain stands on the platen with its least width upright, as it comes to rest on a plate, where a load does not
    turn it. Raises InputError if no grain has pieces that hold the corner radius.
    """
    p, grains = params, []
    made = lsm.shapes.angular_aggregate if p.dim == 2 else lsm.shapes.polyhedral_aggregate
    of_pieces = f"--pieces {p.pieces}, --corner-radius {p.corner_radius:g}, --seed {p.seed}"
    for k in range(p.grains):
        with in_terms_of(of_pieces, "lower the corner radius"):
            grains.append(made(p.pieces, [p.seed, k], p.corner_radius))
        if progress:
            progress({"stage": "making grains", "done": k + 1, "total": p.grains})
    upright = [least_width(grain) for grain in grains]
    size = p.height / np.array([width for _, width in upright])
    up = np.array([normal for normal, _ in upright])
    below = np.array([grain.support(-normal[None])[0] for grain, normal in zip(grains, up, strict=True)])
    # No fragment reaches another grain, also if that sends one towards it.
    place = (PITCH + 2.0 * flight_of(p)) * p.height * _lattice(p.grains, p.dim)
    place[:, 1] = size * below
    kind = np.arange(p.grains)
    pieces = placed_pieces(grains, kind, size, _turned_up(up), place)
    return lsm.Scene(
        position=pieces.position,
        shapes=[shape for grain in grains for shape in grain.shapes],
        shape_index=pieces.shape_index,
        diameter=pieces.diameter,
        **initial_orientations(pieces.rotation, 0),
        density=p.density,
        thickness=p.height,
        bonds=pieces.bonds,
        bond_area=pieces.bond_area * (p.height if p.dim == 2 else 1.0),
        effects=effects_of(p),
        walls=[
            lsm.PlaneWall("base", point=(0.0,) * p.dim, normal=tuple(np.eye(p.dim)[1])),
            lsm.PlaneWall(
                "ram",
                point=tuple(p.height * np.eye(p.dim)[1]),
                normal=tuple(-np.eye(p.dim)[1]),
                velocity=tuple(-velocity_of(p) * np.eye(p.dim)[1]),
            ),
        ],
        safety=p.step_safety,
    )


def least_width(grain: Aggregate) -> tuple[NDArray, float]:
    """Direction (dim,) of the least width of a grain, body frame, and that width [diameter of the grain].

    The best of even directions, then of ever closer ones about the best so far, which are drawn with a fixed seed.
    """
    dim, rng = grain.position.shape[1], np.random.default_rng(0)

    def best_of(directions: NDArray) -> tuple[NDArray, float]:
        unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        width = grain.support(unit) + grain.support(-unit)
        return unit[np.argmin(width)], float(width.min())

    best, least = best_of(rng.standard_normal((2000, dim)))
    for spread in (0.1, 0.03, 0.01, 3e-3, 1e-3):
        near = best + spread * rng.standard_normal((200, dim))
        best, least = best_of(np.concatenate([best[None], near]))
    return best, least


def _turned_up(directions: NDArray) -> NDArray:
    """Rotations, as of `lsm.random_rotations`, that turn each of these directions (n, dim) upright, along y."""
    if directions.shape[1] == 2:
        return 0.5 * np.pi - np.arctan2(directions[:, 1], directions[:, 0])
    rotations = [Rotation.align_vectors([[0.0, 1.0, 0.0]], [direction])[0] for direction in directions]
    return np.array([rotation.as_quat(scalar_first=True) for rotation in rotations])


def _lattice(count: int, dim: int) -> NDArray:
    """Places (count, dim) of a row in 2D, of a square in the plane of the platens in 3D, one apart."""
    place, side = np.zeros((count, dim)), count if dim == 2 else int(np.ceil(np.sqrt(count)))
    place[:, 0] = np.arange(count) % side
    if dim == 3:
        place[:, 2] = np.arange(count) // side
    return place


def steps_of_rows(params: Params, dt: float) -> list[int]:
    """Time steps of dt [s] from row to row, together those in which the platen goes its way; at least one for a row."""
    steps = max(1, round(params.compression * params.height / (velocity_of(params) * dt)))
    return np.diff(np.linspace(0, steps, min(params.rows, steps) + 1).round().astype(int)).tolist()


def flight_of(params: Params) -> float:
    """How far a fragment may fly while the platen goes its way, over the height of a grain [1].

    At most at the speed at which the strain energy of its grain, strength^2/(2 E) per volume, would all be its own.
    """
    strain = params.tensile_strength / params.youngs_modulus
    return strain * params.compression / params.speed


def press(params: Params, sim: lsm.Simulation, progress: Progress | None = None) -> dict[str, NDArray]:
    """Bring the upper platen down; columns of crush.nc, one row for each place of it where they are measured."""
    p, rows = params, []
    begin, every = lsm.energies(sim).balance, steps_of_rows(p, sim.dt)
    with signals.held() as pending:
        for k, steps in enumerate(every):
            sim.run(steps)
            rows.append({"time": sim.time, **_of_grains(p, sim), **_of_energies(sim, begin)})
            if progress:
                broken = int(np.sum(rows[-1]["fragments"] > 1))
                progress({"stage": f"pressing, {broken} grains broken", "done": k + 1, "total": len(every)})
            if pending.signum is not None:
                pending.deliver()
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def _of_grains(p: Params, sim: lsm.Simulation) -> dict[str, NDArray]:
    """Of each grain the force [N] on the upper platen, its fragments, and the share of its mass in the largest one."""
    contacts = sim.contacts()
    on_ram = contacts.second_id.values == -1 - RAM
    owner = contacts.first_id.values[on_ram] // p.pieces
    force = np.bincount(owner, contacts.normal_force.values[on_ram], p.grains)
    mass = sim.scene.masses()[0]
    fragment = lsm.fragments(sim)
    of_fragment = np.bincount(fragment, mass)
    first = np.unique(fragment, return_index=True)[1] // p.pieces  # the grain of each fragment
    largest = np.zeros(p.grains)
    np.maximum.at(largest, first, of_fragment)
    whole = mass.reshape(p.grains, p.pieces).sum(axis=1)
    return {"force": force, "fragments": np.bincount(first, minlength=p.grains), "largest_share": largest / whole}


def _of_energies(sim: lsm.Simulation, begin: float) -> dict[str, float]:
    """Terms of the budget [J], what bonds dissipated among them, and what the budget leaves open."""
    sums = sim.measure.sums()
    now = lsm.energies(sim, sums)
    return {
        "work": now.work,
        "elastic_energy": now.elastic,
        "kinetic_energy": now.kinetic,
        "dissipated_energy": now.dissipated,
        "fracture_energy": sums["dissipated_elastic_brittle_bond"],
        "energy_residual": begin - now.balance,
    }


def run(
    params: Params, out: str | os.PathLike[str], progress: Progress | None = None, existing: Existing = "refuse"
) -> xarray.Dataset:
    """Run the experiment; writes crush.nc, crush.png and summary.json, returns crush.nc as a Dataset.

    existing: what becomes of a run that is there: it makes `run` refuse the folder, is removed, or is made again.
    Raises InputError before anything is computed, SimulationError if the run has to be stopped.
    """
    check(params)
    watch = Stopwatch()
    with run_folder(params, "crush-grain", out, existing) as folder:
        sim = lsm.Simulation(build(params, progress), params.arch, params.precision, params.threads)
        sim.keep_checkpoints(folder, seconds=np.inf)
        return _conclude(params, folder, press(params, sim, progress), sim.dt, watch, progress)


def _conclude(
    params: Params, out: Path, columns: dict[str, NDArray], dt: float, watch: Stopwatch, progress: Progress | None
) -> xarray.Dataset:
    """File, picture and summary."""
    dataset = write_crushing(out, columns, params, dt)
    plot_crushing(out / f"crush.{params.format}", dataset, params)
    metrics: dict[str, Metric] = analyse(dataset, params) | watch.metrics()
    write_summary(out, "crush-grain", params.preset_name, metrics, quiet=progress is None)
    return dataset
