"""Restitution of a linear spring with a dashpot, and the dashpot that gives a restitution."""

import numpy as np


def restitution_of(zeta: float) -> float:
    """Restitution e of a linear spring with dashpot whose total force is never attractive.

    zeta = c/(2 sqrt(k m)) >= 0 [1]. The contact ends when k d + c d' = 0, Schwager & Poeschel (2007), Eq. (21).
    """
    if zeta == 0.0:
        return 1.0
    if zeta < 1.0:
        omega = np.sqrt(1.0 - zeta * zeta)
        angle = np.pi - np.arctan2(2.0 * zeta * omega, 1.0 - 2.0 * zeta * zeta)
        return float(np.exp(-zeta / omega * angle))
    if zeta == 1.0:
        return float(np.exp(-2.0))
    omega = np.sqrt(zeta * zeta - 1.0)
    return float(np.exp(-zeta / omega * np.log((zeta + omega) / (zeta - omega))))


def damping_ratio_of(restitution: float) -> float:
    """Ratio zeta = c/(2 sqrt(k m)) [1] that gives this restitution, 0.01 <= restitution <= 1; by bisection."""
    if restitution == 1.0:
        return 0.0
    low, high = 0.0, 1.0e3
    middle = 0.5 * (low + high)
    # Restitution falls as zeta grows; the bracket is halved until it holds no number between its ends.
    while low < middle < high:
        low, high = (middle, high) if restitution_of(middle) > restitution else (low, middle)
        middle = 0.5 * (low + high)
    return middle
