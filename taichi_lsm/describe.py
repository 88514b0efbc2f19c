"""What a scene or a simulation consists of, as a tree, and two renderings of it: text and HTML.

The tree is built once from plain attributes; `print(scene)` shows the text, a notebook shows the HTML.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from .core.fields import bytes_per_row

if TYPE_CHECKING:
    from .scene import Scene
    from .simulation import Simulation

MOST_SHAPES = 8  # rows of the shape table that are shown one by one
STYLE = "font-family: monospace; line-height: 1.4"
INDENT = "margin-left: 1.2em"


@dataclass(frozen=True)
class Node:
    """A line of the tree, with the lines that belong to it."""

    label: str
    value: str = ""
    children: tuple[Node, ...] = ()

    @property
    def line(self) -> str:
        """The line without its children."""
        return f"{self.label}: {self.value}" if self.value else self.label


def as_text(node: Node) -> str:
    """The tree with box-drawing characters, one line per node."""
    return "\n".join([node.line, *_branches(node)])


def _branches(node: Node) -> Iterator[str]:
    for child in node.children:
        last = child is node.children[-1]
        yield ("└── " if last else "├── ") + child.line
        yield from (("    " if last else "│   ") + line for line in _branches(child))


def as_html(node: Node) -> str:
    """The tree as nested <details>, escaped, without scripts, style sheets or anything from outside."""
    return f'<div style="{STYLE}">{_details(node, " open")}</div>'


def _details(node: Node, opened: str = "") -> str:
    line = escape(node.label) + (f": <b>{escape(node.value)}</b>" if node.value else "")
    if not node.children:
        return f'<div style="{INDENT}">{line}</div>'
    inner = "".join(_details(child) for child in node.children)
    return f'<details style="{INDENT}"{opened}><summary>{line}</summary>{inner}</details>'


def scene_line(scene: Scene) -> str:
    """Scene(2D, 600 grains, 3 shapes, linear_elastic + gravity)."""
    effects = " + ".join(e.name for e in scene.effects) or "no effects"
    return f"Scene({scene.dim}D, {_counted(len(scene), 'grain')}, {_counted(len(scene.shapes), 'shape')}, {effects})"


def simulation_line(sim: Simulation) -> str:
    """Simulation(2D, 600 grains, step 1200, time 0.012 s, dt 1e-05 s)."""
    scene = sim.scene
    size = f"{scene.dim}D, {_counted(len(scene), 'grain')}"
    return f"Simulation({size}, step {sim.step}, time {sim.time:g} s, dt {sim.dt:g} s)"


def scene_tree(scene: Scene) -> Node:
    """Grains, shapes, effects, boundaries and step of a scene."""
    step = Node("time step", "chosen from the stable one" if scene.dt is None else f"{scene.dt:g} s", _step(scene))
    return Node("Scene", f"{_counted(len(scene), 'grain')} in {scene.dim}D", (*_contents(scene), step))


def simulation_tree(sim: Simulation) -> Node:
    """The same of a simulation, with its progress, runtime and memory."""
    scene, runtime = sim.scene, sim.runtime
    step = Node("time step", f"{sim.dt:g} s", _step(scene))
    progress = Node(
        "progress",
        f"step {sim.step}, time {sim.time:g} s",
        (Node("neighbour lists built", str(sim.rebuilds + 1)), Node("skin", f"{sim.skin:g} m")),
    )
    where = Node("runtime", f"{runtime.arch}, {runtime.precision}, {_counted(runtime.threads, 'thread')}")
    contents = (*_contents(scene), step, progress, where, _memory(sim))
    return Node("Simulation", f"{_counted(len(scene), 'grain')} in {scene.dim}D", contents)


def _contents(scene: Scene) -> tuple[Node, ...]:
    return _grains(scene), _shapes(scene), _effects(scene), _boundaries(scene)


def _grains(scene: Scene) -> Node:
    mobile = int((scene.platen_index < 0).sum())
    lines = [
        Node("mobile", f"{mobile} of {len(scene)}"),
        Node("diameter", _span(scene.diameter, "m")),
        Node("density", f"{scene.density:g} kg m-3"),
    ]
    if scene.dim == 2:
        lines.append(Node("thickness", f"{scene.thickness:g} m"))
    if scene.bonds is not None:
        lines.append(Node("bonds", str(len(scene.bonds))))
    return Node("grains", str(len(scene)), tuple(lines))


def _shapes(scene: Scene) -> Node:
    used = np.bincount(scene.shape_index, minlength=len(scene.shapes))
    rows = [
        Node(shape.name, f"{_counted(shape.patch_count, 'patch')}, {_counted(int(count), 'grain')}")
        for shape, count in zip(scene.shapes[:MOST_SHAPES], used, strict=False)
    ]
    if len(scene.shapes) > MOST_SHAPES:
        rows.append(Node(f"and {len(scene.shapes) - MOST_SHAPES} more"))
    return Node("shapes", str(len(scene.shapes)), tuple(rows))


def _effects(scene: Scene) -> Node:
    rows = []
    for effect in scene.effects:
        given = {name: value for name, value in vars(effect).items() if name in effect.units and value is not None}
        children = tuple(Node(name, _quantity(value, effect.units[name])) for name, value in given.items())
        rows.append(Node(type(effect).__name__, effect.equation, children))
    return Node("effects", str(len(rows)), tuple(rows))


def _boundaries(scene: Scene) -> Node:
    axes = "xyz"[: scene.dim]
    around = [
        f"{axis} {f'periodic, {length:g} m' if repeats else 'open'}"
        for axis, length, repeats in zip(axes, scene.lengths, scene.periodic, strict=True)
    ]
    rows = [Node("cell", "; ".join(around))]
    if scene.shear_rate:
        rows.append(Node("shear rate", f"{scene.shear_rate:g} s-1"))
    if scene.cell_servo:
        rows.append(Node("height", repr(scene.cell_servo)))
    for wall in scene.walls:
        moving = f", velocity {_number(wall.velocity)} m s-1" if np.any(wall.velocity) else ""
        rigid = ", rigid" if wall.rigid else ""
        servo = f", {wall.servo!r}" if wall.servo else ""
        where = f"point {_number(wall.point)} m, normal {_number(wall.normal)}"
        rows.append(Node(f"wall {wall.name}", where + moving + rigid + servo))
    for number, platen in enumerate(scene.platens):
        drives = tuple(Node(axis, repr(drive)) for axis, drive in zip(axes, platen.drives, strict=False))
        rows.append(Node(f"platen {platen.name}", _counted(int((scene.platen_index == number).sum()), "grain"), drives))
    return Node("boundaries", "", tuple(rows))


def _step(scene: Scene) -> tuple[Node, ...]:
    rows = [Node("integrator", scene.integrator.__name__)]
    if scene.dt is None:
        rows.append(Node("share of the stable step", f"{scene.safety:g}"))
    return (*rows, Node("dissipation accounting", "on" if scene.track_dissipation else "off"))


def _memory(sim: Simulation) -> Node:
    """Bytes of the fields of the grains and of the neighbour list, which are nearly all of a large run."""
    per_grain = bytes_per_row(sim.grains.variables.values(), sim.grains.sizes)
    per_pair = sim.pairs.bytes_per_pair()
    capacity = sim.grains.slot_of.shape[0]
    rows = (
        Node("grains", f"room for {capacity}, {per_grain} bytes each"),
        Node("neighbour list", f"room for {sim.pairs.capacity} pairs, {per_pair} bytes each"),
    )
    return Node("memory", f"{(capacity * per_grain + sim.pairs.capacity * per_pair) / 2**20:.3g} MiB", rows)


def _counted(number: int, noun: str) -> str:
    plural = {"patch": "patches"}.get(noun, f"{noun}s")
    return f"{number} {noun if number == 1 else plural}"


def _span(values: np.ndarray, unit: str) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:g} {unit}" if low == high else f"{low:g} to {high:g} {unit}, mean {values.mean():g} {unit}"


def _number(value: Any) -> str:
    if isinstance(value, Iterable) and not isinstance(value, str):
        return f"({', '.join(_number(v) for v in value)})"
    return f"{value:g}" if isinstance(value, float | int | np.number) and not isinstance(value, bool) else str(value)


def _quantity(value: Any, unit: str) -> str:
    return _number(value) if unit == "1" else f"{_number(value)} {unit}"
