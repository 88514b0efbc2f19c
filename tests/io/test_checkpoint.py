"""A restored simulation goes on as if it had never stopped, bit for bit; foreign and broken files are refused."""

import hashlib
from contextlib import contextmanager

import netCDF4
import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.contact.pair_storage import HAS_IMPULSE
from taichi_lsm.io.checkpoint_file import DamagedCheckpointError, content_digest
from tests.helpers import scenes
from tests.helpers.output_files import table

STEPS = 400


@contextmanager
def altered(path):
    """A checkpoint that is changed, and gets the digest of what it then holds."""
    with netCDF4.Dataset(path, "a") as file:
        yield file
        file.digest = content_digest(file)


def layer():
    """Frictional discs between two platens, one of them driven and servo-controlled."""
    rng = np.random.default_rng(3)
    x = np.stack(np.meshgrid(np.arange(8) + 0.5, np.arange(6) * 0.98), axis=-1).reshape(-1, 2)
    x += rng.uniform(-0.01, 0.01, x.shape)
    glued = np.full(48, -1)
    glued[:8], glued[-8:] = 0, 1
    servo = lsm.ServoStress(stress=100.0, outward=1, stiffness=1e5, inertia=1e4, speed_limit=1.0)
    return scenes.scene(
        x,
        scenes.frictional(),
        lengths=(8.0, np.inf),
        periodic=(True, False),
        platen_index=glued,
        platens=[
            lsm.Platen("bottom", [lsm.SpringLoadPoint(-0.5, 1e5, 1e4), lsm.Fixed()]),
            lsm.Platen("top", [lsm.ConstantVelocity(0.5), servo]),
        ],
        velocity=np.where(glued[:, None] < 0, rng.normal(size=x.shape), 0.0),
    )


def moving(name):
    scene = scenes.reference_packing_scene(name)
    rng = np.random.default_rng(1)
    scene.velocity[:] = 0.3 * rng.normal(size=scene.velocity.shape)
    scene.angular_velocity[:] = 0.3 * rng.normal(size=scene.angular_velocity.shape)
    return scene


SCENES = {"layer": layer, "arcs": lambda: moving("frictional_arcs")}


def digest(sim):
    """Hash of every restart row."""
    result = hashlib.sha256()
    count = len(sim.grains)
    for name, row in sim.grains.variables.items():
        if row.restart:
            result.update(getattr(sim.state, name).to_numpy().tobytes() if name != "id" else b"")
    used = int(sim.pairs.row_start.to_numpy()[count])
    order = np.argsort(sim.grains.id.to_numpy()[:count])
    start = sim.pairs.row_start.to_numpy()
    slots = np.concatenate([np.arange(start[k], start[k + 1]) for k in order]).astype(int)
    assert len(slots) == used
    for row in sim.pairs.variables:
        if row.restart and row.name != "partner":
            values = getattr(sim.pairs, row.name).to_numpy()[slots]
            if row.name in ("pair_impulse", "pair_angular_impulse"):  # read only where the status says so
                values[(sim.pairs.status.to_numpy()[slots] & HAS_IMPULSE) == 0] = 0.0
            result.update(values.tobytes())
    if sim.platens:
        for values in sim.platens.snapshot().values():
            result.update(np.ascontiguousarray(values).tobytes())
    return result.hexdigest(), sim.step, sim.rebuilds


@pytest.fixture(scope="module")
def saved(runtime, tmp_path_factory):
    """(simulation of two grains, digest of its state, checkpoint of an earlier one)."""
    sim = scenes.simulate(scenes.scene([(0.0, 0.0), (0.99, 0.0)], scenes.frictional()))
    sim.run(10)
    path = tmp_path_factory.mktemp("checkpoints") / "checkpoint.nc"
    lsm.save_checkpoint(sim, path)
    sim.run(10)
    return sim, digest(sim), path


