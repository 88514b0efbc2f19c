"""Hard cases of drives: servos, load points, heavy loads, creep, cycles, and a chain that is pulled apart."""

from __future__ import annotations

import functools
import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import taichi_lsm as lsm
from workflows.common.small_scenes import scene_of
from workflows.hard import Bench, hard, refused, worst_balance

STIFFNESS = 1e6  # [N m-1]
MASS = 1000.0 * np.pi / 4  # [kg] of a disc of 1 m
STRESS = 1000.0  # [Pa], a thousandth of the stiffness over the thickness
GLUED = 30  # discs of a press, which bears on one grain
PRESSES = {"stiff": 100.0, "soft": 0.01, "flying": 1.0}  # stiffness assumed by the servo, over the nominal one
LIFT = 0.3  # [m], of the flying press
SPEED_LIMIT = 0.1 * math.sqrt(STRESS / 1000.0)  # [m s-1]
LINKS = 49
G = 10.0  # [m s-2]
HEAVY = 1e4  # load of the column over its weight
ROWS = 10  # discs of the column
STROKE = 1e-5  # [m], of a cycle
INERTIA = 2e4  # [kg], of the driven platen of the layer


def effects_of(friction: float = 0.5, stiffness: float = STIFFNESS) -> list[Any]:
    """Elastic, damped and frictional contacts."""
    return [
        lsm.LinearElastic(stiffness),
        lsm.ViscousDamping(restitution=0.3),
        lsm.CoulombFriction(friction, 0.5 * stiffness),
    ]


def presses() -> lsm.Scene:
    """Presses of thirty discs in a row, each above one grain that lies on two fixed discs; one starts lifted."""
    seat = np.array([(-0.6, -0.8), (0.6, -0.8), (0.0, 0.0)])
    row = np.stack([np.arange(GLUED) - 0.5 * (GLUED - 1) + 0.5, np.ones(GLUED)], axis=1)
    position, platen = [], []
    for p, name in enumerate(PRESSES):
        at = np.array([100.0 * p, 0.0])
        position += [seat + at, row + at + (0.0, LIFT * (name == "flying"))]
        platen += [[0, 0, -1], [p + 1] * GLUED]
    nominal = STIFFNESS * GLUED / 2.0
    drives = [lsm.ServoStress(STRESS, 1, share * nominal, GLUED * MASS, SPEED_LIMIT) for share in PRESSES.values()]
    platens = [lsm.Platen("base", [lsm.Fixed(), lsm.Fixed()])]
    platens += [lsm.Platen(name, [lsm.Fixed(), drive]) for name, drive in zip(PRESSES, drives, strict=True)]
    return scene_of(
        np.concatenate(position),
        effects_of(),
        platen_index=np.concatenate(platen),
        platens=platens,
        area=float(GLUED),
        dt=2e-3,
    )


@functools.lru_cache(maxsize=1)
def pressing(bench: Bench) -> tuple[float, dict[str, float]]:
    """(greatest speed of a press over the limit, greatest deviation of its stress at the end over the target)."""
    sim = bench.simulate(presses())
    fastest, deviation = 0.0, np.zeros(len(PRESSES))
    pieces = bench.steps(4000, 800)
    for piece in range(pieces):
        sim.run(25)
        speed = np.abs(sim.platens.snapshot()["velocity"]).max()
        fastest = speed if speed != speed else max(fastest, speed)
        if piece >= 0.8 * pieces:
            force = sim.platens.force.to_numpy()[1:, 1]
            deviation = np.maximum(deviation, np.abs(force / (STRESS * GLUED) - 1.0))
    return fastest / SPEED_LIMIT, dict(zip(PRESSES, deviation, strict=True))


@hard("Servo of the wrong stiffness on one contact", "deviation of the stress from its target at rest", 1e-3)
def servo_on_one_contact(bench: Bench) -> float:
    """A press that counts on thirty contacts bears on one grain, with ten times its usual drag or a tenth.

    Servos that take the velocity of the next step from the stress of the last one overshoot and oscillate ever more.
    """
    _, deviation = pressing(bench)
    return max(deviation["stiff"], deviation["soft"])


@hard("Servo without a contact", "greatest speed over the limit of speed", 1.0)
def servo_in_flight(bench: Bench) -> float:
    """A press that has lost its contacts has no force to balance.

    Without a limit it falls ever faster and crushes the layer as it lands.
    """
    return pressing(bench)[0]


