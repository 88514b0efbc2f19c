"""Every experiment of several parts goes on with those that are missing, to the same files.

Short form of test_resume.py, which computes: stand-ins take the place of what a part computes.
"""

import signal
from concurrent.futures import Future
from contextlib import contextmanager

import netCDF4
import numpy as np
import pytest

from tests.experiments.test_accuracy_cost import AFTER, DRIFT, DURING, falling
from tests.experiments.test_hard_cases import row
from workflows import accuracy_cost, energy_conservation, hard_cases, shape_roughness
from workflows.cli.main import main
from workflows.common import signals
from workflows.common.discovery import find_workflows
from workflows.common.parameters import merge
from workflows.common.run_folder import is_complete
from workflows.protocol import finished_parts

# Experiments whose runs have checkpoints: test_resume.py, and tests/workflows/common/test_parallel_runs.py for several.
OF_LAYERS = {
    *("shear-gouge", "compare-shapes", "velocity-steps", "slide-hold-slide", "stick-slip", "normal-stress-steps"),
    *("shear-cell", "oedometer"),
}
ONE_SCENE = {"crush-grain"}  # of all grains at once, which is made anew
TIMED = {"seconds"}  # variables that no two runs share


class Parts:
    """Counts the parts that are made, and stops the experiment before it makes one too many."""

    def __init__(self):
        self.made, self.most = [], None

    def __call__(self, name, result):
        if len(self.made) == self.most:
            raise signals.Interrupted(signal.SIGTERM)
        self.made.append(name)
        return result


class Here:
    """Stands in for a pool of processes."""

    def submit(self, function, *arguments):
        future = Future()
        try:
            future.set_result(function(*arguments))
        except signals.Interrupted as stop:
            future.set_exception(stop)
        return future


@contextmanager
def no_processes(count):
    yield Here()


def of_energy(patch, parts):
    def measure_scheme(params, scheme, *_):
        rows, energies = [], {"time": np.linspace(0.0, 1.0, 12) / 3.0, "shadow_correction": np.zeros(12)}
        for run in energy_conservation.runs_of(params, scheme):
            drift = 0.1 / run.steps_per_contact**2
            rows.append({"scheme": scheme, **run._asdict(), "drift": drift, "shadow_drift": 0.1 * drift})
        return parts(scheme, (rows, energies | {name: np.full(12, len(scheme)) for name in energy_conservation.TERMS}))

    patch.setattr(energy_conservation, "measure_scheme", measure_scheme)


def of_hard_cases(patch, parts):
    cases = {kind: [case.name for case in hard_cases.cases_of(kind)] for kind in hard_cases.modules()}

    def run_kind(kind, precision, *_):
        return parts(f"{kind} {precision}", [row(name, precision, 1.0 / 3.0, "passed", kind) for name in cases[kind]])

    patch.setattr(hard_cases, "run_kind", run_kind)


def of_roughness(patch, parts):
    def in_process(function, params, kind, elements, *_):
        return parts(f"{kind} {elements}", dict.fromkeys(shape_roughness.FRICTION, 1.0 / elements) | {"cost": elements})

    circle = np.stack([np.cos(np.linspace(0, 6.28, 50)), np.sin(np.linspace(0, 6.28, 50))], axis=1)
    patch.setattr(shape_roughness, "in_fresh_process", in_process)
    patch.setattr(shape_roughness, "shapes_of", lambda params, kind, elements: ([], 0.1 / elements, 0.01))
    patch.setattr(shape_roughness, "example_outlines", lambda params: (circle, circle))


def of_accuracy(patch, parts):
    numerical = falling("explicit_euler", DRIFT, 0.1)
    for scheme, power in (("symplectic_euler", 1.0), ("velocity_verlet", 2.0), ("onset_verlet", 2.0)):
        numerical += falling(scheme, DRIFT, power)
    numerical += falling("symplectic_euler", DURING, 1.0) + falling("velocity_verlet", AFTER, 2.0)
    numerical += falling("onset_verlet", AFTER, 4.0) + falling("forest_ruth", AFTER, 2.0)
    patch.setattr(accuracy_cost, "numerical", lambda params, report: parts("numerical", numerical))
    patch.setattr(
        accuracy_cost, "of_shapes", lambda params, report: parts("shapes", falling("patches", "shape error", 1))
    )
    patch.setattr(accuracy_cost, "physical", lambda params, out, report: ([], []))  # of layers, which have checkpoints


STAND_INS = {
    "energy-conservation": of_energy,
    "hard-cases": of_hard_cases,
    "shape-roughness": of_roughness,
    "accuracy-cost": of_accuracy,
}


def variables(folder):
    """Bytes of all variables of all files in a folder, but for times."""
    found = {}
    for path in sorted(folder.glob("*.nc")):
        with netCDF4.Dataset(path) as file:
            file.set_auto_mask(False)
            for name, variable in file.variables.items():
                values = np.asarray(variable[...])
                found[path.name, name] = values.tolist() if values.dtype == object else values.tobytes()
    return {key: values for key, values in found.items() if key[1] not in TIMED}


@pytest.mark.parametrize("name", sorted(find_workflows().keys() - OF_LAYERS - ONE_SCENE))
def test_a_run_that_goes_on_makes_the_missing_parts_alone(name, tmp_path, monkeypatch, capsys):
    module, parts = find_workflows()[name], Parts()
    monkeypatch.setattr(finished_parts, "fresh_processes", no_processes)
    for picture in (name for name in vars(module) if name.startswith("plot_")):  # they take longer than all the rest
        monkeypatch.setattr(module, picture, lambda *_: None)
    STAND_INS[name](monkeypatch, parts)
    params = merge(module.Params, "smoke")
    module.run(params, tmp_path / "whole")
    every, parts.made, parts.most = parts.made, [], 1
    assert len(every) > 1
    with pytest.raises(signals.Interrupted):
        module.run(params, tmp_path / "stopped")
    assert parts.made == every[:1] and not is_complete(tmp_path / "stopped")
    parts.most = None
    module.run(params, tmp_path / "stopped", existing="resume")
    assert parts.made == every  # each once
    assert variables(tmp_path / "stopped") == variables(tmp_path / "whole") != {}
    before = {path: path.read_bytes() for path in (tmp_path / "stopped").iterdir()}
    assert main(["resume", str(tmp_path / "stopped"), "--format", "svg"]) == 2  # nothing is left to go on with
    assert "is complete, and nothing is left of it" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in (tmp_path / "stopped").iterdir()} == before
    assert {path.name for path in (tmp_path / "stopped").iterdir()} == {p.name for p in (tmp_path / "whole").iterdir()}