def check_refused(saved, path, reason):
    """The file is named, and the simulation is as it was."""
    sim, before, _ = saved
    with pytest.raises(lsm.InputError, match=rf"checkpoint .*{path.name}: {reason}"):
        lsm.restore_checkpoint(sim, path)
    assert digest(sim) == before


@pytest.mark.parametrize("other", [False, pytest.param(True, marks=pytest.mark.validate)], ids=["same", "other"])
@pytest.mark.parametrize("name", ["layer", pytest.param("arcs", marks=pytest.mark.validate)])
def test_a_restored_run_gives_the_same_bits(saved, tmp_path, name, other):
    """Restored into the same simulation, and into another one of its scene (so does test_resume.py)."""
    file = tmp_path / "checkpoint.nc"
    first = scenes.simulate(SCENES[name]())
    if first.platens:
        first.platens.set("top", 0, lsm.ConstantVelocity(0.6))
    first.run(STEPS)
    first.monitor._check_energy()  # takes the energies with which later ones are compared
    lsm.save_checkpoint(first, file)
    half, guards = digest(first), first.monitor.memory()
    drives = [list(axes) for axes in first.platens.drives] if first.platens else None
    first.run(STEPS)
    whole = digest(first)
    if first.platens:
        first.platens.set("top", 0, lsm.ConstantVelocity(0.7))
    second = scenes.simulate(SCENES[name]()) if other else first
    lsm.restore_checkpoint(second, file)
    assert digest(second) == half
    assert second.monitor.memory() == guards
    second.monitor.check_all()
    assert second.monitor.memory() == guards  # when a checkpoint is written decides nothing
    assert not second.platens or second.platens.drives == drives
    assert second.rebuilds == half[2] > 0
    second.run(STEPS)
    assert second.rebuilds > half[2]
    assert digest(second) == whole != half
    check_refused(saved, file, "grains is 48, but the scene has 2")  # of another scene
    if second.platens:
        check_drives_are_read_with_care(second, file)


def test_missing_truncated_and_foreign_files_are_refused(saved, tmp_path):
    check_refused(saved, tmp_path / "none.nc", "no such file, must be a whole file that save_checkpoint wrote")
    whole = saved[2].read_bytes()
    broken = tmp_path / "broken.nc"
    for share in (0.0, 0.05, 0.5, 0.99):
        broken.write_bytes(whole[: int(share * len(whole))])
        check_refused(saved, broken, "cannot be read .*must be a whole file that save_checkpoint wrote")
    broken.write_bytes(b"no file of numbers")
    check_refused(saved, broken, "cannot be read")
    table(tmp_path / "compare.nc")
    check_refused(saved, tmp_path / "compare.nc", "is none, must be a whole file that save_checkpoint wrote")


def test_a_file_of_which_a_number_changed_is_refused(saved, tmp_path):
    """One byte of a position, of an attribute and of the run's own state."""
    whole, copy = saved[2].read_bytes(), tmp_path / "copy.nc"
    for change in (
        lambda file: file["grains"]["position"].__setitem__((0, 0), 1e-9),
        lambda file: file.setncattr("step", np.int64(7)),
        lambda file: file.setncattr("run_state", '{"rows": 4}'),
    ):
        copy.write_bytes(whole)
        with netCDF4.Dataset(copy, "a") as file:
            change(file)
        check_refused(saved, copy, "is damaged, its digest differs")
        with pytest.raises(DamagedCheckpointError):
            lsm.restore_checkpoint(saved[0], copy)


def test_files_of_other_versions_are_refused_by_name(saved, tmp_path):
    copy = tmp_path / "copy.nc"
    for changes, reason in (
        ({"format": np.int64(3)}, "is of format 3, must be 7: another version wrote it"),
        ({"taichi": "1.0.0"}, "was written by version 1.0.0 of taichi, this is"),
        ({"arch": "cuda"}, "arch is cuda, but the scene has cpu"),
    ):
        copy.write_bytes(saved[2].read_bytes())
        with altered(copy) as file:
            file.setncatts(changes)
        check_refused(saved, copy, reason)


