"""The same physics described in two ways must give the same grains: discs cut into arcs, and other units."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes

STEPS = 500


def packed_discs(shapes, shape, count=200):
    """A dense, moving packing of frictional, damped discs."""
    rng = np.random.default_rng(8)
    arguments = scenes.packing("discs", count, seed=3)
    return scenes.scene(
        effects=scenes.frictional(),
        velocity=0.3 * rng.standard_normal((count, 2)),
        angular_velocity=0.6 * rng.standard_normal((count, 1)),
        **arguments | {"shapes": shapes, "shape_index": shape, "angle": rng.uniform(0, 6, count)},
    )


@pytest.mark.validate
def test_disc_cut_into_8_or_30_arcs_moves_like_the_disc(runtime):
    plain = scenes.simulate(packed_discs([lsm.disc()], 0))
    kinds = [lsm.disc(), lsm.shapes.regular_disc_of_arcs(8), lsm.shapes.regular_disc_of_arcs(30)]
    cut = scenes.simulate(packed_discs(kinds, np.arange(200) % 3))
    assert plain.dt == cut.dt
    start = plain.state.position.to_numpy()
    assert plain.measure.sums()["contact_count"] > 350
    for sim in (plain, cut):
        sim.run(STEPS)
    there = plain.state.position.to_numpy()
    assert np.abs(there - start).max() > 0.05
    assert np.abs(there - cut.state.position.to_numpy()).max() < 1e-9
    assert plain.state.angular_velocity.to_numpy() == pytest.approx(cut.state.angular_velocity.to_numpy(), abs=1e-8)
    first, second = plain.measure.sums(), cut.measure.sums()
    for name in ("contact_count", "sliding_count"):
        assert first[name] == second[name]
    assert first["dissipated_coulomb_friction"] > 0
    for name in ("elastic_energy", "dissipated_coulomb_friction", "dissipated_viscous_damping"):
        assert first[name] == pytest.approx(second[name], rel=1e-9)


def layer_in_units(metre, kilogram, second):
    """A sheared, damped, heavy layer of angular grains, every input in these units."""
    newton = kilogram * metre / second**2
    per_metre = newton / metre
    pascal = newton / metre**2
    rng = np.random.default_rng(12)
    columns, rows = 12, 6
    inner = np.stack(np.meshgrid(np.arange(columns), 1.05 * np.arange(1, rows)), axis=-1).reshape(-1, 2) * 1.02
    walls = [np.stack([np.arange(columns) * 1.02, np.full(columns, y)], axis=1) for y in (0.0, 1.07 * rows)]
    position = np.concatenate([walls[0], walls[1], inner])
    platen = np.concatenate([np.repeat([0, 1], columns), np.full(len(inner), -1)])
    k = 1e6
    servo = lsm.ServoStress(400.0 * pascal, 1, k * per_metre, 8e3 * kilogram, 0.125 * metre / second)
    pull = lsm.ConstantVelocity(0.25 * metre / second, 4.0 * metre / second**2)
    return scenes.scene(
        position * metre,
        [
            lsm.LinearElastic(k * per_metre),
            lsm.ViscousDamping(restitution=0.5),
            lsm.CoulombFriction(0.5, 0.5 * k * per_metre),
            lsm.Gravity((0.0, -2.0 * metre / second**2)),
        ],
        shapes=[lsm.disc(), *lsm.shapes.random_angular_shapes(4, 4)],
        shape_index=np.where(platen < 0, 1 + np.arange(len(position)) % 4, 0),
        diameter=metre * rng.uniform(0.72, 0.82, len(position)),
        angle=rng.uniform(0, 6, len(position)),
        velocity=0.3 * rng.standard_normal(position.shape) * (platen < 0)[:, None] * (metre / second),
        density=1000.0 * kilogram / metre**3,
        lengths=(columns * 1.02 * metre, np.inf),
        periodic=(True, False),
        platen_index=platen,
        platens=[
            lsm.Platen("lower", [lsm.Fixed(), lsm.Fixed()]),
            lsm.Platen("upper", [pull, servo]),
        ],
        dt=second / 512,
        skin=0.125 * metre,
    )


@pytest.mark.validate
def test_units_scaled_by_powers_of_two_leave_the_scaled_bits(runtime):
    """Nothing in the core knows an absolute size: no tolerance, no constant with a hidden unit."""
    metre, kilogram, second = 2.0**-10, 2.0**-31, 2.0**-7
    sims = [scenes.simulate(layer_in_units(*units)) for units in ((1.0, 1.0, 1.0), (metre, kilogram, second))]
    for sim in sims:
        sim.run(2000)
        assert sim.rebuilds > 1
    sums = [sim.measure.sums() for sim in sims]
    assert sums[0]["sliding_count"] > 0
    joule = kilogram * metre**2 / second**2
    units = {
        "position": metre,
        "velocity": metre / second,
        "angular_velocity": 1 / second,
        "force": kilogram * metre / second**2,
    }
    units |= {"torque": joule, "dissipated": joule, "orientation": 1.0}
    for name, unit in units.items():
        first, second_ = (getattr(sim.state, name).to_numpy() for sim in sims)
        assert np.array_equal(first * unit, second_), name
    contacts = [sim.contacts() for sim in sims]
    for name, unit in {
        "first_id": 1,
        "second_id": 1,
        "sliding": 1,
        "overlap": metre,
        "normal_force": joule / metre,
    }.items():
        assert np.array_equal(contacts[0][name] * unit, contacts[1][name]), name
    for name in ("elastic_energy", "translational_energy", "dissipated_coulomb_friction"):
        assert sums[0][name] * joule == sums[1][name]
    work = [sim.platens.snapshot()["work"] for sim in sims]
    assert np.abs(work[0]).max() > 0 and np.array_equal(work[0] * joule, work[1])
