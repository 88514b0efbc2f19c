"""A small sheared layer of angular grains: what ShearedLayer reports against forces, counts and areas taken apart."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.measure.layer_rows import layer_rows
from tests.helpers import scenes
from tests.helpers.supports import support_of_arcs

COLUMNS, ROWS, STRESS, K = 14, 18, 1000.0, 2e5


@pytest.fixture(scope="module")
def consolidated(runtime):
    """(simulation, ShearedLayer, row): at rest under the normal stress of the servo."""
    rng = np.random.default_rng(6)
    pitch = 1.0
    x, y = np.meshgrid(np.arange(COLUMNS), np.arange(ROWS))
    position = pitch * np.stack([x + 0.5, 1.1 * y], axis=-1).reshape(-1, 2)
    platen = np.where(y == 0, 0, np.where(y == ROWS - 1, 1, -1)).ravel()
    mobile = platen < 0
    scale = np.where(mobile, rng.uniform(0.7, 0.8, len(position)), 0.95)
    area = pitch * COLUMNS
    mass = 1000.0 * np.pi / 4 * (scale**2).sum()
    servo = lsm.ServoStress(STRESS, 1, K * COLUMNS / ROWS, 0.1 * mass, 1.0, damping_ratio=0.5)
    sim = scenes.simulate(
        scenes.scene(
            position,
            [lsm.LinearElastic(K), lsm.ViscousDamping(restitution=0.3), lsm.CoulombFriction(0.5, 0.5 * K)],
            shapes=[lsm.disc(), *lsm.shapes.random_angular_shapes(8, 6)],
            shape_index=np.where(mobile, 1 + np.arange(len(position)) % 8, 0),
            diameter=scale,
            angle=rng.uniform(0, 6, len(position)),
            velocity=0.5 * rng.standard_normal(position.shape) * mobile[:, None],
            lengths=(area, np.inf),
            periodic=(True, False),
            platen_index=platen,
            platens=[
                lsm.Platen("bottom", [lsm.Fixed(), lsm.Fixed()]),
                lsm.Platen("top", [lsm.ConstantVelocity(0.0), servo]),
            ],
            thickness=1.0,
        )
    )
    layer = lsm.ShearedLayer(sim, STRESS, 0.75)
    layer.row()
    for _ in range(70):
        sim.run(500)
        layer.sample()
    layer.row()
    sim.run(500)
    layer.sample()
    return sim, layer, layer.row()


def test_stress_in_the_bulk_is_the_stress_on_the_platen(consolidated):
    sim, _, row = consolidated
    assert row["translational_energy"] < 1e-3 * row["elastic_energy"]  # static
    assert row["platen_normal_stress"] == pytest.approx(STRESS, rel=1e-3)
    assert row["normal_stress"] == pytest.approx(row["platen_normal_stress"], rel=1e-2)
    assert row["shear_stress"] == pytest.approx(row["platen_shear_stress"], abs=1e-2 * STRESS)
    assert row["platen_normal_rms"] < 1e-2 * STRESS
    force = sim.platens.force.to_numpy() / (sim.platens.area * STRESS)
    assert force[0, 1] == pytest.approx(-1.0, rel=1e-2) and force[1, 1] == pytest.approx(1.0, rel=1e-2)


def test_stress_is_the_mean_over_planes_of_the_forces_that_cross_them(consolidated):
    sim, layer, row = consolidated
    y = sim.state.position.to_numpy()[:, 1]
    contacts = sim.contacts()
    first, second = contacts.first_id.values, contacts.second_id.values
    force = (contacts.normal_force * contacts.normal + contacts.tangential_force).values
    bottom, top = layer.plane[0], layer.plane[1] + sim.platens.displacement.to_numpy()[1, 1]
    margin = 3 * layer.diameter
    found = []
    for plane in np.linspace(bottom + margin, top - margin, 4001):
        crosses = (y[first] < plane) != (y[second] < plane)
        upwards = np.where(y[first] < plane, 1.0, -1.0)[crosses, None]
        found.append((force[crosses] * upwards).sum(axis=0) / sim.platens.area)
    shear, normal = np.mean(found, axis=0)
    assert normal == pytest.approx(row["normal_stress"], rel=2e-3)
    assert -shear == pytest.approx(row["shear_stress"], abs=2e-3 * STRESS)


def test_stress_of_a_slab_is_that_of_its_contacts_cut_at_its_borders(consolidated):
    """Of branch vectors what lies in the slab counts; the rest of the stress is that of moving grains."""
    sim, layer, _ = consolidated
    bottom, top = layer.plane[0], layer.plane[1] + sim.platens.displacement.to_numpy()[1, 1]
    low, high = bottom + 2.0 * layer.diameter, top - 4.3 * layer.diameter
    sums = sim.measure.sums(low, high, 1.0)
    contacts = sim.contacts()
    force = (contacts.normal_force * contacts.normal + contacts.tangential_force).values
    begin = (contacts.point - contacts.arm).values[:, 1]
    ends = np.sort(np.stack([begin, begin + contacts.branch.values[:, 1]]), axis=0)
    inside = np.clip(np.minimum(ends[1], high) - np.maximum(ends[0], low), 0.0, None) / np.diff(ends, axis=0)[0]
    stress = np.einsum("c,ca,cb->ab", inside, force, contacts.branch.values)
    place, mass = sim.positions, sim.scene.masses()[0]
    moving = (sim.scene.platen_index < 0) & (place[:, 1] >= low) & (place[:, 1] < high)
    mass, velocity = mass[moving], sim.velocities[moving]
    momentum = mass @ velocity
    stress += (mass[:, None] * velocity).T @ velocity - np.outer(momentum, momentum) / mass.sum()
    assert stress == pytest.approx(sums["stress_volume"], abs=scenes.tolerance(1e-12, 1e-5) * np.abs(stress).max())
    assert 0 < (inside == 0.0).sum() < len(inside) and ((inside > 0.01) & (inside < 0.99)).sum() > 5
    assert float(contacts.elastic_energy.sum()) == pytest.approx(sums["elastic_energy"], rel=scenes.tolerance(1e-12))


def test_porosity_thickness_and_coordination_are_those_counted_by_hand(consolidated):
    sim, layer, row = consolidated
    scene = sim.scene
    mobile = scene.platen_index < 0
    place = sim.state.position.to_numpy()
    inner = [place[scene.platen_index == p, 1].mean() + side * 0.475 for p, side in ((0, 1), (1, -1))]
    assert row["layer_thickness"] == pytest.approx(inner[1] - inner[0], rel=1e-12)
    solid = np.pi / 4 * (scene.diameter[mobile] ** 2).sum()  # shapes have the area of a disc of diameter 1
    assert row["porosity"] == pytest.approx(1 - solid / ((inner[1] - inner[0]) * COLUMNS), rel=1e-9)
    assert 0.05 < row["porosity"] < 0.4
    ends = contacts = 0
    for a, b in touching_outlines(sim, place):
        contacts += mobile[a] or mobile[b]
        ends += int(mobile[a]) + int(mobile[b]) if mobile[a] or mobile[b] else 0
    assert row["contact_count"] == contacts
    assert row["coordination_number"] == pytest.approx(ends / mobile.sum(), rel=1e-12)
    assert 2.0 < row["coordination_number"] < 6.0


def touching_outlines(sim, place):
    """Pairs whose support functions overlap in every direction: s(n) > 0 for all n on a fine grid."""
    scene = sim.scene
    orientation = sim.state.orientation.to_numpy()
    angle = np.arctan2(orientation[:, 1], orientation[:, 0])
    grid = 2 * np.pi / 4096 * np.arange(4096)
    n = np.stack([np.cos(grid), np.sin(grid)], axis=1)
    shapes = [scene.shapes[index] for index in scene.shape_index]
    h = np.array([scene.diameter[k] * support_of_arcs(shapes[k], grid - angle[k]) for k in range(len(place))])
    opposite = np.roll(h, -2048, axis=1)  # h(-n)
    for a in range(len(place)):
        for b in range(a + 1, len(place)):
            c = place[b] - place[a]
            c[0] -= COLUMNS * np.round(c[0] / COLUMNS)
            if c @ c < 1.5 and (h[a] + opposite[b] - n @ c).min() > 0:
                yield a, b


def test_shear_closes_its_energy_budget(consolidated):
    sim, layer, before = consolidated
    velocity = 0.4
    sim.platens.set("top", 0, lsm.ConstantVelocity(velocity, 4.0))
    layer.begin_shear()
    start, began = sim.platens.snapshot(), sim.time
    for _ in range(6):
        for _ in range(10):
            sim.run(200)
            layer.sample()
        row = layer.row()
    now = sim.platens.snapshot()
    path = now["displacement"][1, 0] - start["displacement"][1, 0]
    assert path == pytest.approx(velocity * (sim.time - began), rel=0.05)  # but for the ramp
    assert row["shear_strain"] == pytest.approx(path / row["layer_thickness"], rel=0.1)
    assert row["shear_strain"] > 0.1
    assert row["plate_velocity"] == pytest.approx(velocity, rel=1e-9)
    assert row["instantaneous_plate_velocity"] == velocity
    assert row["inertial_number"] == pytest.approx(
        velocity / row["layer_thickness"] * 0.75, rel=1e-6
    )  # sqrt(rho/P) = 1
    assert 0.1 < row["friction"] < 1.0
    assert row["friction"] == pytest.approx(row["shear_stress"] / row["normal_stress"], rel=1e-12)
    assert 0 < row["sliding_fraction"] < 0.6
    work = np.abs(row["external_work"] - before["external_work"])
    assert layer.memory.throughput >= 0.9 * work > 0
    assert layer.residual_fraction() < 2e-3
    lost = np.array(row["dissipated_energy"]) - np.array(before["dissipated_energy"])
    assert dict(zip(layer.effects, lost))["coulomb_friction"] > 0.3 * work
    assert {v.name for v in layer_rows()} == set(row) - {"time"}


def test_anisotropies_of_the_sheared_layer_give_its_stress_ratio_back(consolidated):
    """Angular grains, whose branch vectors lean off the normals: Rothenburg & Bathurst (1989) within 5 %."""
    sim, _, _ = consolidated
    found = lsm.statistics.fabric(sim.contacts())
    assert found.contacts > 300 and found.stress_ratio > 0.15
    assert found.sum_of_anisotropies == pytest.approx(found.stress_ratio, rel=0.05)
    assert found.contact > 0.05 and found.normal_force > 0.05 and found.tangential_force > 0.02
    assert 0.5 < found.stress_direction[0] / -found.stress_direction[1] < 2.0  # against the shear, at about 45 degrees


def height(layer):
    """Thickness of the layer now [m]."""
    apart = layer.platens.snapshot()["displacement"][:, 1] + layer.plane
    return apart[1] - apart[0]


@pytest.mark.parametrize(("moving", "resting"), [(500, 2), (2, 500)])
def test_strain_is_right_however_unevenly_the_platens_slide(consolidated, moving, resting):
    """Ten times some steps at a velocity and some at rest, sampled at rest, where the velocity is zero."""
    sim, layer, _ = consolidated
    sim.platens.set("top", 0, lsm.ConstantVelocity(0.0))
    sim.run(5000)  # or the thickness would still change between two samples
    layer.sample()
    layer.row()
    strain, slip, time, expected = layer.strain, layer.slip, sim.time, 0.0
    for _ in range(10):
        thickness = []
        for velocity, steps in ((0.2, moving), (0.0, resting)):
            sim.platens.set("top", 0, lsm.ConstantVelocity(velocity))
            thickness.append(height(layer))
            sim.run(steps)
        expected += 0.2 * moving * sim.dt / np.mean(thickness)  # as the motion begins and as it ends
        layer.sample()
    path, row = 10 * 0.2 * moving * sim.dt, layer.row()
    assert layer.slip - slip == pytest.approx(path, rel=1e-9)
    assert layer.strain - strain == pytest.approx(expected, rel=1e-3)
    assert row["plate_velocity"] == pytest.approx(path / (sim.time - time), rel=1e-9)
    assert row["instantaneous_plate_velocity"] == 0.0


def test_a_layer_goes_on_from_its_memory_to_the_last_bit(consolidated):
    sim, layer, _ = consolidated
    layer.sample()
    saved = json.loads(json.dumps(layer.memory.as_plain()))
    other = lsm.ShearedLayer(sim, STRESS, 0.75)
    other.memory = type(layer.memory).from_plain(saved)
    sim.run(100)
    layer.sample()
    other.sample()
    assert json.dumps(other.memory.as_plain()) == json.dumps(layer.memory.as_plain())
    mine, theirs = layer.row(), other.row()
    assert all(np.array_equal(mine[name], theirs[name]) for name in mine)
    del saved["works"]
    with pytest.raises(lsm.InputError, match="memory of the layer"):
        type(layer.memory).from_plain(saved)


def test_platens_that_meet_stop_the_run(consolidated):
    sim, layer, _ = consolidated
    layer.plane[1] -= 100.0
    try:
        with pytest.raises(lsm.SimulationError, match="the platens met"):
            layer.sample()
    finally:
        layer.plane[1] += 100.0


def test_what_makes_no_sense_is_refused(consolidated, reference_packing):
    sim, layer, _ = consolidated
    for stress in (0.0, -STRESS, np.nan):
        with pytest.raises(lsm.InputError, match=r"ShearedLayer\.target_stress: .*, must be > 0"):
            lsm.ShearedLayer(sim, stress, 0.75)
    with pytest.raises(lsm.InputError, match=r"ShearedLayer\.diameter: -1.0, must be > 0"):
        lsm.ShearedLayer(sim, STRESS, -1.0)
    with pytest.raises(lsm.InputError, match=r"Scene\.platens: 0, must be 2"):
        lsm.ShearedLayer(reference_packing("frictional_discs"), STRESS, 0.75)
    silent = SimpleNamespace(scene=SimpleNamespace(track_dissipation=False))
    with pytest.raises(lsm.InputError, match=r"Scene\.track_dissipation is False"):
        lsm.ShearedLayer(silent, STRESS, 0.75)
    with pytest.raises(lsm.InputError, match=r"no sample since the last row"):
        layer.row()


def test_stress_over_everything_is_a_number(reference_packing):
    sums = reference_packing("frictional_discs").measure.sums()
    assert np.isfinite(sums["stress"]).all() and sums["stress"][1, 1] > 0
