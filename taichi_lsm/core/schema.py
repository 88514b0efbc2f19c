"""Declaration of every stored quantity: one row drives allocation, NetCDF files and checkpoints.

A table of the state is a list of rows (`Variable`), declared once beside the class that owns it, such as
`stepping.grain_state.grain_variables` or `contact.pair_storage.pair_variables`. Everything else follows from the row:

- Allocation: `core.fields.allocate` makes one Taichi field per row. The first name of `dims` is the element index, the
  lengths of the others multiply to the size of the vector kept per element, and `dtype` gives its number type.
- NetCDF: `io` writes a variable of the row's name with the row's dimensions, `units` and `long_name`.
- Checkpoint: `io.checkpoint_file` saves the rows marked `restart`, and no others, as they lie in memory. A run that
  goes on gives the same bits, so a row that changes from step to step and cannot be derived from others must be marked.

A quantity that is not in a row does not exist for files; a row that a scene does not need is not declared, and then
takes no memory.
"""

from dataclasses import dataclass

from .errors import InputError

DTYPES = ("real", "f64", "i32", "i8")


@dataclass(frozen=True)
class Variable:
    """One stored quantity.

    Parameters
    ----------
    name
        Identifier, the same in Taichi fields, NetCDF files and checkpoints.
    dims
        Named dimensions, such as ("grain", "space"); () for a scalar.
    dtype
        "real" follows the precision of the run (contact geometry and forces); "f64", "i32" and "i8" never change.
    units
        UDUNITS string, SI; "1" for a pure number.
    long_name
        What a reader of the file needs to know.
    restart
        Whether a run cannot be continued bit for bit without it.

    Raises
    ------
    InputError
        If the name is no identifier, the dtype is unknown, or units or long_name are missing.
    """

    name: str
    dims: tuple[str, ...]
    dtype: str
    units: str
    long_name: str
    restart: bool = False

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise InputError(f"Variable.name: {self.name!r}, must be an identifier")
        if self.dtype not in DTYPES:
            raise InputError(f"Variable.dtype: {self.dtype!r} of {self.name}, must be one of {', '.join(DTYPES)}")
        for field in ("units", "long_name"):
            if not getattr(self, field):
                raise InputError(f"Variable.{field}: missing for {self.name}, must be given; units of a number are '1'")