@hard("Servo that lands", "deviation of the stress from its target at rest", 1e-3)
def servo_lands(bench: Bench) -> float:
    """After its flight the press meets one grain at the limit of speed and must come to rest there, not bounce."""
    return pressing(bench)[1]["flying"]


def column() -> lsm.Scene:
    """Discs piled in a narrow shaft between plane walls, under a press of ten thousand times their weight."""
    load = HEAVY * ROWS * MASS * G
    stiffness = 100.0 * load  # of a contact: some are 3 % of a disc deep
    wide = 1.6
    up = math.sqrt(1.0 - (wide - 1.0) ** 2)
    row = np.arange(ROWS + 1)
    position = np.stack([np.where(row % 2, wide - 0.5, 0.5), 0.5 + up * row], axis=1)
    servo = lsm.ServoStress(load, 1, stiffness / ROWS, 10.0 * MASS, 20.0)
    walls = [
        lsm.PlaneWall("floor", (0.0, 0.0), (0.0, 1.0)),
        lsm.PlaneWall("left", (0.0, 0.0), (1.0, 0.0)),
        lsm.PlaneWall("right", (wide, 0.0), (-1.0, 0.0)),
    ]
    return scene_of(
        position,
        [*effects_of(stiffness=stiffness), lsm.Gravity((0.0, -G))],
        platen_index=np.where(row == ROWS, 0, -1),
        platens=[lsm.Platen("press", [lsm.Fixed(), servo])],
        walls=walls,
        area=1.0,
    )


@functools.lru_cache(maxsize=1)
def jammed(bench: Bench) -> tuple[float, float]:
    """(error of the force on the walls over the weight, error of the energy balance over the work done) at the end."""
    sim = bench.simulate(column())
    begin = lsm.energies(sim).balance
    sim.run(bench.steps(2_000_000, 20_000))
    now, weight = lsm.energies(sim), ROWS * MASS * G
    force = sim.walls.snapshot()["force"][:, 1].sum()
    return abs(-force - weight - HEAVY * weight) / weight, abs(now.balance - begin) / now.work


@hard("Column under 10000 times its weight", "error of the force on the walls over the weight", 1e-3, f32_bound=0.2)
def jammed_column_rests(bench: Bench) -> float:
    """The weight is a ten-thousandth of the forces in the contacts.

    Any force that does not cancel, and any motion that does not die, hides it. At rest the walls carry the load and the
    weight.
    """
    return jammed(bench)[0]


@hard("Energy of a jammed column", "error of the energy balance over the work done", 5e-6, f32_bound=1e-5)
def jammed_column_energy(bench: Bench) -> float:
    """A press falls at its limit of speed on a column without free space.

    All of its work must be found in contacts, dashpots, slip and the drag of the servo.
    """
    return jammed(bench)[1]


def chain(speed: float = 1.05) -> lsm.Scene:
    """A straight chain of bonded discs in its lowest longitudinal mode; speed 1 just strains it to its strength."""
    bond = lsm.effects.ElasticBrittleBond(youngs_modulus=1e7, poissons_ratio=0.25, cohesion=1e5, friction_angle=0.6)
    x = np.arange(LINKS + 1) - 0.5 * LINKS
    strain = 1e5 / math.tan(0.6) / 1e7
    sound = math.sqrt(1e7 / MASS)  # [m s-1], of bonds of 1 m
    velocity = np.zeros((LINKS + 1, 2))
    velocity[:, 0] = speed * strain * sound * np.sin(np.pi * x / (LINKS + 1))
    bonds = np.stack([np.arange(LINKS), np.arange(LINKS) + 1], axis=1)
    return scene_of(
        np.stack([x, 0.0 * x], axis=1), [lsm.LinearElastic(STIFFNESS), bond], velocity=velocity, bonds=bonds
    )


@hard("Chain pulled apart", "relative error of the energy over the fracture", 5e-3)
def chain_that_snaps(bench: Bench) -> float:
    """Fifty bonded discs fly apart until a bond gives way.

    Its energy goes at once, a wave runs through both pieces, and codes that drop the bond and do not count what it held
    as dissipated lose energy that they cannot name.
    """
    sim = bench.simulate(chain())
    worst = worst_balance(sim, bench.steps(200_000, 4000), 200)
    return worst if sim.measure.sums()["bond_count"] < LINKS else math.inf


