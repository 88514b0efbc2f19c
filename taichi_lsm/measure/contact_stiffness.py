"""Stiffness of the contacts of a scene under a stress, whatever its effects."""

from collections.abc import Iterable

import numpy as np

from ..effects.base import Effect


def contact_stiffness(effects: Iterable[Effect], stress: float, width: float) -> float:
    """Normal stiffness k [N m-1] of contacts under a stress, of all effects that repel.

    Springs have theirs. A contact of Hertz stiffens with its load; its k is that of the spring of equal stiffness
    number k/(P width) = (E/P)^(2/3): overlaps of both are about d over this number.

    Parameters
    ----------
    effects
        Of the scene.
    stress
        P [Pa] that the contacts carry.
    width
        Out-of-plane thickness in 2D, mean diameter in 3D [m].

    Returns
    -------
    float
        nan if no effect repels.
    """
    stiffness = 0.0
    for effect in effects:
        stiffness += effect.normal_stiffness()
        if effect.stiffness_per_radius() > 0.0:
            modulus = float(getattr(effect, "youngs_modulus", np.nan))
            stiffness += (modulus / stress) ** (2.0 / 3.0) * stress * width
    return stiffness or np.nan
