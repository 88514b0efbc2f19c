"""A restored simulation goes on as if it had never stopped, bit for bit; foreign and broken files are refused."""

import hashlib

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.contact.pair_storage import HAS_IMPULSE
from tests.helpers import scenes

STEPS = 400


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


@pytest.mark.parametrize("name", SCENES)
def test_a_restored_run_gives_the_same_bits(runtime, tmp_path, name):
    file = tmp_path / "checkpoint.nc"
    first = scenes.simulate(SCENES[name]())
    first.run(STEPS)
    lsm.save_checkpoint(first, file)
    half = digest(first)
    first.run(STEPS)
    second = scenes.simulate(SCENES[name]())
    lsm.restore_checkpoint(second, file)
    assert digest(second) == half
    assert first.rebuilds > half[2] > 0
    second.run(STEPS)
    assert digest(second) == digest(first) != half
    lsm.restore_checkpoint(first, file)  # back in the same process
    first.run(STEPS)
    assert digest(first) == digest(second)
    if name != "arcs":
        return
    broken = tmp_path / "broken.nc"
    broken.write_bytes(file.read_bytes()[:2000])
    with pytest.raises(lsm.InputError, match="broken.nc"):
        lsm.restore_checkpoint(first, broken)
    with pytest.raises(lsm.InputError, match="no such file"):
        lsm.restore_checkpoint(first, tmp_path / "none.nc")
    other = scenes.simulate(scenes.scene([(0.0, 0.0), (3.0, 0.0)], scenes.frictional()))
    with pytest.raises(lsm.InputError, match="grains is 48, but the scene has 2"):
        lsm.restore_checkpoint(other, file)
