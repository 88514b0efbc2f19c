"""The folder of a run as a tree: its files, read when they are used where they are large, while the run goes on."""

import numpy as np
import pytest
import xarray

import taichi_lsm as lsm
from taichi_lsm.io import record_arrays
from tests.helpers.contact_tables import moments_of, touching, write_contacts
from tests.helpers.exported_runs import write_run
from tests.helpers.output_files import effects, grains, grains_writer, run_row, run_writer, table

PLACE = np.array([[0.0, 0.0], [0.9, 0.1], [1.7, 0.4], [2.5, 0.6]])


@pytest.fixture
def folder(tmp_path):
    """A complete run of nine grains with three snapshots, two moments of contacts and a table."""
    write_run(tmp_path / "run", 2)
    write_contacts(tmp_path / "run" / "contacts.nc", moments_of([touching(PLACE, 1.0)] * 2, [0.0, 1e-3]))
    table(tmp_path / "run" / "events.nc")
    return tmp_path / "run"


def appended(path, count, done=None):
    """A writer of grains.nc that has as many snapshots; every value of number i is off by i."""
    static, snapshot = grains(3)
    writer = grains_writer(path, static, 3)
    for i in range(count):
        writer.append(float(i), {n: v + i for n, v in snapshot.items()} | {"stage": f"stage {i}"})
    if done is not None:
        writer.close(done)
    return writer, snapshot


def test_every_file_is_a_child_as_it_is_opened_alone(folder):
    tree = lsm.open_run(folder)
    assert isinstance(tree, xarray.DataTree) and list(tree.children) == ["contacts", "events", "grains", "run"]
    for name in tree.children:
        xarray.testing.assert_identical(tree[name].to_dataset().load(), lsm.open_run(folder / f"{name}.nc"))
    tree = lsm.open_run(str(folder))
    assert tree.run.friction.variable._in_memory and tree.events.friction_mean.variable._in_memory
    lazy = [tree.grains.position, tree.grains.velocity, tree.contacts.branch]
    assert not any(variable.variable._in_memory for variable in lazy)
    assert np.isfinite(tree.grains.position.values).all() and not tree.grains.position.variable._in_memory


def test_functions_of_datasets_take_the_tree(folder):
    tree = lsm.open_run(folder)
    assert len(lsm.outlines(tree, 1e-3)) == len(lsm.outlines(tree.grains)) == 9
    rows = lsm.read_effects(tree)
    assert rows and str(rows) == str(lsm.read_effects(lsm.open_run(folder / "run.nc")))
    xarray.testing.assert_identical(lsm.by_row(tree), lsm.by_row(lsm.open_run(folder / "run.nc")))
    with pytest.raises(lsm.InputError, match=r"run: has no stage_index, cycle, displacement, must be the run\.nc"):
        lsm.statistics.stack_cycles(tree, "shear")
    with pytest.raises(lsm.InputError, match=r"run: has no .*external_work"):
        lsm.statistics.work_partition(tree)
    with pytest.raises(lsm.InputError, match="grains: has no bond_first"):
        lsm.fragment_catalogue(tree)


def test_a_run_may_go_on_while_its_tree_is_used(tmp_path):
    writer, snapshot = appended(tmp_path / "grains.nc", 2)
    tree = lsm.open_run(tmp_path)
    position = tree.grains.position
    writer.append(2.0, {n: v + 2 for n, v in snapshot.items()} | {"stage": "stage 2"})
    for _ in range(2):  # nothing is kept, and nothing is locked
        assert position.values == pytest.approx(snapshot["position"] + np.arange(2.0)[:, None, None])
        writer.append(writer.last_time + 1.0, {**snapshot, "stage": "more"})
    assert tree.grains.attrs["run_status"] == "running"
    writer.close("complete")
    assert tree.grains.sizes["time"] == 2 and tree.grains.stage.values.tolist() == ["stage 0", "stage 1"]
    again = lsm.open_run(tmp_path).grains
    assert again.sizes["time"] == 5 and again.attrs["run_status"] == "complete"


def test_a_file_that_was_replaced_or_cut_is_told(tmp_path):
    path = tmp_path / "grains.nc"
    appended(path, 3, "complete")
    tree = lsm.open_run(tmp_path)
    with open(path, "rb+") as file:
        file.truncate(path.stat().st_size - 900)
    assert tree.grains.position[0].values.shape == (5, 3)
    with pytest.raises(lsm.InputError, match=r"grains\.nc: has become shorter since it was opened, open it again"):
        tree.grains.position.values  # noqa: B018
    path.rename(tmp_path / "former.nc")
    with pytest.raises(lsm.InputError, match=r"grains\.nc: cannot be read any more \("):
        tree.grains.velocity.values  # noqa: B018
    appended(path, 3)
    with pytest.raises(lsm.InputError, match=r"grains\.nc: was replaced since it was opened, open it again"):
        tree.grains.velocity.values  # noqa: B018