@hard("Momentum of the pieces of a chain", "change of the momentum of a free piece, relative", 1e-12, f32_bound=1e-7)
def momentum_of_the_pieces(bench: Bench) -> float:
    """Each piece of a chain that broke flies on freely.

    A bond that breaks for one of its grains before the other, or a force that stays in a list, pushes a piece from
    nowhere.
    """
    sim = bench.simulate(chain())
    scale = MASS * np.abs(sim.scene.velocity[:, 0]).sum()
    pieces = np.zeros(len(sim), int)
    labels, before, worst = np.empty(0), None, 0.0
    for _ in range(bench.steps(20_000, 1000)):
        sim.run(1)  # to miss no contact of the pieces
        pieces, free = lsm.fragments(sim), sim.measure.sums()["contact_count"] == 0
        v = sim.state.velocity.to_numpy()
        now = np.stack([np.bincount(pieces, MASS * v[:, a], len(v)) for a in (0, 1)])
        if not free or not np.array_equal(pieces, labels):
            labels, before = pieces if free else np.empty(0), None
        elif before is None:  # velocities lag by half a step: only now is the last force in them
            before = now
        else:
            worst = max(worst, float(np.abs(now - before).max()) / scale)
    return worst if len(set(pieces)) > 1 else math.inf


def layer() -> lsm.Scene:
    """Twelve angular grains between rough platens.

    The bottom one is driven, the top one is pressed down by a servo and held along the shear by a spring that is as
    stiff as the step allows.
    """
    columns, rows, pitch = 4, 5, 0.92
    x, y = np.meshgrid(np.arange(columns), np.arange(rows))
    position = pitch * np.stack([x + 0.5 * (y % 2), y], axis=-1).reshape(-1, 2)
    platen = np.where(y == 0, 0, np.where(y == rows - 1, 1, -1)).ravel()
    mobile = platen < 0
    rng = np.random.default_rng(4)
    servo = lsm.ServoStress(STRESS, 1, STIFFNESS, INERTIA, SPEED_LIMIT)
    dt = 2e-3
    return scene_of(
        position,
        effects_of(),
        shapes=[lsm.disc(), *lsm.shapes.random_angular_shapes(8, 6)],
        shape_index=np.where(mobile, 1 + np.arange(len(position)) % 8, 0),
        diameter=np.where(mobile, rng.uniform(0.75, 0.85, len(position)), 0.8),
        angle=rng.uniform(0.0, 6.0, len(position)),
        velocity=0.3 * rng.standard_normal(position.shape) * mobile[:, None],
        lengths=(pitch * columns, np.inf),
        periodic=(True, False),
        platen_index=platen,
        platens=[
            lsm.Platen("bottom", [lsm.ConstantVelocity(0.0), lsm.Fixed()]),
            lsm.Platen("top", [spring(0.0, INERTIA / dt**2), servo]),
        ],
        thickness=1.0,
        dt=dt,
    )


def spring(velocity: float, stiffness: float) -> lsm.SpringLoadPoint:
    """The drive of the top platen along the shear."""
    return lsm.SpringLoadPoint(velocity, stiffness, INERTIA)


@functools.lru_cache(maxsize=1)
def settled(bench: Bench) -> tuple[lsm.Simulation, Path]:
    """(simulation, file) of the layer at rest under its load."""
    sim = bench.simulate(layer())
    sim.run(100_000)
    file = Path(tempfile.mkdtemp()) / "settled.nc"
    lsm.save_checkpoint(sim, file)
    return sim, file


def at_rest(bench: Bench) -> lsm.Simulation:
    """The layer at rest under its load, restored from the file."""
    sim, file = settled(bench)
    lsm.restore_checkpoint(sim, file)
    return sim


def height(sim: lsm.Simulation) -> float:
    """Displacement of the top platen [m]."""
    return float(sim.platens.displacement.to_numpy()[1, 1])


@functools.lru_cache(maxsize=1)
def crept(bench: Bench) -> Any:
    """Changes of the undisturbed layer under its load, over the second half of the run.

    Change of the thickness [m], change of the shear force over the load, error of the orientations.
    """
    sim, half = at_rest(bench), bench.steps(5_000_000, 50_000)
    sim.run(half)
    before, tension = height(sim), float(sim.platens.force.to_numpy()[1, 0])
    sim.run(half)
    load = STRESS * sim.platens.area
    orientation = sim.state.orientation.to_numpy()
    return (
        abs(height(sim) - before),
        abs(float(sim.platens.force.to_numpy()[1, 0]) - tension) / load,
        float(np.abs(np.linalg.norm(orientation, axis=1) - 1.0).max()),
    )


@hard("Thickness over millions of steps at rest", "change of the thickness", 1e-8, unit="m", f32_bound=1e-6)
def creep_of_the_thickness(bench: Bench) -> float:
    """A layer of angular grains under a constant load does nothing, for millions of steps.

    Rounding that always goes one way, or a spring of friction that loses a little in each step, makes it creep.
    """
    return crept(bench)[0]


