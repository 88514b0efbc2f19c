"""What the file of a calibration asks for, the sweeps that it makes, and mistakes by name."""

import re
from pathlib import Path

import pytest

from taichi_lsm import data_path
from taichi_lsm.core.errors import InputError
from workflows.calibrate.study import identity_of, study_of
from workflows.common.discovery import find_workflows
from workflows.common.parameters import merge
from workflows.sweep.plan import plan_of

FOUND = find_workflows()
FILE = """
experiment = "shear-gouge"
preset = "smoke"
shape = "angular"
seed = 5

[calibrate]
runs = 20
batch = 4
replicas = 2
model_error = {friction_mean = 0.02}
priors.friction = {from = 0.1, to = 0.9}
priors.corner_radius = {from = 0.02, to = 0.2, spacing = "log"}
targets.friction_mean = {value = 0.45, error = 0.01}
"""


@pytest.fixture
def written(tmp_path):
    """written(text, name): the path of a file."""

    def write(text, name="study.toml"):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return write


def test_a_study_has_what_its_file_says(written):
    study = study_of(written(FILE), FOUND)
    assert study.experiment == "shear-gouge" and study.base.preset_name == "smoke"
    problem = study.problem
    assert (problem.points, problem.batch, problem.replicas) == (10, 4, 2)
    assert problem.metrics == ("friction_mean",) and problem.targets[0].model_error == 0.02
    assert study.base.friction == pytest.approx(0.5) and study.base.corner_radius == pytest.approx(0.0632, rel=1e-3)


def test_every_run_has_a_seed_of_its_own(written):
    """And is one that `lsm sweep` makes alone."""
    study = study_of(written(FILE), FOUND)
    points = [{"friction": 0.2, "corner_radius": 0.1}, {"friction": 0.3, "corner_radius": 0.05}]
    plan = plan_of(written(study.sweep_of(points, 6), "sweep.toml"), FOUND)
    assert [run.params.seed for run in plan.runs] == [11, 12, 13, 14]
    assert [run.params.friction for run in plan.runs] == [0.2, 0.2, 0.3, 0.3]
    assert all(run.params.shape == "angular" and run.params.preset_name == "smoke" for run in plan.runs)


def test_the_file_serves_a_single_run_too(written):
    params = merge(FOUND["shear-gouge"].Params, None, written(FILE), None, "shear-gouge", {})
    assert params.shape == "angular"
    assert any("the table [calibrate] was not taken: it is for lsm calibrate" in note for note in params.notes)


def test_runs_depend_on_all_but_targets_and_budget(written):
    same = FILE.replace("0.45", "0.5").replace("runs = 20", "runs = 30")
    other = FILE.replace("from = 0.1", "from = 0.2")
    first, second, third = (identity_of(written(text, f"{i}.toml")) for i, text in enumerate((FILE, same, other)))
    assert first == second != third


def changed(old, new):
    assert old in FILE
    return FILE.replace(old, new)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[calibrate]", r"study.toml: experiment is missing"),
        (changed("shear-gouge", "shear-gauge"), r"experiment = shear-gauge, must be one of .*Did you mean shear-gouge"),
        ('experiment = "shear-gouge"', r"calibrate is missing, must be a table"),
        ('experiment = "shear-gouge"\ncalibrate = 3', r"calibrate is no table"),
        (changed("batch = 4", "bach = 4"), r"calibrate.bach: unknown, must be one of priors.*Did you mean batch"),
        (changed("runs = 20", "runs = 11"), r"calibrate.runs = 11: must be a whole number from 12 to"),
        (changed("replicas = 2", "replicas = true"), r"calibrate.replicas = True: must be a whole number"),
        (changed("batch = 4", "batch = 0"), r"calibrate.batch = 0: must be"),
        (changed("friction_mean = 0.02", "porosity = 0.02"), r"model_error.porosity: is no target"),
        (changed("targets.friction_mean", "targets.porosity"), r"model_error.friction_mean: is no target"),
        (changed("priors.friction =", "priors.frictio ="), r"study.toml: calibrate.priors.frictio: unknown parameter"),
        (changed('shape = "angular"', 'shape = "round"'), r"--corner-radius .*no effect with --shape round"),
        (changed("seed = 5", "seed = 2147483647"), r"seed = 2147483647: each run has a seed of its own from there on"),
        (changed('shape = "angular"', 'shpe = "angular"'), r"shpe = angular.*unknown parameter. Did you mean shape"),
        (
            FILE + 'laboratory = {file = "lab.csv"}',
            r"study.toml: calibrate.laboratory.columns = None: must be a table",
        ),
    ],
)
def test_mistakes_are_named(written, text, message):
    with pytest.raises(InputError, match=message):
        study_of(written(text), FOUND)


def test_a_metric_has_one_source(written, tmp_path):
    rows = "\n".join(f"{i},{0.4 + 0.01 * (-1) ** i}" for i in range(60))
    (tmp_path / "lab.csv").write_text(f"strain,mu\n{rows}")
    table = """
[calibrate.laboratory]
file = "lab.csv"
steady_from = 1
columns = {shear_strain = {column = "strain"}, friction = {column = "mu"}}
"""
    with pytest.raises(InputError, match=r"targets.friction_mean: is measured by calibrate.laboratory too"):
        study_of(written(FILE + table), FOUND)
    alone = changed("targets.friction_mean = {value = 0.45, error = 0.01}", "") + table
    (target,) = study_of(written(alone), FOUND).problem.targets
    assert target.value == pytest.approx(0.4, abs=1e-3) and 0.0 < target.freedom < 100.0


def test_a_file_that_is_not_there_is_named(written):
    path = written(FILE)
    with pytest.raises(InputError, match=r"stdy.toml: there is no such file. Did you mean study.toml"):
        study_of(path.with_name("stdy.toml"), FOUND)


def test_the_examples_of_the_page_are_right(written, tmp_path):
    """Its blocks: a calibration, the table of a laboratory for the same file, and a sweep for a sensitivity."""
    page = (Path(__file__).parents[3] / "docs" / "calibration.md").read_text(encoding="utf-8")
    calibration, laboratory, sensitivity = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    problem = study_of(written(calibration), FOUND).problem
    assert [prior.name for prior in problem.priors] == ["friction", "corner_radius", "restitution"]
    assert problem.metrics == ("friction_mean", "porosity") and (problem.points, problem.batch) == (60, 8)
    rows = "\n".join(f"{0.03 * i},2.0,{2.0 + 0.1 * (-1) ** i},5.0" for i in range(200))
    (tmp_path / "lab.csv").write_text(f"disp_mm,h,tau,sigma_n\n{rows}")
    alone = re.sub(r"targets\.friction_mean.*\n", "", calibration)
    targets = study_of(written(alone + laboratory), FOUND).problem.targets
    assert targets[0].metric == "friction_mean" and targets[0].value == pytest.approx(0.4, abs=1e-3)
    plan = plan_of(written(sensitivity), FOUND)
    assert len(plan.runs) == 32 * (3 + 2) * 3 and all(run.params is not None for run in plan.runs)


def test_the_shipped_calibration_is_right():
    study = study_of(data_path("knuth2007_rods.toml"), FOUND)
    assert study.base.preset_name == "smoke" and study.base.shape == "round"
    (target,) = study.problem.targets
    assert (target.value, target.error, target.model_error) == (0.23, 0.01, 0.02)
