"""Profiles across a layer or a cell: velocity, solid fraction, fluctuations and stress in slabs along its height."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError, shown
from .cell_images import Cell, cell_of, into_cell
from .contact_moments import contacts_at
from .grain_stress import BALL, NO_THICKNESS, contact_arms, is_glued, same_instant
from .run_parts import holds, nearest, part_of

if TYPE_CHECKING:
    from xarray import Dataset

    from .run_parts import Run

Array = npt.NDArray[np.float64]
NEEDED = ("position", "velocity", "mass", "kind", "shape_scale", "bounding_radius", "time")
MOST_BINS = 10_000
LEVEL = 1e-12  # least height of a branch vector over its length
FLAT = 1e-12  # spread of heights within a slab, over their square: below it no slope is seen
UNITS = {
    "velocity": ("m s-1", "mean velocity of the grains, by mass"),
    "angular_velocity": ("rad s-1", "mean angular velocity of the grains, by mass"),
    "solid_fraction": ("1", "share of the volume that mobile grains fill"),
    "shear_rate": ("s-1", "slope of the velocity along the shear over the height, within the slab"),
    "granular_temperature": ("m2 s-2", "mean square of the velocity relative to the slab, per direction"),
    "platen_velocity": ("m s-1", "velocity of the lower and of the upper platen"),
    "stress": ("Pa", "stress, compression positive: force along space on a plane with its normal along plane"),
}


def profiles(
    run: "Run",
    time: float | tuple[float, float] | None = None,
    bins: int | npt.ArrayLike = 20,
    contacts: "Run | None" = None,
) -> "Dataset":
    """Means over slabs along the height, of one snapshot or of all within a time.

    With w_kb the share of the volume V_k of grain k that lies in slab b, each grain as the disc or sphere of its
    equivalent diameter, m its mass and A D_b the volume of the slab,
    v_b = sum m w v_k/sum m w                                                                             (1)
    phi_b = sum V_k w/(A D_b)                                                                             (2)
    T_b = sum m w |v'|^2/(D sum m w), v' = v_k - v_b - c_b (y_k - y_b)                                    (3)
    sigma_b = (sum over contacts of s_b f l + sum m w v' v')/(A D_b)                                      (4)
    with c_b the slope of the velocity over the height y by least squares within the slab, so that shear itself is no
    fluctuation, and s_b the share of the branch vector l that lies in the slab. Sums are over all snapshots.

    Parameters
    ----------
    run
        The tree of a run, or its grains.nc, of a layer or a cell.
    time
        Time [s] of a snapshot, the nearest one is taken; (from, to) for all snapshots within, such as those of steady
        shear; None: the last one.
    bins
        Number of slabs of equal height from the lower reference plane to the upper one, from border to border of a cell
        that is periodic along y, else from the lowest to the highest point of the grains; or their borders [m], rising.
        Slabs much thinner than grains show these.
    contacts
        The contacts.nc, or one moment of it, where `run` is not the tree that has it.

    Returns
    -------
    xarray.Dataset
        Along height [m], the middle of each slab: velocity (height, space), angular_velocity where grains rotate,
        solid_fraction, shear_rate, granular_temperature; stress (height, space, plane) where contacts of the same
        instants are known: [:, 1, 1] is the normal stress, and minus [:, 0, 1] the shear stress of run.nc. Slabs
        without a grain have nan. With platens platen_velocity (platen, space), of the lower and of the upper one.
        Grains glued to platens are left out of all but the contacts.

    Raises
    ------
    InputError
        If there are no grains, no such snapshots, or bins are no number or do not rise.

    References
    ----------
    Goldhirsch (2010), doi:10.1007/s10035-010-0181-z, for (4), there with other weights; da Cruz et al. (2005),
    doi:10.1103/PhysRevE.72.021309, for profiles of sheared layers.
    """
    grains = part_of(run, "grains", NEEDED)
    snapshots = [grains]
    if "time" in grains.dims:
        snapshots = [grains.isel(time=place) for place in _chosen(grains, time)]
    given = _borders(bins)
    source = contacts
    if contacts is None and holds(run, "contacts") and part_of(run, "contacts").sizes["time"]:  # none yet: no stress
        source = run
    sums = _Sums()
    for snapshot in snapshots:
        _add(sums, snapshot.load(), given, source)
    return _dataset(sums)


def _borders(bins: int | npt.ArrayLike) -> int | Array:
    """A number of slabs, or their borders; InputError if it is neither."""
    if isinstance(bins, int | np.integer) and not isinstance(bins, bool):
        if 1 <= bins <= MOST_BINS:
            return int(bins)
        raise InputError(f"bins = {bins}: must be a number from 1 to {MOST_BINS}, or borders [m]")
    try:
        borders = np.asarray(bins, float)
    except (TypeError, ValueError):
        borders = np.empty(0)
    if borders.ndim != 1 or borders.size < 2 or not np.all(np.diff(borders) > 0.0):
        raise InputError(f"bins = {shown(bins)}: must be a number of slabs, or at least 2 rising borders [m]")
    return borders


def _chosen(grains: "Dataset", time: float | tuple[float, float] | None) -> list[int]:
    """Places of the snapshots that are asked for."""
    times = np.asarray(grains.time, float)
    if time is None or np.ndim(time) == 0:
        return [nearest(times, time, "snapshot")]  # pyright: ignore[reportArgumentType]
    try:
        low, high = (float(end) for end in time)  # pyright: ignore[reportGeneralTypeIssues]
    except (TypeError, ValueError):
        raise InputError(f"time = {shown(time)}: must be a time [s], or the first and the last time") from None
    places = np.flatnonzero((times >= low) & (times <= high))
    if not places.size:
        raise InputError(f"time = {shown(time)}: no snapshot lies there; those of the run are {_span_of(times)}")
    return places.tolist()


def _span_of(times: Array) -> str:
    return f"from {times.min():g} to {times.max():g} s" if times.size else "none yet"


class _Slabs(NamedTuple):
    """Slabs of one snapshot: borders (b + 1,) [m], horizontal extent [m or m2], out-of-plane thickness [m]."""

    borders: Array
    extent: float
    thickness: float


@dataclass
class _Sums:
    """What is added up over snapshots; lists have one array for each."""

    borders: list[Array] = field(default_factory=list)
    room: list[Array] = field(default_factory=list)  # volumes of the slabs
    solid: list[Array] = field(default_factory=list)
    moments: dict[str, Array] = field(default_factory=dict)  # sums by mass: of 1, y, y^2, v, v y, v v, omega
    contact_stress: list[Array] = field(default_factory=list)
    platens: list[Array] = field(default_factory=list)
    middle: float = 0.0  # heights and velocities are taken from these, lest digits be lost
    flow: Array | None = None
    thickness: float = 1.0
    times: list[float] = field(default_factory=list)


def _add(sums: _Sums, now: "Dataset", bins: int | Array, contacts: "Run | None") -> None:
    """Add one snapshot."""
    cell, glued = cell_of(now), is_glued(now)
    position, velocity = now.position.values, now.velocity.values
    there = np.flatnonzero(np.isfinite(position).all(axis=1) & ~glued)
    if not there.size:
        raise InputError(f"grains: no mobile grain has a position at {float(now.time):g} s")
    slabs = _slabs(now, cell, glued, there, bins)
    if sums.flow is None:
        sums.middle, sums.flow = float(slabs.borders.mean()), velocity[there].mean(axis=0)
    rows, y, flow = _with_images(cell, position[there], velocity[there])
    rows = there[rows]
    scale, dim = now.shape_scale.values[rows], position.shape[1]
    share = np.diff(_part_below(slabs.borders, y, 0.5 * scale, dim), axis=1)
    sums.borders.append(slabs.borders)
    sums.room.append(slabs.extent * np.diff(slabs.borders))
    sums.solid.append((BALL[dim] * scale**dim) @ share)
    w, y, v = share * now.mass.values[rows, None], y - sums.middle, flow - np.asarray(sums.flow)
    moments = {
        "1": w.sum(axis=0),
        "y": y @ w,
        "yy": y**2 @ w,
        "v": np.einsum("nb,ni->bi", w, v),
        "vy": np.einsum("nb,n,ni->bi", w, y, v),
        "vv": np.einsum("nb,ni,nj->bij", w, v, v),
    }
    if "angular_velocity" in now:
        moments["omega"] = np.einsum("nb,n...->b...", w, now.angular_velocity.values[rows])
    for name, values in moments.items():
        sums.moments[name] = sums.moments.get(name, 0.0) + values
    if glued.any():
        above = position[:, 1] > position[there, 1].mean()
        ends = [velocity[glued & side] for side in (~above, above)]
        sums.platens += [np.stack([v.mean(axis=0) for v in ends])] if all(map(len, ends)) else []
    sums.times.append(float(now.time))
    if contacts is not None:
        _add_contacts(sums, now, cell, slabs, contacts)


def _slabs(now: "Dataset", cell: Cell, glued: npt.NDArray, there: npt.NDArray, bins: int | Array) -> _Slabs:
    """The slabs of one snapshot."""
    place, reach = now.position.values, now.bounding_radius.values
    sides = [axis for axis in range(place.shape[1]) if axis != 1]
    open_width = np.ptp(place[there], axis=0) + 2.0 * reach[there].max()
    widths = [cell.edges[axis, axis] if axis in cell.axes else open_width[axis] for axis in sides]
    if isinstance(bins, int):
        y, middle = place[:, 1], place[there, 1].mean()
        low, high = (y[there] - reach[there]).min(), (y[there] + reach[there]).max()
        if 1 in cell.axes:
            low, high = 0.0, cell.edges[1, 1]
        # Reference planes of platens: mean of the innermost points of their glued grains.
        if (lower := glued & (y < middle)).any():
            low = (y + reach)[lower].mean()
        if (upper := glued & (y > middle)).any():
            high = (y - reach)[upper].mean()
        borders = np.linspace(low, high, bins + 1)
    else:
        borders = bins
    thickness = 1.0
    if place.shape[1] == 2 and "density" in now.variables:
        area = BALL[2] * now.shape_scale.values**2
        thickness = float(now.mass.sum() / (now["density"] * area.sum()))
    elif place.shape[1] == 2:
        thickness = np.nan
    return _Slabs(borders, float(np.prod(widths)), thickness)


def _with_images(cell: Cell, position: Array, velocity: Array) -> tuple[npt.NDArray, Array, Array]:
    """Rows, heights and velocities of the grains; of a cell periodic along y within it, and of the images beside."""
    rows, flow = np.arange(len(position)), velocity.copy()
    if 1 not in cell.axes:
        return rows, position[:, 1], flow
    inside, taken = into_cell(cell, position)
    height = cell.edges[1, 1]
    jump = np.zeros(position.shape[1])
    jump[0] = cell.shear_rate * height
    flow -= taken[:, 1:2] * jump
    heights = np.concatenate([inside[:, 1] + n * height for n in (-1, 0, 1)])
    return np.tile(rows, 3), heights, np.concatenate([flow + n * jump for n in (-1, 0, 1)])


def _part_below(borders: Array, y: Array, radius: Array, dim: int) -> Array:
    """Share (n, b + 1) of the discs or balls about y (n,) that lies below the borders."""
    u = np.clip((borders - y[:, None]) / radius[:, None], -1.0, 1.0)
    if dim == 2:
        return 0.5 + (u * np.sqrt(1.0 - u**2) + np.arcsin(u)) / np.pi
    return 0.5 + 0.25 * u * (3.0 - u**2)


def _add_contacts(sums: _Sums, now: "Dataset", cell: Cell, slabs: _Slabs, contacts: "Run") -> None:
    """Add the stress of the contacts of this instant, if they are known."""
    moment = contacts_at(contacts, float(now.time))
    if not same_instant(now, moment):
        return
    if np.isnan(slabs.thickness):
        raise InputError(NO_THICKNESS)
    arms, height = contact_arms(now, moment), cell.edges[1, 1]
    begin = now.position.values[arms.first, 1]
    begin = begin - np.floor(begin / height) * height if 1 in cell.axes else begin
    low = np.minimum(begin, begin + arms.branch[:, 1])
    # A level branch vector is given a height that does not matter.
    length = np.maximum(np.abs(arms.branch[:, 1]), LEVEL * np.linalg.norm(arms.branch, axis=1))
    share = np.zeros((len(low), slabs.borders.size - 1))
    for n in (-1, 0, 1) if 1 in cell.axes else (0,):
        below = (slabs.borders - low[:, None] - n * height) / length[:, None]
        share += np.diff(np.clip(below, 0.0, 1.0), axis=1)
    volume = slabs.extent * np.diff(slabs.borders) * slabs.thickness
    sums.contact_stress.append(np.einsum("cb,ci,cj->bij", share, arms.force, arms.branch) / volume[:, None, None])
    sums.thickness = slabs.thickness


def _dataset(sums: _Sums) -> "Dataset":
    """The means of what was added up."""
    import xarray

    moments, flow = sums.moments, np.asarray(sums.flow)
    mass = moments["1"]
    with np.errstate(invalid="ignore", divide="ignore"):  # slabs without a grain
        mean = {name: (values.T / mass).T for name, values in moments.items()}
        velocity, slope, covariance = _within(mean)
    borders, room = np.mean(sums.borders, axis=0), np.sum(sums.room, axis=0)
    found = {
        "velocity": (("height", "space"), velocity + flow),
        "solid_fraction": ("height", np.sum(sums.solid, axis=0) / room),
        "shear_rate": ("height", slope[:, 0]),
        "granular_temperature": ("height", np.trace(covariance, axis1=1, axis2=2) / flow.size),
    }
    if "omega" in mean:
        found["angular_velocity"] = (("height", "space")[: mean["omega"].ndim], mean["omega"])
    if sums.contact_stress:
        kinetic = np.nan_to_num(covariance) * (mass / (room * sums.thickness))[:, None, None]
        found["stress"] = (("height", "space", "plane"), np.mean(sums.contact_stress, axis=0) + kinetic)
    if sums.platens:
        platens = np.mean(sums.platens, axis=0)
        found["platen_velocity"] = (("platen", "space"), platens)
    data = {
        name: (dims, values, dict(zip(("units", "long_name"), UNITS[name], strict=True)))
        for name, (dims, values) in found.items()
    }
    middle = 0.5 * (borders[1:] + borders[:-1])
    coordinates = {
        "height": ("height", middle, {"units": "m", "long_name": "middle of the slab"}),
        "slab_height": ("height", np.diff(borders), {"units": "m", "long_name": "height of the slab"}),
        "space_name": ("space", list("xyz"[: flow.size]), {"long_name": "axis"}),
    }
    about = {
        "title": "Profiles along the height",
        "snapshots": len(sums.times),
        "times": [min(sums.times), max(sums.times)],
    }
    return xarray.Dataset(data, coordinates, about)


def _within(mean: dict[str, Array]) -> tuple[Array, Array, Array]:
    """Velocity (b, D), its slope (b, D) over the height, and the covariance (b, D, D) of what is left, of each slab."""
    y, v = mean["y"], mean["v"]
    spread = mean["yy"] - y**2
    together = mean["vy"] - v * y[:, None]
    slope = np.where((spread > FLAT * mean["yy"])[:, None], together / spread[:, None], 0.0)
    covariance = mean["vv"] - v[:, :, None] * v[:, None, :]
    return v, slope, covariance - slope[:, :, None] * slope[:, None, :] * np.maximum(spread, 0.0)[:, None, None]
