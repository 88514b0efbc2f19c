"""`lsm plot`: figures from files alone, what is missing, which folders are drawn, and what a new figure must define."""

import re
import shutil
import sys
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from PIL import Image

import taichi_lsm as lsm
from tests.helpers.drawn_runs import rows_of_run, write_drawn_run
from tests.helpers.exported_runs import TIMES
from tests.helpers.pictures import curves
from tests.helpers.processes import run_python
from workflows.cli.main import main
from workflows.common.run_folder import clear_plots
from workflows.plots import run_figures
from workflows.plots.canvas import PRINT, figure_at
from workflows.plots.run_figures import figure_module, figure_names, is_of_moment, runs_to_draw
from workflows.plots.run_files import WRITES, Moments, RunFiles

COURSE = ("energy", "friction", "stresses", "thickness")
OF_CONTACTS = ("force_chains", "packing_coordination", "packing_force", "packing_stress", "rose")
DOTS = 60
OF_GRAINS = ("grain_sizes", "packing_angular_velocity", "packing_velocity", "profiles")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_drawn_run(tmp_path_factory.mktemp("run") / "a")


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    """Pictures of few dots, which take less time."""
    monkeypatch.setitem(PRINT, "savefig.dpi", DOTS)


def plot(*words):
    return main(["plot", *map(str, words)])


@pytest.mark.parametrize("name", figure_names())
def test_every_figure_defines_what_the_registry_needs(name):
    module = figure_module(name)
    assert (module.__doc__ or "").strip() and set(module.NEEDS) <= set(WRITES) and len(module.SIZE) == 2
    kinds = [hasattr(module, "draw_run"), hasattr(module, "draw_moment")]
    assert sum(kinds) == 1 and is_of_moment(module) == hasattr(module, "scale_of") == kinds[1]


def test_all_figures_are_drawn_and_say_what_they_show(folder, tmp_path, capsys):
    assert plot(folder, "--out", tmp_path) == 0
    drawn = sorted(path.stem for path in tmp_path.iterdir())
    assert drawn == sorted((*COURSE, *OF_CONTACTS, *OF_GRAINS)) == figure_names()
    assert "not drawn" not in capsys.readouterr().out
    for path in tmp_path.iterdir():
        with Image.open(path) as picture:
            words = picture.text["Description"]
            assert picture.width == 3.5 * DOTS  # a column
        assert words.startswith((figure_module(path.stem).__doc__ or "").strip().splitlines()[0])
        assert "2D gouge of discs, 1000 µm across, sheared at constant velocity, normal stress 5 MPa" in words
        assert words.endswith("inertial number 0.001, stiffness number 1000")
        assert not any(sentence[0].islower() for sentence in words.split(". "))


def test_a_run_that_lost_grains_and_rows_is_drawn(folder, tmp_path, monkeypatch, capsys):
    """One whose last rows are no numbers, nor is the place of a grain; without any porosity its figure is left out."""
    run = tmp_path / "run"
    shutil.copytree(folder, run)
    monkeypatch.setattr(run_figures, "figure_names", lambda: [*COURSE, "profiles"])
    with netCDF4.Dataset(run / "grains.nc", "a") as grains:
        grains["position"][:, 3] = np.nan
    with netCDF4.Dataset(run / "run.nc", "a") as rows:
        for name in ("shear_strain", "friction", "shear_stress", "layer_thickness", "external_work", "porosity"):
            rows[name][-3:] = np.nan
    assert plot(run) == 0
    assert len(list((run / "plots").iterdir())) == 5 and "not drawn" not in capsys.readouterr().out
    with netCDF4.Dataset(run / "run.nc", "a") as rows:
        rows["porosity"][:] = np.nan
    assert plot(run) == 0
    assert "not drawn: thickness: needs layer_thickness and porosity, and no row" in capsys.readouterr().out


