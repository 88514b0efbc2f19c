"""The benchmark's scenes, decks and files; nothing here needs LAMMPS or measures time."""

import json
import re

import numpy as np
import pytest

import taichi_lsm as lsm
from benchmarks import all as everything
from benchmarks import bounds, effect_sets, flops, lammps, ours, output_cost, page, roofline, run, scenes, sizes


@pytest.fixture(params=scenes.TAGS)
def state(request):
    return scenes.load(request.param)


def test_states_are_what_they_say(state):
    count = int(state.tag.split("_")[1])
    assert state.x.shape == (count, int(state.tag[1])) and state.d.shape == state.kind.shape == (count,)
    assert state.x.dtype == state.d.dtype == np.float64
    assert set(state.kind) == {scenes.MOBILE, scenes.BOTTOM, scenes.TOP}
    assert (state.d > 0.8).all() and (state.d < 1.2).all()
    assert (state.x >= 0.0).all() and (state.x <= state.box).all()
    assert state.x[state.kind == scenes.BOTTOM, 1].max() < 0.2 * state.box[1]
    assert state.x[state.kind == scenes.TOP, 1].min() > 0.8 * state.box[1]
    assert (scenes.STATES / f"{state.tag}.npz").stat().st_size < 500_000


def test_states_are_dense(state):
    """Mobile grains are closer packed than they could be without touching, and overlap little."""
    solid = state.mass.sum() / state.box.prod()
    assert (0.80 < solid < 0.90) if state.dim == 2 else (0.57 < solid < 0.66)


def test_scene_holds_the_state(state):
    scene = scenes.build(state)
    assert (scene.platen_index[state.kind == scenes.MOBILE] == -1).all()
    assert (scene.platen_index[state.kind == scenes.TOP] == 1).all()
    np.testing.assert_allclose(scene.masses()[0], state.mass, rtol=1e-14)
    assert scene.dt == scenes.TIME_STEP < scene.stable_dt()
    assert {e.name for e in scene.effects} == {"linear_elastic", "viscous_damping", "coulomb_friction"}
    assert not scene.track_dissipation and scene.integrator is lsm.VelocityVerlet
    full = scenes.build(state, extras=True)
    assert full.track_dissipation and full.integrator is lsm.OnsetVerlet


def test_unknown_scene_is_named():
    with pytest.raises(ValueError, match=r"S9_1.*S2_1000"):
        scenes.load("S9_1")


@pytest.mark.parametrize("tag", ["S2_100000", "S3_2000", "S3_100000"])
def test_repeated_states_are_periodic_and_complete(tag):
    stored, copies = scenes.LARGE[tag]
    one, many = scenes.load(stored), scenes.load(tag)
    count = int(np.prod(copies))
    assert len(many.x) == len(many.d) == len(many.kind) == count * len(one.x) == int(tag.split("_")[1])
    axes = [0, 2][: len(copies)]
    assert many.box[1] == one.box[1] and (many.box[axes] == one.box[axes] * copies).all()
    assert (many.x >= 0).all() and (many.x <= many.box).all()
    assert many.mass.sum() == pytest.approx(count * one.mass.sum(), rel=1e-12)
    glued = many.kind != scenes.MOBILE
    images = np.tile(one.x, (count, 1))
    apart = many.x - images
    apart[:, axes] -= np.round(apart[:, axes] / one.box[axes]) * one.box[axes]
    assert np.abs(apart).max() <= 1.01 * scenes.NUDGE and np.abs(apart[glued]).max() < 1e-12
    assert (np.abs(apart[~glued]).max(axis=1) > 0).mean() > 0.99
    cells = np.floor((many.x[:, axes] + 1e-9) / one.box[axes]).astype(int) % copies
    assert len(np.unique(np.column_stack([cells, np.arange(len(images)) % len(one.x)]), axis=0)) > 0.999 * len(images)


def test_a_domain_may_be_longer():
    scene, volume, steps = scenes.declared("S3_1000@100")
    state = scenes.load("S3_1000")
    assert scene.lengths == tuple(100 * state.box) and (scene.position == state.x).all()
    assert volume == state.box.prod() and steps == 0
    cut, _, _ = scenes.declared("S2_1000/30")
    assert cut.lengths == tuple(scenes.load("S2_1000").box) and cut.shapes[1].patch_count == 30


def test_bounds_are_printed_beside_values():
    metrics = {"a": bounds.metric(2.0, "s", 2.0), "b": bounds.metric(2.1, "s", 2.0)}
    assert metrics["a"]["holds"] and not metrics["b"]["holds"]
    assert bounds.table(metrics).splitlines()[2:] == ["| a | 2 | s | 2 | yes |", "| b | 2.1 | s | 2 | NO |"]