def test_a_file_that_the_run_made_anew_goes_on_where_it_was(tmp_path):
    """Its header is longer, so that the records lie elsewhere; those that the tree knows are the same."""
    path = tmp_path / "grains.nc"
    _, snapshot = appended(path, 3, "interrupted")
    tree, size = lsm.open_run(tmp_path), path.stat().st_size
    again = grains_writer(path, grains(3)[0], 3, keep=3)
    again.append(3.0, {**snapshot, "stage": "resumed"})
    assert path.stat().st_size > size
    assert tree.grains.position.values == pytest.approx(snapshot["position"] + np.arange(3.0)[:, None, None])
    grains_writer(path, grains(3)[0], 3, keep=2)
    with pytest.raises(lsm.InputError, match="was replaced since it was opened"):
        tree.grains.position.values  # noqa: B018


def test_a_file_is_known_by_its_header_and_not_by_its_number(tmp_path):
    """A file system gives the number of a file that was removed to a new one: here another header in the same file."""
    path = tmp_path / "contacts.nc"
    rows = moments_of([touching(PLACE, 1.0)] * 2, [0.0, 1e-3])
    write_contacts(path, rows.assign_attrs(id="a run"), run_status="running", room=4)
    contacts = lsm.open_run(tmp_path).contacts
    write_contacts(tmp_path / "new", rows.assign_attrs(id="a run"), run_status="running", room=20)
    path.write_bytes((tmp_path / "new").read_bytes())
    assert np.array_equal(contacts.branch.values, rows.branch.values)
    write_contacts(tmp_path / "new", rows.assign_attrs(id="other"), run_status="running", room=20)
    path.write_bytes((tmp_path / "new").read_bytes())
    with pytest.raises(lsm.InputError, match="was replaced since it was opened"):
        contacts.branch.values  # noqa: B018


def test_a_file_is_read_by_the_header_that_it_has_though_another_thread_takes_over(tmp_path, monkeypatch):
    rows = moments_of([touching(PLACE, 1.0)] * 2, [0.0, 1e-3])
    heads = []
    for room in (4, 20):
        write_contacts(tmp_path / f"{room}.nc", rows, room=room)
        heads.append(record_arrays.read_head(tmp_path / f"{room}.nc"))
    array = record_arrays.RecordArray(tmp_path / "4.nc", heads[0], "normal_force", float, ())
    is_of = record_arrays.RecordHead.is_of

    def meanwhile(self, file):
        array.head = heads[1]
        return is_of(self, file)

    monkeypatch.setattr(record_arrays.RecordHead, "is_of", meanwhile)
    assert np.array_equal(array._read((slice(None),)), rows.normal_force.values)


def test_a_header_whose_sizes_disagree_is_refused(tmp_path):
    """The size of a variable stands in the header twice, by its dimensions and in bytes: 5 grains of 3 values of 8."""
    path = tmp_path / "grains.nc"
    appended(path, 2, "complete")
    whole = path.read_bytes()
    at = whole.index(b"grain\0\0\0\0\0\0\x05") + 8  # the length of the dimension
    path.write_bytes(whole[:at] + b"\0\0\0\x04" + whole[at + 4 :])
    with pytest.raises(
        lsm.InputError, match=r"grains\.nc: cannot be read \(its header is damaged \(position: 120 bytes for 96"
    ):
        lsm.open_run(tmp_path)


CHOICES = (
    {"time": 1},
    {"time": slice(None, None, -2), "grain": [3, 0]},
    {"time": [2, 0], "space": slice(1, None)},
    {"time": slice(1, 3), "grain": slice(4, 0, -3)},
    {"time": slice(3, 3)},
    {"grain": 2, "space": -1},
)


@pytest.mark.parametrize("small", [True, False])
def test_any_choice_of_a_file_gives_the_values_of_the_whole(tmp_path, monkeypatch, small):
    """Records that are read one by one, and several at once."""
    monkeypatch.setattr(record_arrays, "SMALL_RECORD", 10**6 if small else 0)
    monkeypatch.setattr(record_arrays, "AT_ONCE", 1500)
    appended(tmp_path / "grains.nc", 4, "complete")
    lazy, whole = lsm.open_run(tmp_path).grains.to_dataset(), lsm.open_run(tmp_path / "grains.nc")
    for choice in CHOICES:
        for name in ("position", "angular_velocity", "orientation"):
            wanted = {axis: at for axis, at in choice.items() if axis in whole[name].dims}
            found = lazy[name].isel(wanted)
            assert not found.variable._in_memory
            np.testing.assert_array_equal(found.values, whole[name].isel(wanted).values)
    assert whole.position[3].values == pytest.approx(grains(3)[1]["position"] + 3.0)
    xarray.testing.assert_identical(lazy.sel(stage="stage 2").load(), whole.sel(stage="stage 2"))


