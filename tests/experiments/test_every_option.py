"""Whatever options a user gives, a workflow accepts them or says in a line what is wrong; it never shows a traceback.

Every option of every workflow is driven to its bounds and just beyond them, alone and with another one, through
the merge of parameters and all that is computed before a run begins. A new workflow is tested without being named here.
"""

import itertools
import json
import math
import os
import random
import subprocess
import sys
import types
from pathlib import Path

import pytest

import taichi_lsm as lsm
from workflows.common.discovery import find_workflows
from workflows.common.parameter_types import choices, items, kind, members
from workflows.common.parameters import merge, option_name

ROOT = Path(__file__).parents[2]
WORKFLOWS = find_workflows()
PAIRS = 80  # of options that are changed together, per workflow
TINY_LAYER = {"length": "6", "start": "loose"}  # a dense start takes longer to make
TINY = {  # small runs of the workflows whose standard ones are large, from which single options are changed
    "shear-gouge": [
        TINY_LAYER | {"grains": "20"},
        TINY_LAYER | {"grains": "20", "shape": "angular", "breakable": True},
        TINY_LAYER | {"grains": "20", "dim": "3", "width": "4"},
        TINY_LAYER | {"grains": "20", "dim": "3", "width": "5", "shape": "angular", "start": "dense"},
    ],
    "velocity-steps": [TINY_LAYER | {"grains": "20"}],
    "normal-stress-steps": [TINY_LAYER | {"grains": "20"}],
    "slide-hold-slide": [TINY_LAYER | {"grains": "20"}],
    "stick-slip": [TINY_LAYER | {"grains": "20", "load_stiffness": "1e3"}],
    "shear-cell": [
        TINY_LAYER | {"grains": "20"},
        TINY_LAYER | {"grains": "20", "dim": "3", "width": "5", "shape": "angular", "start": "dense"},
    ],
    "compare-shapes": [TINY_LAYER | {"grains": "20", "replicas": "1"}],
    "energy-conservation": [{"grains": "16", "order_grains": "16"}],
    "shape-roughness": [{"layer_thickness": "8", "length": "6"}],
}
# Values for what has neither bounds nor choices.
FREE_LISTS = ("", "steps", "nonsense", "steps,nonsense", ",")
TABLES = (
    [],
    [{}],
    [{"name": "gravity", "acceleration": [0.0, -9.81]}],
    [{"name": "gravity", "acceleration": [0.0, -9.81, 0.0]}],
    [{"name": "gravity", "acceleration": "down"}],
    [{"name": "hertz", "youngs_modulus": 1e9, "poissons_ratio": 0.3}],
    [{"name": "linear_elastic", "stiffness": "stiff"}],
    [{"name": "linear_elastic", "stiffness": -1.0}],
    [{"name": "linear_elastic", "stiffness": math.inf}],
    [{"name": "linear_elastic", "stiffness": math.nan}],
    [{"name": "linear_elastic"}],
    [{"name": ["linear_elastic"]}],
    [{"name": "linear_elastc", "stiffness": 1e6}],
    [{"name": "gravity", "acceleration": [0.0, -9.81]}] * 2,
)


pytestmark = pytest.mark.usefixtures("few_shapes")


def bounds(metadata):
    """(values that the bounds allow, values that they refuse) of a number."""
    allowed, refused = [], []
    for rule in metadata:
        for name, outward in (("ge", -1.0), ("le", 1.0), ("gt", -1.0), ("lt", 1.0)):
            limit = getattr(rule, name, None)
            if limit is None:
                continue
            whole = isinstance(limit, int) and abs(limit) < 2**53
            beyond = limit + int(outward) if whole else math.nextafter(limit, outward * math.inf)
            if name in ("ge", "le"):
                allowed.append(limit)
                refused.append(beyond)
            else:
                allowed.append(math.nextafter(limit, -outward * math.inf))
                refused.append(limit)
    return allowed, refused