def test_a_damaged_checkpoint_does_not_take_the_place_of_a_good_one(saved, tmp_path):
    def refuse(state, path):
        raise lsm.InputError(f"{path.name} of rows {state['rows']}: is of another run")

    for step in range(2):
        lsm.checkpoints.keep_checkpoint(saved[0], tmp_path, {"rows": step})
    last = tmp_path / "checkpoint.nc"
    last.write_bytes(last.read_bytes()[:-500])
    with pytest.raises(lsm.InputError, match=r"^checkpoint.previous.nc of rows 0: is of another run"):
        lsm.checkpoints.restore_last(saved[0], tmp_path, refuse)
    assert (tmp_path / "checkpoint.previous.nc").exists()  # a refusal changes nothing
    restored = lsm.checkpoints.restore_last(saved[0], tmp_path)
    assert restored.run_state == {"rows": 0} and "cannot be read" in restored.damage
    lsm.checkpoints.keep_checkpoint(saved[0], tmp_path, {"rows": 2})
    for name, rows in (("checkpoint.nc", 2), ("checkpoint.previous.nc", 0)):
        assert lsm.restore_checkpoint(saved[0], tmp_path / name) == {"rows": rows}
    lsm.checkpoints.remove_checkpoints(tmp_path)
    assert not list(tmp_path.iterdir())
    none = r"checkpoint\.nc: no such file.*checkpoint\.previous\.nc: no such file.*begin the run anew"
    with pytest.raises(lsm.InputError, match=none):
        lsm.checkpoints.restore_last(saved[0], tmp_path)


def test_what_a_run_saves_beside_its_grains_comes_back_to_the_last_bit(saved, tmp_path):
    state = {"rows": 3, "strain": 0.1 + 0.2, "names": ["shear"], "nothing": None, "left": float("nan")}
    lsm.save_checkpoint(saved[0], tmp_path / "run.nc", state)
    found = lsm.restore_checkpoint(saved[0], tmp_path / "run.nc")
    assert found.pop("left") != state.pop("left") and found == state
    with netCDF4.Dataset(tmp_path / "run.nc") as file:
        assert file.Conventions == "CF-1.11, ACDD-1.3"


def test_checkpoints_that_lack_a_table_or_a_number_are_refused(saved, tmp_path):
    copy = tmp_path / "copy.nc"
    copy.write_bytes(saved[2].read_bytes())
    with altered(copy) as file:
        file["pairs"].renameVariable("status", "gone")
    check_refused(saved, copy, "cannot be read .*status")
    copy.write_bytes(saved[2].read_bytes())
    with altered(copy) as file:
        file.delncattr("rebuilds")
    check_refused(saved, copy, "rebuilds missing")
    for guards in ("{}", '{"next_check": 1, "next_sum": 2, "highest": 0.0, "first_energies": [1.0]}', "[[", "7"):
        copy.write_bytes(saved[2].read_bytes())
        with altered(copy) as file:
            file.guards = guards
        check_refused(saved, copy, "cannot be read")


def test_files_whose_values_do_not_fit_leave_the_simulation_alone(saved, tmp_path):
    """All numbers and shapes are checked before the first row is overwritten."""
    copy = tmp_path / "copy.nc"

    def changed(**attributes):
        copy.write_bytes(saved[2].read_bytes())
        with altered(copy) as file:
            file.setncatts(attributes)

    changed(dt=-1.0)
    check_refused(saved, copy, "dt is .*-1.0.* s, must be > 0")
    changed(dt="soon")
    check_refused(saved, copy, "dt is 'soon' s, must be > 0")
    changed(step=1.5)
    check_refused(saved, copy, "step is .*1.5.*, must be a whole number >= 0")
    changed()
    with altered(copy) as file:
        file["list"]["row_start"][-1] = 2**30
    check_refused(saved, copy, "row_start ends at 1073741824, must be 0")
    changed()
    with altered(copy) as file:
        pairs = file["pairs"]
        row = pairs["status"]
        pairs.renameVariable("status", "gone")
        pairs.createDimension("other", 7)
        other = pairs.createVariable("status", row.dtype, ("other",))
        other.units, other.long_name = row.units, row.long_name
        other[:] = np.zeros(7)
    check_refused(saved, copy, r"status has shape \(7,\), must be \(1,\)")


