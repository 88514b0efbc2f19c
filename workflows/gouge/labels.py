"""What a layer consists of and what acted in it, in words, from the scene that ran or its file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

import taichi_lsm as lsm
from workflows.common.effect_words import effect_words

if TYPE_CHECKING:
    import xarray

ROUND = {2: "discs", 3: "spheres"}
USUAL = {"linear_elastic", "viscous_damping", "servo"}  # which every layer has unless it says otherwise
SPRING_WORDS = {  # by the parameter that gives the stiffness of the spring of the load point
    "load_stiffness": "{:g} N/m",
    "load_stiffness_area": "{:g} Pa/m",
    "load_stiffness_ratio": "{:g} times the shear stiffness of the layer",
}


def grain_words(scene: lsm.Scene) -> str:
    """The mobile grains of a scene in words: discs, spheres, angular grains, clumps, bonded pieces."""
    rows = np.unique(scene.shape_index[scene.platen_index < 0])
    shapes = [scene.shapes[row] for row in rows]
    if scene.bonds is not None:
        return "breakable grains"
    if any(len(shape.parts) > 1 for shape in shapes):
        return "clumps"
    return ROUND[scene.dim] if all(shape.patch_count == 1 for shape in shapes) else "angular grains"


def shape_words(shape: str, dim: int) -> str:
    """Grains of a shape, by its option, in words."""
    return ROUND[dim] if shape == "round" else "angular grains"


def grains_of_run(run: xarray.Dataset, params: Any) -> str:
    """The mobile grains of a run in words, as the title of its file names those that ran (`grain_words`).

    params: attributes by the name of a parameter, as stored in the file. Breakable grains have pieces and bonds there,
    those of a file without such a title are named by their option.
    """
    of_title = re.fullmatch(r"Shear of a (?:layer|cell) of (.+) in \dD", str(run.attrs.get("title", "")))
    words = of_title[1] if of_title else shape_words(params.shape, params.dim)
    if words != "breakable grains":
        return words
    pieces, strength, modulus = (getattr(params, n, None) for n in ("pieces", "bond_strength", "weibull_modulus"))
    known = [f"{pieces} pieces each"] if pieces else []
    known += [f"bond strength {strength:g} times the normal stress"] if strength else []
    known += [f"Weibull modulus {modulus:g}"] if isinstance(modulus, int | float) and modulus == modulus else []
    return f"breakable {shape_words(params.shape, params.dim)}" + (f" ({', '.join(known)})" if known else "")


def spring_words(params: Any) -> str | None:
    """The spring of the load point in words, in the unit in which the run was given it; None without one.

    params: attributes by the name of a parameter, as stored in the file, where none is a word.
    """
    for name, words in SPRING_WORDS.items():
        value = getattr(params, name, None)
        if isinstance(value, int | float):
            return words.format(value)
    return None


def friction_words(run: xarray.Dataset) -> str:
    """Friction between the grains of a run: "Coulomb friction (coefficient 0.5)"; from the effects in its file."""
    rows = [row for row in lsm.read_effects(run) if row.role == "friction"]
    if not rows:
        return "no friction"
    return f"{effect_words(rows[0].effect)} ({_number_words([row for row in rows if row.unit in ('1', 'Pa')])})"


def other_effects(run: xarray.Dataset) -> str:
    """Effects of a run beside springs, dashpots and friction: ", with Hertz, gravity", "" without any."""
    names = [str(name) for name in run.effect_name.values]
    rows = lsm.read_effects(run)
    names += [row.effect for row in rows if row.effect not in names]
    friction = {row.effect for row in rows if row.role == "friction"}
    others = [_with_elasticity(name, rows) for name in dict.fromkeys(names) if name not in friction | USUAL]
    return f", with {', '.join(others)}" if others else ""


def _with_elasticity(name: str, rows: Sequence[Any]) -> str:
    """The name of an effect in words, of elasticity with its moduli: "Hertz (Young's modulus 7e+10 Pa, ...)"."""
    words = _number_words([row for row in rows if row.effect == name and row.role == "elasticity"])
    return effect_words(name) + (f" ({words})" if words else "")


def _number_words(rows: Sequence[Any]) -> str:
    """The numbers of an effect with their units: "coefficient 0.5, Young's modulus 7e+10 Pa"."""
    known = [row for row in rows if row.value == row.value]
    numbers = [
        f"{row.name.replace('_', ' ')} {row.value:g}{'' if row.unit == '1' else f' {row.unit}'}" for row in known
    ]
    return ", ".join(numbers).replace("youngs", "Young's").replace("poissons", "Poisson's")