@hard("Friction over millions of steps at rest", "change of the shear force over the load", 1e-5, f32_bound=1e-3)
def creep_of_the_friction(bench: Bench) -> float:
    """The springs of friction hold a shear force that nothing renews: if they leak, it relaxes."""
    return crept(bench)[1]


@hard("Orientations over millions of steps", "error of the length of the unit complex numbers", 1e-14)
def orientations_stay_unit(bench: Bench) -> float:
    """Each step multiplies the orientation of a grain by a small rotation; in many codes its length drifts."""
    return crept(bench)[2]


def strained(bench: Bench, cycles: int) -> Any:
    """The layer after `cycles` of its bottom to and fro by STROKE, and its heights (cycles,) [m]."""
    sim, quarter = at_rest(bench), 250
    speed = STROKE / (quarter * sim.dt)
    heights = []
    for _ in range(cycles):
        for direction, steps in ((1.0, quarter), (-1.0, 2 * quarter), (1.0, quarter)):
            sim.platens.set("bottom", 0, lsm.ConstantVelocity(direction * speed))
            sim.run(steps)
        heights.append(height(sim))
    return sim, np.array(heights)


@hard("Tiny cycles of shear", "compaction per cycle over the stroke of a cycle, last half", 1e-4, f32_bound=1e-2)
def tiny_cycles(bench: Bench) -> float:
    """Cycles of a hundred-thousandth of a diameter are elastic but for the slip of few contacts.

    After some of them they are purely elastic. A friction that slides at each reversal ratchets on.
    """
    _, heights = strained(bench, bench.steps(5000, 60))
    half = len(heights) // 2
    return abs(heights[-1] - heights[half]) / (len(heights) - 1 - half) / STROKE


def error_over_work(sim: lsm.Simulation, steps: int) -> float:
    """Error of the energy balance over the energy dissipated in a run of `steps` steps."""
    begin = lsm.energies(sim)
    sim.run(steps)
    now = lsm.energies(sim)
    return abs(now.balance - begin.balance) / (now.dissipated - begin.dissipated)


@hard("Platen that jumps to its velocity", "error of the energy balance over the energy dissipated", 2e-3)
def velocity_jump(bench: Bench) -> float:
    """The bottom platen jumps to a tenth of a diameter per inertial time at once, and back.

    The work of an infinite acceleration on a platen of finite mass must be computed with the mean velocity of the step.
    """
    sim = at_rest(bench)
    sim.platens.set("bottom", 0, lsm.ConstantVelocity(0.1))
    error = error_over_work(sim, bench.steps(500_000, 5000))
    sim.platens.set("bottom", 0, lsm.ConstantVelocity(-0.1))
    return max(error, error_over_work(sim, bench.steps(500_000, 5000)))


@hard("Load point on a very soft spring", "error of the energy balance over the energy dissipated", 2e-3)
def soft_spring(bench: Bench) -> float:
    """On a spring ten thousand times softer than the grains the layer waits, then slips at once.

    It slips by many diameters in one event, at a speed that its inertia alone bounds, and the servo loses its contacts.
    """
    sim = at_rest(bench)
    soft = 1e-4 * STIFFNESS
    sim.platens.set("top", 0, spring(20.0, soft))
    sim.run(600)  # to two thirds of the strength
    sim.platens.set("top", 0, spring(0.2, soft))
    return error_over_work(sim, bench.steps(500_000, 20_000))


@hard("Load point on the stiffest spring", "error of the energy balance over the energy dissipated", 2e-3)
def stiffest_spring(bench: Bench) -> float:
    """The spring is as stiff as the step allows, thousands of times stiffer than the grains.

    Its own oscillation takes six steps, and must neither grow nor feed on the grains.
    """
    sim = at_rest(bench)
    sim.platens.set("top", 0, spring(0.05, INERTIA / sim.dt**2))
    return error_over_work(sim, bench.steps(1_000_000, 20_000))


@hard("Load point on a spring too stiff for the step", "0 if refused with the reason", 0.0)
def spring_too_stiff(bench: Bench) -> float:
    """A spring stiffer than the step can follow makes a platen of any mass diverge."""
    sim = at_rest(bench)
    drive = spring(0.0, 1.01 * INERTIA / sim.dt**2)
    return refused(lambda: sim.platens.set("top", 0, drive), "stiffness", "inertia/dt^2")
