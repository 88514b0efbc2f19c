"""Values get into fields by one kernel, whole or in part, and not at all if one of them is refused."""

import numpy as np
import pytest

from taichi_lsm.core.allocation import allocating, read, when_allocated, write, writing_together
from taichi_lsm.core.errors import InputError
from taichi_lsm.core.fields import fill_rows
from taichi_lsm.core.runtime import ti


@pytest.fixture(scope="module")
def fields(runtime):
    """One field of each kind, with first values: a number, a row, a table of vectors with one and two axes, bytes."""
    made, seen = {}, {}
    with allocating():
        made["number"] = ti.field(ti.f64, ())
        made["row"] = ti.field(ti.i32, 5)
        made["vectors"] = ti.Vector.field(3, ti.f32, 4)
        made["table"] = ti.Vector.field(2, ti.f64, (3, 2))
        made["bytes"] = ti.field(ti.i8, 3)
        when_allocated(lambda: [write(made[name], first(name)) for name in made])
        when_allocated(lambda: seen.update({name: read(made[name]) for name in made}))
    assert all(np.array_equal(seen[name], first(name)) for name in made)  # before they were written
    return made


def first(name):
    """Values with which the field of this name begins."""
    shapes = {"number": (), "row": (5,), "vectors": (4, 3), "table": (3, 2, 2), "bytes": (3,)}
    return 1.0 + np.arange(np.prod(shapes[name], dtype=int), dtype=float).reshape(shapes[name])


def test_first_values_arrive_in_every_kind_of_field_by_one_kernel(fields):
    for name, field in fields.items():
        assert np.array_equal(field.to_numpy(), first(name)), name
    assert len({id(field.host_copies[0]) for field in fields.values()}) == 1


@pytest.mark.parametrize(("name", "rows"), [("number", None), ("row", 3), ("vectors", 2), ("table", 2), ("bytes", 0)])
def test_the_first_rows_of_every_kind_of_field_are_read(fields, name, rows):
    values = read(fields[name], rows)
    expected = fields[name].to_numpy() if rows is None else fields[name].to_numpy()[:rows]
    assert values.dtype == expected.dtype and np.array_equal(values, expected)


def test_rows_that_are_not_given_keep_what_they_hold(fields):
    write(fields["row"], first("row"))
    write(fields["row"], [7, 8])
    assert fields["row"].to_numpy().tolist() == [7, 8, 3, 4, 5]
    write(fields["vectors"], first("vectors"))
    write(fields["vectors"], [[-1.0, -2.0, -3.0]])
    assert fields["vectors"].to_numpy()[:2].tolist() == [[-1, -2, -3], [4, 5, 6]]


def test_nothing_is_written_if_one_value_is_refused(fields):
    def refused():
        with writing_together():
            write(fields["number"], 2.0)
            fill_rows(fields["row"], np.zeros(6))

    write(fields["number"], 1.0)
    with pytest.raises(InputError, match="6 rows of the shape table, there is room for 5"):
        refused()
    assert fields["number"][None] == 1.0


def test_of_two_values_the_later_one_is_written(fields):
    values = np.array([9.0, 9.0])
    with writing_together():
        write(fields["row"], [1])
        write(fields["row"], values)
        values[:] = 0.0
        assert read(fields["row"]).tolist()[:2] == [9, 9]
    assert fields["row"].to_numpy()[:2].tolist() == [9, 9]


def test_parts_that_are_collected_add_up_as_if_written_at_once(fields):
    write(fields["row"], first("row"))
    with writing_together():
        write(fields["row"], [7, 8, 9])
        write(fields["row"], [6])
        assert read(fields["row"]).tolist() == [6, 8, 9, 4, 5]
    assert fields["row"].to_numpy().tolist() == [6, 8, 9, 4, 5]


@pytest.mark.parametrize(("name", "values"), [("number", [1.0, 2.0]), ("row", np.zeros(6)), ("vectors", np.zeros(4))])
def test_more_values_than_room_and_broken_rows_are_refused(fields, name, values):
    before = fields[name].to_numpy()
    with pytest.raises(InputError, match="must be whole rows and no more than that"):
        write(fields[name], values)
    assert np.array_equal(fields[name].to_numpy(), before)
