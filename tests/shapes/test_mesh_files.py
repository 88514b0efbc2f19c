"""Mesh files of common programs: every format gives the body that was written."""

import subprocess
import sys

import numpy as np
import pytest
import trimesh

from taichi_lsm.shapes import from_mesh
from tests.helpers.bodies import BODIES, obj_of_quads, ply_of_quads


@pytest.mark.parametrize("name", ["quads.obj", "texture.obj", "double.ply", "float.ply"])
def test_quads_textures_and_materials_give_the_box(tmp_path, name):
    path = tmp_path / name
    kind, suffix = name.split(".")
    path.write_text(ply_of_quads(kind) if suffix == "ply" else obj_of_quads(kind == "texture"))
    shape, misfit, placement = from_mesh(path, 6)
    assert shape.face_count == 6 and misfit.repairs == ()
    assert placement.centre == pytest.approx([0.5, 1.0, 1.5], abs=1e-9)
    assert placement.diameter == pytest.approx((36.0 / np.pi) ** (1 / 3))


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "ply"])
@pytest.mark.parametrize("unit", [1.0, 1e-6])
def test_files_in_any_unit_and_far_away_give_the_stone(tmp_path, kind, unit):
    stone = BODIES["stone"]
    path = tmp_path / f"stone.{kind[:3]}"
    shift = np.array([300.0, -200.0, 100.0])
    far = trimesh.Trimesh(unit * (np.asarray(stone.vertices) + shift), stone.faces, process=False)
    far.export(path, file_type=kind)
    shape, misfit, placement = from_mesh(path, 12)
    clean = from_mesh(stone, 12)
    assert placement.diameter == pytest.approx(unit * clean.placement.diameter, rel=1e-4)  # 300 sizes away, in f32
    assert misfit.volume == pytest.approx(clean.misfit.volume, abs=1e-3) and shape.face_count == 12


@pytest.mark.validate
def test_a_scan_of_a_million_triangles_takes_less_than_a_minute_and_2_gb(tmp_path):
    ball = trimesh.creation.uv_sphere(count=[500, 499])
    x = np.asarray(ball.vertices) * (1.0 + 0.02 * np.sin(5.0 * np.asarray(ball.vertices)[:, :1])) * [1.0, 0.8, 0.6]
    path = tmp_path / "scan.stl"
    trimesh.Trimesh(0.02 * x, ball.faces, process=False).export(path)
    code = (
        "import resource, time, taichi_lsm as lsm\n"
        f"shape, misfit, placement = lsm.shapes.from_mesh({str(path)!r}, hull=True)\n"
        "print(time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6, misfit.rms_distance)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    seconds, gigabytes, rms = map(float, run.stdout.split()[-3:])
    assert seconds < 60.0 and gigabytes < 2.0 and rms < 0.01
