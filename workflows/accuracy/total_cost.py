"""What all measurements of accuracy-cost are expected to take, from the numbers of runs, grains and steps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from workflows import shear_gouge
from workflows.accuracy import collisions, gas, gouge, outlines
from workflows.common.refusals import checked
from workflows.common.run_cost import PROCESS_BYTES, RunCost, of_replicas
from workflows.gouge.layer_cost import layer_cost

if TYPE_CHECKING:
    from workflows.accuracy_cost import Params

PROCESS = 3.0  # to start a process of its own [s]
SIMULATION = 2.5  # to compile a simulation [s]
SAMPLE = 2e-3  # to sum the energies [s]
GRAIN_STEP = 80e-9  # of the gas, per grain and step [s]
PACKED_GRAIN = 0.01  # to make a grain of the gas [s]
IMPACT = 0.2  # to make and run an impact of two ellipses [s]


def total_cost(params: Params) -> RunCost:
    """Expected steps, time and memory; measurements that are timed run one after the other."""
    parts = [*_collisions(params), *_gases(params), *_shapes(params), *_layers(params)]
    return RunCost(
        sum(part.steps for part in parts), sum(part.seconds for part in parts), max(part.memory for part in parts)
    )


def _collisions(params: Params) -> list[RunCost]:
    """Pairs with both force laws, and the rack: side by side."""
    runs = params.replicas * len(collisions.LEVELS)
    steps = params.replicas * sum(collisions.LEVELS)
    jobs = [
        RunCost(steps * schemes, PROCESS + schemes * (SIMULATION + SAMPLE * (steps / 3 + 5 * runs)), PROCESS_BYTES)
        for schemes in (len(collisions.SCHEMES), 3, len(collisions.SCHEMES))  # linear, Hertz, rack
    ]
    return [of_replicas(jobs, 2)]


def _gases(params: Params) -> list[RunCost]:
    """The gas of arcs in every scheme, and the skin."""
    p, costs = params, []
    of_drift = params.replicas * params.contacts * sum(gas.LEVELS)
    samples = 60 * params.replicas * len(gas.LEVELS)
    for schemes in gas.GROUPS.values():
        steps = len(schemes) * of_drift + (len(schemes) + 1) * p.timed_steps * (p.turns + 1)
        seconds = PROCESS + (len(schemes) + 1) * SIMULATION + PACKED_GRAIN * p.gas_grains * p.replicas
        seconds += len(schemes) * samples * SAMPLE + GRAIN_STEP * p.gas_grains * steps
        costs.append(RunCost(steps, seconds, PROCESS_BYTES))
    if p.lists:
        steps = len(gas.SKINS) * p.timed_steps * (p.turns + 1)
        costs.append(RunCost(steps, PROCESS + SIMULATION + GRAIN_STEP * p.gas_grains * steps, PROCESS_BYTES))
    return costs


def _shapes(params: Params) -> list[RunCost]:
    """Layers of every kind of grain, stars and impacts."""
    layer = layer_cost(checked(shear_gouge.Params, **outlines.LAYER, shape="angular", seed=params.seed))
    kinds = 1 + len(params.patches) + len(params.discs) + len(params.corners)
    costs = [layer] * (kinds * params.shape_turns)
    if params.corners:
        grain_steps = outlines.STARS**2 * (len(outlines.BARS) + 1) * params.timed_steps * (params.turns + 1)
        seconds = PROCESS + (len(outlines.BARS) + 1) * SIMULATION + GRAIN_STEP * grain_steps
        costs.append(RunCost(grain_steps / outlines.STARS**2, seconds, PROCESS_BYTES))
    impacts = params.impacts * (1 + len(outlines.PATCHES))
    return [*costs, RunCost(0.0, PROCESS + SIMULATION + IMPACT * impacts, PROCESS_BYTES)]


def _layers(params: Params) -> list[RunCost]:
    """Layers of every setting, one after the other, and the long ones, two at a time."""
    costs, one = [], params.model_copy(update={"seeds": 1})  # no cost depends on the seed
    for shape in dict.fromkeys(params.shapes + params.long_shapes):
        parameters = params.parameters if shape in params.shapes else ["step_safety"]
        jobs = {job[0]: job[2] for job in gouge.jobs_of(one, shape, parameters, Path()).values()}
        for cost in map(layer_cost, jobs.values()):
            costs.append(replace(cost, steps=params.seeds * cost.steps, seconds=params.seeds * cost.seconds))
        if params.long_strain and shape in params.long_shapes:
            long = layer_cost(gouge.layer(params, shape, params.seed, strain=params.long_strain))
            costs += [long, of_replicas([long] * (params.long_runs - 1), 2)]
    return costs
