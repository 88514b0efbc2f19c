"""The clump scenes: stored clumps, their volumes, deck, data and output; nothing needs LAMMPS or measures time."""

import re

import numpy as np
import pytest

from benchmarks import clumps, effect_sets, lammps_clumps, relax, scenes


@pytest.fixture(params=clumps.TAGS)
def state(request):
    return clumps.load(request.param)


def test_clumps_are_what_they_say(state):
    each = int(state.tag[1:].split("_")[0])
    assert state.offset.shape == (512, each, 3) and state.x.shape == (512, 3)
    assert set(state.kind) == {scenes.MOBILE, scenes.BOTTOM, scenes.TOP}
    centre = state.spheres.reshape(512, each, 3).mean(axis=1)  # equal spheres: also the centre of mass
    np.testing.assert_allclose(centre, state.centre, atol=1e-7)
    np.testing.assert_allclose(state.mass, each * np.pi / 6 * state.d**3)
    for name in (f"{state.tag}.npz", f"{state.tag}_faces.npz"):
        assert (scenes.STATES / name).stat().st_size < 500_000
    with pytest.raises(ValueError, match=r"P9.*P8_500"):
        clumps.load("P9")


def test_clumps_have_the_size_of_the_spheres(state):
    """Equivalent diameters are uniform in [0.8, 1.2], as those of the sphere scenes."""
    d = clumps.diameters(state)
    assert 0.79 < d.min() < 0.82 and 1.18 < d.max() < 1.21 and abs(d.mean() - 1.0) < 0.02


def test_volume_of_a_union():
    """Two spheres whose centres are one radius apart: the sum less the lens pi d^3 5/96 (two caps of height d/4)."""
    d = 0.8
    apart = np.array([[0.0, 0.0, 0.0], [0.5 * d, 0.0, 0.0]])
    exact = 2 * np.pi / 6 * d**3 - 5 * np.pi / 96 * d**3
    assert clumps.union_volume(apart, d) == pytest.approx(exact, rel=3e-3)
    assert clumps.union_volume(np.zeros((3, 3)), d) == pytest.approx(np.pi / 6 * d**3, rel=3e-3)


def test_stored_volumes(state):
    rng = np.random.default_rng(1)
    for i in (0, 100, 511):
        offset, d = state.offset[i], state.d[i]
        assert clumps.union_volume(offset, d) == pytest.approx(state.volume[i], rel=1e-6)
        low, high = offset.min(axis=0) - d / 2, offset.max(axis=0) + d / 2
        points = low + (high - low) * rng.random((50_000, 3))
        inside = (np.linalg.norm(points[:, None] - offset, axis=2) < 0.5 * d).any(axis=1)
        assert inside.mean() * (high - low).prod() == pytest.approx(state.volume[i], rel=0.02)


def test_our_scene_stands_for_the_clumps(state):
    scene = clumps.build(state, clumps.relaxed(state.tag))
    assert (scene.platen_index[state.kind == scenes.MOBILE] == -1).all()
    assert (scene.platen_index[state.kind == scenes.TOP] == 1).all()
    assert scene.shapes[0].face_count == 20 and (scene.shape_index == 0).all() and len(scene.shapes) == 1
    assert scene.masses()[0].sum() == pytest.approx(state.mass.sum(), rel=1e-12)
    ratio = scene.diameter**3 * np.pi / 6 / state.volume  # one factor for all volumes
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-12)
    assert 1.0 < ratio[0] < 1.3
    assert scene.dt == scenes.TIME_STEP < scene.stable_dt() and not scene.track_dissipation


def test_relaxed_grains_are_near_the_clumps(state):
    """Relaxing and shearing moves mobile grains by about a diameter at most; walls keep their form."""
    faces = clumps.relaxed(state.tag)
    shift = faces.position - state.centre
    np.testing.assert_allclose(shift[state.kind == scenes.BOTTOM], 0.0, atol=1e-12)
    top = shift[state.kind == scenes.TOP]
    np.testing.assert_allclose(top, np.broadcast_to(top[0], top.shape), atol=1e-9)
    assert np.abs(np.linalg.norm(faces.orientation, axis=1) - 1.0).max() < 1e-9
    across = shift[state.kind == scenes.MOBILE][:, 1]
    assert np.abs(across).max() < 1.5 and np.abs(across).mean() < 0.5


