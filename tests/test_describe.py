"""The trees that describe a scene and a simulation, as text and as HTML."""

import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm import describe
from taichi_lsm.describe import Node
from tests.helpers import scenes

TREE = Node("a", "1", (Node("b", "", (Node("c", "2"), Node("d <&> 'e'"))), Node("f", '"g"')))


def every_kind():
    """A scene with whatever a tree can show: many shapes, walls of hostile names, platens, bonds, a given step."""
    n = 12
    shapes = [lsm.disc() for _ in range(10)]
    return scenes.scene(
        [(1.1 * i, 2.0) for i in range(n)],
        [
            lsm.LinearElastic(1e6),
            lsm.ViscousDamping(restitution=0.5),
            lsm.Gravity((0.0, -9.81)),
            lsm.effects.ElasticBrittleBond(1e6, 0.25, cohesion=1e5, friction_angle=0.6, radius_ratio=0.5),
        ],
        shapes=shapes,
        shape_index=np.arange(n) % 10,
        diameter=np.linspace(0.5, 1.0, n),
        lengths=(20.0, np.inf),
        periodic=(True, False),
        walls=[lsm.PlaneWall("<script>alert('floor')</script>", (0.0, 0.0), (0.0, 1.0), (0.5, 0.0))],
        platen_index=[0] + [-1] * (n - 1),
        platens=[lsm.Platen("lower & left", [lsm.Fixed(), lsm.ConstantVelocity(0.1)])],
        bonds=[(3, 4)],
        dt=1e-4,
    )


def test_text_is_drawn_with_branches():
    assert describe.as_text(TREE) == "a: 1\n├── b\n│   ├── c: 2\n│   └── d <&> 'e'\n└── f: \"g\""


def text_of(element):
    """Texts of all lines of rendered HTML."""
    if element.tag in ("summary",) or (element.tag == "div" and not len(element.findall("div"))):
        yield "".join(element.itertext()) if element.find("details") is None else ""
    for child in element:
        yield from text_of(child)


def test_html_shows_the_same_lines_as_the_text():
    lines = [line.lstrip("│├└─ ") for line in describe.as_text(TREE).splitlines()]
    shown = [line for line in text_of(ElementTree.fromstring(as_xml(TREE))) if line]
    assert shown == lines


def as_xml(node):
    """HTML of a tree; the attribute without a value gets one, so that it is XML."""
    return describe.as_html(node).replace(" open>", ' open="">')


class Tags(HTMLParser):
    """Every tag and attribute of a page."""

    def __init__(self, page):
        super().__init__()
        self.tags, self.attributes = set(), set()
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.attributes |= {name for name, _ in attrs}


def test_html_is_escaped_and_needs_nothing_from_outside():
    page = every_kind()._repr_html_()
    found = Tags(page)
    assert found.tags == {"div", "details", "summary", "b"} and found.attributes == {"style", "open"}
    assert "&lt;script&gt;" in page and "lower &amp; left" in page and "http" not in page
    ElementTree.fromstring(page.replace(" open>", ' open="">'))  # every tag is closed


def test_a_scene_in_one_line_and_as_a_tree():
    scene = every_kind()
    effects = "linear_elastic + viscous_damping + gravity + elastic_brittle_bond"
    assert repr(scene) == f"Scene(2D, 12 grains, 10 shapes, {effects})"
    lines = str(scene).splitlines()
    for line in (
        "Scene: 12 grains in 2D",
        "mobile: 11 of 12",
        "diameter: 0.5 to 1 m, mean 0.75 m",
        "density: 1000 kg m-3",
        "bonds: 1",
        "and 2 more",
        "stiffness: 1e+06 N m-1",
        "acceleration: (0, -9.81) m s-2",
        "cell: x periodic, 20 m; y open",
        "velocity (0.5, 0) m s-1",
        "platen lower & left: 1 grain",
        "x: Fixed()",
        "time step: 0.0001 s",
        "integrator: OnsetVerlet",
    ):
        assert any(shown.endswith(line) for shown in lines), line
    assert "None" not in str(scene)


def test_a_simulation_shows_its_progress_and_its_memory(runtime):
    scene = scenes.scene([(0.0, 0.0), (0.99, 0.0)], [lsm.LinearElastic(1e6)])
    sim = scenes.simulate(scene)
    sim.run(3)
    assert repr(sim) == f"Simulation(2D, 2 grains, step 3, time {sim.time:g} s, dt {sim.dt:g} s)"
    text = str(sim)
    assert text.splitlines()[0] == "Simulation: 2 grains in 2D"
    assert f"progress: step 3, time {sim.time:g} s" in text and f"time step: {sim.dt:g} s" in text
    assert f"runtime: cpu, {runtime.precision}, 1 thread" in text
    room = sim.grains.slot_of.shape[0]
    words = next(line for line in text.splitlines() if "grains: room for" in line).split()
    per_grain = sum(row.to_numpy().nbytes for row in (getattr(sim.grains, v) for v in sim.grains.variables)) / room
    assert int(words[-4].rstrip(",")) == room and int(words[-3]) == pytest.approx(per_grain)
    assert sim._repr_html_().count("<details") == sim._repr_html_().count("</details>") > 5


def test_energies_are_one_readable_line(runtime):
    terms = lsm.Energies(kinetic=1.5, elastic=0.25, potential=-2.0, dissipated=0.5, work=0.125)
    assert repr(terms) == (
        "Energies(kinetic 1.5 J, elastic 0.25 J, potential -2 J, dissipated 0.5 J, work 0.125 J; balance 0.125 J)"
    )
