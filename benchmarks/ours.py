"""Our code as a process of its own: Taichi is initialised once per process, so each configuration needs one.

`Worker` starts `python -m benchmarks.ours`, which compiles, prints its number of grains, then waits for requests on
its standard input, one per line:

- "run N" advances by N steps and answers with the seconds on the wall clock and on the processor;
- "rebuild N" searches for neighbours N times and answers with the seconds of each search;
- "memory" answers with the bytes resident now and at their peak;
- "size" answers with the fields and bytes of a grain and of a listed pair;
- "measure" answers with the metrics that LAMMPS gives too.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import taichi_lsm as lsm

ROOT = Path(__file__).parent.parent


class Worker:
    """A running configuration; it uses no processor time while others are timed.

    Parameters
    ----------
    tag : str
        Declared scene, see `scenes.declared`, or one of `clumps.TAGS`.
    precision : str
        "f64" or "f32".
    threads : int
        Threads of the simulation.
    extras : bool
        Track dissipation and correct the onset of contacts, see `scenes.build`.
    """

    def __init__(self, tag: str, precision: str, threads: int, extras: bool) -> None:
        self.command = [sys.executable, "-m", "benchmarks.ours", tag, precision, str(threads), str(int(extras))]
        self.process = subprocess.Popen(
            self.command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        assert self.process.stdin is not None and self.process.stdout is not None  # both are pipes
        self._requests, self._answers = self.process.stdin, self.process.stdout
        self.grains: int = self.ask(None)["grains"]

    def ask(self, request: str | None) -> dict[str, Any]:
        """Send a request (None: wait only) and return the answer; RuntimeError if the process has ended."""
        if request is not None:
            self._requests.write(request + "\n")
            self._requests.flush()
        answer = self._answers.readline()
        if not answer:
            raise RuntimeError(f"{' '.join(self.command)}: ended with code {self.process.wait()}")
        return json.loads(answer)

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *error: object) -> None:
        self._requests.close()
        self.process.wait()


def metrics(sim: lsm.Simulation, volume: float) -> dict[str, float]:
    """Quantities that LAMMPS prints too: contacts per mobile grain, pressure of the pairs, kinetic energies, mass.

    volume: that of the scene (area in 2D), by which the trace of the stress sum is divided.
    """
    sums = sim.measure.sums()
    mobile = sim.scene.platen_index < 0
    # What fluctuations carry is part of the trace of our stress; LAMMPS gives that of pairs alone.
    mass = sim.scene.masses()[0][mobile]
    momentum = mass @ sim.velocities[mobile]
    kinetic = 2.0 * sums["translational_energy"] - float(momentum @ momentum) / float(mass.sum())
    return {
        "contacts_per_grain": sums["contact_ends"] / int(mobile.sum()),
        "pressure": (float(np.trace(sums["stress_volume"])) - kinetic) / (sim.scene.dim * volume),
        "translational_energy": sums["translational_energy"],
        "rotational_energy": sums["rotational_energy"],
        "mass": float(sim.scene.masses()[0].sum()),
    }


def timed_rebuild(sim: lsm.Simulation) -> float:
    """Seconds of one neighbour search."""
    began = time.perf_counter()
    sim.rebuild_neighbours()
    return time.perf_counter() - began


def memory() -> dict[str, int]:
    """Memory of this process from Linux' /proc: {"resident": bytes now, "peak": highest so far}."""
    lines = Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines()
    kilobytes = dict(line.split(":", 1) for line in lines)
    return {name: int(kilobytes[key].split()[0]) * 1024 for name, key in (("resident", "VmRSS"), ("peak", "VmHWM"))}


def size(sim: lsm.Simulation) -> dict[str, int]:
    """Size of the state of a simulation: number of fields, bytes per grain and per slot of the neighbour list."""
    from taichi_lsm.core.fields import bytes_per_row

    grains, pairs = sim.grains, sim.pairs
    return {
        "fields": len(grains.variables) + len(pairs.variables) + len(pairs.saved),
        "bytes_per_grain": bytes_per_row(grains.variables.values(), grains.sizes),
        "bytes_per_pair": pairs.bytes_per_pair(),
    }


def serve(tag: str, precision: str, threads: int, extras: bool) -> None:
    """Answer requests from standard input until it closes; parameters as for `Worker`."""
    import taichi_lsm as lsm
    from benchmarks import clumps, scenes

    parallel = False if threads == 1 else None  # with more than one the simulation chooses by the number of grains
    if tag in clumps.TAGS:
        state, steps = clumps.load(tag), 0
        scene = clumps.build(state, clumps.relaxed(tag), extras, parallel)
        measure = partial(clumps.metrics, clumps=state)
    else:
        scene, volume, steps = scenes.declared(tag, extras, parallel)
        measure = partial(metrics, volume=volume)
    sim = lsm.Simulation(scene, precision=precision, threads=threads)
    sim.run(steps)
    measure(sim)  # compiles the last kernels
    print(json.dumps({"grains": len(sim)}), flush=True)
    for line in sys.stdin:
        request, *count = line.split()
        if request == "run":
            before, began, cpu_began = sim.rebuilds, time.perf_counter(), time.process_time()
            sim.run(int(count[0]))
            answer = {"seconds": time.perf_counter() - began, "cpu_seconds": time.process_time() - cpu_began}
            answer["rebuilds"] = sim.rebuilds - before
        elif request == "rebuild":
            answer = {"seconds": [timed_rebuild(sim) for _ in range(int(count[0]))]}
        elif request == "memory":
            answer = memory()
        elif request == "size":
            answer = size(sim)
        else:
            answer = measure(sim)
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    serve(sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4] == "1")
