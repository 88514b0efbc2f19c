"""One small file of every kind, for the tests of files."""

import netCDF4
import numpy as np

import taichi_lsm as lsm
from taichi_lsm.core.schema import Variable
from taichi_lsm.io.grains_file import GrainsWriter, snapshot_rows, static_rows
from taichi_lsm.io.netcdf_variables import Scalar
from taichi_lsm.io.run_file import RunWriter, file_attributes, write_table

RUN = [
    Variable("shear_strain", ("time",), "f64", "1", "integral of shear rate over time"),
    Variable("friction", ("time",), "f64", "1", "shear stress over normal stress"),
    Variable("dissipated_energy", ("time", "effect"), "f64", "J", "energy dissipated so far"),
    Variable("plate_velocity", ("time", "platen"), "real", "m s-1", "velocity of the platen along x"),
    Variable("contact_count", ("time",), "i32", "1", "number of contacts"),
    Variable("piece", ("time",), "i32", "1", "piece of the sample"),
]
LABELS = {"effect": ["linear_elastic", "coulomb_friction"], "platen": ["lower", "upper"]}
PIECE = {"piece": {"flag_values": [0, 1], "flag_meanings": ["left", "right"]}}
STAGE = {"stage": "stage of the run"}
STAGES = ("settle", "shear")
SCALARS = [
    Scalar("run", "angular-7", "name of the run"),
    Scalar("seed", 7, "random seed"),
    Scalar("density", 2500.0, "density of the grains", "kg m-3"),
]


def effects():
    """Effects whose table has numbers, texts, vectors and a parameter that is not set."""
    rates = (0.1, 0.01, 0.02, 1e-6, 1e-3, 1e5)
    return [
        lsm.LinearElastic(1e5),
        lsm.effects.RateAndStateFriction(*rates, evolution="slip"),
        lsm.Gravity((0.0, -9.81)),
    ]


def attributes():
    return file_attributes("Sheared gouge", "Test of the files", 'title = "Grüße"\n', 7, 1e-8, "cpu", "f64")


def run_writer(path, **options):
    options = {"auxiliary": ("shear_strain",), "extra_attributes": PIECE, "text": STAGE, "scalars": SCALARS} | options
    return RunWriter(path, RUN, attributes(), LABELS, **options)


def run_row(i):
    """Row number i; every value tells i, so that a mixed-up file shows."""
    return {
        "time": 0.5 * i,
        "shear_strain": 0.01 * i,
        "friction": i + 0.25,
        "dissipated_energy": [i, 2 * i],
        "plate_velocity": np.array([-i, i]),
        "contact_count": 10 * i,
        "piece": i % 2,
        "stage": STAGES[i % 2],
    }


def grains(dim, count=5):
    """Constants and one snapshot of grains of two shapes, with one and three patches."""
    rng = np.random.default_rng(dim)
    angular_velocity = (count,) if dim == 2 else (count, dim)
    static = {
        "mass": rng.random(count),
        "inertia": rng.random(angular_velocity),
        "bounding_radius": rng.random(count),
        "kind": np.resize([0, 0, 1, 0, 1], count),
        "shape_index": np.resize([0, 1, 1, 0, 1], count),
        "shape_scale": rng.random(count),
        "patch_count": [1, 3],
        "patch_centre": rng.random((4, dim)),
        "patch_radius": rng.random(4),
        "patch_axis": rng.random((4, dim)),
        "patch_angle": rng.random(4),
        "patch_part": [0, 0, 0, 0],
        "patch_edge_radius": np.zeros(4),
    }
    snapshot = {
        "position": rng.random((count, dim)),
        "velocity": rng.random((count, dim)),
        "angular_velocity": rng.random(angular_velocity),
        "orientation": rng.random((count, 4)),
        "shear_strain": 0.5,
    }
    return static, snapshot


def grains_writer(path, static, dim, **options):
    rows = [RUN[0], *snapshot_rows(dim)]
    options = {"text": STAGE, "scalars": SCALARS} | options
    return GrainsWriter(path, static, static_rows(dim), rows, attributes(), **options)


def table(path, **changes):
    rows = [
        Variable("seed", ("run",), "i32", "1", "random seed"),
        Variable("friction_mean", ("run",), "f64", "1", "mean friction"),
    ]
    columns = {
        "seed": [1, 2],
        "shape": ["sphere", "angular"],
        "friction_mean": [0.3, 0.45],
        "status": ["a", "b"],
    }
    text = {"shape": "grain shape", "status": "outcome of the run"}
    write_table(path, {**columns, **changes}, rows, attributes(), ("seed", "shape"), text)


def write_every_kind(folder):
    """One file of every kind, with rows; returns the paths."""
    writer = run_writer(folder / "run.nc", effects=effects())
    for i in range(3):
        writer.append(run_row(i))
    writer.close("complete")
    for dim in (2, 3):
        static, snapshot = grains(dim)
        writer = grains_writer(folder / f"grains{dim}.nc", static, dim)
        writer.append(0.0, snapshot | {"stage": "settle"})
        writer.close("complete")
    table(folder / "compare.nc")
    return sorted(folder.glob("*.nc"))


def check_described(path):
    """Conventions are named, and every variable has a unit (but for texts) and a long_name, and no _FillValue."""
    with netCDF4.Dataset(path) as dataset:
        assert dataset.Conventions.startswith("CF-"), path
        groups = [dataset]
        for group in groups:
            groups += group.groups.values()
            for name, variable in group.variables.items():
                assert variable.long_name, f"{path}: {name}"
                is_text = variable.dtype is str or variable.dtype.char == "S"
                assert is_text or variable.units, f"{path}: {name}"
                assert "_FillValue" not in variable.ncattrs(), f"{path}: {name}"
