"""The kernel that copies values from the host to any of many fields."""

from typing import Any

from .runtime import current, ti


@ti.data_oriented
class FieldWriter:
    """One kernel that writes to any of its fields, each of which remembers it as `host_writer`."""

    def __init__(self, fields: list[Any]) -> None:
        self.fields = fields
        self.serial = current().serial
        for number, field in enumerate(fields):
            field.host_writer = (self, number)

    @ti.kernel
    def copy(self, which: ti.i32, rows: ti.i32, values: ti.types.ndarray(dtype=ti.f64, ndim=1)):
        """Copy `values`, a row after the other, to the first rows of the field of this number."""
        ti.loop_config(serialize=self.serial)
        for k in range(rows):
            for number in ti.static(range(len(self.fields))):
                if which == number:
                    self.copy_row(self.fields[number], k, values)

    @ti.func
    def copy_row(self, field: ti.template(), k, values: ti.template()):
        """Copy row k of the values to the field."""
        # The index of a row whose field has no, one or two axes.
        index = ti.Vector([0 * k] * ti.static(len(field.shape)))
        if ti.static(len(field.shape) == 1):
            index[0] = k
        elif ti.static(len(field.shape) == 2):
            index[0], index[1] = k // field.shape[1], k % field.shape[1]
        if ti.static(isinstance(field, ti.MatrixField)):
            for c in ti.static(range(field.n)):
                field[index][c] = ti.cast(values[k * field.n + c], field.dtype)
        else:
            field[index] = ti.cast(values[k], field.dtype)
