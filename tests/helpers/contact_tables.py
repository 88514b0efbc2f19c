"""Grains and contacts as datasets in the form of grains.nc and contacts.nc, without a simulation."""

import netCDF4
import numpy as np
import xarray

DENSITY, THICKNESS = 2500.0, 1e-3  # kg/m3, m (of 2D grains)


def grains_of(position, diameter, periodic=(), glued=(), velocity=None, cells=None, density=DENSITY):
    """Snapshots (time, grain, space) of discs or spheres at 0, 1, ... s; cells: (height, shift, rate) of each."""
    position = np.asarray(position, float)
    position = position[None] if position.ndim == 2 else position
    times, count, dim = position.shape
    diameter = np.broadcast_to(np.asarray(diameter, float), count)
    volume = np.pi / 4 * diameter**2 * THICKNESS if dim == 2 else np.pi / 6 * diameter**3
    in_time = ("time", "grain", "space")
    data = {
        "position": (in_time, position),
        "velocity": (
            in_time,
            np.zeros_like(position) if velocity is None else np.broadcast_to(velocity, position.shape),
        ),
        "mass": ("grain", density * volume),
        "kind": ("grain", np.isin(np.arange(count), glued).astype(np.int32)),
        "shape_scale": ("grain", diameter),
        "bounding_radius": ("grain", 0.5 * diameter),
    }
    if cells is not None:
        for name, column in zip(("height", "shift", "shear_rate"), np.transpose(cells), strict=True):
            data[f"cell_{name}"] = ("time", column)
    coordinates = {"time": np.arange(float(times)), "density": density}
    return xarray.Dataset(data, coordinates, {"periodic_lengths": list(periodic), "dt": 1e-6})


def touching(position, diameter, periodic=(), shift=0.0, stiffness=1e4, slope=0.0):
    """Contacts of discs or spheres (n, space) that overlap: springs, and `slope` times their force along the tangent.

    periodic: lengths along x, y, ...; shift: of the image above along x.
    """
    position, dim = np.asarray(position, float), np.shape(position)[1]
    radius = 0.5 * np.broadcast_to(np.asarray(diameter, float), len(position))
    edges = np.diag([*periodic, *np.ones(dim)][:dim])
    edges[0, 1] = shift
    whole = np.floor(np.linalg.solve(edges, position.T).T) * (np.arange(dim) < len(periodic))
    inside = position - whole @ edges.T
    ranges = [(-1, 0, 1) if axis < len(periodic) else (0,) for axis in range(dim)]
    images = np.array(np.meshgrid(*ranges)).reshape(dim, -1).T
    k, l, image = np.nonzero(np.ones((len(position), len(position), len(images))))
    branch = inside[l] - inside[k] + images[image] @ edges.T
    distance = np.linalg.norm(branch, axis=1)
    depth = radius[k] + radius[l] - distance
    rows = np.flatnonzero((k < l) & (depth > 0.0))
    k, l, branch, distance, depth = (values[rows] for values in (k, l, branch, distance, depth))
    normal = branch / distance[:, None]
    across = np.zeros_like(normal)
    across[:, :2] = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    force = stiffness * depth
    return moment_of(
        k,
        l,
        position[k] + (radius[k] - 0.5 * depth)[:, None] * normal,
        branch,
        normal,
        force,
        slope * force[:, None] * across,
    )


def moment_of(first, second, point, branch, normal, normal_force, tangential_force):
    """A moment of contacts, with the columns that analyses need."""
    vectors = {"point": point, "branch": branch, "normal": normal, "tangential_force": tangential_force}
    data = {name: (("contact", "space"), np.asarray(values, float)) for name, values in vectors.items()}
    ids = {"first_id": first, "second_id": second}
    data |= {name: ("contact", np.asarray(values, np.int32)) for name, values in ids.items()}
    return xarray.Dataset(data | {"normal_force": ("contact", np.asarray(normal_force, float))})


def moments_of(moments, times):
    """Several moments as one contacts.nc: a contiguous ragged array."""
    sizes = [moment.sizes["contact"] for moment in moments]
    rows = xarray.concat([moment.drop_vars("time", errors="ignore") for moment in moments], "contact")
    about = {"sample_dimension": "contact"}
    return rows.assign(row_size=("time", np.array(sizes, np.int32), about)).assign_coords(
        time=np.asarray(times, float), shear_strain=("time", 0.1 * np.asarray(times, float))
    )


def write_contacts(path, dataset, room=0, run_status="complete"):
    """contacts.nc: its records are contacts, with room for further moments, whose time is nan."""
    write_records(path, dataset, "contact", {"time": room}, run_status)


def write_records(path, dataset, along, room=None, run_status="complete"):
    """A dataset as a file of records along a dimension; room: of others, filled with 0, their labels with nan."""
    spare = room or {}
    with netCDF4.Dataset(path, "w", format="NETCDF3_64BIT_OFFSET") as file:
        file.setncatts({"run_status": run_status, "Conventions": "CF-1.11", **dataset.attrs})
        for name, size in dataset.sizes.items():
            file.createDimension(name, None if name == along else size + spare.get(name, 0))
        for name, variable in dataset.variables.items():
            made = file.createVariable(name, variable.dtype, variable.dims)
            made.setncatts(variable.attrs)
            empty = [np.nan if name in spare else 0] * sum(spare.get(d, 0) for d in variable.dims)
            made[:] = np.append(variable.values, empty) if empty else variable.values
