"""Lines of the stages of a run."""

import io
import time

import pytest
from rich.console import Console

from workflows.cli.progress import ProgressLine, heights


def test_every_stage_has_a_line_also_if_it_follows_at_once():
    console = Console(file=io.StringIO(), width=120)
    line = ProgressLine(console=console)
    for done in range(1, 4):  # the second and the third come too soon
        line({"stage": "making shapes", "done": done, "total": 60})
    line({"stage": "compiling"})
    line({"stage": "consolidating", "height": 1.8e-3, "height_goal": 1.3e-3, "normal_stress": 2e3})
    assert console.file.getvalue().splitlines() == [
        "making shapes 1/60",
        "compiling",
        "consolidating | height 1.8 of 1.3 mm | sigma_n 2.00 kPa",
    ]


@pytest.mark.parametrize(
    ("height", "goal", "text"),
    [(1.8, None, "1.8 m"), (0.2, 1.0, "0.2 of 1 m"), (5e-4, 3e-5, "500 of 30 um"), (0.0, 0.0, "0 of 0 m")],
)
def test_heights_are_in_the_unit_of_the_goal(height, goal, text):
    assert heights(height, goal) == text


def silent_for(line, seconds):
    """What is printed where the last report came so many seconds ago."""
    console = line._console
    begin = len(console.file.getvalue())
    line._reported_at = line._printed_at = time.monotonic() - seconds
    line._tell_wait()
    return console.file.getvalue()[begin:].splitlines()


def test_a_line_without_reports_says_what_is_done_and_for_how_long():
    line = ProgressLine(console=Console(file=io.StringIO(), width=120))
    line({"stage": "compiling"})
    assert silent_for(line, 1.0) == [] and silent_for(line, 7.0) == ["compiling | for 7 s"]
    line({"label": "a", "stage": "shearing", "strain": 0.5})
    line({"label": "b", "stage": "compiling", "state": "done"})
    assert silent_for(line, 12.0) == ["a: shearing | for 12 s"]
    line({"label": "a", "state": "3 runs done", "ended": True})
    line({"label": "", "state": "failed"})
    assert silent_for(line, 12.0) == ["still at work | for 12 s"]
    line.close()
    assert silent_for(line, 12.0) == []


def test_long_waits_are_told_less_often():
    line = ProgressLine(console=Console(file=io.StringIO(), width=120))
    line({"stage": "compiling"})
    silent_for(line, 100.0)
    line._printed_at -= 10.0
    line._tell_wait()
    assert line._console.file.getvalue().count("for ") == 1
    line.close()
