"""What share of a run goes into diagnostics, files, checkpoints and guards? `python -m benchmarks.output_cost`.

Runs the shear experiment (`lsm shear-gouge` with its defaults) and times, from outside of the program, every sample of
the layer (all sums over grains and contacts), every row and snapshot written, every checkpoint at the default interval,
and every check and sum of the guards. Then the same with contacts and snapshots at every percent of shear strain.
The first of each is left out of both the share and the whole: it compiles. The picture made at the end does not grow
with the run and is given in seconds.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from typing import Any

from benchmarks import bounds, page
from benchmarks.ours import ROOT

SHAPES = ("sphere", "angular")
DIAGNOSTICS, FILES, CHECKPOINTS, GUARDS = 0.03, 0.01, 0.02, 0.02  # bounds of the shares
CONTACTS, SNAPSHOTS = 0.03, 0.03  # likewise, of a run that writes them often
OFTEN = {"contacts": ["every=0.01"], "snapshots": ["every=0.01"]}


class Stopwatch:
    """Seconds and calls of the watched methods; a call from inside another watched call is not counted again."""

    def __init__(self) -> None:
        self.calls, self.seconds, self.first, self.inside = 0, 0.0, 0.0, False

    def watch(self, owner: Any, name: str) -> None:
        """Replace attribute `name` of the class or module `owner` by a timed version."""
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


def watched() -> dict[str, tuple[Any, tuple[str, ...]]]:
    """Classes or modules and their functions whose calls are timed, by what they are counted as."""
    import taichi_lsm as lsm
    from taichi_lsm.io.contacts_file import ContactsWriter
    from taichi_lsm.io.grains_file import GrainsWriter
    from taichi_lsm.stepping.monitor import Monitor
    from workflows.plots import run_plots
    from workflows.protocol.run_loop import RunLoop

    return {
        "samples": (lsm.ShearedLayer, ("sample",)),
        "contacts": (lsm.LayerRecorder, ("moment",)),
        "contacts_at_end": (ContactsWriter, ("close",)),
        "snapshots": (lsm.LayerRecorder, ("snapshot",)),
        "snapshots_at_end": (GrainsWriter, ("close",)),
        "files": (lsm.LayerRecorder, ("row", "snapshot", "__enter__", "__exit__")),
        "checkpoints": (RunLoop, ("keep_checkpoint",)),
        "picture": (run_plots, ("plot_run",)),
        "checks": (Monitor, ("_check_grains",)),
        "sums": (Monitor, ("_check_energy",)),
        "error_flags": (Monitor, ("check_error_flags",)),
    }


def serve(shape: str, often: bool) -> None:
    """Run the experiment and print as JSON the seconds of the whole and of its parts, see `watched`."""
    from workflows import shear_gouge

    watches = {name: Stopwatch() for name in watched()}
    for name, (owner, functions) in watched().items():
        for function in functions:
            watches[name].watch(owner, function)
    samples, picture, checks, sums = (watches[name] for name in ("samples", "picture", "checks", "sums"))
    contacts, snapshots = (watches[name] for name in ("contacts", "snapshots"))
    params = shear_gouge.Params.model_validate({"shape": shape} | (OFTEN if often else {}))
    scene = shear_gouge.build(params)
    with tempfile.TemporaryDirectory() as out:
        began = time.perf_counter()
        shear_gouge.simulate(scene, params, out)
        whole = time.perf_counter() - began
    print(
        json.dumps(
            {
                "run": whole - samples.first - picture.seconds - checks.first - sums.first - contacts.first,
                "contacts": contacts.seconds - contacts.first + watches["contacts_at_end"].seconds,
                "snapshots": snapshots.seconds - snapshots.first + watches["snapshots_at_end"].seconds,
                "moments": contacts.calls,
                "samples": samples.seconds - samples.first,
                "count": samples.calls - 1,
                "files": watches["files"].seconds,
                "checkpoints": watches["checkpoints"].seconds,
                "guards": checks.seconds - checks.first + sums.seconds - sums.first + watches["error_flags"].seconds,
                "picture": picture.seconds,
            }
        )
    )


def run(shape: str, often: bool = False) -> dict[str, float]:
    """Seconds that `serve` prints, from a process of its own."""
    command = [sys.executable, "-m", "benchmarks.output_cost", "--serve", shape, *["--often"] * often]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr[-2000:]}")
    return json.loads(done.stdout.splitlines()[-1])


def measure(shapes: Sequence[str]) -> tuple[dict[str, dict[str, Any]], dict[str, dict[str, float]]]:
    """Shares of a run as metrics with their bounds, and the seconds of each shape."""
    seconds = {shape: run(shape) for shape in shapes}
    often = {shape: run(shape, often=True) for shape in shapes}
    metrics = {}
    for shape, s in seconds.items():
        metrics[f"diagnostics_{shape}"] = bounds.metric(s["samples"] / s["run"], "1", DIAGNOSTICS)
        metrics[f"files_{shape}"] = bounds.metric(s["files"] / s["run"], "1", FILES)
        metrics[f"checkpoints_{shape}"] = bounds.metric(s["checkpoints"] / s["run"], "1", CHECKPOINTS)
        metrics[f"guards_{shape}"] = bounds.metric(s["guards"] / s["run"], "1", GUARDS)
        metrics[f"contacts_{shape}"] = bounds.metric(often[shape]["contacts"] / often[shape]["run"], "1", CONTACTS)
        metrics[f"snapshots_{shape}"] = bounds.metric(often[shape]["snapshots"] / often[shape]["run"], "1", SNAPSHOTS)
    return metrics, seconds


def table(seconds: dict[str, dict[str, float]]) -> str:
    """Markdown table of the seconds of each run."""
    names = ("run", "samples", "files", "checkpoints", "guards", "picture")
    lines = page.head("shape", *(f"{name} [s]" for name in names), "number of samples")
    for shape, s in seconds.items():
        lines.append(page.row(shape, *(f"{s[name]:.3f}" for name in names), s["count"]))
    return "\n".join(lines)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--serve", choices=SHAPES, help="run one shape in this process and print its seconds")
    parser.add_argument("--often", action="store_true", help="with contacts and snapshots at every percent of strain")
    args = parser.parse_args()
    if args.serve:
        serve(args.serve, args.often)
        return
    metrics, seconds = measure(SHAPES)
    print(f"{table(seconds)}\n\n{bounds.table(metrics)}")


if __name__ == "__main__":
    main()
