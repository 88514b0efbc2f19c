"""Every option of every workflow changes what is computed, or is refused: none is ignored without a word.

Layers are run to their end with stand-ins for the simulation and its files, which write down what they are given.
"""

import ast
import contextlib
import hashlib
import math
import re
import types
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray

import taichi_lsm as lsm
import workflows
from workflows import compare_shapes, normal_stress_steps, oedometer, shear_gouge, stick_slip, velocity_steps
from workflows.common.discovery import find_workflows
from workflows.common.parameter_types import choices, kind, members
from workflows.common.parameters import ParameterError, merge, option_name
from workflows.gouge import layer_run, target_runs
from workflows.gouge.layer_parameters import LayerParams
from workflows.plots import run_plots
from workflows.protocol.run_loop import RunLoop

pytestmark = pytest.mark.usefixtures("few_shapes")

WORKFLOWS = find_workflows()
LAYER = {"length": 6.0, "grains": 20, "strain": 1.6, "inertial_number": 0.02, "start": "loose"}  # which is made sooner
STEPPED = {name: value for name, value in LAYER.items() if name != "strain"}
STEPPED |= {"run_in": 0.1, "cycles": 2, "step_slip": 4.0}
RATE_AND_STATE = dict.fromkeys(("reference_coefficient", "direct_effect", "evolution_effect"), 0.1)
RATE_AND_STATE |= {"name": "rate_and_state_friction", "slip_distance": 1e-6, "reference_velocity": 1e-3}
RATE_AND_STATE |= {"tangential_stiffness": 1e5}
HERTZ = {"name": "hertz", "youngs_modulus": 5e10, "poissons_ratio": 0.3}
DASHPOT = {"name": "viscous_damping", "restitution": 0.3}
BASES = {
    "shear-gouge": [
        LAYER,
        LAYER | {"shape": "angular"},
        LAYER | {"shape": "angular", "breakable": True},
        LAYER | {"dim": 3, "width": 5.0, "shape": "angular"},
        LAYER | {"effects": [RATE_AND_STATE, HERTZ]},
        LAYER | {"effects": [DASHPOT], "load_stiffness": 1e3},
        {name: value for name, value in LAYER.items() if name not in ("strain", "steady_from")}
        | {"stages": [{"name": "shear", "velocity": 1.0, "until": {"strain": 0.5}}]},
        {"layer_thickness": 8.0, "length": 20.0, "target_error": 0.05},
    ],
    "velocity-steps": [STEPPED],
    "normal-stress-steps": [STEPPED | {"ramp": 1.0}],
    "stick-slip": [
        {name: value for name, value in STEPPED.items() if name not in ("cycles", "step_slip")}
        | {"load_stiffness": 1e3, "strain": 0.3, "row_time": 0.1}
    ],
    "oedometer": [
        {name: value for name, value in LAYER.items() if name not in ("strain", "inertial_number")}
        | {"stress_ratio": 3.0, "levels": 3, "level_time": 4.0, "row_time": 0.5}
    ],
    "compare-shapes": [
        LAYER | {"replicas": 1},
        LAYER | {"replicas": 1, "dim": 3, "width": 5.0},
        {name: value for name, value in LAYER.items() if name != "grains"} | {"layer_thickness": 8.0, "replicas": 1},
    ],
}
TABLES = {  # other values of what only a file can give
    "effects": ([DASHPOT | {"restitution": 0.7}], [{"name": "gravity", "acceleration": [0.0, -9.81, 0.0]}]),
    **dict.fromkeys(("contacts", "snapshots"), (["every=0.2"], ["stages"])),
    "stages": ([{"name": "fast", "velocity": 2.0, "until": {"strain": 0.5}}],),
}


class Stop(Exception):
    """Ends an experiment that would go on with files of its runs."""


def scene_words(scene):
    """All that a scene consists of, as a text."""
    arrays = [scene.position, scene.diameter, scene.shape_index, scene.angle, scene.orientation, scene.bonds]
    arrays += [patch for shape in scene.shapes for patch in shape.patches()]
    digest = hashlib.sha256(b"".join(np.asarray(a, float).tobytes() for a in arrays if a is not None)).hexdigest()
    drives = [(platen.name, platen.drives) for platen in scene.platens]
    numbers = (scene.dim, scene.lengths, scene.density, scene.thickness, scene.area, scene.chosen_dt())
    return f"{digest} {list(scene.effects)} {drives} {numbers}"


