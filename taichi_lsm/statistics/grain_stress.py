"""Stress within each grain by the forces at its contacts (Love and Weber)."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError
from .cell_images import cell_of
from .contact_moments import contacts_at
from .run_parts import part_of, snapshot_at

if TYPE_CHECKING:
    from xarray import Dataset

    from .run_parts import Run

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
NEEDED = ("first_id", "second_id", "point", "branch", "normal", "normal_force", "tangential_force")
BALL = {2: np.pi / 4.0, 3: np.pi / 6.0}  # area or volume over the power of the diameter
NO_THICKNESS = "grains: has no density, from which the thickness of 2D grains follows; assign it [kg m-3]"
SAME_TIME = 1e-9  # of a time: contacts and positions are of the same instant
LEAST_STEP = 1.5  # time steps, where a file tells its own


class ContactArms(NamedTuple):
    """Contacts with their forces and the arms on which they act.

    Parameters
    ----------
    first, second
        (n,) ids of the grains; the second is below 0 for a wall.
    force
        (n, D) on the second grain [N].
    branch, first_arm, second_arm
        (n, D) [m]: from the first centre to the second, and from each centre to the contact point.
    """

    first: Integers
    second: Integers
    force: Array
    branch: Array
    first_arm: Array
    second_arm: Array


def grain_stress(run: "Run", time: float | None = None, contacts: "Run | None" = None) -> "Dataset":
    """Mean stress within every grain at one moment, compression positive.

    sigma_ij = -(1/V) sum over contacts of f_i r_j                                                        (1)
    with the force f on the grain and the arm r from its centre to the contact point. Over grains without platens and
    walls sum V sigma is the sum over contacts of force times branch vector.

    Parameters
    ----------
    run
        The tree of a run with grains.nc and contacts.nc, or a grains.nc.
    time
        Time [s]; the nearest moment of the contacts is taken, by default the last one. Positions must be of the same
        instant; without a time those of the last snapshot, where that lies before the last contacts.
    contacts
        The contacts.nc, or one moment such as `sim.contacts()`, where `run` is not the tree that has it.

    Returns
    -------
    xarray.Dataset
        Along grain: stress (grain, space, plane) [Pa], force along space on a plane with its normal along `plane`;
        contact_count; glued; volume [m3] of the grain, in 2D of the slab. Glued grains have nan: a platen holds them by
        forces that are not known.

    Raises
    ------
    InputError
        If there are no contacts or no positions at that instant, or ids do not fit.

    References
    ----------
    Love (1892); Weber (1966); Christoffersen, Mehrabadi & Nemat-Nasser (1981), doi:10.1115/1.3157619.
    """
    import xarray

    grains, moment = at_one_instant(run, time, contacts)
    arms = contact_arms(grains, moment)
    count, dim = grains.sizes["grain"], grains.sizes["space"]
    volume, glued = grain_volumes(grains), is_glued(grains)
    total, touching = np.zeros((count, dim, dim)), np.zeros(count, int)
    pair = arms.second >= 0  # others are walls, which have no stress
    np.add.at(total, arms.first, arms.force[:, :, None] * arms.first_arm[:, None, :])
    np.add.at(total, arms.second[pair], -arms.force[pair][:, :, None] * arms.second_arm[pair][:, None, :])
    for ids in (arms.first, arms.second[pair]):
        touching += np.bincount(ids, minlength=count)
    stress = np.where(glued[:, None, None], np.nan, total / volume[:, None, None])
    return xarray.Dataset(
        {
            "stress": (
                ("grain", "space", "plane"),
                stress,
                {"units": "Pa", "long_name": "mean stress within the grain, compression positive"},
            ),
            "contact_count": ("grain", touching, {"units": "1", "long_name": "number of contacts"}),
            "glued": ("grain", glued, {"long_name": "whether the grain is glued to a platen"}),
            "volume": ("grain", volume, {"units": "m3", "long_name": "volume of the grain"}),
        },
        {"time": ((), float(grains.time), {"units": "s", "long_name": "simulated time"})},
        {"title": "Stress within grains"},
    )


def at_one_instant(run: "Run", time: float | None, contacts: "Run | None" = None) -> tuple["Dataset", "Dataset"]:
    """A snapshot of the grains and the contacts of the same instant, both in memory; see `grain_stress`."""
    moment = contacts_at(run if contacts is None else contacts, time)
    needed = ("position", "kind", "shape_scale", "mass", "time")
    instant = float(moment.time) if "time" in moment.variables else None
    grains = snapshot_at(part_of(run, "grains", needed), instant).load()
    if time is None and contacts is None and not same_instant(grains, moment):
        # While a run goes on, and after a kill, one file may end some seconds before the other.
        moment = contacts_at(run, float(grains.time))
        instant = float(moment.time)
    if not same_instant(grains, moment):
        raise InputError(
            f"time: contacts are those of {instant:g} s, the nearest positions of {float(grains.time):g} s, must be of "
            "the same instant; run with --snapshots and --contacts at the same times"
        )
    return grains, moment


def same_instant(grains: "Dataset", moment: "Dataset") -> bool:
    """Whether a snapshot and contacts are of the same instant, within a step; taken for granted without a time."""
    if "time" not in moment.variables:
        return True
    found, instant = float(grains.time), float(moment.time)
    step = LEAST_STEP * float(np.nan_to_num(grains.attrs.get("dt", 0.0)))
    return abs(found - instant) <= max(SAME_TIME * abs(instant), step)


def contact_arms(grains: "Dataset", moment: "Dataset") -> ContactArms:
    """Forces of the contacts and where they act; grains and contacts of one instant."""
    missing = [name for name in NEEDED if name not in moment.variables]
    if missing:
        raise InputError(f"contacts: has no {', '.join(missing)}, must be a contacts.nc, or what sim.contacts() gives")
    normal, point, branch, tangential = (
        np.asarray(moment[name], float) for name in ("normal", "point", "branch", "tangential_force")
    )
    force = np.asarray(moment.normal_force, float)[:, None] * normal + tangential
    first, second = (np.asarray(moment[f"{which}_id"]).astype(np.int64) for which in ("first", "second"))
    count, last = grains.sizes["grain"], max(first.max(initial=-1), second.max(initial=-1))
    if last >= count or first.min(initial=0) < 0:
        raise InputError(f"contacts: ids up to {last}, the run has {count} grains; must be contacts of this run")
    if "arm" in moment.variables:
        arm = np.asarray(moment.arm, float)
        return ContactArms(first, second, force, branch, arm, arm - branch)
    cell = cell_of(grains)
    # The point lies beside the first grain, or beside an image of it.
    arm = point - grains.position.values[first]
    share = np.linalg.solve(cell.reduced, arm.T).T
    open_axes = [axis for axis in range(arm.shape[1]) if axis not in cell.axes]
    share[:, open_axes] = 0.0
    arm = arm - np.round(share) @ cell.reduced.T
    return ContactArms(first, second, force, branch, arm, arm - branch)


def is_glued(grains: "Dataset") -> npt.NDArray[np.bool_]:
    """Whether each grain is glued to a platen."""
    return np.asarray(grains.kind) == 1


def grain_volumes(grains: "Dataset") -> Array:
    """Volumes (n,) [m3], in 2D of slabs of the run's thickness: mass over density where the density is known.

    Raises
    ------
    InputError
        In 2D if the density is not known.
    """
    dim, mass = grains.sizes["space"], np.asarray(grains.mass, float)
    density = float(grains["density"]) if "density" in grains.variables and grains["density"].ndim == 0 else np.nan
    if density > 0.0:
        return mass / density
    if dim == 2:
        raise InputError(NO_THICKNESS)
    return BALL[dim] * np.asarray(grains.shape_scale, float) ** dim