def test_what_is_missing_is_told_with_the_option_that_records_it(folder, tmp_path, monkeypatch, capsys):
    run = tmp_path / "run"
    shutil.copytree(folder, run, ignore=shutil.ignore_patterns("contacts.nc"))
    monkeypatch.setattr(run_figures, "figure_names", lambda: ["friction", "packing_force", "rose"])
    assert plot(run, "--format", "svg") == 0
    reason = "needs contacts.nc, which a run with --contacts end, events or every=0.1 writes"
    assert capsys.readouterr().out.splitlines() == [
        str(run / "plots" / "friction.svg"),
        f"not drawn: packing_force: {reason}",
        f"not drawn: rose: {reason}",
    ]
    assert plot(run, "--what", "rose") == 2
    assert f"rose: {reason}" in capsys.readouterr().err
    (run / "plots" / "notes.txt").write_text("mine")
    clear_plots(run)
    assert [path.name for path in (run / "plots").iterdir()] == ["notes.txt"]


def test_each_moment_has_a_picture_of_its_own(folder, tmp_path, capsys):
    assert plot(folder, "--what", "rose", "--times", "0.001:", "--out", tmp_path) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rose_1.png", "rose_2.png"]
    assert plot(folder, "--time", "9", "--out", tmp_path) == 2
    assert "--times 9: 9 s is not within the run" in capsys.readouterr().err


def test_mistakes_are_answered(folder, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "summary.json").write_text("{}")
    (tmp_path / "sweep").mkdir()
    (tmp_path / "sweep" / "sweep.nc").write_text("")
    cases = [
        ((folder, "--what", "packing_velocty"), "unknown figure, must be one of energy, force_chains"),
        ((folder, "--what", "packing_velocty"), "packing_velocity?"),
        ((tmp_path / "none",), "there is no such folder"),
        ((tmp_path / "empty",), "holds no run.nc and no grains.nc"),
        ((tmp_path / "sweep",), f"lsm sweep-plot {tmp_path / 'sweep'} draws it"),
        ((folder, "--out", folder / "run.nc"), "is a file, must be a folder"),
    ]
    for words, message in cases:
        assert plot(*words) == 2 and message in capsys.readouterr().err, message


def test_runs_of_a_comparison_are_drawn_each_in_its_folder(folder, tmp_path):
    for name in ("angular-1", "round-1"):
        shutil.copytree(folder, tmp_path / "runs" / name)
    (tmp_path / "compare.nc").write_text("")
    runs = [tmp_path / "runs" / name for name in ("angular-1", "round-1")]
    assert runs_to_draw(tmp_path, tmp_path / "plots") == [(run, run / "plots") for run in runs]
    assert runs_to_draw(tmp_path, tmp_path / "own") == [(run, tmp_path / "own" / run.name) for run in runs]
    assert runs_to_draw(runs[0], tmp_path / "own") == [(runs[0], tmp_path / "own")]


def test_a_run_that_has_not_come_far_is_drawn_as_far_as_it_is(tmp_path):
    """Two rows since shear began make a curve; a steady mean needs more."""
    for rows, drawn in ((1, False), (2, False), (6, True)):
        rows_of_run(tmp_path / "run.nc", rows)
        assert (plot(tmp_path, "--quiet", "--what", "friction") == 0) == drawn
        assert (tmp_path / "plots" / "friction.png").exists() == drawn


def test_room_for_moments_that_were_not_recorded_counts_for_none(tmp_path):
    """Of a run that was killed, whose contacts have other times than its last snapshot."""
    run = write_drawn_run(tmp_path / "run", times=TIMES[:2], room=5)
    with netCDF4.Dataset(run / "contacts.nc", "a") as file:
        file.run_status = "running"
    with RunFiles(run) as files:
        moments = Moments(files, ("grains", "contacts"), "all")
        assert [moment.time for moment in moments] == list(TIMES[:2])
        assert [moment.time for moment in Moments(files, ("contacts",))] == [TIMES[1]]
        assert [moment.time for moment in Moments(files, ("grains",))] == [TIMES[2]]


def test_grains_and_contacts_of_other_times_are_not_mixed(tmp_path):
    run = write_drawn_run(tmp_path / "run", times=(0.5e-3, 1.5e-3))
    with RunFiles(run) as files, pytest.raises(lsm.InputError, match="none were recorded; give --snapshots"):
        Moments(files, ("grains", "contacts"))


