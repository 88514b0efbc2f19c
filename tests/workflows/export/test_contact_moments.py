"""Exported contacts: lines between centres as pyvista opens them, rows as pandas reads them."""

import numpy as np
import pandas
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.schema import Variable
from taichi_lsm.io.contacts_file import ContactsWriter
from taichi_lsm.measure.contacts import CONTACT_ROWS, FLAGS
from tests.helpers.exported_runs import LENGTH, TIMES, write_run
from tests.helpers.output_files import STAGE, attributes
from workflows.export.formats import export_run

STRAIN = Variable("shear_strain", ("time",), "f64", "1", "shear strain")
CELL = [Variable(f"cell_{name}", ("time",), "f64", "1", name) for name in ("height", "shift", "shear_rate")]
COUNTS = (4, 0, 2)


def contacts_of(dim, count, seed):
    """Contacts at random places, some beyond the border of the cell."""
    rng = np.random.default_rng(seed)
    columns = {}
    for row in CONTACT_ROWS:
        shape = (count, dim) if "space" in row.dims else (count,)
        whole = rng.integers(0, 2 if row.dtype == "i8" else 9, shape)
        columns[row.name] = rng.uniform(-2.0, 2.0, shape) * LENGTH if row.dtype == "f64" else whole
    return columns


def write_contacts(folder, dim, periodic, sheared=False):
    """Three moments at the times of the snapshots; returns the rows of each."""
    writer = ContactsWriter(
        folder / "contacts.nc",
        CONTACT_ROWS,
        [STRAIN, *CELL * sheared],
        attributes() | {"periodic_lengths": periodic},
        dim,
        STAGE,
        extra_attributes=FLAGS,
    )
    moments = [contacts_of(dim, count, i) for i, count in enumerate(COUNTS)]
    cell = {"cell_height": 0.5 * LENGTH, "cell_shift": 1.3 * LENGTH, "cell_shear_rate": 0.0} if sheared else {}
    for i, (time, rows) in enumerate(zip(TIMES, moments, strict=True)):
        writer.append(time, {"shear_strain": 0.1 * i, "stage": "shear"} | cell, rows)
    writer.close("complete")
    return moments


@pytest.mark.parametrize("dim", [2, 3])
def test_lines_run_from_centre_to_centre_with_the_forces(tmp_path, dim):
    pyvista = pytest.importorskip("pyvista")
    folder = write_run(tmp_path / "run", dim)
    moments = write_contacts(folder, dim, [LENGTH] * (dim - 1))
    paths, _ = export_run(folder, tmp_path / "vtk", "vtk")
    assert [path.name for path in paths] == ["grains.pvd", "contacts.pvd"]
    reader = pyvista.PVDReader(paths[1])
    assert reader.time_values == list(TIMES)
    for i, rows in enumerate(moments):
        reader.set_active_time_point(i)
        mesh = reader.read()[0]
        assert mesh.n_cells == COUNTS[i]
        if not COUNTS[i]:
            continue
        ends = mesh.points[mesh.lines.reshape(-1, 3)[:, 1:]]
        centre, branch = rows["point"] - rows["arm"], rows["branch"]
        assert ends[:, 1, :dim] - ends[:, 0, :dim] == pytest.approx(branch, abs=1e-6 * LENGTH)
        periods = (centre - ends[:, 0, :dim]) / LENGTH
        axes = [0] if dim == 2 else [0, 2]
        assert periods[:, axes] == pytest.approx(np.round(periods[:, axes]), abs=1e-6)
        assert np.all((ends[:, 0, axes] >= 0.0) & (ends[:, 0, axes] <= LENGTH)) and not periods[:, 1].any()
        assert mesh["normal_force"] == pytest.approx(rows["normal_force"])
        assert mesh["tangential_force"] == pytest.approx(np.linalg.norm(rows["tangential_force"], axis=1))
        assert mesh["sliding"].tolist() == rows["sliding"].tolist()
    again, _ = export_run(folder, tmp_path / "vtk", "vtk", "last")  # what the first export left is removed
    assert len(list((tmp_path / "vtk").glob("contacts*.vtp"))) == 1 and len(again) == 2


def test_centres_lie_in_the_sheared_cell(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    folder = write_run(tmp_path / "run", 2)
    moments = write_contacts(folder, 2, [LENGTH, 0.5 * LENGTH], sheared=True)
    _, contacts = export_run(folder, tmp_path / "vtk", "vtk")[0]
    reader = pyvista.PVDReader(contacts)
    reader.set_active_time_point(0)
    mesh = reader.read()[0]
    begin = mesh.points[mesh.lines.reshape(-1, 3)[:, 1], :2]
    edges = np.array([[LENGTH, 0.3 * LENGTH], [0.0, 0.5 * LENGTH]])  # as columns: 1.3 lengths are 0.3
    periods = np.linalg.solve(edges, (moments[0]["point"] - moments[0]["arm"] - begin).T)
    assert periods == pytest.approx(np.round(periods), abs=1e-6)
    share = np.linalg.solve(edges, begin.T)
    assert share.min() > -1e-9 and share.max() < 1.0 + 1e-9


def test_rows_are_read_by_pandas_with_their_units(tmp_path):
    folder = write_run(tmp_path / "run", 2)
    moments = write_contacts(folder, 2, [LENGTH])
    paths, _ = export_run(folder, tmp_path / "csv", "csv")
    assert "contacts.csv" in {path.name for path in paths}
    table = pandas.read_csv(tmp_path / "csv" / "contacts.csv")
    assert table.columns[:3].tolist() == ["time [s]", "stage", "shear_strain [1]"] and len(table) == sum(COUNTS)
    for time, rows in zip(TIMES, moments, strict=True):
        own = table[table["time [s]"] == time]
        assert np.array_equal(own["normal_force [N]"], rows["normal_force"])
        assert np.array_equal(own[["branch.x [m]", "branch.y [m]"]], rows["branch"])
        assert own["first_id [1]"].tolist() == rows["first_id"].tolist()
    paths, _ = export_run(folder, tmp_path / "csv", "csv", f"{TIMES[0]}:{TIMES[0]}")
    assert len(pandas.read_csv(tmp_path / "csv" / "contacts.csv")) == COUNTS[0]


def test_contacts_without_a_moment_are_left_out(tmp_path):
    folder = write_run(tmp_path / "run", 2)
    ContactsWriter(folder / "contacts.nc", CONTACT_ROWS, [STRAIN], attributes(), 2, STAGE).close("failed")
    paths, _ = export_run(folder, tmp_path / "csv", "csv")
    assert "contacts.csv" not in {path.name for path in paths}
    assert lsm.open_run(folder / "contacts.nc").run_status == "failed"