def test_each_hundredth_record_is_read_in_pieces_too(tmp_path, monkeypatch):
    """What lies between the records comes along: it must not add up to the whole file in memory."""
    rows = moments_of([touching(PLACE, 1.0)] * 200, np.arange(200.0))
    write_contacts(tmp_path / "contacts.nc", rows)
    force, sizes, read = lsm.open_run(tmp_path).contacts.normal_force, [], record_arrays.RecordArray._bytes

    def counted(self, file, start, size):
        sizes.append(size)
        return read(self, file, start, size)

    monkeypatch.setattr(record_arrays.RecordArray, "_bytes", counted)
    monkeypatch.setattr(record_arrays, "AT_ONCE", 20_000)
    for step in (1, 10, 100, 599):
        assert np.array_equal(force[::step].values, rows.normal_force.values[::step])
    assert 0 < max(sizes) <= 20_000 and sum(sizes) > 40_000


@pytest.mark.parametrize("run_status", ["running", "failed", "interrupted"])
def test_a_run_that_only_began_was_killed_or_failed_is_opened(tmp_path, run_status):
    """A killed one has run_status running."""
    rows = run_writer(tmp_path / "run.nc", effects=effects())
    writer = grains_writer(tmp_path / "grains.nc", grains(2)[0], 2)
    contacts = moments_of([touching(PLACE, 1.0)], [0.0]).isel(time=slice(0), contact=slice(0))
    write_contacts(tmp_path / "contacts.nc", contacts, room=3, run_status="running")
    if run_status != "running":
        rows.append(run_row(0))
        rows.close(run_status)
        writer.close(run_status)
    tree = lsm.open_run(tmp_path)
    assert tree.run.attrs["run_status"] == tree.grains.attrs["run_status"] == run_status
    assert tree.grains.sizes["time"] == tree.contacts.sizes["time"] == 0
    for analysis in (lsm.outlines, lsm.profiles):
        with pytest.raises(lsm.InputError, match="holds no snapshot yet"):
            analysis(tree)
    with pytest.raises(lsm.InputError, match="holds no moment yet"):
        lsm.force_chains(tree)


def test_what_is_no_table_is_left_out_and_what_is_damaged_is_named(folder):
    xarray.Dataset({"mine": ("x", [1.0])}).to_netcdf(folder / "mine.nc")
    for name in ("checkpoint.nc", "stopped.nc", "checkpoint.previous.nc"):
        (folder / name).write_bytes(b"a state")
    assert list(lsm.open_run(folder).children) == ["contacts", "events", "grains", "run"]
    for name in ("grains.nc", "events.nc"):
        whole = (folder / name).read_bytes()
        for cut in (0, 300, len(whole) - 40):
            (folder / name).write_bytes(whole[:cut])
            with pytest.raises(lsm.InputError, match=rf"{name}: cannot be read .*may be truncated or damaged"):
                lsm.open_run(folder)
        (folder / name).write_bytes(whole)
    assert "grains" in lsm.open_run(folder).children


def test_the_runs_of_an_experiment_are_trees_within_its_tree(tmp_path):
    table(tmp_path / "compare.nc")
    for name in ("angular-1", "hold-31.62"):
        write_run(tmp_path / "runs" / name, 2)
    (tmp_path / "runs" / "begun").mkdir()
    tree = lsm.open_run(tmp_path)
    assert list(tree.children) == ["compare", "runs"] and list(tree.runs.children) == ["angular-1", "hold-31.62"]
    one = tree["runs/angular-1"]
    assert one.run.sizes["time"] == 3 and len(lsm.outlines(one)) == 9
    with pytest.raises(lsm.InputError, match=r"holds many runs, must be one of them, such as tree\['runs/angular-1'\]"):
        lsm.outlines(tree)
    with pytest.raises(lsm.InputError, match=r"angular-1: holds no contacts\.nc; run with --contacts"):
        lsm.force_chains(one)


def test_folders_without_a_run_and_missing_files_are_named(tmp_path):
    (tmp_path / "config.toml").write_text("")
    with pytest.raises(lsm.InputError, match=rf"{tmp_path}: holds no file of a run yet"):
        lsm.open_run(tmp_path)
    with pytest.raises(lsm.InputError, match=r"nowhere: no such file"):
        lsm.open_run(tmp_path / "nowhere")