def test_titles_tell_the_strain_and_the_friction_of_their_row(folder):
    with RunFiles(folder) as files:
        first, middle, _ = Moments(files, ("grains",), "all")
        strain = float(middle.grains.dataset.shear_strain)
        row = files.table.sel(time=TIMES[1], method="nearest")
        assert first.words == "shear, 0 ms"
        assert middle.words == f"strain {strain:.3g}, friction {float(row.friction):.2f}"


def test_a_snapshot_that_run_nc_has_not_come_to_has_no_friction(folder, tmp_path):
    rows_of_run(tmp_path / "run.nc", 10)
    shutil.copy(folder / "grains.nc", tmp_path)
    with RunFiles(tmp_path) as files:
        (moment,) = Moments(files, ("grains",))
        assert "friction" not in moment.words and moment.words.startswith("strain ")


def test_the_curves_of_the_course_are_those_of_the_file(folder, tmp_path, pictures):
    with RunFiles(folder) as files:
        for name in COURSE:
            module = figure_module(name)
            with figure_at(tmp_path / f"{name}.png", module.SIZE, PRINT) as figure:
                module.draw_run(figure, files)
        rows = files.sheared
    axes = dict(zip(COURSE, (picture.axes[0] for picture in pictures), strict=True))
    assert np.array_equal(curves(axes["stresses"])["shear, bulk"], (rows.shear_strain, rows.shear_stress / 1e6))
    assert np.array_equal(curves(axes["friction"])["in the bulk"], (rows.shear_strain, rows.friction))
    assert np.allclose(curves(axes["thickness"])["_child0"][1], 1e3 * rows.layer_thickness)
    bars = pictures[COURSE.index("energy")].axes[1].patches
    assert [bar.get_width() for bar in bars] == pytest.approx([25.0, 75.0])
    for axes in (axes for picture in pictures for axes in picture.axes):  # no word is outside of its picture
        texts = [axes.title, axes._left_title, axes.xaxis.label, axes.yaxis.label]
        texts += axes.get_legend().get_texts() if axes.get_legend() else []
        slack = 0.02 * axes.figure.dpi
        for text in texts:
            box = text.get_window_extent()
            assert box.x0 > -slack and box.x1 < axes.figure.bbox.x1 + slack, text.get_text()


def test_no_two_words_of_a_legend_meet_its_curves(folder, tmp_path, pictures):
    with RunFiles(folder) as files, figure_at(tmp_path / "a.png", (3.5, 3.0), PRINT) as figure:
        figure_module("friction").draw_run(figure, files)
    (axes,) = pictures[0].axes
    box = axes.get_legend().get_window_extent()
    for line in axes.lines:
        points = axes.transData.transform(np.column_stack(line.get_data()))
        inside = (points > (box.x0, box.y0)).all(axis=1) & (points < (box.x1, box.y1)).all(axis=1)
        assert not inside.any(), line.get_label()


def test_the_example_of_a_new_figure_is_drawn(tmp_path, monkeypatch):
    page = (Path(__file__).resolve().parents[3] / "docs" / "pictures.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    (tmp_path / "coordination.py").write_text(code)
    monkeypatch.setattr(run_figures.figures, "__path__", [str(tmp_path)])
    rows_of_run(tmp_path / "run.nc")
    assert plot(tmp_path, "--quiet") == 0 and (tmp_path / "plots" / "coordination.png").exists()
    sys.modules.pop("workflows.plots.figures.coordination")


def test_every_figure_has_a_row_on_the_page():
    page = (Path(__file__).resolve().parents[3] / "docs" / "pictures.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| .* \| (.*) \|$", page, re.MULTILINE)
    assert sorted(name for name, _ in rows) == figure_names()
    for name, needs in rows:
        assert re.findall(r"`(\w+)\.nc`", needs) == list(figure_module(name).NEEDS), name


@pytest.mark.validate
def test_figures_need_no_taichi(folder, tmp_path):
    code = (
        "import sys; sys.modules['taichi'] = None; from workflows.cli.main import main; "
        "sys.exit(main(['plot', sys.argv[1], '--out', sys.argv[2], '--what', 'friction,profiles']))"
    )
    assert len(run_python("-c", code, str(folder), str(tmp_path)).splitlines()) == 2
