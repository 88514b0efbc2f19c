"""Discs on inclined planes: where they roll, where they slide, and how fast; run.nc of the steepest one.

    python examples/inclined_plane.py [out]

A disc with friction mu slides down a plane at the angle a with the acceleration g (sin a - mu cos a) while it is turned
by the friction; up to tan a = 3 mu it rolls instead, with 2/3 g sin a, as its moment of inertia is m r^2/2.
"""

import sys
from pathlib import Path

import numpy as np

import taichi_lsm as lsm

G, MU, DIAMETER, STIFFNESS = 9.81, 0.2, 0.01, 1e6  # m s-2, 1, m, N/m
TIME, ROWS = 0.2, 20  # s of each run, rows of its file
ANGLES = (10, 20, 30, 40, 50, 60)  # degrees


def scene(angle: float) -> lsm.Scene:
    """A disc at rest on a plane at this angle [rad], so deep in it that the force carries the weight across it."""
    normal = np.array([np.sin(angle), np.cos(angle)])
    mass = 2500.0 * np.pi / 4 * DIAMETER**3  # of a slab as thick as the disc is wide
    depth = mass * G * normal[1] / STIFFNESS
    return lsm.Scene(
        position=[(0.5 * DIAMETER - depth) * normal],
        diameter=[DIAMETER],
        density=2500.0,
        effects=[lsm.LinearElastic(STIFFNESS), lsm.CoulombFriction(MU, 0.5 * STIFFNESS), lsm.Gravity((0.0, -G))],
        walls=[lsm.PlaneWall("plane", point=(0.0, 0.0), normal=tuple(normal))],
    )


def acceleration(angle: float) -> float:
    """What theory says [m s-2]."""
    rolls = np.tan(angle) <= 3.0 * MU
    return G * (2 / 3 * np.sin(angle) if rolls else np.sin(angle) - MU * np.cos(angle))


def main(out: str, angles: tuple[float, ...] = ANGLES) -> list[tuple[float, float, float]]:
    """Run all angles; (angle [degrees], acceleration measured, and by theory [m s-2]) of each."""
    sim, table = lsm.Simulation(scene(np.radians(angles[0]))), []
    for angle in np.radians(angles):
        sim.reset(scene(angle))
        walls = lsm.WallSeries(sim)
        notes = lsm.file_attributes("Inclined plane", f"at {np.degrees(angle):g} degrees", "", 0, sim.dt, "cpu", "f64")
        run = lsm.RunWriter(Path(out) / "run.nc", walls.variables, notes, walls.coordinates)
        for _ in range(ROWS):
            sim.run(round(TIME / ROWS / sim.dt))
            run.append({"time": sim.time, **walls.row()})
        run.close("complete")
        down = (np.cos(angle), -np.sin(angle))
        table.append((float(np.degrees(angle)), float(sim.velocities[0] @ down / sim.time), acceleration(angle)))
        print("{:4.0f} degrees: {:.4f} m/s2, by theory {:.4f} m/s2".format(*table[-1]))
    return table


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else ".")
