"""Lines of the stages of a run."""

import io

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