@pytest.mark.validate  # test_scene_identity.py compares every input of a scene
@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"track_dissipation": False}, "Scene.track_dissipation is false, but the scene has true; restore it into"),
        (
            {"lengths": (9.0, 9.0), "periodic": (True, False)},
            "Scene.lengths is 9.0, 9.0, but the scene has Infinity, Infinity",
        ),
    ],
)
def test_checkpoints_of_scenes_that_keep_other_rows_are_refused(saved, tmp_path, changes, reason):
    other = scenes.simulate(scenes.scene([(0.0, 0.0), (0.99, 0.0)], scenes.frictional(), **changes))
    lsm.save_checkpoint(other, tmp_path / "other.nc")
    check_refused(saved, tmp_path / "other.nc", reason)


def test_only_a_file_of_this_run_is_its_last_good_state(saved, tmp_path):
    """Neither a file that lay in the folder before nor one of the scene before a reset."""
    good = tmp_path / "checkpoint.nc"
    good.write_bytes(saved[2].read_bytes())
    sim = scenes.simulate(scenes.scene([(0.0, 0.0), (0.99, 0.0)], scenes.frictional()))

    def saved_at_a_stop():
        sim.state.velocity.from_numpy(np.full((2, 2), np.nan))
        with pytest.raises(lsm.SimulationError) as stopped:
            sim.run(10)
        return [path.name for path in stopped.value.saved]

    sim.keep_checkpoints(tmp_path, seconds=0.0)
    assert saved_at_a_stop() == ["stopped.nc"]
    sim.reset(sim.scene)
    sim.keep_checkpoints(tmp_path, seconds=0.0)
    sim.run(10)
    sim.keep_checkpoints(tmp_path, seconds=0.0)
    assert saved_at_a_stop() == ["stopped.nc"]
    sim.reset(sim.scene)
    sim.keep_checkpoints(tmp_path, seconds=0.0)
    sim.run(10)
    assert saved_at_a_stop() == ["stopped.nc", "checkpoint.nc"]
    sim.reset(sim.scene)
    assert saved_at_a_stop() == ["stopped.nc"]
    sim.reset(sim.scene)
    sim.keep_checkpoints(tmp_path, seconds=0.0, last=good)  # as a run that goes on from it
    assert saved_at_a_stop() == ["stopped.nc", "checkpoint.nc"]


def check_drives_are_read_with_care(sim, whole):
    """Other kinds, values that are no numbers and damaged texts are refused, and the simulation is as it was."""
    copy, before = whole.with_name("copy.nc"), digest(sim)
    for change in ('"Fixed"', '"velocity": -0.5', '"stress": 100.0', "[["):
        copy.write_bytes(whole.read_bytes())
        with altered(copy) as file:
            assert change in file.drives
            file.drives = file.drives.replace(change, '"velocity": "fast"', 1)
        with pytest.raises(lsm.InputError, match=r"copy\.nc: drives cannot be read"):
            lsm.restore_checkpoint(sim, copy)
    assert digest(sim) == before


def test_no_checkpoint_is_written_without_a_folder(saved, tmp_path):
    with pytest.raises(lsm.InputError, match=r"last\.nc: cannot be written, there is no folder"):
        lsm.save_checkpoint(saved[0], tmp_path / "runs" / "last.nc")
