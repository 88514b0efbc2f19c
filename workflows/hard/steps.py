"""Hard cases of the time step: steps that are too long, impacts too fast for them, and the guards that detect them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import taichi_lsm as lsm
from workflows.common.small_scenes import scene_of
from workflows.hard import Bench, hard, refused, steps_until_stopped

STIFFNESS = 1e5  # [N m-1]
MASS = 250.0 * np.pi  # of a disc of 1 m [kg]
CRITICAL = np.sqrt(2.0 * MASS / STIFFNESS)  # 2/omega of two free discs in contact, omega^2 = 2 k/m [s]
HELD = 0.01  # depth of two discs held together by cohesion [m]
RANGE = 0.5  # of the cohesion [m], wide enough to hardly change the stiffness of the contact
AMPLITUDE = 1e-3  # of the held discs at the start [m]
OSCILLATION_STEPS = 400  # steps over which an oscillation must grow to be called unstable


def elastic() -> list[Any]:
    """Linear springs."""
    return [lsm.LinearElastic(STIFFNESS)]


def held_pair(dt: float | None, guards: lsm.Guards | None = None) -> lsm.Scene:
    """Two discs that cohesion holds at the depth HELD, oscillating about it by AMPLITUDE."""
    effects = [*elastic(), lsm.effects.Cohesion(pull_off_force=STIFFNESS * HELD, distance=RANGE)]
    more: dict[str, Any] = {"guards": guards} if guards else {}
    return scene_of([[0.0, 0.0], [1.0 - HELD + AMPLITUDE, 0.0]], effects, dt=dt, **more)


def greatest_oscillation(sim: lsm.Simulation, steps: int) -> float:
    """Greatest distance from rest of the held discs over that of the start [1]; infinite if the run is stopped."""
    widest = 0.0
    for _ in range(steps):
        try:
            sim.run(1)
        except lsm.SimulationError:
            return math.inf
        x = sim.state.position.to_numpy()[:, 0]
        widest = max(widest, abs(x[1] - x[0] - 1.0 + HELD))
        if widest > 1e3 * AMPLITUDE:
            break
    return widest / AMPLITUDE


def blow_up_step(bench: Bench) -> float:
    """Measured critical step [s] of the held pair: the shortest at which its oscillation grows, by bisection."""
    low, high = 0.5 * CRITICAL, 2.0 * CRITICAL
    free = lsm.Guards(step=None, displacement=None, energy=None)
    while high / low > 1.002:
        middle = math.sqrt(low * high)
        grows = greatest_oscillation(bench.simulate(held_pair(middle, free)), OSCILLATION_STEPS) > 10.0
        low, high = (low, middle) if grows else (middle, high)
    return low


@hard("Step of 0.9 of the critical one", "greatest oscillation of a contact over its first", 1.01)
def step_below_critical(bench: Bench) -> float:
    """Verlet oscillates without growth up to the step 2/omega.

    Codes that judge a step by rules of thumb waste half of it or exceed it. The critical step is measured here: the
    blow-up step of two discs in contact.
    """
    return greatest_oscillation(
        bench.simulate(held_pair(0.9 * blow_up_step(bench))), bench.steps(20_000, OSCILLATION_STEPS)
    )


@hard(
    "Step of 1.1 of the critical one", "greatest oscillation of a contact over its first before the run is refused", 1.0
)
def step_above_critical(bench: Bench) -> float:
    """Above the critical step a contact gains energy in every step and grains fly apart.

    Often they do only after hours of a run. It must be refused before the first step, with the step to use.
    """
    dt = 1.1 * blow_up_step(bench)
    try:
        return greatest_oscillation(bench.simulate(held_pair(dt)), OSCILLATION_STEPS)
    except lsm.InputError as error:
        return 1.0 if "Scene.dt" in str(error) and "must be <=" in str(error) else math.inf


def crowd(dt: float | None) -> lsm.Scene:
    """16 discs in a periodic triangular lattice, each pressed by its six neighbours, at random velocities."""
    row, column = np.divmod(np.arange(16), 4)
    near = 0.99
    position = near * np.stack([column + 0.5 * (row % 2), np.sqrt(0.75) * row], axis=1)
    velocity = np.random.default_rng(1).normal(0.0, 0.01, (16, 2))
    lengths = (4 * near, 4 * near * np.sqrt(0.75))
    return scene_of(position, elastic(), lengths=lengths, periodic=(True, True), velocity=velocity, dt=dt)


@hard("Step that suits two grains, but not a crowd", "steps until the run is stopped with the step to use", 1.0)
def step_of_a_pair_in_a_crowd(bench: Bench) -> float:
    """A grain among six neighbours oscillates faster than one of a pair.

    A step that is stable while grains are loose can become unstable when they are packed. The contacts that are there
    are counted while the simulation runs.
    """
    try:
        sim = bench.simulate(crowd(0.95 * CRITICAL))
    except lsm.SimulationError as error:
        return 0.0 if "use dt <=" in str(error) and "stable" in str(error) else math.inf
    return steps_until_stopped(sim, 2000, "stable", "use dt <=")


@hard("Step of zero, less, or no number", "accepted steps of four that make no sense", 0.0)
def step_without_sense(bench: Bench) -> float:
    """A step of zero runs for ever and a negative one backwards, with dampers that feed energy in."""
    senseless = (0.0, -1e-3, math.nan, math.inf)
    return float(sum(refused(lambda dt=dt: bench.simulate(on_floor(0.0, dt)), "Scene.dt") > 0.0 for dt in senseless))


def on_floor(speed: float, dt: float | None, stiffness: float = STIFFNESS, height: float = 50.0) -> lsm.Scene:
    """Two discs 20 cm apart that approach each other at `speed` each [m s-1], `height` above a floor [m]."""
    position, velocity = [[-0.6, height], [0.6, height]], [[speed, 0.0], [-speed, 0.0]]
    floor = lsm.PlaneWall("floor", (0.0, 0.0), (0.0, 1.0))
    return scene_of(position, [lsm.LinearElastic(stiffness)], velocity=velocity, walls=[floor], dt=dt)


@hard("Impact that crosses half a grain in one step", "steps until the run is stopped", 1.0)
def crossing_in_one_step(bench: Bench) -> float:
    """A grain that moves by its own radius in a step may pass through another without ever being in contact.

    Nothing in the energies tells. Its displacement in a step is limited, and the error names the step to use.
    """
    dt = 0.05 * CRITICAL
    try:
        sim = bench.simulate(on_floor(0.5 / dt, dt))
    except lsm.SimulationError as error:
        return 0.0 if "in one step" in str(error) and "use dt <=" in str(error) else math.inf
    return steps_until_stopped(sim, 100, "in one step", "use dt <=")


@hard("Impact deeper than a contact can be", "overlap over the sum of the radii when the run is stopped", 0.999)
def deeper_than_the_limit(bench: Bench) -> float:
    """Soft grains hit hard overlap until their centres pass each other.

    Then the contact pushes them through instead of back. The run must stop before, not drop the contact.
    """
    sim = bench.simulate(on_floor(10.0, 0.02 * CRITICAL))
    try:
        sim.run(1000)
    except lsm.SimulationError as error:
        return 1.0 - error.values["distance"] if "overlap reached" in str(error) else math.inf
    return math.inf


@hard("Velocity that is not a number", "steps until the run is stopped", 1.0)
def not_a_number(bench: Bench) -> float:
    """One NaN spreads from contact to contact through a whole packing, and every comparison with it is false.

    Lists and averages hide it for thousands of steps. The grain is named in the step in which its position is lost.
    """
    sim = bench.simulate(on_floor(1.0, 0.02 * CRITICAL))
    sim.run(20)
    velocity = sim.state.velocity.to_numpy()
    velocity[1] = math.nan
    sim.state.velocity.from_numpy(velocity)
    return steps_until_stopped(sim, 1000, "grain 1", "not a number")


@hard("Grain shot at a wall that is too soft", "displacement of the centre beyond the wall at the stop, in radii", 0.2)
def through_a_wall(bench: Bench) -> float:
    """Beyond a wall there is nothing to push a grain back once its centre has crossed it: it leaves the experiment."""
    scene = on_floor(0.0, 0.02 * CRITICAL, height=1.0)
    scene.velocity[:, 1] = -15.0
    sim = bench.simulate(scene)
    try:
        sim.run(1000)
    except lsm.SimulationError as error:
        stopped = "beyond wall 'floor'" in str(error)
        return float(-sim.state.position.to_numpy()[:, 1].min() / 0.5) if stopped else math.inf
    return math.inf


@hard("Grain that slips through a platen", "distance beyond the platen at the stop, in diameters", 1.0)
def through_a_platen(bench: Bench) -> float:
    """A platen whose glued grains leave a gap, or yield, lets a grain out of the layer.

    The layer goes on with one grain less and only its pressure shows it, thousands of steps later.
    """
    still: Any = [lsm.Fixed(), lsm.Fixed()]
    scene = scene_of(
        [[0.5, 0.0], [0.5, 5.0], [2.5, 1.5]],
        elastic(),
        lengths=(4.0, np.inf),
        periodic=(True, False),
        platen_index=[0, 1, -1],
        platens=[lsm.Platen("bottom", still), lsm.Platen("top", still)],
        velocity=[[0.0, 0.0], [0.0, 0.0], [0.0, -10.0]],
        dt=2e-4 * CRITICAL,
    )
    sim = bench.simulate(scene)
    stopped = steps_until_stopped(sim, 20_000, "grain 2", "beyond the platens")
    return float(-sim.positions[2, 1]) if np.isfinite(stopped) else math.inf


@hard("Scheme that feeds energy in", "energy over that of the start when the run is stopped", 1.5)
def lost_balance(bench: Bench) -> float:
    """The scheme as the paper prints it gains energy in every contact.

    A slow gain looks like physics, a hot granular gas, until the balance of the energy is computed.
    """
    position = [[0.5, 0.5], [1.55, 0.5], [1.0, 1.45]]
    velocity = [[1.0, 0.3], [-1.0, 0.2], [0.1, -1.0]]
    cell = {"lengths": (3.0, 3.0), "periodic": (True, True)}
    scheme = {"integrator": lsm.ExplicitEuler, "dt": 4e-3 * CRITICAL}
    sim = bench.simulate(scene_of(position, elastic(), velocity=velocity, **scheme, **cell))
    start = lsm.energies(sim).balance
    steps_until_stopped(sim, 400_000, "energy balance is lost")
    return lsm.energies(sim).balance / start
