"""Hard cases of the force laws of contacts: one grain or two, and the ends of the range of each parameter."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import taichi_lsm as lsm
from workflows.common.small_scenes import scene_of
from workflows.hard import Bench, hard, refused, worst_balance

STIFFNESS = 1e6  # [N m-1]
MASS = 1000.0 * np.pi / 4  # [kg] of a disc of 1 m
FLOOR = lsm.PlaneWall("floor", (0.0, 0.0), (0.0, 1.0))
G = 10.0  # [m s-2]
FAR = 100.0  # [m] above the floor, for pairs that meet nothing else
REST = 0.5 - MASS * G / STIFFNESS  # [m], height of a disc on the floor
ROLLING = 0.1  # coefficient
ROLLING_STIFFNESS = 0.01 * STIFFNESS  # [N m rad-1], soft beside the spring of friction: the disc rolls
WELL = {"pull_off_force": 1e3, "distance": 0.02}


def scene(
    position: ArrayLike,
    weight: float = 0.0,
    restitution: float = 1.0,
    friction: float = 0.0,
    dynamic: float | None = None,
    rolling: float = 0.0,
    **more,
) -> lsm.Scene:
    """Two discs above a floor, with `weight` times the gravity G; with a dynamic friction they also resist rolling."""
    effects = [
        lsm.LinearElastic(STIFFNESS),
        lsm.ViscousDamping(restitution=restitution),
        lsm.CoulombFriction(friction, 0.5 * STIFFNESS, dynamic),
        lsm.Gravity((0.0, -weight * G)),
    ]
    effects += [] if dynamic is None else [lsm.effects.RollingResistance(rolling, ROLLING_STIFFNESS)]
    return scene_of(position, effects, walls=[FLOOR], **more)


def impact(
    speed: float, offset: float = 0.0, angular_velocity: ArrayLike = (0.0, 0.0), gap: float = 0.01, **more
) -> lsm.Scene:
    """Two discs that fly at each other along x, the second higher by `offset` [m]."""
    ahead = math.sqrt(1.0 - offset**2) + gap
    velocity = 0.5 * speed * np.array([(1.0, 0.0), (-1.0, 0.0)])
    return scene(
        [(0.0, FAR), (ahead, FAR + offset)],
        velocity=velocity,
        angular_velocity=np.array(angular_velocity, float)[:, None],
        **more,
    )


def resting(**more) -> lsm.Scene:
    """Two discs side by side on the floor at the depth that carries their weight, pressed lightly together."""
    return scene([(0.0, REST), (0.999, REST)], weight=1.0, **more)


def bouncing() -> lsm.Scene:
    """Two discs above each other that fall on the floor."""
    return scene([(0.0, 0.7), (0.0, 2.0)], weight=1.0, skin=0.5)


def cohesive(speed: float) -> lsm.Scene:
    """Two cohesive discs where the force between them is zero, parting at `speed` [m s-1]."""
    apart = 1.0 - WELL["pull_off_force"] / STIFFNESS
    velocity = 0.5 * speed * np.array([(-1.0, 0.0), (1.0, 0.0)])
    effects = [lsm.LinearElastic(STIFFNESS), lsm.effects.Cohesion(**WELL)]
    return scene_of(
        [(0.0, 0.0), (apart, 0.0)], effects, velocity=velocity, safety=0.04
    )  # to resolve the edge of escape


def well_depth() -> float:
    """Energy [J] that tears cohesive discs apart."""
    f, h = WELL["pull_off_force"], WELL["distance"]
    return 0.5 * f * f / STIFFNESS + 0.5 * f * h


def escape_speed() -> float:
    """Speed of parting [m s-1] that just tears cohesive discs apart."""
    return math.sqrt(2.0 * well_depth() / (0.5 * MASS))


def while_touching(sim: lsm.Simulation, watch: Callable[[], None] = lambda: None, most: int = 20000) -> Any:
    """Run until a contact has begun and ended; `watch` is called after every step."""
    begun = False
    for _ in range(most):
        sim.run(1)
        watch()
        touching = sim.measure.sums()["contact_count"] > 0
        if begun and not touching:
            return
        begun |= touching
    raise lsm.SimulationError(f"no contact began and ended in {most} steps")


def shaken(bench: Bench, sim: lsm.Simulation, speed: float, full: int, short: int) -> tuple[float, float]:
    """Error of the energy and share of sliding while the floor moves to and fro at `speed` [m s-1] for random times.

    Error of the energy balance over the energy dissipated [1]; share of the times at which a contact slid [1].
    """
    rng, sliding = np.random.default_rng(3), []
    begin = lsm.energies(sim).balance
    for reversal in range(bench.steps(full, short)):
        sim.walls.set_velocity("floor", (speed if reversal % 2 else -speed, 0.0))
        sim.run(int(rng.integers(5, 80)))
        sliding.append(sim.measure.sums()["sliding_count"] > 0)
    now = lsm.energies(sim)
    return abs(now.balance - begin) / now.dissipated, float(np.mean(sliding))


@hard("Impact at the smallest restitution", "error of the coefficient of restitution 0.01", 2e-3)
def smallest_restitution(bench: Bench) -> float:
    """The dashpot for a restitution of 0.01 is far overdamped: its rate, not that of the spring, bounds the step.

    In codes whose step knows the spring alone, such contacts diverge or throw the grains back.
    """
    worst = 0.0
    for speed in np.geomspace(0.1, 10.0, bench.steps(11, 2)):
        sim = bench.simulate(impact(speed, gap=1e-3, restitution=0.01))
        while_touching(sim)
        v = sim.state.velocity.to_numpy()[:, 0]
        worst = max(worst, abs((v[1] - v[0]) / speed - 0.01))
    return worst


@hard("Hundreds of elastic impacts", "relative error of the energy", 3e-3)
def elastic_impacts(bench: Bench) -> float:
    """Two discs that bounce on each other and on a floor without any loss.

    Where the force begins inside a step Verlet makes an error, and over many impacts such errors add up like a random
    walk; they have to stay within the ripple that Verlet shows inside one contact, a tenth of the square of its phase
    per step.
    """
    sim = bench.simulate(bouncing())
    return worst_balance(sim, bench.steps(400_000, 20_000), bench.steps(4000, 200))


@hard("Dashpot stronger than any restitution", "0 if refused with the reason", 0.0)
def restitution_out_of_range(bench: Bench) -> float:
    """A restitution of 0 or below 0.01 asks for a dashpot without bound, and with it for a step of zero.

    Some codes take it and return numbers that mean nothing.
    """
    return max(
        refused(lambda e=e: lsm.ViscousDamping(restitution=e), "restitution", "between 0.01 and 1")
        for e in (0.001, 0.0, -0.1, 1.001, math.nan)
    )


@hard("Oblique impact without friction", "greatest change of an angular velocity", 0.0, unit="rad s-1")
def frictionless_oblique_impact(bench: Bench) -> float:
    """With a friction coefficient of zero no torque may act on a disc: its angular velocity must keep every bit.

    Divisions by the limit of friction and torques from rounded normals break this.
    """
    angular_velocity = np.array([3.0, -7.0])
    sim, worst = bench.simulate(impact(1.0, 0.5, angular_velocity)), 0.0
    for offset in np.linspace(0.05, 0.95, bench.steps(40, 4)):
        sim = bench.simulate(impact(1.0, offset, angular_velocity))
        while_touching(sim)
        worst = max(worst, float(np.abs(sim.state.angular_velocity.to_numpy()[:, 0] - angular_velocity).max()))
    return worst


@hard("Oblique impact with friction 10", "growth of the stored energy or error of the balance, relative", 1e-2)
def friction_of_ten(bench: Bench) -> float:
    """A contact that practically never slides throws its tangential spring to and fro.

    What the spring holds must be cut back with the normal force as the grains part, or it becomes energy from nowhere.
    """
    worst = 0.0
    count = bench.steps(40, 4)
    for offset, omega in zip(np.linspace(0.1, 0.9, count), np.linspace(-4.0, 4.0, count), strict=True):
        sim = bench.simulate(impact(1.0, offset, (omega, omega), friction=10.0, restitution=0.9))
        energies = [lsm.energies(sim)]
        while_touching(sim, lambda sim=sim, energies=energies: energies.append(lsm.energies(sim)))
        stored, balance = np.array([(e.stored, e.balance) for e in energies]).T / energies[0].stored
        worst = max(worst, float(np.abs(balance - 1.0).max()), float(np.diff(stored).max()))
    return worst


@hard("Sliding reversed again and again", "error of the energy balance over the energy dissipated", 1e-5)
def sliding_reversed(bench: Bench) -> float:
    """The floor under two discs jumps from one velocity to the opposite at random times.

    Each time the springs of friction must let go, pass through zero and slide the other way, and all work must be
    accounted for.
    """
    sim = bench.simulate(resting(friction=0.3, restitution=0.5))
    return shaken(bench, sim, 1.0, 20_000, 400)[0]


@hard("Static friction far above dynamic friction", "error of the energy balance over the energy dissipated", 1e-5)
def static_above_dynamic(bench: Bench) -> float:
    """Grains on a shaken floor stick at a coefficient of 1 and slide at one of 0.05.

    Where the contact gives way the force drops at once by a factor of twenty, and what the spring held must count as
    dissipated.
    """
    sim = bench.simulate(resting(friction=1.0, dynamic=0.05, restitution=0.5))
    error, sliding = shaken(bench, sim, 0.5, 20_000, 400)
    return error if 0.05 < sliding < 0.95 else math.inf


@hard("Grazing contacts of about one step", "relative error of the energy", 1e-5)
def grazing_contacts(bench: Bench) -> float:
    """Fast grains that graze each other overlap for about one step: the contact is seen once, twice or never.

    The error may be no more than the work of the deepest force over the path of a step, k L^4/16 at a path L.
    """
    rng, worst, path = np.random.default_rng(1), 0.0, 0.05
    dt = 0.3 * impact(1.0).stable_dt()
    for _ in range(bench.steps(400, 8)):
        offset = 1.0 - rng.random() * path**2 / 8.0
        sim = bench.simulate(impact(path / dt, offset, gap=path * (1.0 + rng.random()), dt=dt))
        begin = lsm.energies(sim).balance
        sim.run(8)
        worst = max(worst, abs(lsm.energies(sim).balance / begin - 1.0))
    return worst


@hard("Rolling resistance brings a disc to rest", "angular velocity left, over the amplitude of elastic rocking", 1.05)
def rolling_to_rest(bench: Bench) -> float:
    """A moment against rolling that always acts at its limit never lets a grain rest.

    It overshoots and turns the grain back. With its elastic share the grain rocks by no more than that holds.
    """
    sim = bench.simulate(rolling())
    sim.run(int(2.0 / sim.dt))
    worst = 0.0
    for _ in range(bench.steps(20_000, 400)):
        sim.run(3)
        worst = max(worst, float(np.abs(sim.state.angular_velocity.to_numpy()).max()))
    return worst / rocking_velocity()


@hard("Cohesive pair at the edge of escape", "error of the energy over the depth of the well", 5e-4)
def cohesive_pair(bench: Bench) -> float:
    """Two cohesive grains move out almost to where attraction ends, or just beyond.

    Codes that let attraction act on touching grains only, or drop pairs at the reach, create or lose the energy of the
    well; a grain with more than the escape energy must leave.
    """
    worst = 0.0
    for share in (0.5, 0.999, 1.001):
        sim = bench.simulate(cohesive(share * escape_speed()))
        begin = lsm.energies(sim).balance
        for _ in range(bench.steps(10_000, 300)):
            sim.run(10)
            worst = max(worst, abs(lsm.energies(sim).balance - begin))
        gap = float(np.ptp(sim.state.position.to_numpy()[:, 0])) - 1.0
        if (gap > WELL["distance"]) != (share > 1.0):
            return math.inf
    return worst / well_depth()


def rolling() -> lsm.Scene:
    """Two discs that roll on the floor, apart from each other, in opposite directions."""
    speed = 0.5
    return scene(
        [(0.0, REST), (5.0, REST)],
        weight=1.0,
        restitution=0.5,
        friction=0.8,
        dynamic=0.8,
        rolling=ROLLING,
        velocity=speed * np.array([(-1.0, 0.0), (1.0, 0.0)]),
        angular_velocity=speed / REST * np.array([[1.0], [-1.0]]),
    )


def rocking_velocity() -> float:
    """Greatest angular velocity [rad s-1] that rolling resistance and friction leave to a disc.

    It is what their springs hold at their limits: the amplitudes of rocking without slip and of the slip that the
    friction of the braked disc starts.
    """
    radius, k_t = 0.5, 0.5 * STIFFNESS
    contact_moment = ROLLING * radius * MASS * G
    rocking = contact_moment / math.sqrt(ROLLING_STIFFNESS * 1.5 * MASS * radius**2)
    friction = contact_moment / (1.5 * radius)
    return rocking + 2.0 / 3.0 * friction / k_t * math.sqrt(3.0 * k_t / MASS) / radius
