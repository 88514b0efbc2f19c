"""A workflow that needs no physics, given to `lsm` as a plugin."""

import sys

import pytest

import workflows

TOY = '''"""A toy that behaves as it is told."""

import os
import signal
import time
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import BaseModel, Field, model_validator

from taichi_lsm.core.errors import InputError, SimulationError
from workflows.common import signals
from workflows.common.parameters import Params as BaseParams
from workflows.common.metrics import Metric, write_summary
from workflows.common.run_cost import RunCost


REMEDY = "the layer is crushed: lower --normal-stress"


class Effect(BaseModel, extra="forbid"):
    name: str
    stiffness: float = Field(1.0, gt=0)


class Params(BaseParams):
    grains: int = Field(600, ge=2, description="number of grains")
    dim: int = Field(2, ge=2, le=3, description="space dimensions")
    normal_stress: float = Field(5e6, gt=0, description="normal stress on the layer [Pa]")
    shape: Literal["sphere", "angular"] = Field("sphere", description="shape of the grains")
    shapes: tuple[Literal["sphere", "angular"], ...] = Field(("sphere",), description="shapes to compare")
    seeds: list[Annotated[int, Field(ge=0)]] = Field([1, 2], description="seeds")
    time_step: float | None = Field(1e-3, gt=0, description="time step [s]")
    rough: bool = Field(True, description="rough platens")
    note: str = Field("", description="free text")
    effects: list[Effect] = Field([], description="effects")
    act: str = Field("finish", description="what to do")

    presets: ClassVar[dict[str, dict]] = {
        "smoke": {"grains": 10, "normal_stress": 1e3},
        "demo": {},
        "standard": {"normal_stress": 1e6},
        "reference": {"grains": 10000},
    }

    @model_validator(mode="after")
    def _cross_check(self):
        if self.dim == 3 and self.shape == "angular" and self.grains == 13:
            raise ValueError("13 angular grains do not fit in 3D")
        return self


def check(params):
    """Refuses nothing."""


def estimate(params):
    return RunCost(steps=1e3, seconds=2.0, memory=1e8)


def run(params, out, progress=None, existing="refuse"):
    out = Path(out)
    if params.act == "reject":
        raise InputError("grains 600: do not fit")
    if params.act == "diverge":
        raise SimulationError("diverged at step 7")
    if params.act == "disk":
        raise OSError(28, "No space left on device")
    if params.act == "crash":
        raise KeyError("a programming error")
    if params.act == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    if params.act == "wait":
        (out / "ready").write_text("")
        try:
            time.sleep(60)
        except signals.Interrupted:
            time.sleep(0.2)  # a flush that takes a while
            (out / "flushed").write_text("")
            raise
    if params.act == "count":
        for signum in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(signum, lambda number, frame: received.append(number))
        received, until = [], time.monotonic() + 20.0
        (out / "ready").write_text("")
        for name in ("first", "second"):
            while not received and time.monotonic() < until:
                time.sleep(0.01)
            (out / f"{name}.new").write_text(str(received.pop()))
            (out / f"{name}.new").rename(out / name)
        return
    print("noise from a library")
    if progress:
        progress({"strain": 0.5, "strain_total": 1.0, "friction": 0.31})
    (out / "process").write_text(f"{os.getpid()} {os.environ.get('OMP_NUM_THREADS')}")
    holds = params.normal_stress <= 2e6 or params.act != "judge"
    stress = Metric(params.normal_stress, "Pa", 2e6, holds, remedy=REMEDY)
    metrics = {"seed": Metric(params.seed, "1"), "stress": stress}
    write_summary(out, "toy-run", params.preset_name, metrics, quiet=progress is None)
'''


@pytest.fixture
def plugins(tmp_path, monkeypatch):
    """The folder LSM_PLUGINS/workflows with toy_run.py in it; forgotten after the test."""
    folder = tmp_path / "plugins" / "workflows"
    folder.mkdir(parents=True)
    (folder / "toy_run.py").write_text(TOY)
    monkeypatch.setenv("LSM_PLUGINS", str(folder.parent))
    monkeypatch.chdir(tmp_path)
    path, modules = list(workflows.__path__), set(sys.modules)
    yield folder
    workflows.__path__[:] = path
    for name in set(sys.modules) - modules:
        if name.startswith("workflows."):
            del sys.modules[name]
            vars(workflows).pop(name.removeprefix("workflows."), None)


@pytest.fixture
def toy(plugins):
    """The module of the toy workflow."""
    from workflows.common.discovery import find_workflows

    return find_workflows()["toy-run"]
