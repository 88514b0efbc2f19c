"""The runs of the elastic gas: schemes, sizes, seeds and steps, and what they are expected to take."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from workflows.common.run_cost import PROCESS_BYTES, RunCost, of_replicas

if TYPE_CHECKING:
    from workflows.energy_conservation import Params

LEVELS = (50, 71, 100, 141, 200, 283, 400)  # steps per contact, for the order
SCHEMES = {  # by name: importing a workflow must not start Taichi
    "onset_verlet": "OnsetVerlet",
    "velocity_verlet": "VelocityVerlet",
    "symplectic_euler": "SymplecticEuler",
    "explicit_euler": "ExplicitEuler",
}
CONES = {"cones": 0.0, "cones_that_miss_seams": 1.0}  # general patches with the default integrator, in missed seams


# What `estimate` counts with [s]: the start of a process, with compiling; making a grain; a sample; a grain and step.
START = 6.0
PACKED_GRAIN = {2: 0.01, 3: 0.05}
SAMPLE = 3e-3
GRAIN_STEP = {2: 60e-9, 3: 200e-9, "cones": 5e-6}
GRAIN_BYTES = 4e4  # of a grain, which has a shape of its own


class Planned(NamedTuple):
    """A run of a gas: its purpose (drift | long | order | plateau), size, random seed, step and number of steps."""

    purpose: str
    grains: int
    seed: int
    steps: int
    steps_per_contact: int


def runs_of(params: Params, scheme: str) -> list[Planned]:
    """All runs of one scheme, in their order."""
    p = params
    if scheme in CONES:  # a plateau: over equal times the drift hardly falls with the step
        return [Planned("plateau", p.order_grains, p.seed, p.steps // 2 * n // 50, n) for n in (50, 100, 200)]
    seeds = range(p.seed, p.seed + (p.seeds if scheme != "explicit_euler" else 1))
    runs = [Planned("drift", p.grains, seed, p.steps, n) for n in (50, 100) for seed in seeds]
    if scheme == "onset_verlet":
        runs.append(Planned("long", p.grains, p.seed, p.long_steps, 50))
    levels = LEVELS if scheme != "explicit_euler" and p.dim == 2 else ()
    seeds = range(p.seed, p.seed + p.order_seeds)
    runs += [Planned("order", p.order_grains, seed, p.steps // 2 * n // 50, n) for n in levels for seed in seeds]
    return runs


def schemes_of(params: Params) -> list[str]:
    """Keys of SCHEMES and CONES that are measured in this dimension."""
    return [*SCHEMES, *CONES] if params.dim == 2 else list(SCHEMES)


def gas_cost(params: Params) -> RunCost:
    """Expected steps, time and memory of all runs, two schemes at a time."""
    costs = []
    for scheme in schemes_of(params):
        runs = runs_of(params, scheme)
        made = {(run.grains, run.seed) for run in runs}
        samples = sum(min(params.samples, run.steps) for run in runs)
        grain_steps = sum(float(run.grains) * run.steps for run in runs)
        seconds = START + PACKED_GRAIN[params.dim] * sum(grains for grains, _ in made) + SAMPLE * samples
        seconds += grain_steps * GRAIN_STEP["cones" if scheme in CONES else params.dim]
        memory = PROCESS_BYTES + GRAIN_BYTES * max(run.grains for run in runs)
        costs.append(RunCost(float(sum(run.steps for run in runs)), seconds, memory))
    return of_replicas(costs, 2)