def values_of(field):
    """(values to try, values that must be refused) of an option, as a user would write them."""
    how, names = kind(field.annotation), choices(field.annotation)
    if how == "flag":
        return [True, False], []
    if how == "toml":
        return list(TABLES), []
    if how == "list":
        inner = [a for m in members(field.annotation) if m is not types.NoneType for a in m.__args__]
        rules = [
            rule for a in inner for extra in getattr(a, "__metadata__", ()) for rule in getattr(extra, "metadata", ())
        ]
        allowed, refused = bounds(rules)
        tried = [*names, ",".join(names), *map(repr, allowed)] if names or allowed else FREE_LISTS
        return ["", *tried], [*map(repr, refused), *(["nonsense"] if names or allowed else [])]
    if names:
        return names, ["nonsense"]
    allowed, refused = bounds(field.metadata)
    empty = ["none"] if types.NoneType in members(field.annotation) else []
    return [*map(repr, allowed), *empty], [*map(repr, refused), "nonsense", "nan", "inf", "1e400"]


def outcome(name, options):
    """Accepted or refused: what a command with these options comes to before its run begins."""
    module = WORKFLOWS[name]
    try:
        params = merge(module.Params, None, None, options)
        module.check(params)
        if name == "shear-gouge":
            module.build(params)
    except lsm.InputError as error:
        text = str(error)
        assert text.strip() and "Traceback" not in text, options
        return text
    return "accepted"


def cases(name):
    """(base, option, its field) of a workflow."""
    fields = WORKFLOWS[name].Params.model_fields
    return [(base, key, field) for base in TINY.get(name, [{}])[:2] for key, field in fields.items()]


def test_the_tiny_runs_are_accepted():
    for name, bases in TINY.items():
        for base in bases:
            assert outcome(name, base) == "accepted", base


@pytest.mark.parametrize("name", sorted(WORKFLOWS))
def test_every_number_has_a_bound_on_both_sides(name):
    for key, field in WORKFLOWS[name].Params.model_fields.items():
        options = members(field.annotation)
        if kind(field.annotation) == "list":
            options = [i for m in options if m is not types.NoneType for i in items(m)]
        if {int, float} & set(options):
            tried, refused = values_of(field)
            assert len(refused) >= 3, f"{key}: must have a least and a greatest value"


@pytest.mark.parametrize("name", sorted(WORKFLOWS))
def test_every_option_at_its_bounds(name):
    for base, key, field in cases(name):
        tried, refused = values_of(field)
        assert tried, f"{name}: {key} has no value to try"
        for value in tried:
            outcome(name, base | {key: value})
        for value in refused:
            text = outcome(name, base | {key: value})
            assert option_name(key) in text and ("must be" in text or "has no effect" in text), (key, value, text)


@pytest.mark.parametrize("name", sorted(WORKFLOWS))
def test_pairs_of_options(name):
    rng = random.Random(f"pairs of {name}")
    fields = WORKFLOWS[name].Params.model_fields
    for _ in range(PAIRS):
        base, keys = rng.choice(TINY.get(name, [{}])), rng.sample(sorted(fields), 2)
        outcome(name, base | {key: rng.choice(list(values_of(fields[key])[0])) for key in keys})


@pytest.mark.parametrize("radius", ["0.02", "0.25"])
def test_every_corner_radius_of_shapes_that_replace_those_of_a_layer_is_accepted(radius):
    """The rule that ties the stiffness number to the corner radius is for the layer's own shapes."""
    assert outcome("shape-roughness", {"corner_radius": radius}) == "accepted"
    assert outcome("accuracy-cost", {"corners": radius, "shapes": "sphere,angular"}) == "accepted"


def test_flat_sides_are_accepted_from_the_roundest_to_the_flattest():
    """In 2D and 3D: the shapes are made."""
    angular = TINY_LAYER | {"grains": "20", "shape": "angular"}
    for key, more in (("side_half_width", {}), ("face_flatness", {"dim": "3", "width": "5"})):
        for value in bounds(WORKFLOWS["shear-gouge"].Params.model_fields[key].metadata)[0]:
            assert outcome("shear-gouge", angular | more | {key: repr(value)}) == "accepted", (key, value)