class Simulation:
    """Stands in for a simulation: counts steps, and writes down what it is made of and told."""

    def __init__(self, scene, *machine):
        self.log = [scene_words(scene), *machine]
        self.scene, self.dt, self.step, self.speed = scene, scene.chosen_dt(), 0, 0.0
        self.platens = SimpleNamespace(drives=[platen.drives for platen in scene.platens], set=self.drive)

    def __len__(self):
        return len(self.scene)

    def drive(self, platen, axis, drive):
        self.log.append(drive)
        self.speed = getattr(drive, "velocity", self.speed)

    def run(self, steps):
        self.step += steps

    def keep_checkpoints(self, folder, seconds):
        pass

    def keep_checkpoint(self, state):
        pass

    @property
    def time(self):
        return self.step * self.dt


class Layer:
    """Stands in for a sheared layer that is at its stress and follows its drive."""

    def __init__(self, sim, stress, diameter):
        sim.log += [stress, diameter]
        self.sim, self.stress, self.thickness, self.strain, self.before = sim, stress, 8.0 * diameter, 0.0, 0
        self.slip, self.memory = 0.0, SimpleNamespace(as_plain=dict)

    def begin_shear(self):
        self.strain = 0.0

    def sample(self):
        self.sim.log.append(self.sim.step)
        moved = self.sim.speed * self.sim.dt * (self.sim.step - self.before)
        self.slip, self.strain = self.slip + moved, self.strain + moved / self.thickness
        self.before = self.sim.step

    def residual_fraction(self):
        return 0.0


class Recorder:
    """Stands in for the files of a layer."""

    def __init__(self, out, layer, title, *others):
        layer.sim.log.append(title)
        self.layer, self.rows, self.snapshots, self.moments = layer, 0, 0, 0
        self.grains, self.id = SimpleNamespace(last_time=-1.0), "run"

    def __enter__(self):
        return self

    def __exit__(self, *error):
        return None

    def begin_stage(self, name, index, cycle=0, slip=0.0):
        self.layer.sim.log.append((name, index))

    def flush(self):
        pass

    def row(self):
        self.layer.sim.log.append("row")
        of_row = {"friction": 0.3, "shear_strain": self.layer.strain}
        return of_row | {"platen_normal_stress": self.layer.stress}

    def snapshot(self):
        self.layer.sim.log.append("snapshot")

    moment = snapshot  # of the contacts


class Loop(RunLoop):
    """Writes down how often checkpoints are wanted."""

    def __init__(self, layer, *others, checkpoint_seconds):
        super().__init__(layer, *others, checkpoint_seconds=checkpoint_seconds)
        layer.sim.log.append(checkpoint_seconds)


def series():
    """A file run.nc whose steady state depends on where it begins."""
    strain = np.linspace(0.0, 3.0, 301)
    wave = 1.0 + 0.1 * np.sin(40.0 * strain) + 0.3 * np.exp(-strain)
    columns = {name: ("time", 5e6 * wave ** (1 + i % 3)) for i, name in enumerate(ROWS)}
    columns |= {"shear_strain": ("time", strain), "stage": ("time", ["shear"] * len(strain)), "stiffness_number": 1.0}
    columns |= {name: ("time", np.ones(len(strain), int)) for name in ("stage_index", "cycle")}
    return xarray.Dataset(columns, coords={"time": strain}).set_coords(["stage", "shear_strain"])


ROWS = (
    *("shear_stress", "normal_stress", "platen_shear_stress", "platen_normal_stress", "platen_normal_rms"),
    *("energy_residual", "work_throughput", "inertial_number", "layer_thickness", "porosity"),
    *("coordination_number", "sliding_fraction", "deepest_overlap"),
)
StagedParams = (velocity_steps.Params, normal_stress_steps.Params, stick_slip.Params, oedometer.Params)
EXPERIMENTS = {velocity_steps: "STEPS", normal_stress_steps: "STEPS", stick_slip: "STICK_SLIP", oedometer: "OEDOMETER"}


