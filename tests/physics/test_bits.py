"""Same scene, same bits: whatever the threads, the skin of the list, the pairs of a block, or the day.

The scene has friction, platens and a plane wall.
"""

import json

import pytest

from tests.helpers.processes import run_module

RUNS = {  # threads, shared work or not, skin, pairs of a block
    "one thread": (1, "alone", 0.1, 32),
    "two threads, other skin and blocks": (2, "shared", 0.2, 4),
}
ONE_BY_ONE = {
    "two threads": (2, "shared", 0.1, 32),
    "two threads, again": (2, "shared", 0.1, 32),
    "one thread, other skin and blocks": (1, "shared", 0.2, 4),
}


def run(folder, steps, threads, path, skin, width):
    """Summary of a run of tests/helpers/bits_run.py in a process of its own."""
    file = folder / "summary.json"
    run_module("tests.helpers.bits_run", file, steps, threads, path, skin, width)
    return json.loads(file.read_text(encoding="utf-8"))


def check(folder, steps, runs):
    results = {}
    for name, settings in runs.items():
        (folder / name).mkdir()
        results[name] = run(folder / name, steps, *settings)
    reference = results["one thread"]
    assert reference["grains"] >= 5000 and reference["finite"]
    assert reference["rebuilds"] > 10 and reference["sliding"] > 100 and reference["wall_work"] != 0.0
    assert results["two threads, other skin and blocks"]["rebuilds"] < 0.8 * reference["rebuilds"]
    for name, result in results.items():
        different = [column for column, value in reference["digest"].items() if result["digest"][column] != value]
        assert not different, f"{name}: {different}"


def test_bits_are_the_same(tmp_path):
    check(tmp_path, 1000, RUNS)


@pytest.mark.validate
def test_bits_are_the_same_for_long(tmp_path):
    check(tmp_path, 5000, RUNS | ONE_BY_ONE)
