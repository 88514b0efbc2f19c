"""What a sheared layer remembers from one sample to the next; a checkpoint saves it with the state of the grains."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError


@dataclass
class LayerMemory:
    """Sums since shear began, samples of the present row, and the state of the platens at its begin.

    Attributes
    ----------
    time, row_step
        Time [s] and step of the last row.
    displacement, thickness
        Of the platens at the last sample [m].
    strain, slip, throughput
        Since shear began: shear strain [1], displacement [m] and integral of the absolute power of the drives [J].
    first_balance, residual, first_residual
        Balance of the energies at the start; residual at the last sample and when shear began [J].
    works
        Work of the shear drive and of the normal drive at the last row [J].
    elastic
        Energy stored in the contacts at the last row, and of the motion in a cell [J].
    samples
        What was measured since the last row, see `Measure.sums`.
    platens, row_platens
        Snapshots of the platens, or of the height of a cell, at the last sample and at the last row.
    row_walls
        What the next row needs of the plane walls at the last one, `wall_rows.wall_sums`.
    """

    time: float
    displacement: float
    thickness: float
    works: npt.NDArray
    row_step: int
    row_platens: dict[str, Any]
    strain: float = 0.0
    slip: float = 0.0
    throughput: float = 0.0
    first_balance: float | None = None
    residual: float = 0.0
    first_residual: float = 0.0
    elastic: float = 0.0
    samples: list[dict[str, Any]] = field(default_factory=list)
    platens: dict[str, Any] = field(default_factory=dict)
    row_walls: dict[str, Any] = field(default_factory=dict)

    def as_plain(self) -> dict[str, Any]:
        """All values as numbers, lists and dicts, exact to the last bit."""
        return {f.name: plain(getattr(self, f.name)) for f in fields(self)}

    @classmethod
    def from_plain(cls, values: Mapping[str, Any]) -> Self:
        """The memory that `as_plain` described; InputError if a name is missing or unknown."""
        names = {f.name for f in fields(cls)}
        if set(values) != names:
            raise InputError(f"memory of the layer: {sorted(values)}, must have {sorted(names)}")
        return cls(**{name: revived(value) for name, value in values.items()})


def plain(value: Any) -> Any:
    """A value without types of NumPy: arrays become {"array": nested lists}."""
    if isinstance(value, np.ndarray):
        return {"array": value.tolist()}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


def revived(value: Any) -> Any:
    """The value that `plain` took apart."""
    if isinstance(value, Mapping):
        if set(value) == {"array"}:
            return np.array(value["array"], float)
        return {name: revived(item) for name, item in value.items()}
    return [revived(item) for item in value] if isinstance(value, list) else value
