"""Columns by persistent id, and a scene pays only for what it lists: fields and bytes are counted."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.contact.arc_chains import ChainTable
from taichi_lsm.contact.pair_storage import pair_variables
from taichi_lsm.core.fields import bytes_per_row, rounded_capacity
from taichi_lsm.stepping.grain_state import Grains, grain_variables
from taichi_lsm.stepping.kernel_spec import KernelSpec
from tests.helpers import scenes

REAL = 8 if scenes.PRECISION == "f64" else 4
SIZES = {"space": 2, "rotation": 1, "orientation": 2, "channel": 2, "history": 2, "two": 2, "gap": 3}


@pytest.fixture(scope="module")
def grains(runtime):
    return Grains(KernelSpec(count=50, kind="chain", rotates=True, oriented=True, channels=2))


def test_columns_by_id_survive_a_reorder(grains):
    rng = np.random.default_rng(0)
    position, shape, platen = rng.random((50, 2)), rng.integers(0, 9, 50), rng.integers(-1, 2, 50)
    dissipated = rng.random((50, 2))
    columns = {"position": position, "shape_index": shape, "platen_index": platen, "dissipated": dissipated}
    for name, values in columns.items():
        grains.set_column(name, values)
    slots = np.arange(50)
    for _ in range(3):
        order = rng.permutation(50)
        held = slots
        grains.reorder(order)
        slots = held[order]
        assert np.array_equal(grains.id.to_numpy()[:50], slots)
        assert np.array_equal(grains.previous_slot.to_numpy()[:50], order)
        assert np.array_equal(grains.slot_of.to_numpy()[slots], np.arange(50))
        for name, values in columns.items():
            assert np.array_equal(grains.column(name), values)
        assert np.array_equal(grains.position.to_numpy()[:50], position[slots])  # the rows did move
    grains.set_column("position", -position)
    assert np.array_equal(grains.column("position"), -position)
    assert len(grains) == 50 and grains.has("angular_velocity") and not grains.has("temperature")


def names(**facts):
    return {row.name for row in grain_variables(KernelSpec(**facts))}


def test_rows_exist_only_for_what_the_scene_lists():
    plain = names()
    rolling = names(rotates=True)
    angular = names(rotates=True, oriented=True, kind="chain")
    assert len(plain) == 8
    assert rolling - plain == {"angular_velocity", "inverse_inertia", "torque"}
    assert angular - rolling == {"orientation", "shape_index", "diameter", "overlap_limit", "travel"}
    assert names(channels=1) - plain == {"dissipated"}


def test_bytes_of_a_grain_and_of_a_pair(runtime):
    plain = grain_variables(KernelSpec())
    # id, platen; position, velocity, built_position in f64; radius, inverse mass, force in the run's precision
    assert bytes_per_row(plain, SIZES) == 2 * 4 + 3 * 2 * 8 + 4 * REAL
    rolling = grain_variables(KernelSpec(rotates=True))
    assert bytes_per_row(rolling, SIZES) - bytes_per_row(plain, SIZES) == 8 + 2 * REAL
    angular = grain_variables(KernelSpec(rotates=True, oriented=True, kind="chain"))
    assert bytes_per_row(angular, SIZES) - bytes_per_row(rolling, SIZES) == 2 * 8 + 4 + 2 * REAL + 8
    assert bytes_per_row(grain_variables(KernelSpec(channels=2)), SIZES) - bytes_per_row(plain, SIZES) == 2 * 8
    slim = pair_variables(KernelSpec())
    assert bytes_per_row(slim, SIZES) == 3 * 4 + 1 + 2 * REAL  # both slots, id; status; force
    full = pair_variables(KernelSpec(rotates=True, kind="chain", history=2))  # torque, features, free path and history
    assert bytes_per_row(full, SIZES) - bytes_per_row(slim, SIZES) == REAL + 2 * 4 + 8 + 2 * REAL


ARCS = [pytest.param(name, marks=pytest.mark.validate) for name in ("elastic_arcs", "frictional_arcs")]


@pytest.mark.parametrize("name", ["elastic_discs", "frictional_discs", *ARCS])
def test_simulation_pays_only_for_its_effects(reference_packing, name):
    sim = reference_packing(name)
    kind, body = name.split("_")
    shaped, frictional = body == "arcs", kind == "frictional"
    rotates = shaped or frictional
    spec = KernelSpec(
        kind="chain" if shaped else "sphere",
        rotates=rotates,
        oriented=shaped,
        channels=2 if frictional else 0,
        onset=True,
    )
    expected = {row.name for row in grain_variables(spec)}
    assert set(sim.grains.variables) == expected
    for row in ("angular_velocity", "orientation", "dissipated", "shape_index"):
        assert hasattr(sim.grains, row) == (row in expected)
    pair_rows = {row.name for row in sim.pairs.variables}
    assert ("pair_torque" in pair_rows) == rotates
    assert ("feature" in pair_rows) == shaped
    assert ("history" in pair_rows) == frictional
    assert (sim.surfaces is not None) == shaped and sim.parts is None
    assert sim.platens is None
    assert ("dissipated_coulomb_friction" in sim.measure.names) == frictional
    # a slot: rows (with those of the onset correction), copy kept over a rebuild, transpose; the history rests in the
    # force rows over a rebuild
    onset = 2 * REAL + shaped * REAL
    rows = 3 * 4 + 1 + 2 * REAL + rotates * REAL + shaped * 16 + frictional * 2 * REAL + onset
    kept = 4 + 1 + shaped * 16
    assert sim.pairs.bytes_per_pair() == rows + kept + 4


def test_without_dissipation_accounting_no_energy_is_summed(runtime):
    sim = scenes.simulate(scenes.scene([(0.0, 0.0), (0.9, 0.0)], scenes.frictional(), track_dissipation=False))
    assert not sim.grains.has("dissipated") and not hasattr(sim.grains, "dissipated")
    assert not [name for name in sim.measure.names if name.startswith("dissipated")]
    sim.run(3)
    assert sim.measure.sums()["translational_energy"] > 0


def test_state_is_read_and_written_by_name(reference_packing):
    sim = reference_packing("elastic_discs")
    assert sim.state.position.to_numpy().shape == (48, 2)
    with pytest.raises(AttributeError, match=r"no state 'angular_velocity'.*position"):
        sim.state.angular_velocity.to_numpy()


def test_capacity_is_rounded_by_an_eighth_at_most():
    for count in (1, 8, 9, 100, 4097, 123_457):
        room = rounded_capacity(count)
        assert count <= room <= max(count + 7, 1.125 * count)
    assert len({rounded_capacity(n) for n in range(1000, 2000)}) <= 9


def test_shape_table_repeats_the_first_patch_of_every_shape(runtime):
    shapes = [lsm.disc(), *lsm.shapes.random_angular_shapes(3, 1)]
    table = ChainTable(shapes)
    for row, shape in enumerate(shapes):
        first, patches = table.first_row[row], table.patches[row]
        assert patches == shape.patch_count
        radius = table.patch_radius.to_numpy()[first : first + patches + 1]
        assert radius == pytest.approx(np.append(shape.radius, shape.radius[0]), rel=1e-7)
        if patches > 1:
            seam = table.seam.to_numpy()[first : first + patches + 1]
            assert np.array_equal(seam[0], seam[-1]) and seam[:-1] == pytest.approx(shape.seam, abs=1e-7)


GOOD = {"position": [(0.0, 0.0), (3.0, 0.0)], "effects": [lsm.LinearElastic(1.0)]}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"position": np.zeros((0, 2))}, "no grains"),
        ({"position": [(0.0, np.nan), (1.0, 0.0)]}, "Scene.position: grain 0 is not finite"),
        ({"position": np.zeros((2, 4))}, "Scene.dim: 4"),
        ({"diameter": -1.0}, "Scene.diameter"),
        ({"density": 0.0}, "Scene.density"),
        ({"shape_index": 1}, "Scene.shape_index"),
        ({"platen_index": np.array([0, -1])}, "Scene.platen_index"),
        ({"velocity": np.zeros((3, 2))}, "Scene.velocity"),
        ({"lengths": (1.0,)}, "Scene.lengths"),
        ({"effects": [lsm.LinearElastic(1.0)] * 2}, "Scene.effects"),
        ({"effects": ["spring"]}, "Scene.effects"),
    ],
)
def test_scene_that_makes_no_sense_is_refused(changes, message):
    scenes.scene(**GOOD)
    with pytest.raises(lsm.InputError, match=message):
        scenes.scene(**GOOD | changes)
