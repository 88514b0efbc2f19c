"""Hard cases of grains that rest on each other."""

from __future__ import annotations

import numpy as np

import taichi_lsm as lsm
from workflows.common.small_scenes import scene_of
from workflows.hard import Bench, hard
from workflows.hard.outlines import STIFFNESS, box, rotated_outline

G = 10.0  # [m s-2]
ROCKING = 10.0  # damping of all motion of a stack [s-1]


def stack(count: int = 4) -> lsm.Scene:
    """Flat slabs on each other above a floor, a thousandth of a diameter apart, with friction and damping.

    Their faces bulge a little; without a damping of all motion they would rock on them for ever, as they should.
    """
    slab = box(4.0, 1.0)
    height = 2.0 * rotated_outline(slab, 0.0)[:, 1].max()
    middle = (np.arange(count) + 0.5) * (height + 1e-3) + 1e-3
    position = np.stack([np.zeros(count), middle], axis=1)
    effects = [
        lsm.LinearElastic(STIFFNESS),
        lsm.ViscousDamping(restitution=0.3),
        lsm.CoulombFriction(0.5, 0.5 * STIFFNESS),
        lsm.Gravity((0.0, -G)),
        lsm.effects.GlobalDamping(ROCKING),
    ]
    floor = lsm.PlaneWall("floor", (0.0, 0.0), (0.0, 1.0))
    return scene_of(position, effects, shapes=[slab], angle=np.zeros(count), walls=[floor])


@hard("Stack of slabs at rest, face on face", "kinetic energy over weight times diameter", 1e-12, f32_bound=1e-9)
def stack_at_rest(bench: Bench) -> float:
    """Large faces that rest on each other.

    The contact may wander from end to end and rock the stack for ever, or let it creep. A damping of all motion takes
    the rocking on faces that bulge, which loses nothing by itself.
    """
    sim = bench.simulate(stack())
    sim.run(bench.steps(400_000, 40_000))
    return lsm.energies(sim).kinetic / (1000.0 * np.pi / 4.0 * G)