def test_growth_starts_without_deep_contacts(state):
    scene = clumps.build(state, clumps.unrelaxed(state, 1.0))
    factor = relax.first_factor(state, scene.shapes[0])
    assert 0.4 < factor < 1.0
    mobile = np.flatnonzero(state.kind == scenes.MOBILE)
    d, x = factor * clumps.diameters(state), state.centre
    for i in mobile[::20]:
        apart = x - x[i]
        apart -= np.round(apart / state.box) * state.box * [1, 0, 1]
        gap = np.linalg.norm(apart, axis=1) - scene.shapes[0].bounding_radius * (d + d[i])
        gap[i] = 0.0
        assert (gap > -0.5 * scene.shapes[0].overlap_limit * (d + d[i]) - 1e-12).all()


def test_data_file_holds_the_spheres(state):
    text = lammps_clumps.data_file(state)
    lines = text.splitlines()
    rows = np.array([line.split() for line in lines[lines.index("Atoms # hybrid") + 2 :]], float)
    each = state.offset.shape[1]
    assert rows.shape == (512 * each, 11) and f"{512 * each} atoms" in lines
    assert np.array_equal(rows[:, 0], np.arange(1, 512 * each + 1)) and (rows[:, 6] == 1.0).all()
    assert np.array_equal(rows[:, 7], np.repeat(np.arange(1, 513), each))
    assert np.array_equal(rows[:, 1], np.repeat(state.kind, each))
    assert (rows[:, 2:5] >= 0).all() and (rows[:, 2:5] <= state.box).all()
    np.testing.assert_allclose(rows[:, 2:5] + rows[:, 8:11] * state.box, state.spheres, atol=1e-12)
    assert (rows[:, 9] == 0).all()
    low, high = re.search(r"^(\S+) (\S+) ylo yhi$", text, re.MULTILINE).groups()
    assert (float(low), float(high)) == (0.0, state.box[1])


def test_deck_describes_the_same_scene():
    deck = lammps_clumps.deck("grains.data", skip=200, steps=400)
    commands = [line.split() for line in deck.splitlines() if line]
    style, *numbers, damping = next(c[1:] for c in commands if c[0] == "pair_style")
    wanted = [effect_sets.NORMAL_STIFFNESS, effect_sets.TANGENTIAL_STIFFNESS, effect_sets.DAMPING_RATE]
    assert style == "gran/hooke/history" and damping == "0"
    assert [float(n) for n in numbers] == [*wanted, 0.0, effect_sets.FRICTION]
    assert [float(c[1]) for c in commands if c[0] in ("timestep", "neighbor")] == [scenes.SKIN, scenes.TIME_STEP]
    assert [c[1] for c in commands if c[0] == "run"] == ["200", "400", "0"]
    assert ["fix", "rigid", "mob", "rigid/small", "molecule"] in commands
    assert ["fix", "shear", "top", "move", "linear", str(scenes.WALL_SPEED), "0", "0"] in commands
    assert "{" not in deck


PRINTED = """Loop time of 0.5 on 1 procs for 200 steps with 4096 atoms
90.0% CPU use with 1 MPI tasks x 1 OpenMP threads
Loop time of 1.25 on 1 procs for 400 steps with 4096 atoms
80.0% CPU use with 1 MPI tasks x 1 OpenMP threads
Step c_zz c_p c_move c_up c_down
     600   768   14.5   1.5   300   -340
Loop time of 1e-06 on 1 procs for 0 steps with 4096 atoms
99.9% CPU use with 1 MPI tasks x 1 OpenMP threads
"""
TOUCHING = "ITEM: TIMESTEP\n600\nITEM: ENTRIES c_touch[1] c_touch[2]\n8 9\n10 1\n17 8\n"


def test_output_of_lammps_is_read():
    state = clumps.load("P8_500")
    assert lammps_clumps.touching_clumps(TOUCHING, 8).tolist() == [[0, 1], [0, 2]]
    metrics = lammps_clumps.parse(PRINTED, TOUCHING, state)
    mobile = state.kind == scenes.MOBILE
    ends = 2 * mobile[0] + mobile[1] + mobile[2]
    assert metrics["contacts_per_grain"] == pytest.approx(ends / mobile.sum())
    assert metrics["sphere_contacts_per_grain"] == pytest.approx(768 / mobile.sum())
    assert metrics["normal_stress"] == pytest.approx(320 / (state.box[0] * state.box[2]))
    assert metrics["seconds"] == 1.25 and metrics["cpu_seconds"] == pytest.approx(1.0)
    with pytest.raises(ValueError, match="did not finish"):
        lammps_clumps.parse("ERROR: Lost atoms", TOUCHING, state)
