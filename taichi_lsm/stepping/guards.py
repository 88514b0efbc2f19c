"""Limits beyond which a run is not to be trusted."""

from dataclasses import dataclass

import numpy as np

from ..core.errors import InputError


@dataclass(frozen=True)
class Guards:
    """Limits of a run; None switches a guard off.

    Attributes
    ----------
    step : float
        Time step over the stable one of the contacts that exist [1].
    displacement : float
        Displacement of a grain in one step, over half the least width of its thinnest part [1].
    energy : float
        Error of the energy balance, in the energy exchanged [1].
    overlap : float
        Overlap of a contact over its overlap limit, 1 or None.
    wall : float
        Centres may not pass plane walls, 1 or None.
    platen : float
        Mobile grains may not lie beyond the centres of the platens of a layer, 1 or None.
    finite : float
        Positions, velocities and orientations are numbers, 1 or None.

    Raises
    ------
    InputError
        If a limit is not positive, or not 1 where only 1 is allowed.
    """

    step: float | None = 1.0
    displacement: float | None = 0.1
    energy: float | None = 0.1
    overlap: float | None = 1.0
    wall: float | None = 1.0
    platen: float | None = 1.0
    finite: float | None = 1.0

    def __post_init__(self):
        for name in ("step", "displacement", "energy"):
            limit = getattr(self, name)
            if limit is not None and not (np.isfinite(limit) and limit > 0.0):
                raise InputError(f"Guards.{name} = {limit!r}: must be > 0, or None to switch the guard off")
        for name in ("overlap", "wall", "platen", "finite"):
            if getattr(self, name) not in (1.0, None):
                raise InputError(f"Guards.{name} = {getattr(self, name)!r}: must be 1, or None to switch the guard off")
