"""What `lsm list --effects` says of shapes and costs."""

import json
import re
from pathlib import Path

import pytest

from benchmarks import effect_shapes, page
from benchmarks.effects import SAVED
from workflows.cli import inspect_run


@pytest.fixture
def listed(capsys):
    """{effect: what is listed of it}."""
    assert inspect_run.print_effects() == 0
    blocks = capsys.readouterr().out.split("\n\n")
    return {block.split(":")[0].strip(): block for block in blocks if "equation" in block}


def test_the_shapes_of_an_effect_are_those_that_scenes_accept(listed):
    shapes = {name: re.search(r"shapes +(.*)", text)[1] for name, text in listed.items()}
    local = "arc chains in 2D, cones in 2D, unions in 2D, ball-polyhedra in 3D, cones in 3D, unions in 3D"
    assert shapes.pop("hertz") == f"equivalent: all; local: all but {local}"
    assert len(shapes) > 10 and set(shapes.values()) == {"all"}


def test_the_table_of_the_page_is_that_of_the_code():
    """`python -m benchmarks.effect_shapes` writes it; a cell says that the effect works or which reason refuses it."""
    table = effect_shapes.table()
    text = Path(effect_shapes.PAGE).read_text(encoding="utf-8")
    assert page.replaced(text, effect_shapes.NAME, table) == text
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines() if line[:3] == "| `"]
    reasons = [f"refused ({line.split('.')[0]})" for line in table.splitlines() if re.match(r"\d+\. ", line)]
    assert {cell for row in rows for cell in row[1:]} == {"works", *reasons} and reasons


def test_costs_below_the_scatter_are_called_that(listed):
    assert not any(re.search(r"cost +-", text) for text in listed.values())
    added = {name: cost["added_ns"] for name, cost in json.loads(SAVED.read_text())["effects"].items()}
    least = min(added, key=lambda name: added[name])  # below 0, which no effect can be: so much is noise
    assert (f"less time than can be measured, {-added[least]:.1f} ns" in listed[least]) == (added[least] < 0.0)
    assert re.search(rf"cost +{added['linear_elastic']:.1f} ns per grain and step, 145 bytes", listed["linear_elastic"])
