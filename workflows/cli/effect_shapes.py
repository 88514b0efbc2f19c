"""Which effect acts on grains of which shape: found by making scenes, which refuse what makes no sense."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator
from typing import Any

import numpy as np

import taichi_lsm as lsm
from workflows.common.small_scenes import scene_of

STIFFNESS = 1e5  # [N m-1], of the springs beside an effect that does not repel
APART = 4.0  # [diameters], of the two grains of a scene


@functools.cache
def shapes_of(dim: int) -> dict[str, Any]:
    """One shape of each kind in this dimension, by the name that tables have for the kind.

    All patches of a grain have the same radius only among discs and spheres and in clumps.
    """
    if dim == 2:
        angular = lsm.shapes.from_polygon([(0, 0), (2, 0), (2, 1), (0.5, 1.4)], 0.1)
        named = {"discs": lsm.disc(), "arc chains": angular, "cones": lsm.shapes.from_chain(angular)}
        return named | {"clumps": _clump(2), "unions": lsm.shapes.crossed_bars()}
    angular = lsm.shapes.ball_of_faces(20, 0.1)
    parts = [lsm.shapes.place_part(angular, (x, 0.0, 0.0)) for x in (-0.3, 0.3)]
    named = {"spheres": lsm.sphere(), "ball-polyhedra": angular, "cones": _cones()}
    return named | {"clumps": _clump(3), "unions": lsm.shapes.union(parts)}


def _clump(dim: int) -> Any:
    """Two balls."""
    centres = np.zeros((2, dim))
    centres[:, 0] = -0.4, 0.4
    return lsm.shapes.clump(centres, [1.0, 1.0])


def _cones() -> Any:
    """A ball that is flattened below: two caps of unequal radii, in 3D, where cones never tile all directions."""
    rim, radius = 1.0, np.array([1.0, 1.1])
    depth = np.sqrt(radius**2 - rim**2)  # of the centres beyond the plane of the rim
    axis = np.array([(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
    height = 0.5 * np.sum(radius - depth)
    volume = 4.0 / 3.0 * np.pi * rim**2 * height  # of an ellipsoid, nearly
    inertia = 0.2 * volume * np.array([rim**2 + height**2] * 2 + [2.0 * rim**2])
    body: dict[str, Any] = {"measure": volume, "inertia": inertia, "name": "flattened ball"}
    return lsm.shapes.from_patches(-depth[:, None] * axis, radius, axis, np.arcsin(rim / radius), **body)


def companions(effect: Any) -> list[Any]:
    """What a scene must list beside an effect of contacts, so that it makes sense: an elasticity that suits it."""
    if effect.phase == "normal" and effect.role == "elasticity":
        return []
    if hasattr(effect, "youngs_modulus") and effect.phase == "tangential":
        return [lsm.effects.Hertz(effect.youngs_modulus, effect.poissons_ratio)]
    return [lsm.LinearElastic(STIFFNESS)]


def refusal(effect: Any, shape: Any) -> str:
    """Why a scene of two grains of this shape refuses the effect; "" if it does not."""
    position = np.zeros((2, shape.dim))
    position[1, 0] = APART
    bonds: dict[str, Any] = {"bonds": [(0, 1)]} if effect.phase == "bond" else {}
    try:
        scene_of(position, [*companions(effect), effect], shapes=[shape], dt=1e-6, **bonds)
    except lsm.InputError as error:
        return str(error).replace(repr(shape.name), "the grain")
    return ""


def variants(cls: Any) -> Iterator[tuple[str, list[Any]]]:
    """(choices, cases) of an effect: cases that differ in numbers alone belong together."""
    cases: dict[str, list[Any]] = {}
    for case in cls.cases():
        texts = [v for f in dataclasses.fields(case) if isinstance(v := getattr(case, f.name), str)]
        cases.setdefault(", ".join(texts), []).append(case)
    yield from cases.items()


def refusals(cases: list[Any], dim: int) -> dict[str, str]:
    """By kind of shape why all these cases are refused; "" where one of them is not."""
    found = {}
    for kind, shape in shapes_of(dim).items():
        reasons = [refusal(case, shape) for case in cases]
        found[kind] = "" if "" in reasons else reasons[0]
    return found


def shapes_text(cls: Any) -> str:
    """The shapes on which an effect can act, in words: "all", or for a variant "all but ..."."""
    texts = []
    for variant, cases in variants(cls):
        off = [f"{kind} in {dim}D" for dim in (2, 3) for kind, why in refusals(cases, dim).items() if why]
        text = f"all but {', '.join(off)}" if off else "all"
        texts.append((variant, text))
    if all(text == "all" for _, text in texts):
        return "all"
    return "; ".join(f"{variant}: {text}" if variant else text for variant, text in texts)
