"""The homogeneously sheared cell: images that move, their neighbours, stresses, momentum and energy."""

import sys

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes
from tests.helpers.processes import run_module

K = scenes.STIFFNESS
RATE = 0.4
WIDE, HIGH = 11.0, 9.0


def pair(arcs):
    """Two grains in a large cell."""
    shapes = lsm.shapes.random_angular_shapes(2, 7) if arcs else [lsm.disc()]
    more = {
        "shapes": shapes,
        "shape_index": np.arange(2) % len(shapes),
        "lengths": (WIDE, HIGH),
        "periodic": (True, True),
    }
    return scenes.scene([(3.0, 3.0), (6.0, 6.0)], scenes.frictional(100 * K), shear_rate=RATE, dt=1e-4, **more)


@pytest.mark.parametrize("arcs", [False, pytest.param(True, marks=pytest.mark.validate)])
def test_grains_collide_across_the_border_as_inside(runtime, arcs):
    """The same two grains, moved along y and seen with the mean flow there, the second one by its image."""
    sim = scenes.simulate(pair(arcs))
    v = np.array([(0.5, 1.0), (-1.0, -1.5)])
    x = np.array([(4.0, 4.0), (4.5, 5.2)])
    angular_velocity, strain, up = np.array([(1.0,), (-2.0,)]), 0.37, 4.4
    columns = {"orientation": sim.scene.orientation_state()} if arcs else {}
    found = []
    for shift in ((0.0, 0.0), (0.0, up), (0.0, up + 3 * HIGH)):
        start, speed = x + shift, v.copy()
        speed[:, 0] += RATE * start[:, 1]
        if shift[1]:  # the image of the second one that lies below or above
            image = -1.0 if shift[1] == up else 2.0
            start[1] += image * np.array([strain * HIGH, HIGH]) + [WIDE, 0.0]
            speed[1, 0] += image * RATE * HIGH
        scenes.reload(sim, strain=strain, position=start, velocity=speed, angular_velocity=angular_velocity, **columns)
        touched = 0
        for _ in range(160):
            sim.run(25)
            touched = max(touched, sim.measure.sums()["contact_count"])
        end = sim.state.position.to_numpy() - shift
        w = sim.state.velocity.to_numpy()
        w[:, 0] -= RATE * sim.state.position.to_numpy()[:, 1]
        end[:, 0] -= RATE * shift[1] * sim.time
        if shift[1]:
            end[1] -= image * np.array([(strain + RATE * sim.time) * HIGH, HIGH]) + [WIDE, 0.0]
        assert touched == 1
        found.append(np.concatenate([end.ravel(), w.ravel(), sim.state.angular_velocity.to_numpy().ravel()]))
    assert np.abs(found[0][4:8] - v.ravel()).min() > 0.1
    assert found[1] == pytest.approx(found[0], abs=1e-9)
    assert found[2] == pytest.approx(found[0], abs=1e-9)


def layer(skin=None, parallel=None, body="discs"):
    """48 frictional grains, dense."""
    packed = scenes.packing(body)
    return scenes.scene(effects=scenes.frictional(), shear_rate=RATE, dt=2e-4, skin=skin, parallel=parallel, **packed)


@pytest.fixture(scope="module")
def dense(runtime):
    return scenes.simulate(layer())


def start(sim, shift=0.0):
    """Shear from the packing, every grain moved along y."""
    x = sim.scene.position + np.array([0.0, shift])
    scenes.reload(sim, position=x, velocity=sim.domain.mean_flow(x), angular_velocity=np.zeros((len(x), 1)))


def images(sim, x, strain):
    """Pairs (i < j) of the list by brute force over all images."""
    lengths = np.array([sim.domain.length[axis] for axis in range(2)])
    r, reach = sim.state.radius.to_numpy(), sim.skin
    up = np.array([strain * lengths[1], lengths[1]])
    upright = x - np.outer(np.floor(x[:, 1] / lengths[1]), up)
    upright[:, 0] %= lengths[0]
    found = set()
    for n in (-1, 0, 1):
        for m in range(-5, 6):
            d = upright[None] + n * up + [m * lengths[0], 0.0] - upright[:, None]
            near = np.linalg.norm(d, axis=2) < r[:, None] + r[None] + reach
            found |= {(i, j) for i, j in np.argwhere(near).tolist() if i < j}
    return found


@pytest.mark.parametrize("strain", [0.0, 0.13, 0.5, 0.77, -3.31])
def test_the_list_is_that_of_brute_force(dense, strain):
    rng = np.random.default_rng(2)
    r = dense.state.radius.to_numpy()
    order = np.argsort(r)
    apart = r[order[::2]] + r[order[1::2]] + dense.skin
    slant = np.array([1.0, -(strain - np.rint(strain))])  # of a square cell
    slant /= np.linalg.norm(slant)
    tried = 0
    for spread in (*[1.0] * 50, *[5.0] * 5):  # of boxes over which unwrapped positions lie
        x = rng.uniform(-spread, spread, (len(dense), 2)) * 6.5
        x[order[1::2]] = x[order[::2]] + (0.999 * apart)[:, None] * slant  # pairs farthest apart in the upright cell
        dense.state.position.from_numpy(x)
        dense.domain.set_shear(RATE, dense.scene.widest(), strain)
        if dense.search.count(dense.dt, dense.scene.guards) > dense.pairs.capacity:
            continue
        tried += 1
        dense.neighbours.write()
        starts, ids = dense.pairs.row_start.to_numpy()[: len(dense) + 1], dense.grains.id.to_numpy()
        listed = set()
        for k in range(len(dense)):
            partners = dense.pairs.second_id.to_numpy()[starts[k] : starts[k + 1]]
            listed |= {(int(ids[k]), int(j)) for j in partners}
        assert listed == images(dense, x, strain)
    assert tried > 40


