"""An experiment without physics: two metrics that are simple functions of its parameters, with scatter by its seed."""

from pathlib import Path

import numpy as np
from pydantic import Field

from taichi_lsm.core.errors import SimulationError
from workflows.common.metrics import Metric, write_summary
from workflows.common.parameters import Params as BaseParams
from workflows.common.run_cost import RunCost


class Params(BaseParams):
    friction: float = Field(0.5, ge=0, le=10, description="Coulomb coefficient [1]")
    length: float = Field(1.0, gt=0, description="length of the layer [m]")
    scatter: float = Field(0.01, ge=0, description="scatter [1]")
    fails_from: float = Field(1e9, description="length from which a run fails [m]")


def check(params):
    """Refuses nothing."""


def estimate(params):
    return RunCost(steps=1, seconds=0.1, memory=1e6)


def run(params, out, progress=None, existing="refuse"):
    if params.length > params.fails_from:
        raise SimulationError("diverged at step 7")
    noise = np.random.default_rng(params.seed).normal(0.0, params.scatter, 2)
    metrics = {
        "friction_mean": Metric(params.friction**0.5 + noise[0], "1"),
        "height": Metric(params.length * (2.0 + params.friction) + noise[1], "m"),
    }
    write_summary(Path(out), "noisy-run", params.preset_name, metrics, quiet=progress is None)
