"""What every workflow must offer, whatever it computes; a new file is tested without being named here."""

import inspect
import itertools
import math
import pickle
import re
import tomllib
from pathlib import Path

import pytest

import taichi_lsm as lsm
import workflows
from taichi_lsm.core.errors import InputError
from tests.helpers.processes import run_python
from workflows import hard
from workflows.common import fresh_processes, parallel_runs
from workflows.common.discovery import find_workflows
from workflows.common.former_names import FORMER
from workflows.common.parameter_coordinates import UNITS
from workflows.common.parameter_types import choices
from workflows.common.parameters import Params, merge, to_toml
from workflows.common.run_cost import RunCost

WORKFLOWS = find_workflows()
PRESETS = ("smoke", "demo", "standard", "reference")
# A number needs its unit; seeds and counts of threads are counts, and names have none.
UNIT = re.compile(r"\[(1|[^\[\]]+)\]$")
# In place of a unit: files call these "1".
MEASURES = ("mean diameters", "equivalent diameters", "diameters", "contact durations", "tiles", "t_i")


@pytest.fixture(params=sorted(WORKFLOWS))
def module(request):
    return WORKFLOWS[request.param]


def test_the_experiments_are_there():
    files = {path.stem.replace("_", "-") for path in Path(workflows.__file__).parent.glob("[!_]*.py")}
    assert files == set(WORKFLOWS)  # nothing but experiments lies at the top


def test_the_module_and_its_functions_are_documented(module):
    assert module.__doc__ and module.Params.__doc__ and module.run.__doc__


def test_run_takes_parameters_a_folder_a_progress_and_whether_it_may_overwrite(module):
    signature = inspect.signature(module.run)
    assert list(signature.parameters) == ["params", "out", "progress", "existing"]
    assert signature.parameters["progress"].default is None
    assert signature.parameters["existing"].default == "refuse"


@pytest.fixture
def begins_only(monkeypatch):
    """Experiments end where they would make a simulation or a process."""
    monkeypatch.setattr(lsm, "Simulation", None)
    monkeypatch.setattr(parallel_runs, "carry_out", None)
    monkeypatch.setattr(fresh_processes.multiprocessing, "get_context", None)


def test_run_removes_what_former_runs_left_if_it_may_overwrite(module, tmp_path, begins_only):
    for name in ("config.toml", "stopped.nc", "run.pdf", "notes.txt"):
        (tmp_path / name).write_text("old")
    with pytest.raises(TypeError):
        module.run(merge(module.Params, "smoke"), tmp_path, existing="overwrite")
    assert {path.name for path in tmp_path.iterdir()} == {"config.toml", "notes.txt"}
    assert tomllib.loads((tmp_path / "config.toml").read_text())


def test_run_refuses_a_folder_that_is_not_empty(module, tmp_path, begins_only):
    """Before anything is made: Python users lose no results by repeating a line."""
    (tmp_path / "run.nc").write_text("results")
    with pytest.raises(InputError, match=rf"^out {tmp_path}: is not empty, .* unless existing='overwrite' is given\.$"):
        module.run(merge(module.Params, "smoke"), tmp_path)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["results"]


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_gives_valid_parameters(module, preset):
    assert set(module.Params.presets) == set(PRESETS)
    params = merge(module.Params, preset)
    assert params.preset_name == preset
    assert merge(module.Params, preset, options=tomllib.loads(to_toml(params))) == params
    assert pickle.loads(pickle.dumps(params)) == params


def test_parameters_need_nothing_from_the_user(module):
    """Without any option every parameter has its default, but for those of the standard preset."""
    params, standard = merge(module.Params), module.Params.presets["standard"]
    for name, field in module.Params.model_fields.items():
        assert getattr(params, name) == standard.get(name, field.default), name
    assert all(hasattr(params, name) for name in Params.model_fields)  # an option, or fixed


def names_of(module):
    """Parameters of a workflow and the choices of their values; the kinds of hard cases are files."""
    fields = module.Params.model_fields
    return {*fields, *(name for field in fields.values() for name in choices(field.annotation)), *hard.modules()}


def test_former_names_are_gone_and_what_they_are_called_now_is_there():
    found = set().union(*map(names_of, WORKFLOWS.values()))
    assert set(FORMER.values()) <= found and not set(FORMER) & found


def test_what_can_be_refused_before_a_run_is_refused_by_its_check(module):
    assert list(inspect.signature(module.check).parameters) == ["params"]


def test_what_a_run_takes_is_foreseen_for_every_preset(module):
    assert list(inspect.signature(module.estimate).parameters) == ["params"]
    costs = [module.estimate(merge(module.Params, preset)) for preset in PRESETS]
    for cost in costs:
        numbers = (cost.steps, cost.seconds, cost.memory)
        assert isinstance(cost, RunCost) and all(0.0 < number < math.inf for number in numbers)
    assert all(less.seconds <= more.seconds for less, more in itertools.pairwise(costs))  # in the order of PRESETS


def test_every_number_is_described_with_its_unit(module):
    for name, field in module.Params.model_fields.items():
        assert field.description, name
        if name not in Params.model_fields and re.search(r"\b(int|float)\b", str(field.annotation)):
            unit = UNIT.search(field.description)
            assert unit, f"{name}: {field.description!r} ends with no [unit]"
            assert unit[1] in (*UNITS, "1", *MEASURES), f"{name}: files would have the unit 1 for {unit[1]!r}"


IMPORT_ALL = """
import importlib, sys
for name in sys.argv[1:]:
    importlib.import_module(name)
    loaded = {"taichi", "matplotlib", "xarray"} & set(sys.modules)
    assert not loaded, f"{name} loads {loaded}"
"""


def test_importing_a_workflow_loads_no_taichi():
    """Help, checks of parameters and `lsm list` must answer at once."""
    run_python("-c", IMPORT_ALL, *(module.__name__ for module in WORKFLOWS.values()))