def test_refusals_name_option_value_allowed_and_remedy():
    base = TINY["shear-gouge"][0]
    platen = outcome("shear-gouge", base | {"platen_roughness": "3"})
    assert all(words in platen for words in ("--length 6", "--platen-roughness 3", "must be >= 7.04", "raise it"))
    unequal = {"dim": "3", "width": "4", "shape": "angular", "smallest_diameter": "1e-5"}
    angular = outcome("shear-gouge", base | unequal)
    assert "--width 4" in angular and "must be >=" in angular and "across" in angular
    many = outcome("shear-gouge", base | {"grains": "10000000"})
    assert "--grains 10000000, --length 6: the layer has" in many and "--layer-thickness" not in many
    assert "must be <= 1e+07" in many and "make it smaller" in many
    endless = outcome("shear-gouge", base | {"strain": "1e4", "inertial_number": "1e-9"})
    assert "--strain 10000" in endless and "steps" in endless and "raise --inertial-number" in endless
    spring = outcome("shear-gouge", base | {"load_stiffness": "1e15"})
    assert "--load-stiffness 1e+15" in spring and "must be <=" in spring and "lower it" in spring
    stiff = outcome("shear-gouge", base | {"load_stiffness_area": "1e24"})
    assert "--load-stiffness-area 1e+24 Pa/m: must be <=" in stiff


def test_the_command_line_shows_no_traceback(tmp_path):
    """The same through `lsm` itself, in one process for a sample."""
    small = "--length 6 --grains 30"
    lines = [
        f"shear-gouge --platen-roughness 3 {small}",
        f"shear-gouge --dim 3 --smallest-diameter 1e-9 {small}",
        f"shear-gouge --shape angular --corner-radius 0.25 --breakable --pieces 40 --target-error 0.1 {small}",
        f"shear-gouge --strain 10000 --inertial-number 1e-9 {small}",
        f"shear-cell --steady-from 9 {small}",
        f"compare-shapes --platen-roughness 3 {small}",
        "energy-conservation --corner-radius 0.3 --gap 0.2 --order-grains 16",
        "shape-roughness --strain 0.5",
        "accuracy-cost --gas-grains 17",
        "hard-cases --kinds nonsense",
        f"velocity-steps --velocity-ratio 100 --inertial-number 0.1 --step-slip 400 {small}",
        f"normal-stress-steps --stress-ratio 0.5 {small}",
        f"stick-slip --load-stiffness-ratio none {small}",
        f"slide-hold-slide --longest-hold 1 {small}",
        f"oedometer --normal-stiffness 1e9 {small}",
        "crush-grain --youngs-modulus 1e9",
    ]
    assert {line.split()[0] for line in lines} >= set(WORKFLOWS)
    (tmp_path / "lines.json").write_text(json.dumps(lines))
    code = (
        "import json\n"
        "from workflows.cli.main import main\n"
        "print([main(line.split()) for line in json.load(open('lines.json'))])\n"
    )
    process = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert process.returncode == 0 and process.stdout.splitlines()[-1] == str([2] * len(lines)), process.stderr
    assert "Traceback" not in process.stderr
    problems = [line for line in process.stderr.splitlines() if not line.startswith("lsm: note:")]
    assert len(problems) == len(lines) and all(text.startswith("lsm: --") for text in problems)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["lines.json"]  # nothing is left behind


def test_bounds_are_found():
    """The values that this module tries are the bounds and their neighbours."""
    fields = WORKFLOWS["shear-gouge"].Params.model_fields
    assert bounds(fields["dim"].metadata) == ([2, 3], [1, 4])
    assert bounds(fields["strain"].metadata)[0][0] == math.nextafter(0.0, 1.0)
    patches, beyond = values_of(WORKFLOWS["accuracy-cost"].Params.model_fields["patches"])
    assert {"12", "1200"} <= set(patches) and {"11", "1201"} <= set(beyond)
    assert list(itertools.islice(values_of(fields["shape"])[0], 2)) == ["round", "angular"]