def test_momentum_and_energy_of_a_sheared_layer(dense):
    start(dense)
    mass = 1.0 / dense.state.inverse_mass.to_numpy()[:, None]
    first = dense.measure.sums()
    energy, dissipated = scenes.energy(dense)
    momentum = (mass * dense.state.velocity.to_numpy()).sum(axis=0)
    dense.run(20_000)
    last = dense.measure.sums()
    work = last["shear_work"] - first["shear_work"]
    energy_then, dissipated_then = scenes.energy(dense)
    assert dense.rebuilds > 20 and work > 10 * energy
    assert energy_then + dissipated_then - energy - dissipated == pytest.approx(work, abs=1e-4 * work)
    drift = (mass * dense.state.velocity.to_numpy()).sum(axis=0) - momentum
    assert np.abs(drift).max() < scenes.tolerance(1e-11, 1e-7) * np.abs(mass * dense.state.velocity.to_numpy()).sum()


def test_a_restored_run_gives_the_same_bits(dense, tmp_path):
    start(dense)
    dense.run(1000)
    lsm.save_checkpoint(dense, tmp_path / "half.nc")
    ends = []
    for _ in range(2):
        dense.run(2000)
        ends.append([getattr(dense.state, name).to_numpy() for name in ("position", "velocity", "shear_work")])
        lsm.restore_checkpoint(dense, tmp_path / "half.nc")
    assert dense.step == 1000 and dense.domain.strain[0] == pytest.approx(RATE * dense.time)
    assert all(np.array_equal(a, b) for a, b in zip(*ends))


def test_the_border_may_be_anywhere(dense):
    """Moved by half a box the same grains touch across the border: the same stress at first, the same mean later."""
    series = []
    for shift in (0.0, 0.5 * dense.domain.length[1]):
        start(dense, shift)
        rows = []
        for _ in range(60):
            dense.run(500)
            rows.append(dense.measure.sums()["stress"])
        series.append(np.array(rows))
    assert series[1][0] == pytest.approx(series[0][0], rel=1e-6)
    pressure = series[0][10:, 1, 1].mean()
    for a, b in ((0, 0), (0, 1), (1, 1)):
        blocks = [s[10:, a, b].reshape(10, 5).mean(axis=1) for s in series]
        error = np.hypot(*(block.std(ddof=1) / np.sqrt(10) for block in blocks))
        assert abs(blocks[0].mean() - blocks[1].mean()) < 4 * error
        assert error < 0.15 * pressure
    assert series[0][10:, 0, 1].mean() < -0.1 * pressure  # resists the motion of the image above


def test_a_motion_of_all_grains_on_top_of_the_mean_flow_is_no_stress(dense):
    x = dense.scene.position
    stresses = []
    for speed in (0.0, 100.0):
        scenes.reload(dense, position=x, velocity=dense.domain.mean_flow(x) + np.array([speed, 0.0]))
        stresses.append(dense.measure.sums()["stress"])
    assert stresses[1] == pytest.approx(stresses[0], rel=1e-6)


def sheared(sim, body):
    """{name: values} after a run from the start."""
    sim.rebuilds = 0
    sim.run(6000 if body == "discs" else 2400)
    names = ("position", "velocity", "angular_velocity", "shear_work", "dissipated")
    columns = {name: getattr(sim.state, name).to_numpy() for name in names}
    return columns | {"rebuilds": sim.rebuilds, "strain": sim.domain.strain[0]}


@pytest.mark.validate  # a driven cell is sheared, too
@pytest.mark.parametrize("body", ["discs", "arcs"])
def test_bits_depend_neither_on_threads_nor_on_the_skin(dense, tmp_path, body):
    """One thread here; two in a process of its own, with another skin."""
    sim = dense if body == "discs" else scenes.simulate(layer(body=body))
    sim.reset(layer(0.05, body=body))
    here = sheared(sim, body)
    run_module("tests.boundaries.test_sheared_cell", tmp_path / "shared.npz", 2, 0.15, body)
    with np.load(tmp_path / "shared.npz") as arrays:
        shared = dict(arrays)
    assert here["rebuilds"] > 2 * shared["rebuilds"] > 4
    assert [n for n in here if n != "rebuilds" and not np.array_equal(here[n], shared[n])] == []


def test_what_cannot_be_sheared_is_refused():
    def cell(effects=(), lengths=(9.0, 9.0), periodic=(True, True), **more):
        effects = [lsm.LinearElastic(K), *effects]
        return scenes.scene([(1.0, 1.0)], effects, lengths=lengths, periodic=periodic, shear_rate=1.0, **more)

    cell()
    with pytest.raises(lsm.InputError, match="needs a cell that is periodic along x and y"):
        cell(periodic=(True, False))
    with pytest.raises(lsm.InputError, match="with platens, which would not take part in the mean flow"):
        cell(platens=[lsm.Platen("top", [lsm.Fixed(), lsm.Fixed()])])
    with pytest.raises(lsm.InputError, match=r"with .'gravity'., which would change the mean flow"):
        cell([lsm.Gravity((0.0, -9.81))])
    with pytest.raises(lsm.InputError, match="ExplicitEuler, which does not account for the work"):
        cell(integrator=lsm.ExplicitEuler)


if __name__ == "__main__":
    sim = scenes.simulate(layer(float(sys.argv[3]), True, sys.argv[4]), threads=int(sys.argv[2]))
    np.savez(sys.argv[1], **sheared(sim, sys.argv[4]))
