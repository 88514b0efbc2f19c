"""What is tried in processes of their own, which may hang or crash: a step on each device, rendering, plugins."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from workflows.common.discovery import PLUGINS, DiscoveryError, find_workflows
from workflows.common.offscreen import rendering_problem
from workflows.doctor.finding import Finding

PATIENCE_S = 120.0  # with a cold cache on a busy machine a step takes half a minute
HERE = str(Path(__file__).resolve().parents[2])
STEP = """
import sys
import taichi_lsm as lsm
try:
    lsm.effects.find_effects()
    scene = lsm.Scene(position=[(0.0, 0.5), (0.0, 1.4)], density=2650.0, effects=[lsm.LinearElastic(1e7)])
    simulation = lsm.Simulation(scene, sys.argv[1])
    simulation.run(steps=1)
    assert abs(simulation.state.velocity.to_numpy()).max() > 0.0, "a grain that is pushed does not move"
except lsm.InputError as error:
    sys.exit(str(error))
"""
GPU = "runs use the CPU"


def trials() -> Iterator[Finding]:
    """A step on the CPU and on the GPU, plugins, and rendering; the processes run side by side."""
    with ThreadPoolExecutor() as pool:
        cpu, gpu, rendering = pool.submit(step, "cpu"), pool.submit(step, "gpu"), pool.submit(rendering_problem)
        yield plugins()
        problem, seconds = cpu.result()
        if problem:
            yield Finding("CPU", "problem", f"no step can be made: {problem}", needed=True)
        else:
            yield Finding("CPU", "ok", f"a step was made, in a process of {seconds:.1f} s", needed=True)
        problem, seconds = gpu.result()
        if "has no GPU" in problem:
            yield Finding("GPU", "missing", f"none that Taichi can compute on; {GPU}")
        elif problem:
            yield Finding("GPU", "problem", f"no step can be made: {problem}; {GPU}")
        else:
            yield Finding("GPU", "ok", f"a step was made, in a process of {seconds:.1f} s: --arch gpu")
        yield rendered(rendering.result())


def step(arch: str, code: str = STEP, patience: float = PATIENCE_S) -> tuple[str, float]:
    """(why no step of two grains can be made on a device, or "", seconds that the process took)."""
    path = os.pathsep.join(filter(None, (HERE, os.environ.get("PYTHONPATH"))))
    began = time.monotonic()
    try:
        done = subprocess.run(
            [sys.executable, "-c", code, arch],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=patience,
            env=os.environ | {"PYTHONPATH": path},
        )
    except subprocess.TimeoutExpired:
        return f"no answer within {patience:g} s; is the machine busy?", patience
    if done.returncode == 0:
        return "", time.monotonic() - began
    said = [line for line in done.stderr.splitlines() if line.strip()] or [f"exit code {done.returncode}"]
    ended = f"the process was ended by signal {-done.returncode}" if done.returncode < 0 else said[-1].strip()
    return ended, time.monotonic() - began


def plugins() -> Finding:
    """Whether experiments are found, those of LSM_PLUGINS too."""
    try:
        count = len(find_workflows())
    except DiscoveryError as error:
        return Finding("experiments", "problem", f"{error} Mend it, or unset {PLUGINS}", needed=True)
    more = f", with those of {PLUGINS}={os.environ[PLUGINS]}" if os.environ.get(PLUGINS) else ""
    return Finding("experiments", "ok", f"{count}{more}", needed=True)


def rendered(problem: str | None) -> Finding:
    """Whether pictures of 3D grains can be rendered, by what is wrong."""
    if problem is None:
        return Finding("3D pictures", "ok", "pyvista renders without a display")
    state = "missing" if "not installed" in problem else "problem"
    return Finding("3D pictures", state, f"{problem}; drawn by matplotlib meanwhile")
