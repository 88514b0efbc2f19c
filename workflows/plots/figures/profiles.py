"""Profiles along the height: velocity, angular velocity and solid fraction, means of the steady snapshots."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import taichi_lsm as lsm
from workflows.plots.canvas import BLUE, GREEN, ORANGE
from workflows.plots.run_files import RunFiles

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

NEEDS = ("grains",)
SIZE = (3.5, 2.7)
SLABS = (6, 40)  # least and most; between them as high as a mean grain


def draw_run(figure: Figure, run: RunFiles) -> None:
    """Draw a curve for each quantity, with points at the middles of the slabs; dotted the flow of a uniform shear."""
    times, words = steady_times(run)
    found = lsm.profiles(run.snapshots.dataset, times, slabs_of(run.snapshots.dataset))
    height = 1e3 * found.height.values
    curves = [("velocity\nalong x [m/s]", found.velocity.values[:, 0], BLUE)]
    if "angular_velocity" in found:
        about_z = found.angular_velocity.values.reshape(len(height), -1)[:, -1]
        curves.append(("angular velocity\nabout z [rad/ms]", 1e-3 * about_z, ORANGE))
    curves.append(("solid fraction\n[1]", found.solid_fraction.values, GREEN))
    panels = np.atleast_1d(figure.subplots(1, len(curves), sharey=True))
    for letter, axes, (label, values, colour) in zip("abc", panels, curves, strict=False):
        axes.plot(values, height, "o-", color=colour, ms=2.0, lw=1.0)
        axes.set_xlabel(label)
        axes.set_title(f"({letter})")
        axes.locator_params(axis="x", nbins=3)
        axes.margins(x=0.12)
    if "platen_velocity" in found:
        ends = found.slab_height.values[[0, -1]] * (-0.5e3, 0.5e3) + height[[0, -1]]
        panels[0].plot(found.platen_velocity.values[:, 0], ends, "k:", lw=0.9)
        words += "\ndotted: uniform shear between the platens"
    if len(curves) == 3:
        panels[1].axvline(0.0, color="0.6", lw=0.7, zorder=1)
    panels[0].set_ylabel("height y [mm]")
    panels[-1].set_xlim(0.0, 1.15 * float(np.nanmax(found.solid_fraction)))
    figure.suptitle(words)


def steady_times(run: RunFiles) -> tuple[tuple[float, float], str]:
    """First and last time [s] of the snapshots that are averaged, and which they are in words.

    Those of the steady state of the run; where there are none, the last one.
    """
    grains = run.snapshots.dataset
    time = grains.time.values
    strain = grains.shear_strain.values if "shear_strain" in grains.variables else np.zeros(len(time))
    since = float(grains.steady_from) if "steady_from" in grains.variables else 0.0
    steady = np.flatnonzero(strain >= since if since > 0.0 else strain > 0.0)
    if len(steady) < 2:
        return (float(time[-1]), float(time[-1])), f"last snapshot, strain {strain[-1]:.3g}"
    ends = strain[steady[[0, -1]]]
    return (float(time[steady[0]]), float(time[steady[-1]])), (
        f"mean of {len(steady)} snapshots, strain {ends[0]:.3g} to {ends[1]:.3g}"
    )


def slabs_of(grains: xarray.Dataset) -> int:
    """Number of slabs, each about as high as a mean grain."""
    y = grains.position.isel(time=-1).values[:, 1]
    y = y[np.isfinite(y)]  # a run that failed may have lost grains
    height = np.ptp(y) if y.size else 0.0
    return int(np.clip(round(height / float(grains.shape_scale.mean())), *SLABS))
