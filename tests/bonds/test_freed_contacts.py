"""Free pairs that break: their strengths, the budget of a fracture, the contact that follows it, conservation."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.contact.pair_storage import RESTING, TOUCHING
from tests.helpers import scenes

pytestmark = pytest.mark.usefixtures("runtime")

YOUNG, POISSON, COHESION, ANGLE = 1.0e7, 0.25, 1.0e5, 0.6
STIFFNESS = 1e6  # of the contacts
RADIUS, AREA, SECOND = 0.5, np.pi / 4, np.pi / 64  # of bonds as wide as the spheres
SHEAR = YOUNG / (2 * (1 + POISSON))
TENSILE = COHESION / np.tan(ANGLE)
GAP = 10.0
OVERLAP = 0.03
SMALL_AREA = 0.05  # of a bond that is softer than the contact


def bond(**more):
    return lsm.effects.ElasticBrittleBond(
        **{"youngs_modulus": YOUNG, "poissons_ratio": POISSON, "cohesion": COHESION, "friction_angle": ANGLE} | more
    )


def four_pairs(length, velocity, angular_velocity, contact=None, **more):
    """Four bonded pairs along x, of spheres of diameter 1; velocities (4, 3) of the second spheres, opposite to those
    of the first, and angular velocities (4, 2, 3)."""
    first = GAP * np.arange(4)[:, None] * [0.0, 1.0, 0.0]
    x = np.stack([first, first + np.array(length)[:, None] * [1.0, 0, 0]], axis=1)
    v = np.stack([-np.array(velocity), np.array(velocity)], axis=1)
    return scenes.scene(
        x.reshape(-1, 3),
        [*(contact or [lsm.LinearElastic(STIFFNESS)]), bond()],
        velocity=v.reshape(-1, 3),
        angular_velocity=np.reshape(angular_velocity, (-1, 3)),
        bonds=np.arange(8).reshape(4, 2),
        **more,
    )


def pairs_scene():
    """Pulled, bent, twisted, and pulled while their contact would be compressed."""
    angular_velocity = np.zeros((4, 2, 3))
    angular_velocity[1, :, 2] = 4.0, -4.0
    angular_velocity[2, :, 0] = -4.0, 4.0
    velocity = [(2.0, 0, 0), (0, 0, 0), (0, 0, 0), (2.0, 0, 0)]
    return four_pairs([1.0, 1.0, 1.0, 1.0 - OVERLAP], velocity, angular_velocity, dt=2e-6)


def pressed_scene(contact=None):
    """Sheared by their rotation while they are pressed together, but for the last: see `KINDS`."""
    angular_velocity = np.zeros((4, 2, 3))
    angular_velocity[:, :, 2] = np.array([4.5, 24.0, 14.0, 0.0])[:, None]
    velocity = [(-0.5, 0, 0), (-2.75, 0, 0), (-1.5, 0, 0), (1.5, 0, 0)]
    area = [SMALL_AREA, AREA, AREA, AREA]
    return four_pairs([0.9, 0.8, 1.0, 1.0 - OVERLAP], velocity, angular_velocity, contact, bond_area=area, dt=1e-5)


KINDS = ("contact stiffer than the bond", "softer", "hardly any overlap", "pulled apart")


def cluster_scene():
    """Five bonded spheres that rotate and drift, three more far away."""
    rng = np.random.default_rng(2)
    x = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1), (20, 0, 0), (0, 20, 0), (0, 0, 20)], float)
    v = np.cross([0.5, 1.0, -0.7], x) + np.array([0.1, 0.2, 0.3])
    angular_velocity = np.array([0.5, 1.0, -0.7]) + rng.normal(size=x.shape)
    loose = np.arange(8) >= 5
    v[loose], angular_velocity[loose] = 0.0, 0.0
    return scenes.scene(
        x,
        [lsm.LinearElastic(1e6), bond(cohesion=1e9)],
        velocity=v,
        angular_velocity=angular_velocity,
        bonds=[(0, 1), (1, 2), (2, 3), (3, 4)],
        dt=1e-4,
    )


@pytest.fixture(scope="module")
def free(runtime):
    return scenes.simulate(pairs_scene())


def slot_of(sim, pair):
    """The only pair on the list of a grain that is the first one of a broken bond."""
    return sim.pairs.row_start[sim.grains.slot_of[2 * pair]]


def overlap_of(sim, pair):
    """Overlap of two spheres of diameter 1, and the normal between them."""
    x = sim.state.position.to_numpy()
    branch = x[2 * pair + 1] - x[2 * pair]
    return 1.0 - np.linalg.norm(branch), branch / np.linalg.norm(branch)


def test_a_break_creates_no_energy_and_goes_on_with_the_normal_force_of_the_bond(free):
    """In every step in which a bond breaks: contact force, energies, and the budget until all pairs have parted."""
    free.reset(pressed_scene())
    begin, found = sum(scenes.energy(free)), {}
    while len(found) < 4 and free.step < 4000:
        intact, force = free.bonds.intact.to_numpy(), free.bonds.force.to_numpy()
        free.run(1)
        for pair in np.flatnonzero(intact != free.bonds.intact.to_numpy()):
            overlap, n = overlap_of(free, pair)
            s = slot_of(free, pair)
            lost = free.state.dissipated.to_numpy()[2 * pair, 0]
            pushed = free.pairs.pair_force.to_numpy()[s] @ n
            found[KINDS[pair]] = (overlap, free.pairs.rest_overlap[s], force[pair] @ n, pushed, lost)
            gain = 0.5 * pushed**2 / STIFFNESS
            assert free.bonds.contact_gain[pair] == pytest.approx(gain, rel=scenes.tolerance(1e-9), abs=1e-9)
            assert lost >= 0.0
    rest = scenes.tolerance(1e-9, 1e-5)
    overlap, resting, before, pushed, lost = found[KINDS[0]]
    assert before > 1000.0 and pushed == pytest.approx(before, rel=2e-3)  # it changes by that in a step
    assert STIFFNESS * (overlap - resting) == pytest.approx(pushed, rel=rest)
    held = 0.5 * pushed**2 * (0.9 / (YOUNG * SMALL_AREA))
    assert lost > held - 0.5 * pushed**2 / STIFFNESS > 0.0  # the rest is that of shear and bending
    overlap, resting, before, pushed, lost = found[KINDS[1]]
    assert 0.0 < pushed < before and resting > 0.0 and lost == pytest.approx(0.0, abs=rest * pushed)
    overlap, resting, before, pushed, lost = found[KINDS[2]]
    assert resting == 0.0 and pushed == pytest.approx(STIFFNESS * overlap, rel=rest) and 0.0 < pushed < before
    overlap, resting, before, pushed, lost = found[KINDS[3]]
    assert before < 0.0 and pushed == 0.0 and resting == pytest.approx(overlap, abs=rest) and overlap > 0.01
    assert lost == pytest.approx(0.5 * (before**2 / (YOUNG * AREA / (1.0 - OVERLAP))), rel=0.01)
    free.run(40_000)
    assert not free.pairs.status.to_numpy()[: free.pairs.row_start[8]].any()
    assert sum(scenes.energy(free)) == pytest.approx(begin, rel=scenes.tolerance(1e-6))


@pytest.mark.validate
def test_breaks_of_pairs_with_hertz_and_friction_create_no_energy(runtime):
    """Force goes on, and so do energy and momenta while the pieces slide on each other with overlap that rests."""
    hertz = lsm.effects.Hertz(youngs_modulus=1.2e7, poissons_ratio=0.25)
    sim = scenes.simulate(pressed_scene([hertz, lsm.CoulombFriction(0.3, 0.5 * STIFFNESS)]))
    begin, started = sum(scenes.energy(sim)), scenes.momenta(sim)
    before, lost = np.zeros(4), np.zeros(4)
    while sim.bonds.intact.to_numpy().any() and sim.step < 4000:
        intact, force = sim.bonds.intact.to_numpy(), sim.bonds.force.to_numpy()
        sim.run(1)
        for pair in np.flatnonzero(intact != sim.bonds.intact.to_numpy()):
            n = overlap_of(sim, pair)[1]
            before[pair], lost[pair] = force[pair] @ n, sim.state.dissipated.to_numpy()[2 * pair, -1]
            if pair == 0:
                resting = sim.pairs.rest_overlap[slot_of(sim, pair)]
                assert resting > 0.0 and pushed_apart(sim, pair, n) == pytest.approx(before[pair], rel=5e-3)
    assert (before[:3] > 1000.0).all() and before[3] < 0.0 and (lost >= 0.0).all()
    sim.run(500)
    assert sim.pairs.rest_overlap[slot_of(sim, 0)] > 0.0
    sim.run(40_000)
    assert not sim.pairs.status.to_numpy()[: sim.pairs.row_start[8]].any()
    assert sum(scenes.energy(sim)) == pytest.approx(begin, rel=1e-5)
    moved = scenes.momenta(sim)
    assert np.abs(moved[2] - started[2]).max() < scenes.tolerance(1e-11, 1e-5) * started[3]


def test_overlap_left_by_a_break_is_no_depth_until_the_grains_have_parted(free):
    """A pair that was pulled apart comes back at once, rebounds, flies apart, and comes back to its whole overlap."""
    free.reset(pressed_scene())
    pair = 3
    while free.bonds.intact[pair]:
        free.run(1)
    nearest, n = overlap_of(free, pair)
    while overlap_of(free, pair)[0] > 0.25 * OVERLAP:
        assert free.pairs.status[slot_of(free, pair)] == RESTING
        free.run(5)
    speed = approach(free, pair, 1.0)
    left, _ = overlap_of(free, pair)
    assert 0.0 < left < 0.8 * nearest
    deepest = 0.0
    for _ in range(65):  # the depth counts from where the pair turned round
        free.run(100)
        overlap, n = overlap_of(free, pair)
        force, resting = pushed_apart(free, pair, n), free.pairs.rest_overlap[slot_of(free, pair)]
        deepest = max(deepest, overlap)
        rounding = STIFFNESS * scenes.tolerance(1e-12, 2e-7)  # of an overlap
        assert force == pytest.approx(STIFFNESS * max(0.0, overlap - resting), rel=1e-6, abs=rounding)
        assert resting <= left + 1e-6 * RADIUS
    mass = free.scene.masses()[0][0]
    assert deepest - left == pytest.approx(speed * np.sqrt(0.5 * mass / STIFFNESS), rel=0.02)
    assert relative_speed(free, pair) == pytest.approx(-speed, rel=scenes.tolerance(1e-6))
    assert overlap_of(free, pair)[0] < 0.0 and free.pairs.rest_overlap[slot_of(free, pair)] == 0.0
    approach(free, pair, 1.0)
    while not free.pairs.status[slot_of(free, pair)] & TOUCHING:
        free.run(10)
    free.run(50)
    overlap, n = overlap_of(free, pair)
    assert pushed_apart(free, pair, n) == pytest.approx(STIFFNESS * overlap, rel=1e-6, abs=rounding) and overlap < left


def test_a_run_that_goes_on_keeps_the_overlap_that_rests(free, tmp_path):
    """Bit for bit, from a checkpoint between the break and the end of the overlap, through rebuilds of the list."""
    free.reset(pressed_scene())
    free.run(1300)
    resting = free.pairs.rest_overlap.to_numpy()[: free.pairs.row_start[8]]
    assert np.count_nonzero(resting) >= 2
    lsm.save_checkpoint(free, tmp_path / "half.nc")
    free.run(6000)
    end, rebuilds = free.state.position.to_numpy(), free.rebuilds
    lsm.restore_checkpoint(free, tmp_path / "half.nc")
    assert np.array_equal(free.pairs.rest_overlap.to_numpy()[: free.pairs.row_start[8]], resting)
    free.run(6000)
    assert free.rebuilds == rebuilds and np.array_equal(free.state.position.to_numpy(), end)


def relative_speed(sim, pair):
    """Closing speed of the pair [m s-1]."""
    v, (_, n) = sim.state.velocity.to_numpy(), overlap_of(sim, pair)
    return (v[2 * pair] - v[2 * pair + 1]) @ n


def approach(sim, pair, speed):
    """Let the grains of the pair come together at this speed, which is returned."""
    v, (_, n) = sim.state.velocity.to_numpy(), overlap_of(sim, pair)
    v[2 * pair], v[2 * pair + 1] = 0.5 * speed * n, -0.5 * speed * n
    sim.state.velocity.from_numpy(v)
    return speed


def pushed_apart(sim, pair, n):
    """Normal force of the pair [N]."""
    return sim.pairs.pair_force.to_numpy()[slot_of(sim, pair)] @ n


def test_pairs_break_at_their_strengths_and_the_energy_budget_closes(free):
    free.reset(pairs_scene())
    begin = sum(scenes.energy(free))
    loads, balance = np.zeros(4), []
    while free.bonds.intact.to_numpy().any() and free.step < 40_000:
        intact = free.bonds.intact.to_numpy() == 1
        tension = np.linalg.norm(free.bonds.force.to_numpy(), axis=1)
        moment = np.linalg.norm(free.bonds.torque_second.to_numpy(), axis=1)
        loads[intact] = np.where([True, False, False, True], tension, moment)[intact]
        free.run(5)
        balance.append(sum(scenes.energy(free)) / begin - 1)
    strength = np.array(
        [AREA * TENSILE, TENSILE * np.pi * RADIUS**3 / 4, COHESION * np.pi * RADIUS**3 / 2, AREA * TENSILE]
    )
    assert np.abs(loads / strength - 1).max() < 0.01
    assert np.abs(balance).max() < 1e-3
    free.run(2000)
    kinetic, lost = scenes.energy(free)
    assert kinetic + lost == pytest.approx(begin, rel=scenes.tolerance(1e-6))
    stiffness = np.array([YOUNG * AREA, YOUNG * SECOND, 2 * SHEAR * SECOND, YOUNG * AREA / (1 - OVERLAP)])
    held = 0.5 * strength**2 / stiffness
    assert not free.bonds.contact_gain.to_numpy().any()  # of none was the bond compressed
    assert lost == pytest.approx(held.sum(), rel=0.01)
    assert len(set(lsm.fragments(free))) == 8


def test_a_rotating_cluster_keeps_its_momenta_and_its_energy(free):
    scene = cluster_scene()
    free.reset(scene)
    mass, inertia = scene.masses()

    def momenta():
        """Of the positions and velocities of the half step: the kicks of all bonds balance exactly."""
        x, v, angular_velocity = (
            getattr(free.state, name).to_numpy() for name in ("position", "velocity", "angular_velocity")
        )
        return (mass[:, None] * v).sum(0), (np.cross(x, mass[:, None] * v) + inertia * angular_velocity).sum(0)

    p, angular = momenta()
    begin, lost = scenes.energy(free)
    free.run(20_000)
    p_end, angular_end = momenta()
    assert np.abs(p_end - p).max() < scenes.tolerance(1e-10, 1e-8) * np.abs(p).max()
    assert np.abs(angular_end - angular).max() < scenes.tolerance(1e-10, 1e-8) * np.abs(angular).max()
    end, lost_end = scenes.energy(free)
    assert end == pytest.approx(begin, rel=1e-4) and lost_end == 0
    labels = lsm.fragments(free)
    assert len(set(labels)) == 4 and len(set(labels[:5])) == 1
