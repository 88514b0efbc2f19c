"""Our code as a process of its own: Taichi is initialised once per process, so each configuration needs one.

`Worker` starts `python -m benchmarks.ours`, which compiles, says how many grains it has, then waits for lines on its
input: "run N" advances by N steps and answers with the seconds on the wall clock and on the processor; "rebuild N"
searches for neighbours N times and answers with the seconds of each; "memory" answers with the bytes resident now and
at their peak; "size" with the fields and bytes of a grain and of a listed pair; "measure" with the figures that LAMMPS
gives too.
"""

import json
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

ROOT = Path(__file__).parent.parent


class Worker:
    """A running configuration. Waits without using the processor while others are timed."""

    def __init__(self, tag, precision, threads, extras):
        command = [sys.executable, "-m", "benchmarks.ours", tag, precision, str(threads), str(int(extras))]
        self.process = subprocess.Popen(
            command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        self.grains = self.ask(None)["grains"]

    def ask(self, order):
        """Send an order and return the answer; RuntimeError if the process died."""
        if order is not None:
            self.process.stdin.write(order + "\n")
            self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            raise RuntimeError(f"{' '.join(self.process.args)}: ended with code {self.process.wait()}")
        return json.loads(answer)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.process.stdin.close()
        self.process.wait()


def metrics(sim, volume):
    """What LAMMPS prints as well: contacts per mobile grain, pressure of the pairs, kinetic energies. `volume` of the
    scene: its product with the pressure is what is measured."""
    sums = sim.measure.sums(low=-1e9, high=1e9)
    mobile = int((sim.scene.platen_index < 0).sum())
    moving = 2.0 * sums["translational_energy"]  # in the trace of our stress; LAMMPS is asked for pairs only
    return {
        "contacts_per_grain": sums["contact_ends"] / mobile,
        "pressure": (float(sums["stress"].trace()) - moving) / (sim.scene.dim * volume),
        "translational_energy": sums["translational_energy"],
        "rotational_energy": sums["rotational_energy"],
        "mass": float(sim.scene.masses()[0].sum()),
    }


def timed_rebuild(sim):
    """Seconds of one neighbour search."""
    began = time.perf_counter()
    sim.rebuild_neighbours()
    return time.perf_counter() - began


def memory():
    """{"resident": bytes of this process in memory now, "peak": the most there were}, from Linux' /proc."""
    lines = Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines()
    kilobytes = dict(line.split(":", 1) for line in lines)
    return {name: int(kilobytes[key].split()[0]) * 1024 for name, key in (("resident", "VmRSS"), ("peak", "VmHWM"))}


def size(sim):
    """What the state of a simulation holds: fields, and bytes per grain and per slot of the list."""
    from taichi_lsm.core.fields import bytes_per_row

    grains, pairs = sim.grains, sim.pairs
    return {
        "fields": len(grains.variables) + len(pairs.variables) + len(pairs.saved),
        "bytes_per_grain": bytes_per_row(grains.variables.values(), grains.sizes),
        "bytes_per_pair": pairs.bytes_per_pair(),
    }


def serve(tag, precision, threads, extras):
    """Answer orders from standard input until it closes."""
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
        order, *count = line.split()
        if order == "run":
            before, began, cpu_began = sim.rebuilds, time.perf_counter(), time.process_time()
            sim.run(int(count[0]))
            answer = {"seconds": time.perf_counter() - began, "cpu_seconds": time.process_time() - cpu_began}
            answer["rebuilds"] = sim.rebuilds - before
        elif order == "rebuild":
            answer = {"seconds": [timed_rebuild(sim) for _ in range(int(count[0]))]}
        elif order == "memory":
            answer = memory()
        elif order == "size":
            answer = size(sim)
        else:
            answer = measure(sim)
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    serve(sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4] == "1")
