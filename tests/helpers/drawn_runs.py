"""Folders of runs to be drawn: grains.nc and contacts.nc of discs or spheres in rows, and a run.nc beside them."""

import numpy as np

from taichi_lsm.core.schema import Variable
from taichi_lsm.io.netcdf_variables import Scalar
from taichi_lsm.io.run_file import RunWriter
from tests.helpers.contact_tables import moments_of, touching, write_contacts
from tests.helpers.exported_runs import GRID, LENGTH, TIMES, write_run
from tests.helpers.output_files import attributes

ROW = {
    "shear_strain": "1",
    "friction": "1",
    "shear_stress": "Pa",
    "normal_stress": "Pa",
    "platen_shear_stress": "Pa",
    "platen_normal_stress": "Pa",
    "layer_thickness": "m",
    "porosity": "1",
    "displacement": "m",
    "load_point_velocity": "m s-1",
    "translational_energy": "J",
    "rotational_energy": "J",
    "elastic_energy": "J",
    "external_work": "J",
    "work_throughput": "J",
    "energy_residual": "J",
    "inertial_number": "1",
    "coordination_number": "1",
}
CONFIG = """
experiment = "shear-gouge"
shape = "round"
dim = 2
smallest_diameter = 1e-3
largest_diameter = 1e-3
density = 2650.0
normal_stress = 5e6
steady_from = 0.2
"""
ROWS = 41
STIFFNESS = 1e4


def rows_of_run(path, rows=ROWS):
    """A run.nc of a layer whose friction is 0.3 + 0.05 sin(30 strain), sheared by 1 in 2 ms after one row of rest."""
    variables = [Variable(name, ("time",), "f64", units, name.replace("_", " ")) for name, units in ROW.items()]
    variables.append(Variable("dissipated_energy", ("time", "effect"), "f64", "J", "energy dissipated so far"))
    labels = {"effect": ["viscous_damping", "coulomb_friction"]}
    writer = RunWriter(
        path,
        variables,
        attributes() | {"config_toml": CONFIG},
        labels,
        auxiliary=("shear_strain",),
        text={"stage": "stage of the run"},
        scalars=[Scalar("stiffness_number", 1e3, "stiffness number")],
    )
    for i in range(rows):
        strain = max(0, i - 1) / (ROWS - 2)
        friction = 0.3 + 0.05 * np.sin(30.0 * strain)
        row = dict.fromkeys(ROW, 0.0) | {
            "shear_strain": strain,
            "friction": friction,
            "shear_stress": friction * 5e6,
            "normal_stress": 5e6,
            "platen_shear_stress": friction * 5e6,
            "platen_normal_stress": 5e6,
            "layer_thickness": 4e-3 + 1e-5 * strain,
            "porosity": 0.2,
            "external_work": strain,
            "work_throughput": strain,
            "inertial_number": 1e-3,
        }
        row["dissipated_energy"] = [0.25 * strain, 0.75 * strain]
        writer.append(row | {"time": TIMES[-1] * i / (ROWS - 1), "stage": "shear" if i else "consolidate"})
    writer.close("complete" if rows == ROWS else "interrupted")


def contacts_of(place, diameter, length):
    """The contacts of discs or spheres at these places (n, dim) [m], with the flags that files have."""
    dim = place.shape[1]
    found = touching(
        place, diameter, [length] if dim == 2 and np.isfinite(length) else [], stiffness=STIFFNESS, slope=0.2
    )
    none = ("contact", np.zeros(found.sizes["contact"], np.int8))
    return found.assign(bonded=none, sliding=none)


def write_drawn_run(folder, dim=2, times=TIMES, room=0):
    """The run of `write_run` with a run.nc of all curves, and contacts of its grains at these times."""
    write_run(folder, dim)
    rows_of_run(folder / "run.nc")
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(3.0), np.arange(3.0), indexing="ij"))
    place = GRID * np.stack([x, y, x + y][:dim], axis=1)
    moments = [contacts_of(place + np.eye(dim)[0] * 3e-3 * i, 1.5e-3, LENGTH) for i in range(len(times))]
    write_contacts(folder / "contacts.nc", moments_of(moments, times), room)
    return folder
