"""Declaration of every stored quantity: one row drives allocation, NetCDF and checkpoint."""

from dataclasses import dataclass

DTYPES = ("real", "f64", "i32", "i8")


@dataclass(frozen=True)
class Variable:
    """One stored quantity.

    name: identifier, the same in Taichi fields, NetCDF files and checkpoints.
    dims: the named dimensions, e.g. ("grain", "space"); () is a scalar.
    dtype: "real" follows the precision of the run (contact geometry and forces), the others never change.
    units: UDUNITS string, SI; "1" for a pure number.
    long_name: what a reader of the file needs to know.
    restart: True if a run cannot be continued bit for bit without it.
    """

    name: str
    dims: tuple[str, ...]
    dtype: str
    units: str
    long_name: str
    restart: bool = False

    def __post_init__(self):
        if not self.name.isidentifier():
            raise ValueError(f"Variable name {self.name!r} is not an identifier")
        if self.dtype not in DTYPES:
            raise ValueError(f"Variable {self.name}: dtype {self.dtype!r}, allowed are {', '.join(DTYPES)}")
        if not self.units or not self.long_name:
            raise ValueError(f"Variable {self.name}: units and long_name must be given")