def test_growth_is_relative_to_ten_thousand():
    rows = {f"S3_{n}": {"grains": n, "ours_ns": t} for n, t in ((1000, 90.0), (10_000, 100.0), (1_000_000, 300.0))}
    assert sizes.growth_metrics(rows) == {"growth_S3_1000000": bounds.metric(3.0, "1", sizes.GROWTH)}
    rows = {tag: row | {"lammps_ns": None, "ours_cpu_ns": 80.0, "steps_per_rebuild": 50.0} for tag, row in rows.items()}
    assert "| S3_1000 | 1000 | 90 | 80 | - | - | 50 |" in sizes.table(rows)


def test_parts_write_results_and_page(tmp_path, monkeypatch, capsys):
    table = "| new |"
    parts = {"one": lambda full: ({"a": bounds.metric(3.0, "s", 2.0), "full": {"ours_ns": full}}, {"x": table})}
    monkeypatch.setattr(everything, "PARTS", parts)
    monkeypatch.setattr(run, "RESULTS", tmp_path / "results.json")
    file = tmp_path / "page.md"
    file.write_text("<!-- bench:x -->\n<!-- /bench:x -->\n")
    monkeypatch.setattr("sys.argv", ["benchmarks.all", "--parts", "one", "--table", str(file), "--full"])
    everything.main()
    assert file.read_text() == f"<!-- bench:x -->\n{table}\n<!-- /bench:x -->\n"
    found = json.loads((tmp_path / "results.json").read_text())
    assert found == {"a": {"value": 3.0, "unit": "s", "bound": 2.0, "holds": False}, "full": {"ours_ns": True}}
    said = capsys.readouterr().out
    assert table in said and said.endswith("Bounds that do not hold: a\n")


def test_memory_is_read_from_the_system():
    now = ours.memory()
    assert 1e7 < now["resident"] <= now["peak"] < 1e11


def test_only_the_outermost_call_is_timed():
    class Layer:
        def outer(self):
            return self.inner() + 1

        def inner(self):
            return 1

    watch = output_cost.Stopwatch()
    watch.watch(Layer, "outer")
    watch.watch(Layer, "inner")
    assert Layer().outer() == 2 and watch.calls == 1
    Layer().inner()
    assert watch.calls == 2 and watch.seconds >= watch.first >= 0.0


def test_timed_functions_exist():
    for owner, functions in output_cost.watched().values():
        for function in functions:
            assert callable(getattr(owner, function))


@pytest.mark.validate
def test_operations_of_a_contact_are_counted():
    """Two roots at most: the distance and the limit of friction. Each component of the force takes an addition."""
    found = flops.operations("S2_1000")
    assert 1 <= found["roots"] <= 2 and 1 <= found["divisions"] <= 6
    assert 10 < found["additions"] < 100 and 10 < found["multiplications"] < 100


@pytest.mark.usefixtures("runtime")
def test_bytes_of_a_step_are_counted():
    """A row per grain, one per listed pair and one per contact; a name that the schema does not have is refused."""
    sim = lsm.Simulation(scenes.declared("S2_1000", parallel=False)[0])
    sim.run(1)
    total, per_contact, contacts, listed = roofline.step_bytes(sim)
    assert 1.0 < contacts < listed < 4.0
    assert 100.0 < total < 1000.0 and per_contact == pytest.approx(total / contacts)
    with pytest.raises(KeyError, match="no_such_row"):
        roofline.row_bytes(sim.grains.variables.values(), sim.grains.sizes, {"no_such_row": 1})


def test_data_file_holds_the_same_numbers(state):
    lines = lammps.data_file(state).splitlines()
    rows = np.array([line.split() for line in lines[lines.index("Atoms # sphere") + 2 :]], float)
    assert np.array_equal(rows[:, 0], np.arange(1, len(state.d) + 1))
    assert np.array_equal(rows[:, 1], state.kind)
    assert np.array_equal(rows[:, 2], state.d) and (rows[:, 3] == 1.0).all()
    assert np.array_equal(rows[:, 4 : 4 + state.dim], state.x)
    assert f"{len(state.d)} atoms" in lines
    low, high = re.search(r"^(\S+) (\S+) ylo yhi$", "\n".join(lines), re.MULTILINE).groups()
    assert (float(low), float(high)) == (0.0, state.box[1])


def test_deck_describes_the_same_scene(state):
    deck = lammps.deck(state, "grains.data", skip=200, steps=400)
    commands = [line.split() for line in deck.splitlines() if line]
    named = {}
    for name, *values in commands:
        named.setdefault(name, []).append(values)
    style, k_n, k_t, rate, tangential_rate, friction, tangential_damping = named["pair_style"][0]
    assert style == "gran/hooke/history"
    assert float(k_n) == effect_sets.NORMAL_STIFFNESS
    assert float(k_t) == pytest.approx(effect_sets.TANGENTIAL_STIFFNESS, rel=1e-15)
    assert (float(rate), float(friction)) == (effect_sets.DAMPING_RATE, effect_sets.FRICTION)
    assert float(tangential_rate) == 0.0 and tangential_damping == "0"
    assert float(named["timestep"][0][0]) == scenes.TIME_STEP
    assert float(named["neighbor"][0][0]) == scenes.SKIN
    assert named["dimension"] == [[str(state.dim)]] and named["run"] == [["200"], ["400"], ["0"]]
    assert ["shear", "top", "move", "linear", str(scenes.WALL_SPEED), "0", "0"] in named["fix"]
    plane = [["group", "all", "density/disc", "1.0"]] if state.dim == 2 else []
    assert named.get("set", []) == plane
    assert (["plane", "all", "enforce2d"] in named["fix"]) == (state.dim == 2)
    assert "{" not in deck


