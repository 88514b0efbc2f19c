"""The scripts of examples/ run, and what they print is what theory says."""

import runpy
from pathlib import Path

import numpy as np
import pytest

import taichi_lsm as lsm

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


@pytest.mark.validate
def test_discs_roll_and_slide_down_inclined_planes_as_theory_says(runtime, tmp_path, capsys):
    example = runpy.run_path(str(EXAMPLES / "inclined_plane.py"))
    table = example["main"](str(tmp_path), (20, 50))
    assert [angle for angle, _, _ in table] == pytest.approx([20, 50])
    assert capsys.readouterr().out.count("by theory") == 2
    rolling, sliding = 2 / 3 * np.sin(np.radians(20)), np.sin(np.radians(50)) - 0.2 * np.cos(np.radians(50))
    assert [theory for _, _, theory in table] == pytest.approx([9.81 * rolling, 9.81 * sliding])
    assert [measured for _, measured, _ in table] == pytest.approx([9.81 * rolling, 9.81 * sliding], rel=2e-4)
    run = lsm.open_run(tmp_path).run
    normal, along = run.wall_normal_force.values[:, 0], run.wall_tangential_force.values[:, 0]
    weight = 2500.0 * np.pi / 4 * 0.01**3 * 9.81
    assert normal == pytest.approx(weight * np.cos(np.radians(50)), rel=1e-3)
    friction = along @ [np.cos(np.radians(50)), -np.sin(np.radians(50))]
    assert friction[1:] == pytest.approx(0.2 * normal[1:], rel=1e-4)  # its spring is loaded in the first row
