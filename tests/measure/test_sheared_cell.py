"""What ShearedCell reports of a small sheared cell, against forces, volumes and velocities taken apart."""

import json

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.measure.layer_rows import cell_rows
from tests.helpers import scenes

K = scenes.STIFFNESS
STRESS, RATE, THICKNESS = 0.02 * K, 0.5, 2.0


@pytest.fixture(scope="module")
def sheared(runtime):
    """(simulation, ShearedCell, last row) of 48 discs, fast enough for their motion to carry stress."""
    servo = lsm.CellServo(STRESS, 2.0 * K, 1e4, 20.0)
    scene = scenes.scene(
        effects=scenes.frictional(),
        shear_rate=RATE,
        cell_servo=servo,
        dt=2e-4,
        thickness=THICKNESS,
        **scenes.packing("discs"),
    )
    sim = scenes.simulate(scene)
    cell = lsm.ShearedCell(sim, STRESS, 1.0)
    cell.row()
    sim.run(4000)
    cell.sample()
    cell.row()
    cell.begin_shear()
    rows = []
    for _ in range(20):
        sim.run(500)
        cell.sample()
        rows.append(cell.row())
    return sim, cell, rows


def test_stress_is_that_of_contacts_and_of_motion_relative_to_the_flow(sheared):
    sim, _, rows = sheared
    contacts, mass = sim.contacts(), sim.scene.masses()[0]
    force = (contacts.normal_force * contacts.normal + contacts.tangential_force).values
    x, height = sim.positions, float(sim.domain.height[0])
    w = sim.velocities - RATE * x[:, 1:] * [1.0, 0.0] - sim.domain.missing_flow(x)
    volume = height * sim.scene.lengths[0] * THICKNESS
    stress = np.einsum("ca,cb->ab", force, contacts.branch.values) + np.einsum("n,na,nb->ab", mass, w, w)
    momentum = (mass[:, None] * w).sum(axis=0)
    stress = (stress - np.outer(momentum, momentum) / mass.sum()) / volume
    row = rows[-1]
    found = [row["normal_stress_along"], -row["shear_stress"], row["normal_stress"]]
    assert found == pytest.approx([stress[0, 0], stress[0, 1], stress[1, 1]], rel=scenes.tolerance(1e-9))
    assert row["friction"] == pytest.approx(row["shear_stress"] / row["normal_stress"])
    assert float(sim.domain.force[0]) == pytest.approx(stress[1, 1] * volume / height, rel=0.02)  # half a step apart


def test_filling_strain_and_rate_are_those_of_the_cell(sheared):
    sim, cell, rows = sheared
    row, height = rows[-1], float(sim.domain.height[0])
    solid = np.pi / 4.0 * (sim.scene.diameter**2).sum()
    assert row["porosity"] == pytest.approx(1.0 - solid / (height * sim.scene.lengths[0]), rel=1e-12)
    assert cell.solid_fraction == pytest.approx(1.0 - row["porosity"]) and cell.thickness == height
    assert cell.strain == pytest.approx(RATE * 20 * 500 * sim.dt) and row["shear_rate"] == pytest.approx(RATE)
    assert row["inertial_number"] == pytest.approx(RATE * np.sqrt(1000.0 / STRESS))
    mean_height = np.mean([row["cell_height"] for row in rows])
    assert cell.slip == pytest.approx(cell.strain * mean_height, rel=5e-3)


def test_normal_stress_of_every_step_is_held_and_the_budget_closed(sheared):
    sim, cell, rows = sheared
    of_steps, of_samples = (np.mean([row[name] for row in rows]) for name in ("cell_normal_stress", "normal_stress"))
    assert of_steps == pytest.approx(of_samples, rel=0.05) and of_steps == pytest.approx(STRESS, rel=0.3)
    for row in rows:
        assert abs(row["cell_normal_stress"] - STRESS) < row["cell_normal_rms"] < STRESS
    assert cell.residual_fraction() < 1e-3
    worked = rows[-1]["external_work"] - rows[0]["external_work"]
    assert rows[-1]["work_throughput"] > 0.5 * abs(worked) > 0.0


def test_rows_are_those_of_the_schema_and_memory_is_plain(sheared):
    _, cell, rows = sheared
    assert {v.name for v in cell_rows()} == set(rows[-1]) - {"time"}
    plain = json.loads(json.dumps(cell.memory.as_plain()))
    before = cell.memory
    cell.restore(plain)
    assert cell.memory.as_plain() == before.as_plain()


def test_a_scene_without_a_servo_is_refused(sheared):
    sim, _, _ = sheared
    with pytest.raises(lsm.InputError, match=r"ShearedCell.diameter: 0.0, must be > 0"):
        lsm.ShearedCell(sim, STRESS, 0.0)
