"""Rows of the schema refuse what could not be stored or read."""

import dataclasses

import pytest

from taichi_lsm.contact import arc_chains, cone_patches, part_table, polyhedron_table
from taichi_lsm.contact.pair_storage import pair_variables
from taichi_lsm.core.errors import InputError
from taichi_lsm.core.schema import DTYPES, Variable
from taichi_lsm.measure.layer_rows import layer_rows
from taichi_lsm.stepping.grain_state import grain_variables
from taichi_lsm.stepping.kernel_spec import KernelSpec

ALL = {"kind": "polyhedron", "rotates": True, "oriented": True, "onset": True, "channels": 2, "history": 3}


def test_variable_is_plain_and_frozen():
    row = Variable("position", ("grain", "space"), "f64", "m", "centre of mass", True)
    assert (row.name, row.dims, row.dtype, row.units, row.restart) == ("position", ("grain", "space"), "f64", "m", True)
    assert not Variable("a", (), "i32", "1", "number").restart
    with pytest.raises(dataclasses.FrozenInstanceError):
        row.units = "mm"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "two words"}, "two words"),
        ({"dtype": "f16"}, "f16.*real, f64, i32"),
        ({"units": ""}, "units"),
        ({"long_name": ""}, "long_name"),
    ],
)
def test_refusals_name_the_row(changes, message):
    good = {"name": "speed", "dims": (), "dtype": "f64", "units": "m s-1", "long_name": "speed of the grain"}
    Variable(**good)
    with pytest.raises(InputError, match=message):
        Variable(**good | changes)


def test_names_are_unique_and_dtypes_known():
    surfaces = [
        arc_chains.PATCH_ROWS,
        polyhedron_table.FEATURE_ROWS,
        polyhedron_table.BOUND_ROWS,
        cone_patches.patch_rows(),
        part_table.BALL_ROWS,
    ]
    grains = grain_variables(KernelSpec(dim=3, multi_part=True, **ALL))
    pairs = [
        pair_variables(KernelSpec(multi_part=True, **ALL | {"kind": kind})) for kind in ("chain", "polyhedron", "cones")
    ]
    tables = [grains, *pairs, *surfaces, layer_rows()]
    for rows in tables:
        assert len({row.name for row in rows}) == len(rows)
        assert {row.dtype for row in rows} <= set(DTYPES)


def test_everything_that_a_restart_needs_is_marked():
    """Positions, velocities, histories: a continued run reads the rows marked restart and no others."""
    spec = KernelSpec(**ALL)
    marked = {row.name for row in grain_variables(spec) + pair_variables(spec) if row.restart}
    assert {
        "position",
        "velocity",
        "angular_velocity",
        "orientation",
        "dissipated",
        "history",
        "status",
        "second_id",
    } <= marked
