"""Directions of the contacts, and the mean normal force in each direction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import taichi_lsm as lsm
from workflows.plots.canvas import BLUE, ORANGE
from workflows.plots.packing import Scale
from workflows.plots.run_files import Moment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEEDS = ("contacts",)
SIZE = (3.5, 2.4)
BINS = 24  # of a full turn
LEVEL = np.sqrt(0.75)  # part of a normal in the plane of the shear, of those that count in 3D
FEW = 10  # contacts, fewer of which have no directions


def scale_of(moment: Moment) -> Scale:
    """Ends of the radii."""
    number, force = radii_of(fabric_of(moment))
    return {"number": (0.0, 1.15 * number.max()), "force": (0.0, 1.15 * float(np.nanmax(force)))}


def draw_moment(figure: Figure, moment: Moment, scale: Scale) -> None:
    """Draw both roses, from the direction of the shear on; a contact counts in both directions of its normal."""
    found = fabric_of(moment)
    number, force = radii_of(found)
    panels = figure.subplots(1, 2, subplot_kw={"projection": "polar"})
    _draw(panels[0], number, scale["number"][1], BLUE, "(a) contacts over\nan even spread [1]")
    _draw(panels[1], force, scale["force"][1], ORANGE, "(b) normal force over\nits mean [1]")
    # The second harmonic of the contacts, 1 + a cos 2(theta - theta_c): a exp(2 i theta_c) by the fabric tensor.
    wave = 2.0 * (found.tensor[0, 0] - found.tensor[1, 1] + 2j * found.tensor[0, 1])
    theta = np.linspace(0.0, 2.0 * np.pi, 181)
    panels[0].plot(theta, 1.0 + np.real(wave * np.exp(-2j * theta)), "k", lw=1.0)
    lines = [f"{moment.words}; {found.contacts} contacts"]
    lines += ["within 30° of the plane of the shear"] * (moment.touching.sizes["space"] == 3)
    most = f"most at {np.degrees(0.5 * np.angle(wave)) % 180.0:.0f}° from the shear, anisotropy {abs(wave):.2f}"
    lines += [f"black: {most}"]
    figure.suptitle("\n".join(lines))


def fabric_of(moment: Moment) -> lsm.statistics.Fabric:
    """Fabric of the contacts that press, in the plane of the shear; in 3D of those within 30 degrees of it.

    Raises
    ------
    InputError
        If there are fewer than 10 of them, bonds not counted.
    """
    contacts = moment.touching
    normal = contacts.normal.values
    which = (contacts.normal_force.values > 0.0) & ~contacts.bonded.values.astype(bool)
    which &= np.hypot(normal[:, 0], normal[:, 1]) >= LEVEL
    if which.sum() < FEW:
        raise lsm.InputError(f"needs {FEW} contacts that press, and there are {which.sum()} at {moment.time:g} s")
    flat = contacts.isel(contact=np.flatnonzero(which), space=slice(2))
    return lsm.fabric(flat.assign(normal=flat.normal / np.hypot(flat.normal[:, 0], flat.normal[:, 1])), bins=BINS)


def radii_of(found: lsm.statistics.Fabric) -> tuple[NDArray, NDArray]:
    """For each angle of the rose the contacts over those of an even spread, and the normal force over its mean [1].

    nan where no contact points.
    """
    assert found.rose is not None
    mean = float(np.trace(found.normal_force_tensor))
    return 2.0 * np.pi * found.rose.density.values, found.rose.normal_force.values / mean


def _draw(axes: Any, values: NDArray, most: float, colour: str, title: str) -> None:
    """The sectors of a rose, with a circle at 1."""
    from matplotlib.patheffects import withStroke

    width = 2.0 * np.pi / BINS
    axes.bar(width * (np.arange(BINS) + 0.5) - np.pi, np.nan_to_num(values), width, color=colour, alpha=0.75, lw=0)
    axes.plot(np.linspace(0.0, 2.0 * np.pi, 181), np.ones(181), color="0.4", lw=0.7, ls=":")
    axes.set_ylim(0.0, most)
    axes.set_xticks(np.radians([0, 90, 180, 270]), ["0°", "90°", "180°", "270°"])
    axes.tick_params(axis="x", pad=0)
    axes.set_yticks([t for t in (1.0, 2.0, 3.0, 4.0) if t < most])
    axes.set_rlabel_position(45)
    axes.tick_params(axis="y", labelsize=6.5)
    for number in axes.get_yticklabels():
        number.set_path_effects([withStroke(linewidth=1.5, foreground="white")])
    axes.grid(lw=0.4, color="0.8")
    axes.spines["polar"].set(linewidth=0.6, color="0.5")
    axes.set_title(title, loc="center", pad=4)
