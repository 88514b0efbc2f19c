"""What a sweep shows: counts, the runs that go on, and what is left; in a terminal and elsewhere."""

import io
import re
import time
from pathlib import Path

import pytest
from rich.console import Console

from taichi_lsm.io.netcdf_variables import Scalar
from tests.helpers.output_files import SCALARS, run_row, run_writer
from workflows.cli.sweep_progress import DRAW_EVERY_S, SILENCE_S, SweepProgress
from workflows.common.one_run import COMPLETED, FAILED, KILLED, REFUSED, Outcome
from workflows.sweep.drive import AGAIN
from workflows.sweep.factors import Factor, combined
from workflows.sweep.plan import PlannedRun, SweepPlan


@pytest.fixture
def progress(tmp_path, toy, request):
    """Of a sweep of six runs, whose times the tests set; in a terminal for the parameter True."""
    factors = (
        Factor("shape", [{"shape": "sphere"}, {"shape": "angular"}]),
        Factor("seed", [{"seed": s} for s in (1, 2, 3)]),
    )
    params = toy.Params()
    runs = [PlannedRun(str(i + 1), point, params) for i, point in enumerate(combined(factors))]
    console = Console(file=io.StringIO(), width=110, force_terminal=getattr(request, "param", False))
    with SweepProgress(SweepPlan("toy-run", toy, factors, tuple(runs)), tmp_path, console=console) as shown:
        shown.closed.set()  # its thread ends, so that nothing is drawn but by the tests
        yield shown


def lines(progress):
    return re.sub(r"\x1b\[[?\d;]*\w", "", progress.console.file.getvalue()).splitlines()  # without colours


def test_each_change_of_a_run_is_one_line_and_its_beginning_is_none(progress):
    runs = progress.plan.runs
    progress.begin({"6": Outcome(REFUSED, "13 grains do not fit", 0.0), "5": Outcome(COMPLETED, "", 0.0)})
    for label in "1123":
        progress.started(label)
    progress.changed(runs[0], COMPLETED, Outcome(COMPLETED, "", 12.3))
    progress.changed(runs[1], AGAIN, Outcome(KILLED, "killed by SIGKILL", 3.0))
    progress.changed(runs[2], FAILED, Outcome(FAILED, "diverged at step 7\nin a second line", 4.0))
    assert lines(progress) == [
        f"sweep: 6 runs of toy-run, 1 of them complete before, 1 refused, in {progress.out}",
        "sweep: 3/6 run 1 (shape sphere, seed 1) complete, 12 s",
        "sweep: 3/6 run 2 (shape sphere, seed 2) begun again, 3 s: killed by SIGKILL",
        "sweep: 4/6 run 3 (shape sphere, seed 3) failed, 4 s: diverged at step 7",
    ]
    assert progress.status == dict(
        zip("123456", (COMPLETED, "waiting", FAILED, "waiting", COMPLETED, REFUSED), strict=True)
    )
    progress.started("1")  # a message that comes late
    assert progress.status["1"] == COMPLETED and not progress.since


def test_a_silence_is_broken_in_plain_output_after_half_a_minute(progress):
    progress.closed.clear()
    progress.tell("one")
    progress.told_at -= SILENCE_S - 2.0 * DRAW_EVERY_S
    progress.draw()
    assert len(lines(progress)) == 1
    progress.told_at -= DRAW_EVERY_S
    progress.draw()
    progress.draw()
    assert lines(progress)[1:] == ["sweep: 0/6 complete, 0 running, 0 failed | 00:00 gone"]


def test_what_is_left_is_the_mean_time_of_the_runs_not_yet_made(progress):
    """Six runs of 100 s, two at a time: one complete, one 40 s old, one over its time: 500 - 140 s for two workers."""
    now = time.monotonic()
    progress.began = now - 160.0
    progress.changed(progress.plan.runs[0], COMPLETED, Outcome(COMPLETED, "", 100.0))
    for label, age in (("2", 40.0), ("3", 130.0)):
        progress.started(label)
        progress.since[label] = now - age
    assert progress.left(now) == pytest.approx((500.0 - 140.0) / 2)
    assert progress.line(now) == "1/6 complete, 2 running, 0 failed | 02:40 gone, about 03:00 left"
    progress.stopped("3")
    progress.stopped("1")
    assert progress.line(now).startswith("1/6 complete, 1 running")
    progress.lost("the scheduler is lost")
    assert progress.line(now).startswith("1/6 complete, 0 running")


@pytest.mark.parametrize("progress", [True], indirect=True)
def test_the_table_tells_of_each_run_that_goes_on(progress):
    now = time.monotonic()
    folder = Path(progress.out) / "runs" / "2"
    folder.mkdir(parents=True)
    writer = run_writer(folder / "run.nc", scalars=[*SCALARS, Scalar("strain", 3.0, "shear strain to reach")])
    for i in range(4):
        writer.append(run_row(i))
    writer.close("interrupted")
    for label, age in (("4", 5.0), ("2", 70.0)):
        progress.started(label)
        progress.since[label] = now - age
    progress.console.print(progress.table(now))
    shown = [line.split() for line in lines(progress)[-6:] if line.strip()]
    assert ["run", "shape", "seed", "for", "reached"] in shown
    assert ["2", "sphere", "2", "01:10", "shear,", "strain", "0.03/3.00"] in shown and [
        "4",
        "angular",
        "1",
        "00:05",
    ] in shown
    assert "sweep of toy-run: 4 waiting, 2 running, 0 complete, 0 failed, 0 refused" in lines(progress)
