"""The kernels that copy values between the host and any of many fields."""

from typing import Any

import numpy as np

from .runtime import current, ti

NUMPY_TYPES = {ti.f64: np.float64, ti.f32: np.float32, ti.i32: np.int32, ti.i8: np.int8}


@ti.data_oriented
class FieldCopies:
    """One kernel that writes to any of its fields and one that reads them; each field remembers it as `host_copies`."""

    def __init__(self, fields: list[Any]) -> None:
        self.fields = fields
        self.serial = current().serial
        for number, field in enumerate(fields):
            field.host_copies = (self, number)

    @ti.kernel
    def write(self, which: ti.i32, rows: ti.i32, values: ti.types.ndarray(dtype=ti.f64, ndim=1)):
        """Copy `values`, a row after the other, to the first rows of the field of this number."""
        ti.loop_config(serialize=self.serial)
        for k in range(rows):
            for number in ti.static(range(len(self.fields))):
                if which == number:
                    self.write_row(self.fields[number], k, values)

    @ti.kernel
    def read(self, which: ti.i32, rows: ti.i32, values: ti.types.ndarray(dtype=ti.f64, ndim=1)):
        """Copy the first rows of the field of this number to `values`, a row after the other."""
        ti.loop_config(serialize=self.serial)
        for k in range(rows):
            for number in ti.static(range(len(self.fields))):
                if which == number:
                    self.read_row(self.fields[number], k, values)

    @ti.func
    def write_row(self, field: ti.template(), k, values: ti.template()):
        """Copy row k of the values to the field."""
        index = self.index_of(field, k)
        if ti.static(isinstance(field, ti.MatrixField)):
            for c in ti.static(range(field.n)):
                field[index][c] = ti.cast(values[k * field.n + c], field.dtype)
        else:
            field[index] = ti.cast(values[k], field.dtype)

    @ti.func
    def read_row(self, field: ti.template(), k, values: ti.template()):
        """Copy row k of the field to the values."""
        index = self.index_of(field, k)
        if ti.static(isinstance(field, ti.MatrixField)):
            for c in ti.static(range(field.n)):
                values[k * field.n + c] = ti.cast(field[index][c], ti.f64)
        else:
            values[k] = ti.cast(field[index], ti.f64)

    @ti.func
    def index_of(self, field: ti.template(), k):
        """Index of row k of a field that has no, one or two axes."""
        index = ti.Vector([0 * k] * ti.static(len(field.shape)))
        if ti.static(len(field.shape) == 1):
            index[0] = k
        elif ti.static(len(field.shape) == 2):
            index[0], index[1] = k // field.shape[1], k % field.shape[1]
        return index
