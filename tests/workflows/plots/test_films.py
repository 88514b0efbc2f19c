"""`lsm animate`: every moment is a frame, all in one scale; what is refused; nothing is left of a film that fails."""

import os
import stat
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import taichi_lsm as lsm
from tests.helpers.drawn_runs import write_drawn_run
from tests.helpers.exported_runs import TIMES
from tests.helpers.shaped_grains import append_snapshot, grains_file
from workflows.cli.main import main
from workflows.plots import films
from workflows.plots.films import united
from workflows.plots.run_figures import figures_of_moments
from workflows.plots.run_files import Moments, RunFiles

DOTS = 80
FFMPEG = """#!{python}
import sys
arguments = sys.argv[1:]
frames = sys.stdin.buffer.read()
with open(arguments[-1], "w") as file:
    file.write(f"{{len(frames)}} {{arguments}}")
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_drawn_run(tmp_path_factory.mktemp("run") / "a")


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    """Frames of few dots, which take less time."""
    monkeypatch.setattr(films, "DPI", DOTS)


def animate(*words):
    return main(["animate", *map(str, words)])


def test_a_gif_has_a_frame_for_each_moment(folder, tmp_path, capsys):
    out = tmp_path / "film.gif"
    assert animate(folder, "--out", out, "--fps", "4") == 0
    printed = capsys.readouterr().out
    assert f"{out}: 3 frames" in printed and "drawing frames 1/3" in printed
    with Image.open(out) as film:
        assert film.n_frames == len(TIMES) and film.info["loop"] == 0
        frames = []
        for number in range(film.n_frames):
            film.seek(number)
            assert film.info["duration"] == 250 and film.size[0] == 3.5 * DOTS
            frames.append(np.asarray(film.convert("RGB")).astype(int))
    assert all(np.abs(a - b).max() > 50 for a, b in pairwise(frames))  # the grains move
    rows = np.abs(np.diff(frames, axis=0)).max(axis=(0, 3))
    bar = slice(int(0.88 * len(rows)), None)  # and the bar of colours with its numbers stays
    assert rows[bar].max() == 0


def test_all_moments_share_one_scale_in_a_film_beside_the_figures(folder, monkeypatch):
    used = []
    module = films.figure_module("packing_velocity")
    draw = module.draw_moment
    monkeypatch.setattr(module, "draw_moment", lambda f, moment, scale: used.append(scale) or draw(f, moment, scale))
    assert animate(folder, "--quiet", "--times", "0.001:0.002") == 0
    assert [path.name for path in (folder / "plots").iterdir()] == ["packing_velocity.gif"]
    assert len(used) == 4 and all(scale == used[0] for scale in used)  # two samples for the colours, two frames
    with RunFiles(folder) as run:
        ends = np.array([module.scale_of(moment)["colours"] for moment in Moments(run, ("grains",), "0.001:0.002")])
    assert used[0]["colours"] == (ends[:, 0].min(), ends[:, 1].max()) and (np.ptp(ends, axis=0) > 0.0).all()
    assert united({"a": (0.0, 1.0)}, {"a": (-1.0, 0.5)}) == {"a": (-1.0, 1.0)} == united({}, {"a": (-1.0, 1.0)})


@pytest.mark.validate
@pytest.mark.parametrize("name", figures_of_moments())
def test_every_figure_of_a_moment_makes_a_film(folder, tmp_path, name):
    assert animate(folder, "--what", name, "--out", tmp_path / "a.gif", "--quiet", "--every", "2") == 0
    with Image.open(tmp_path / "a.gif") as film:
        assert film.n_frames == 2


def test_an_mp4_gets_all_frames(folder, tmp_path, monkeypatch):
    """The program that stands for ffmpeg writes how many bytes it was given: four for each dot."""
    program = tmp_path / "bin" / "ffmpeg"
    program.parent.mkdir()
    program.write_text(FFMPEG.format(python=sys.executable))
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")
    assert animate(folder, "--quiet", "--format", "mp4", "--fps", "0.4", "--out", tmp_path / "a.mp4") == 0
    count, arguments = (tmp_path / "a.mp4").read_text().split(" ", 1)
    width, height = map(int, arguments.split("'-s', '")[1].split("'")[0].split("x"))
    assert width == 3.5 * DOTS and int(count) == 3 * 4 * width * height
    assert "'-r', '0.4'" in arguments or "'-framerate', '0.4'" in arguments
    assert "'-f', 'mp4'" in arguments and "pad=ceil(iw/2)*2" in arguments


def test_mistakes_are_answered_and_leave_nothing(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(films.shutil, "which", lambda name: None)
    one = tmp_path / "one"
    one.mkdir()
    writer = grains_file(one / "grains.nc", [lsm.disc()], [0, 0], [1e-3, 1e-3])
    append_snapshot(writer, 0.0, [(0.0, 0.0), (2e-3, 0.0)])
    writer.close("complete")
    cases = [
        ((folder, "--format", "mp4"), "needs ffmpeg, which is not installed (Debian, Ubuntu: apt install ffmpeg"),
        ((folder, "--out", tmp_path / "a.avi"), "must end in .gif or .mp4"),
        ((folder, "--what", "friction"), "shows a whole run; films are made of force_chains, packing_"),
        ((folder, "--what", "packing"), "unknown figure"),
        ((folder, "--fps", "0"), "--fps 0: must be from 0.01 to 50"),
        ((folder, "--fps", "1e-4"), "--fps 0.0001: must be from 0.01 to 50"),
        ((folder, "--out", tmp_path / "a.gif", "--what", "rose,force_chains"), "is one file, not 2 films"),
        ((folder, "--out", tmp_path / "a.gif", "--format", "mp4"), "does not end in .mp4"),
        ((folder, "--out", one / "grains.nc" / "a.gif"), "grains.nc is a file, must be a folder"),
        ((one,), "a film needs two moments, and there is 1; a run with --snapshots every=0.01"),
        ((folder, "--times", "last"), "a film needs two moments"),
        ((one, "--what", "rose"), "needs contacts.nc"),
    ]
    for words, message in cases:
        assert animate(*words, "--quiet") == 2 and message in capsys.readouterr().err, message
    assert not list(tmp_path.glob("a.*")) and not list(one.glob("plots/*"))


def test_a_film_may_lie_beside_links_of_the_user(folder, tmp_path):
    (tmp_path / "notes").symlink_to(folder)
    assert animate(folder, "--quiet", "--every", "2", "--out", tmp_path / "a.gif") == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.gif", "notes"]


def test_a_film_that_fails_leaves_no_part_of_it(folder, tmp_path, monkeypatch):
    module = films.figure_module("packing_velocity")

    def fail(figure, moment, scale):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module, "draw_moment", fail)
    assert animate(folder, "--quiet", "--out", tmp_path / "a.gif") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.validate
def test_films_of_many_frames_take_no_more_memory(tmp_path):
    """200 frames of 700 x 600 dots would be 84 MB more, as bytes of a GIF."""
    used = []
    for count in (10, 200):
        run = tmp_path / str(count)
        run.mkdir()
        writer = grains_file(run / "grains.nc", [lsm.disc()], np.zeros(50, int), np.full(50, 1e-3), [1e-2])
        place = np.random.default_rng(1).uniform(0.0, 1e-2, (50, 2))
        for i in range(count):
            append_snapshot(writer, 1e-3 * i, place)
        writer.close("complete")
        command = [sys.executable, "-m", "workflows.cli.main", "animate", str(run), "--quiet"]
        process = subprocess.Popen(command, cwd=Path(__file__).resolve().parents[3])
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        assert process.returncode == 0
        used.append(usage.ru_maxrss)
    assert used[1] < used[0] + 40e3  # kB
