"""Pictures of a layer: grains that are nowhere, sections of 3D layers, and the bar of the colours."""

import shutil

import netCDF4
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import taichi_lsm as lsm
from workflows.plots import layer_pictures, run_plots
from workflows.plots.canvas import STYLE
from workflows.plots.layer_pictures import BAR, Snapshot, bar_beside, draw_colour_bar, draw_packing, read_snapshot

LOST, FAR, FINE = 30, 31, 32  # grains of the round layer: position not a number, far away, in the layer


def pile(period, height):
    """A Snapshot of mobile discs between two rows of glued ones, all of diameter 1."""
    place = np.array([(x + 0.5, y + 0.5) for x in range(period) for y in range(height)])
    angle = np.linspace(0.0, 2.0 * np.pi, 20)
    circle = 0.5 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    glued = (place[:, 1] < 1.0) | (place[:, 1] > height - 1.0)
    count = len(place)
    return Snapshot([circle] * count, place, np.linspace(0.0, 1.0, count), glued, float(period), np.arange(count))


@pytest.mark.parametrize(("period", "height"), [(4, 30), (20, 15), (60, 10)])
def test_the_words_of_the_colour_bar_overlap_no_title(period, height):
    import matplotlib

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11, 8), layout="constrained")
        axes = figure.subplots(2, 2)[0][1]
        drawn = draw_packing(axes, pile(period, height))
        axes.set_title("(b) layer at strain 2\nsection through the middle")
        bar = bar_beside(axes)
        draw_colour_bar(figure, drawn, cax=bar)
        title = figure.suptitle("2D gouge of discs and so on, over the whole width of the figure, as in any run\n" * 2)
        figure.draw_without_rendering()
    words = bar.yaxis.label.get_window_extent()
    assert bar.get_ylabel() == BAR
    for other in (title, axes.title, axes._left_title):
        assert not (other.get_text() and words.overlaps(other.get_window_extent())), other.get_text()
    frame = bar.get_window_extent()
    assert frame.width > 8.0 and frame.width < 0.1 * max(axes.bbox.width, axes.bbox.height)  # a bar, not a line
    assert words.x1 < figure.bbox.x1 and words.y1 < figure.bbox.y1


@pytest.fixture
def broken(sheared, tmp_path):
    """A folder with grains.nc of a layer in whose last snapshot two grains are not where they should be."""
    folder, _, _ = sheared("round")
    shutil.copy(folder / "grains.nc", tmp_path / "grains.nc")
    with netCDF4.Dataset(tmp_path / "grains.nc", "a") as file:
        file["position"][-1, LOST] = np.nan
        file["position"][-1, FAR, 1] = 5.0  # [m]
    return tmp_path


def test_grains_that_are_nowhere_spoil_no_picture(broken, sheared):
    folder, _, _ = sheared("round")
    whole, left = read_snapshot(folder / "grains.nc"), read_snapshot(broken / "grains.nc")
    assert set(whole.number) - set(left.number) == {LOST}
    of_whole = dict(zip(whole.number, whole.velocity, strict=True))
    assert np.allclose([of_whole[k] for k in left.number], left.velocity)  # over the velocity of the same platen
    frames = []
    for snapshot in (whole, left):
        axes = Figure().subplots()
        draw_packing(axes, snapshot)
        frames.append(np.ptp(axes.get_ylim()))
    assert frames[0] < frames[1] < 1.5 * frames[0]  # not up to the grain that has flown away


def test_the_picture_of_a_stop_says_which_grains_at_fault_it_shows(broken, pictures):
    error = lsm.SimulationError("step 9: grain 30: its velocity is not a number", 9, [LOST, FAR, FINE])
    run_plots.plot_stopped(broken, error)
    axes = pictures[0].axes[0]
    assert axes.get_title("left") == "last snapshot; edged in red: grain 32; not in it: grains 30, 31"


def test_a_file_without_a_snapshot_is_refused(sheared, monkeypatch):
    folder, _, _ = sheared("round")
    grains = lsm.open_run(folder / "grains.nc")
    monkeypatch.setattr(lsm, "open_run", lambda path: grains.isel(time=slice(0)))
    with pytest.raises(lsm.InputError, match="holds no snapshot"):
        read_snapshot(folder / "grains.nc")


def balls(z):
    """grains.nc of spheres of diameter 1 mm in a row, at these z [mm], the width 4 mm."""
    count = len(z)
    position = 1e-3 * np.stack([2.0 * np.arange(count), np.zeros(count), z], axis=1)[None]
    return xr.Dataset(
        {
            "position": (("time", "grain", "space"), position),
            "velocity": (("time", "grain", "space"), np.ones((1, count, 3))),
            "kind": ("grain", np.zeros(count, int)),
            "shape_index": ("grain", np.zeros(count, int)),
            "shape_scale": ("grain", np.full(count, 1e-3)),
            "bounding_radius": ("grain", np.full(count, 0.5e-3)),
            "patch_count": ("shape", [1]),
            "patch_centre": (("patch", "space"), np.zeros((1, 3))),
            "patch_radius": ("patch", [0.5]),
        },
        attrs={"periodic_lengths": [20e-3, 4e-3]},
    )


@pytest.mark.parametrize(("through", "cut"), [(None, [0, 1]), (2, [2, 3]), (1, [0, 1])])
def test_a_section_goes_through_the_middle_or_a_grain_at_fault(monkeypatch, through, cut):
    """Balls at z = 2.0 and 2.3 mm are cut in the middle; those at 0.1 and, over the border, 3.9 mm through grain 2."""
    monkeypatch.setattr(lsm, "open_run", lambda path: balls([2.0, 2.3, 0.1, 3.9]))
    snapshot = read_snapshot(layer_pictures.Path("grains.nc"), through=through)
    assert snapshot.number.tolist() == cut and snapshot.is_section
    radii = [np.abs(outline).max() for outline in snapshot.outlines]
    off = {None: [0.0, 0.3], 2: [0.0, 0.2], 1: [0.3, 0.0]}[through]
    assert radii == pytest.approx([np.sqrt(0.25 - d * d) for d in off], rel=2e-3)