OUTPUT = """Loop time of 0.5 on 1 procs for 200 steps with 3 atoms
90.0% CPU use with 1 MPI tasks x 1 OpenMP threads
Loop time of 1.25 on 1 procs for 400 steps with 3 atoms
80.0% CPU use with 1 MPI tasks x 1 OpenMP threads
Step c_zz c_p c_move c_spin v_weight
     600   4.5   65.25   1.5   0.4   2.25
Loop time of 1e-06 on 1 procs for 0 steps with 3 atoms
99.9% CPU use with 1 MPI tasks x 1 OpenMP threads
"""


def test_output_of_lammps_is_read():
    metrics = lammps.parse(OUTPUT, 3)
    assert metrics["seconds"] == 1.25 and metrics["cpu_seconds"] == pytest.approx(1.0)
    assert metrics["contacts_per_grain"] == 4.5
    assert metrics["pressure"] == 65.25 and metrics["mass"] == 2.25
    assert metrics["rotational_energy"] == 0.4
    assert lammps.parse(OUTPUT, 2)["rotational_energy"] == pytest.approx(0.5)  # a disc, not a sphere
    with pytest.raises(ValueError, match="did not finish"):
        lammps.parse("ERROR: Lost atoms", 3)


def test_missing_lammps_is_said_and_ours_goes_on(monkeypatch, capsys):
    monkeypatch.setattr(lammps, "find", lambda: None)
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    assert not run.find_lammps(install=True)
    said = capsys.readouterr().out
    assert "needs root" in said and "apt-get install lammps" in said and "Ours is timed alone" in said
    row = run.times([100.0, 120.0], [130.0, 125.0], [])
    assert row["ours_ns"] == 110.0 and not any("lammps" in name or "ratio" in name for name in row)
    row["ours"] = row["ours_end"] = {"contacts_per_grain": 4.5, "pressure": 65.0}
    assert "| S3_1000_f64_1t | 110 | - | - | - | - | - | 4.50 | 65 |  |" in run.table({"S3_1000_f64_1t": row})


def test_results_have_the_documented_form():
    metrics = {"contacts_per_grain": 4.5, "pressure": 65.0, "translational_energy": 2.0}
    other = metrics | {"pressure": 65.1, "seconds": 1.0}
    turns = [100.0, 120.0, 110.0], [130.0, 125.0, 135.0], [88.0, 80.0, 90.0]
    row = run.times(*turns) | run.agreement(metrics, other, run.MARGINS["S"])
    assert (row["ours_ns"], row["lammps_ns"], row["ratio"]) == (110.0, 88.0, 1.25)
    assert (row["ours_extras_ns"], row["ours_ns_min"], row["lammps_ns_min"]) == (130.0, 100.0, 80.0)
    row |= {"ours_end": metrics, "lammps_end": metrics}
    assert row["agree"] and len(row["ratio_turns"]) == 3 and "seconds" not in row["lammps"]
    assert not run.agreement(metrics, other | {"pressure": 80.0}, run.MARGINS["S"])["agree"]
    assert "| S3_10000_f64_2t | 110 | 88 | 1.25 | 1.25 | 1.48 | - |" in run.table({"S3_10000_f64_2t": row})
    row |= run.times(*turns, "cpu_")
    assert row["cpu_ratio"] == row["ratio"] and row["ours_cpu_ns"] == row["ours_ns"]
    assert "| 1.48 | 1.25 |" in run.table({"S3_10000_f64_1t": row})
    assert run.table({"P8_500_f64_1t": row | {"bound": 1.0, "holds": False}}).endswith("| 1 FAILS |")
    assert json.loads(json.dumps(row)) == row


def test_only_the_text_between_markers_is_replaced(tmp_path):
    file = tmp_path / "page.md"
    text = "# A\n<!-- bench:one -->\nold\n| x |\n<!-- /bench:one -->\nend \\1\n"
    file.write_text(text)
    assert page.write(file, {"one": "| new \\1 |\n", "two": "| none |"}) == ["one"]
    assert file.read_text() == "# A\n<!-- bench:one -->\n| new \\1 |\n<!-- /bench:one -->\nend \\1\n"
    assert page.replaced(text, "two", "| none |") == text
    with pytest.raises(ValueError, match=r"bench:one.*0 closing"):
        page.replaced(text.replace("/bench", "/other"), "one", "x")
