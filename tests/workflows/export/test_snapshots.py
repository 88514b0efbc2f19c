"""Which snapshots are taken, and how a sheared cell and lost grains appear in them."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.schema import Variable
from tests.helpers.shaped_grains import append_snapshot, grains_file
from workflows.export.selection import chosen
from workflows.export.snapshots import Snapshots

TIMES = 0.1 * np.arange(6)
CELL = [Variable(f"cell_{name}", ("time",), "f64", "1", name) for name in ("height", "shift", "shear_rate")]


@pytest.mark.parametrize(
    ("wanted", "every", "expected"),
    [
        ("first", 1, [0]),
        ("last", 3, [5]),
        ("all", 2, [0, 2, 4]),
        ("0.1:0.3", 1, [1, 2, 3]),
        (":0.21", 2, [0, 2]),
        ("0.35:", 1, [4, 5]),
        ("0.42", 1, [4]),
        ("0.5,0.12,0.1", 1, [1, 5]),
    ],
)
def test_snapshots_are_chosen_by_words_times_and_ranges(wanted, every, expected):
    assert chosen(TIMES, wanted, every).tolist() == expected


@pytest.mark.parametrize(
    ("wanted", "every", "message"),
    [
        ("noon", 1, "--times 'noon': must be first, last, all"),
        ("0.1:0.2:0.3", 1, "--times '0.1:0.2:0.3': must be"),
        ("nan", 1, "--times 'nan': must be"),
        ("9", 1, "9 s is not within the run; it has 6 snapshots from 0 to 0.5 s"),
        ("0.31:0.39", 1, "no snapshot lies there; it has 6"),
        ("all", 0, "--every 0: must be >= 1"),
    ],
)
def test_what_cannot_be_chosen_is_told(wanted, every, message):
    with pytest.raises(lsm.InputError, match=message):
        chosen(TIMES, wanted, every)


def test_a_sheared_cell_is_a_tilted_box(tmp_path):
    """Grains lie in the box, their images along its edges are where the file has them, with velocities of the image."""
    writer = grains_file(
        tmp_path / "grains.nc", [lsm.disc()], np.zeros(50, int), np.full(50, 1e-3), [8e-3, 6e-3], (), CELL
    )
    place = np.random.default_rng(1).uniform(-2e-2, 2e-2, (50, 2))
    shear = {"cell_height": 5e-3, "cell_shift": 0.0143, "cell_shear_rate": 20.0}
    append_snapshot(writer, 0.0, place, velocity=np.stack([20.0 * place[:, 1], 0.0 * place[:, 1]], axis=1), **shear)
    with lsm.opened_run(tmp_path / "grains.nc") as dataset:
        (frame,) = Snapshots(dataset, np.array([0]))
    h = frame.cell.matrix
    assert h[1, 1] == 5e-3 and h[0, 1] == pytest.approx(0.0143 - 2 * 8e-3) and frame.cell.periodic.tolist() == [1, 1, 0]
    across = frame.position[:, 1] / h[1, 1]
    along = (frame.position[:, 0] - h[0, 1] * across) / h[0, 0]
    for share in (across, along):
        assert share.min() >= 0.0 and share.max() < 1.0
    assert np.allclose((frame.position + frame.image @ h.T)[:, :2], place, atol=1e-12)
    assert np.allclose(frame.velocity[:, 0], 20.0 * frame.position[:, 1])


def test_grains_that_are_nowhere_are_left_out(tmp_path):
    writer = grains_file(tmp_path / "grains.nc", [lsm.sphere()], [0, 0, 0], [1e-3] * 3, [8e-3, 8e-3])
    append_snapshot(writer, 0.0, [[0.0, 0.0, 9e-3], [np.nan] * 3, [1e-3, 2e-3, 3e-3]])
    append_snapshot(writer, 0.1, np.full((3, 3), np.inf))
    with lsm.opened_run(tmp_path / "grains.nc") as dataset:
        (frame,) = Snapshots(dataset, np.array([0]))
        assert frame.grain.tolist() == [0, 2] and frame.position[0, 2] == pytest.approx(1e-3)
        assert frame.cell.matrix[1, 1] == pytest.approx(3e-3) and frame.cell.origin[1] == pytest.approx(-0.5e-3)
        with pytest.raises(lsm.InputError, match="snapshot 1: no grain has a finite position"):
            list(Snapshots(dataset, np.array([1])))
    grains = lsm.open_run(tmp_path / "grains.nc")
    with pytest.raises(lsm.InputError, match=r"periodic_lengths = .*must be at most 3 lengths > 0 m"):
        Snapshots(grains.assign_attrs(periodic_lengths=[1.0, -1.0]), np.array([0])).frame(0)