@pytest.fixture
def observed(monkeypatch, tmp_path):
    """observed(module, params): all that the experiment does, as a text."""
    log = []

    def jobs_of(jobs, at_a_time, progress, resume):
        for label, _, of_run, _ in jobs:
            idle = of_run.idle()
            log.append((label, {k: v for k, v in of_run.model_dump().items() if k not in idle}))
        log.append(at_a_time)
        raise Stop

    def simulation(*given):
        sim = Simulation(*given)
        log.append(sim.log)
        return sim

    monkeypatch.setattr(lsm, "Simulation", simulation)
    monkeypatch.setattr(lsm, "ShearedLayer", Layer)
    monkeypatch.setattr(lsm, "LayerRecorder", Recorder)
    monkeypatch.setattr(lsm.checkpoints, "remove_checkpoints", lambda out: log.append("removed"))
    monkeypatch.setattr(layer_run, "RunLoop", Loop)
    monkeypatch.setattr(lsm, "open_run", lambda path: series())
    monkeypatch.setattr(lsm, "runtime_profile_text", lambda sim: log.append("profile") or "")
    monkeypatch.setattr(run_plots, "plot_run", lambda out, form: log.append(form))
    monkeypatch.setattr(compare_shapes, "run_replicas", jobs_of)
    monkeypatch.setattr(target_runs, "run_replicas", jobs_of)

    for module, of_module in EXPERIMENTS.items():  # what they conclude from their files is tested with these
        experiment = getattr(module, of_module)
        concluded = replace(experiment, conclude=lambda dataset, params, out: log.append(params.format) or {})
        monkeypatch.setattr(module, of_module, concluded)

    def summary(out, workflow, preset, metrics, quiet):
        timed = ("seconds", "cpu_seconds", "grain_steps_per_second")
        log.append({name: metric.value for name, metric in metrics.items() if name not in timed})

    monkeypatch.setattr(layer_run, "write_summary", summary)

    def observe(module, params):
        log.clear()
        with contextlib.suppress(Stop):
            module.run(params, tmp_path, existing="overwrite")
        return repr(log)

    return observe


