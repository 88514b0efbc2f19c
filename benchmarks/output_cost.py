"""What share of a run goes into diagnostics, files and guards? `python -m benchmarks.output_cost`.

Runs the shear experiment (`lsm shear-gouge` with its defaults) and times, from outside of the program, every sample of
the layer (all sums over grains and contacts), every row and snapshot written, and every look and sum of the guards. The
first of each is left out of both the part and the whole: it compiles. The picture made at the end does not grow with
the run and is given in seconds.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time

from benchmarks import bounds, page
from benchmarks.ours import ROOT

SHAPES = ("sphere", "angular")
DIAGNOSTICS, FILES, GUARDS = 0.03, 0.01, 0.02  # bounds of the shares


class Stopwatch:
    """Seconds and calls of methods, of which only the outermost counts."""

    def __init__(self):
        self.calls, self.seconds, self.first, self.inside = 0, 0.0, 0.0, False

    def watch(self, owner, name):
        """Replace method `name` of the class `owner` by one that is timed."""
        method = getattr(owner, name)

        def timed(*args, **options):
            if self.inside:
                return method(*args, **options)
            self.inside, began = True, time.perf_counter()
            try:
                return method(*args, **options)
            finally:
                taken, self.inside = time.perf_counter() - began, False
                self.first = self.first if self.calls else taken
                self.calls, self.seconds = self.calls + 1, self.seconds + taken

        setattr(owner, name, timed)


def serve(shape):
    """Run the experiment and print the seconds as JSON: of the whole, of samples, of files, of the picture."""
    import taichi_lsm as lsm
    from taichi_lsm.stepping.monitor import Monitor
    from workflows import shear_gouge
    from workflows.plots import run_plots as plots

    samples, files, picture, looks, sums, error_flags = (Stopwatch() for _ in range(6))
    looks.watch(Monitor, "_check_grains")
    sums.watch(Monitor, "_check_energy")
    error_flags.watch(Monitor, "check_faults")
    samples.watch(lsm.ShearedLayer, "sample")
    for name in ("row", "snapshot", "__enter__", "__exit__"):
        files.watch(lsm.LayerRecorder, name)
    picture.watch(plots, "plot_run")
    params = shear_gouge.Params(shape=shape)
    scene = shear_gouge.build(params)
    with tempfile.TemporaryDirectory() as out:
        began = time.perf_counter()
        shear_gouge.simulate(scene, params, out)
        whole = time.perf_counter() - began
    print(
        json.dumps(
            {
                "run": whole - samples.first - picture.seconds - looks.first - sums.first,
                "samples": samples.seconds - samples.first,
                "count": samples.calls - 1,
                "files": files.seconds,
                "guards": looks.seconds - looks.first + sums.seconds - sums.first + error_flags.seconds,
                "picture": picture.seconds,
            }
        )
    )


def run(shape):
    """What `serve` measures, in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.output_cost", "--serve", shape]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr[-2000:]}")
    return json.loads(done.stdout.splitlines()[-1])


def measure(shapes):
    """(figures with the bounds, seconds by shape)."""
    seconds = {shape: run(shape) for shape in shapes}
    metrics = {}
    for shape, part in seconds.items():
        metrics[f"diagnostics_{shape}"] = bounds.figure(part["samples"] / part["run"], "1", DIAGNOSTICS)
        metrics[f"files_{shape}"] = bounds.figure(part["files"] / part["run"], "1", FILES)
        metrics[f"guards_{shape}"] = bounds.figure(part["guards"] / part["run"], "1", GUARDS)
    return metrics, seconds


def table(seconds):
    """Markdown table of the seconds of each run."""
    lines = page.head("shape", "run [s]", "samples [s]", "number of samples", "files [s]", "guards [s]", "picture [s]")
    for shape, s in seconds.items():
        parts = (f"{s['run']:.2f}", f"{s['samples']:.3f}", s["count"], f"{s['files']:.3f}")
        parts += (f"{s['guards']:.3f}", f"{s['picture']:.2f}")
        lines.append(page.row(shape, *parts))
    return "\n".join(lines)


def main():
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--serve", choices=SHAPES, help="run one shape in this process and print its seconds")
    args = parser.parse_args()
    if args.serve:
        serve(args.serve)
        return
    metrics, seconds = measure(SHAPES)
    print(f"{table(seconds)}\n\n{bounds.table(metrics)}")


if __name__ == "__main__":
    main()
