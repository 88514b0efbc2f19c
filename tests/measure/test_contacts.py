"""The table of contacts: analytic values, the sum of forces, the mean stress, and a run that it leaves alone."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import bonds_run, scenes

K, MU = 1e6, 0.3
EXACT = scenes.tolerance(1e-12, 1e-5)  # relative, of a force or a length


@pytest.fixture(scope="module")
def discs(runtime):
    """Discs in a cell that is periodic along x: 0 and 1 across the border, 2 on the floor, 3 and 4 side by side."""
    position = [(0.2, 5.0), (9.5, 5.0), (5.0, 0.49), (4.0, 8.0), (5.2, 8.0)]
    scene = scenes.scene(
        position,
        [lsm.LinearElastic(K), lsm.ViscousDamping(restitution=0.7), lsm.CoulombFriction(MU, K)],
        track_contacts=True,
        diameter=[1.0, 0.5, 1.0, 1.0, 1.5],
        lengths=(10.0, np.inf),
        periodic=(True, False),
        walls=[lsm.PlaneWall("floor", (0.0, 0.0), (0.0, 1.0))],
        skin=0.2,
        integrator=lsm.VelocityVerlet,
    )
    return scenes.simulate(scene)


@pytest.fixture(scope="module")
def spheres(runtime):
    """Spheres that attract each other across gaps up to 0.05 m: 0 and 1 overlap, 2 and 3 are 0.02 m apart."""
    direction = np.array([2.0, -1.0, 2.0]) / 3.0
    position = [np.zeros(3), 0.99 * direction, (5.0, 0.0, 0.0), (5.0, 0.0, 1.02)]
    effects = [lsm.LinearElastic(K), lsm.effects.Cohesion(100.0, 0.05)]
    return scenes.simulate(scenes.scene(position, effects, skin=0.2)), direction


def test_two_discs_across_the_border(discs):
    discs.reset(discs.scene)
    pair = discs.contacts().isel(contact=0)
    overlap = 0.75 - 0.7  # radii 0.5 and 0.25, centres 0.7 apart
    assert (pair.first_id, pair.second_id) == (0, 1) and not pair.sliding and not pair.bonded
    assert float(pair.overlap) == pytest.approx(overlap, rel=scenes.tolerance(1e-13, 1e-4))
    assert pair.normal.values == pytest.approx([-1.0, 0.0], abs=EXACT)
    assert pair.branch.values == pytest.approx([-0.7, 0.0], abs=EXACT)
    assert pair.point.values == pytest.approx([0.2 - (0.5 - 0.5 * overlap), 5.0], rel=EXACT)  # beside grain 0
    assert float(pair.normal_force) == pytest.approx(K * overlap, rel=scenes.tolerance(1e-12, 1e-4))
    assert pair.tangential_force.values == pytest.approx([0.0, 0.0], abs=EXACT * K)


def test_a_disc_on_a_wall(discs):
    discs.reset(discs.scene)
    table = discs.contacts()
    (row,) = np.flatnonzero(table.first_id == 2)
    wall = table.isel(contact=int(row))
    assert wall.second_id == -1 and wall.normal.values == pytest.approx([0.0, -1.0])
    assert float(wall.overlap) == pytest.approx(0.01, rel=scenes.tolerance(1e-12, 1e-4))
    assert float(wall.normal_force) == pytest.approx(0.01 * K, rel=scenes.tolerance(1e-12, 1e-4))
    assert wall.point.values == pytest.approx([5.0, -0.005], abs=EXACT)
    assert wall.branch.values == pytest.approx([0.0, -0.495], abs=EXACT)


def test_friction_of_a_sliding_contact_opposes_the_motion(discs):
    discs.reset(discs.scene)
    velocity = np.zeros((5, 2))
    velocity[4] = (0.0, 30.0)  # upwards past grain 3
    scenes.reload(discs, dt=1e-6, velocity=velocity, angular_velocity=np.zeros((5, 1)))
    discs.run(2000)  # 60 mm: beyond the elongation mu F_n / k_t = 15 mm at which the contact slides
    table = discs.contacts()
    (row,) = np.flatnonzero(table.first_id == 3)
    pair = table.isel(contact=int(row))
    assert pair.second_id == 4 and pair.sliding
    tangential = pair.tangential_force.values
    assert np.linalg.norm(tangential) == pytest.approx(MU * float(pair.normal_force), rel=scenes.tolerance(1e-12, 1e-5))
    assert tangential[1] < 0.0 and tangential @ pair.normal.values == pytest.approx(0.0, abs=EXACT * K)


def test_forces_and_velocities_obey_newton(discs):
    """m (v(t + dt/2) - v(t - dt/2)) = F dt, and v(t) lies in the middle."""
    discs.reset(discs.scene)
    discs.run(20)
    table, velocity = discs.contacts(), discs.velocities
    force = table.normal_force.values[:, None] * table.normal.values + table.tangential_force.values
    total = np.zeros((5, 2))
    np.subtract.at(total, table.first_id.values, force)
    between = table.second_id.values >= 0
    np.add.at(total, table.second_id.values[between], force[between])
    before = discs.state.velocity.to_numpy()
    discs.run(1)
    after = discs.state.velocity.to_numpy()
    mass, _ = discs.scene.masses()
    assert np.abs(total).max() > 1e3
    impulse = mass[:, None] * (after - before)
    assert impulse == pytest.approx(total * discs.dt, abs=EXACT * np.abs(impulse).max())
    assert velocity == pytest.approx(0.5 * (before + after), abs=EXACT * np.abs(velocity).max())


def test_forces_energies_and_losses_of_contacts_add_up(discs):
    """At each step of collisions with each other and the floor, in which contacts begin and end."""
    discs.reset(discs.scene)
    velocity = np.array([(-2.0, 1.0), (1.0, 0.0), (3.0, -4.0), (0.5, 2.0), (0.0, -2.0)])
    scenes.reload(discs, dt=2e-4, velocity=velocity, angular_velocity=np.full((5, 1), 3.0))
    lost, parted, counts = 0.0, 0.0, set()
    for _ in range(300):
        discs.run(1)
        table = discs.contacts()
        power = float(table.dissipated_power.sum() + table.parted_power)
        now = float(discs.state.dissipated.to_numpy().sum())
        assert power * discs.dt == pytest.approx(now - lost, abs=scenes.tolerance(1e-12, 1e-5) * max(now, 1.0))
        lost, parted = now, parted + abs(float(table.parted_power))
        counts.add(table.sizes["contact"])
        if table.sizes["contact"]:
            check_parts_of(table, EXACT * K)
    assert len(counts) > 2 and parted > 0.0 and lost > 1.0


def check_parts_of(table, rounding):
    """Elastic part and energy of linear contacts; the rest is what the dashpot remembers."""
    depth = table.overlap.values
    assert table.elastic_normal_force.values == pytest.approx(K * depth, abs=rounding)
    assert table.dissipative_normal_force.values == pytest.approx(table.history_damping_force.values, abs=rounding)
    whole = table.elastic_normal_force + table.dissipative_normal_force
    assert table.normal_force.values == pytest.approx(whole.values, abs=rounding)
    stored = 0.5 * K * (depth**2 + table.history_tangential_spring.values**2)
    assert table.elastic_energy.values == pytest.approx(stored, abs=rounding)
    assert (table.first_patch == 0).all() and (table.second_patch == np.where(table.second_id < 0, -1, 0)).all()


def test_two_spheres_in_space_and_two_across_a_gap(spheres):
    sim, direction = spheres
    touching, apart = (sim.contacts().isel(contact=c) for c in (0, 1))
    assert touching.normal.values == pytest.approx(direction, abs=EXACT)
    assert float(touching.overlap) == pytest.approx(0.01, rel=scenes.tolerance(1e-12, 1e-4))
    assert float(touching.normal_force) == pytest.approx(0.01 * K - 100.0, rel=scenes.tolerance(1e-12, 1e-4))
    assert float(touching.dissipative_normal_force) == pytest.approx(0.0, abs=EXACT * K)
    assert touching.point.values - touching.arm.values == pytest.approx([0.0, 0.0, 0.0], abs=EXACT)
    assert np.isnan(touching.dissipated_power) and np.isnan(sim.contacts().parted_power)  # the scene does not keep it
    assert touching.point.values == pytest.approx(0.495 * direction, abs=EXACT)
    assert (apart.first_id, apart.second_id) == (2, 3)
    assert float(apart.overlap) == pytest.approx(-0.02, rel=scenes.tolerance(1e-12, 1e-4))
    assert float(apart.normal_force) == pytest.approx(-100.0 * 0.03 / 0.05, rel=scenes.tolerance(1e-12, 1e-4))


def stress_of(sim):
    """Sum of force and branch vector over the contacts and of the fluctuations m v v over the grains [J]."""
    table = sim.contacts()
    force = table.normal_force.values[:, None] * table.normal.values + table.tangential_force.values
    mass, _ = sim.scene.masses()
    velocity = sim.velocities - mass @ sim.velocities / mass.sum()
    return force.T @ table.branch.values + (mass[:, None] * velocity).T @ velocity, table


def test_mean_stress_of_the_contacts_is_that_of_the_measure(reference_packing):
    sim = reference_packing("frictional_arcs")
    sim.reset(sim.scene)
    sim.run(200)
    stress, table = stress_of(sim)
    sums = sim.measure.sums()
    assert table.sizes["contact"] == sums["contact_count"] > 48 and table.sliding.sum() == sums["sliding_count"]
    assert stress == pytest.approx(sums["stress_volume"], abs=scenes.tolerance(1e-13, 1e-6) * np.abs(stress).max())
    ids = list(zip(table.first_id.values.tolist(), table.second_id.values.tolist()))
    assert ids == sorted(ids) and all(first < second for first, second in ids)


def test_the_table_leaves_the_run_as_it_is(reference_packing):
    sim = reference_packing("frictional_arcs")
    ends = []
    for reads in (False, True):
        sim.reset(sim.scene)
        for _ in range(60):
            sim.run(5)
            if reads:
                assert sim.contacts().sizes["contact"] > 0 and sim.velocities.shape == sim.positions.shape
        ends.append(
            [getattr(sim.state, name).to_numpy() for name in ("position", "orientation", "force", "dissipated")]
        )
    assert all(np.array_equal(a, b) for a, b in zip(*ends))


@pytest.mark.validate  # compiles for long
def test_bonds_are_rows_of_their_own(runtime):
    sim = scenes.simulate(bonds_run.rubble(columns=2, rows=2))
    sim.run(300)
    stress, table = stress_of(sim)
    bonds = table.isel(contact=table.bonded.values)
    intact = sim.bonds.intact.to_numpy() == 1
    assert bonds.sizes["contact"] == intact.sum() > 0
    assert np.array_equal(np.stack([bonds.first_id, bonds.second_id], axis=1), sim.scene.bonds[intact])
    assert np.isnan(bonds.overlap).all()
    sums = sim.measure.sums()["stress_volume"]
    assert stress == pytest.approx(sums, abs=scenes.tolerance(1e-13, 1e-6) * np.abs(stress).max())


def test_every_variable_has_units_and_a_long_name(spheres):
    table = spheres[0].contacts()
    for name, variable in table.data_vars.items():
        assert variable.attrs["units"] and variable.attrs["long_name"], name
        assert variable.dims in ((("contact",), ("contact", "space")) if name != "parted_power" else ((),))
    assert table.space.values.tolist() == ["x", "y", "z"] and table.time == spheres[0].time


def test_a_scene_without_contacts_has_an_empty_table(discs):
    discs.reset(discs.scene)
    spread = np.stack([np.arange(5) * 2.0, np.full(5, 20.0)], axis=1)
    scenes.reload(discs, position=spread)
    table = discs.contacts()
    assert table.sizes == {"contact": 0, "space": 2} and table.normal.shape == (0, 2)