def other_values(key, field, value):
    """Values of the option `key` other than `value`, near it where it is a number."""
    how, names = kind(field.annotation), choices(field.annotation)
    if key in TABLES:
        return TABLES[key]
    if how == "flag":
        return [not value]
    if names:
        return [name for name in names if name != value]
    bounds = {k: getattr(rule, k) for rule in field.metadata for k in ("ge", "gt", "le") if hasattr(rule, k)}
    low, high = bounds.get("ge", bounds.get("gt", 1e-3)), bounds["le"]
    whole = int in members(field.annotation)
    near = [1.1 * value, 0.9 * value] if value else [1.5 * low, math.sqrt(max(low, 1e-6) * high), 0.05]
    apart = max(1, int(value) // 10) if whole and value else 1
    near = [value + apart, value - apart] if whole and value else [round(v) if whole else v for v in near]
    return [v for v in near if low <= v <= high]


def outcomes(name, base, key, field, observe, before):
    """For each other value of an option "acts", "ignored", or the reason why it is refused."""
    module = WORKFLOWS[name]
    for value in other_values(key, field, getattr(merge(module.Params, options=base), key)):
        try:
            params = merge(module.Params, options=base | {key: value})
            yield "acts" if observe(module, params) != before else "ignored"
        except lsm.InputError as error:
            yield str(error)


@pytest.mark.parametrize("name", sorted(BASES))
def test_every_option_of_a_layer_acts_or_is_refused(name, observed):
    module, acting = WORKFLOWS[name], set()
    for base in BASES[name]:
        before = observed(module, merge(module.Params, options=base))
        assert before == observed(module, merge(module.Params, options=base))  # only options make a difference
        for key, field in module.Params.model_fields.items():
            found = list(outcomes(name, base, key, field, observed, before))
            assert "acts" in found or (found and "ignored" not in found), (base, key, found)
            acting |= {key} if "acts" in found else set()
    wanted = set(module.Params.model_fields)
    if issubclass(module.Params, StagedParams):  # those of the layer do what they do in shear-gouge
        wanted -= set(LayerParams.model_fields)
    assert wanted <= acting, wanted - acting


REFUSED = [
    ({}, "width", "7"),
    ({}, "corner_radius", "0.05"),
    ({}, "side_half_width", "0.01"),
    ({"shape": "angular", "breakable": True}, "side_half_width", "0.01"),
    ({"shape": "angular", "dim": "3"}, "side_half_width", "0.01"),
    ({"shape": "angular"}, "face_flatness", "50"),
    ({}, "pieces", "7"),
    ({"shape": "angular"}, "bond_strength", "20"),
    ({"shape": "angular"}, "weibull_modulus", "5"),
    ({"effects": [RATE_AND_STATE]}, "friction", "0.5"),
    ({"effects": [RATE_AND_STATE]}, "tangential_ratio", "0.5"),
    ({"effects": [HERTZ]}, "stiffness_number", "1000"),
    ({"effects": [DASHPOT]}, "restitution", "0.5"),
    ({"target_error": "0.05"}, "step_safety", "0.4"),
]


@pytest.mark.parametrize(("base", "key", "value"), REFUSED)
def test_an_option_without_effect_is_refused_even_at_its_default(base, key, value):
    params = merge(shear_gouge.Params, options=base | {key: value})
    with pytest.raises(lsm.InputError, match=rf"^{option_name(key)} [\d.]+: has no effect .*; leave it out$"):
        shear_gouge.check(params)


REFUSED_ELSEWHERE = [
    ("compare-shapes", {}, "width", "7"),
    ("energy-conservation", {}, "chamfers", "11"),
    ("energy-conservation", {"dim": "3"}, "missed_seam", "1e-4"),
    ("energy-conservation", {"dim": "3"}, "order_grains", "225"),
    ("accuracy-cost", {"long_strain": "0"}, "long_runs", "6"),
    ("accuracy-cost", {"long_shapes": ""}, "long_strain", "33"),
]


@pytest.mark.parametrize(("name", "base", "key", "value"), REFUSED_ELSEWHERE)
def test_other_experiments_refuse_what_has_no_effect(name, base, key, value):
    module = WORKFLOWS[name]
    with pytest.raises(lsm.InputError, match=rf"^{option_name(key)} \S+: has no effect .*; leave it out$"):
        module.check(merge(module.Params, options=base | {key: value}))


IDLE = [("shear-gouge", *case) for case in REFUSED] + REFUSED_ELSEWHERE


@pytest.mark.parametrize(("name", "base", "key", "value"), IDLE)
def test_an_option_without_effect_is_called_that_also_with_a_value_that_is_not_allowed(name, base, key, value):
    """The allowed range would only lead to a second refusal."""
    field = WORKFLOWS[name].Params.model_fields[key]
    least = next(getattr(rule, bound) for rule in field.metadata for bound in ("ge", "gt") if hasattr(rule, bound))
    for wrong in (str(least - 1), "many"):
        with pytest.raises(ParameterError) as refused:
            merge(WORKFLOWS[name].Params, options=base | {key: wrong})
        (problem,) = refused.value.problems
        assert re.fullmatch(rf"{option_name(key)} {re.escape(wrong)}: has no effect .*; leave it out", problem)


def test_a_range_is_told_where_the_reason_would_rest_on_a_wrong_value():
    with pytest.raises(ParameterError, match=r"--width 3: must be a number, from 4 to 10000\."):
        merge(shear_gouge.Params, options={"width": "3", "dim": "4"})


@pytest.mark.parametrize(
    ("name", "base", "key", "value"),
    [
        ("shear-gouge", {"target_error": "0.05"}, "strain", "0.5"),
        ("energy-conservation", {"dim": "3", "seed": "2147482900"}, "order_seeds", "900"),
        ("accuracy-cost", {"long_shapes": ""}, "long_strain", "1.5"),
    ],
)
def test_no_rule_between_options_is_about_one_without_effect(name, base, key, value):
    params = merge(WORKFLOWS[name].Params, options=base | {key: value})
    with pytest.raises(lsm.InputError, match=rf"^{option_name(key)} {value}: has no effect .*; leave it out$"):
        WORKFLOWS[name].check(params)


def test_values_of_a_preset_do_not_count_as_given():
    assert "stiffness_number" in shear_gouge.Params.presets["reference"]
    params = merge(shear_gouge.Params, "reference", options={"effects": [HERTZ]})
    shear_gouge.check(params)
    assert "stiffness_number" in params.idle() and "stiffness_number" not in params.given


def read_in(path, names):
    """Those of the names that a module reads as attributes outside its class Params."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    tree.body = [node for node in tree.body if not (isinstance(node, ast.ClassDef) and node.name == "Params")]
    return {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)} & set(names)


@pytest.mark.parametrize("name", sorted(set(WORKFLOWS) - set(BASES)))
def test_every_option_of_the_other_workflows_is_read_by_their_own_modules(name):
    """Beyond what all share: the file of the experiment, and its folder."""
    module, names = WORKFLOWS[name], WORKFLOWS[name].Params.model_fields
    root = Path(workflows.__file__).parent
    own = [Path(module.__file__)]
    for value in vars(module).values():
        if isinstance(value, types.ModuleType | types.FunctionType):
            home = (value.__name__ if isinstance(value, types.ModuleType) else value.__module__).split(".")
            if (
                home[0] == "workflows"
                and len(home) > 2 - (home[-1] == "hard")
                and home[1] in ("accuracy", "cell", "crush", "energy", "hard", "gouge")
            ):
                own += sorted((root / home[1]).glob("*.py"))
    unread = set(names) - set().union(*(read_in(path, names) for path in own))
    assert not unread
