"""What a layer consists of and what acted in it, in words, from the scene that ran or its file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import taichi_lsm as lsm

if TYPE_CHECKING:
    import xarray

ROUND = {2: "discs", 3: "spheres"}


def grain_words(scene: lsm.Scene) -> str:
    """The mobile grains of a scene in words: discs, spheres, angular grains, clumps, bonded pieces."""
    rows = np.unique(scene.shape_index[scene.platen_index < 0])
    shapes = [scene.shapes[row] for row in rows]
    if scene.bonds is not None:
        return "breakable grains"
    if any(len(shape.parts) > 1 for shape in shapes):
        return "clumps"
    return ROUND[scene.dim] if all(shape.patch_count == 1 for shape in shapes) else "angular grains"


def friction_words(run: xarray.Dataset) -> str:
    """Friction between the grains of a run: "Coulomb friction (coefficient 0.5)"; from the effects in its file."""
    rows = [row for row in lsm.read_effects(run) if row.role == "friction"]
    if not rows:
        return "no friction"
    numbers = [
        f"{row.name.replace('_', ' ')} {row.value:g}" for row in rows if row.unit == "1" and row.value == row.value
    ]
    return f"{effect_words(rows[0].effect)} ({', '.join(numbers)})"


def effect_words(name: str) -> str:
    """The name of an effect as a text has it: "coulomb_friction" is "Coulomb friction"."""
    return name.replace("_", " ").replace("coulomb", "Coulomb")
