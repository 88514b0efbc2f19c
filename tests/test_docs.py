"""The documents describe the code as it is: links, commands, equations, names, the example and the recipes."""

import ast
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image  # comes with matplotlib

import workflows
from taichi_lsm.core.errors import InputError
from taichi_lsm.effects import find_effects
from tests.effects.test_every_effect import check_contract
from tests.helpers.processes import run_python
from workflows import hard
from workflows.common.discovery import find_workflows
from workflows.common.parameters import merge

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
PAGES += sorted(ROOT.glob("docs/**/*.md"))
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
CALL = re.compile(r"`(?:\.venv/bin/)?lsm ([^`]+)`|^ +(?:\.venv/bin/)?lsm (.+)$", re.MULTILINE)
PATH = re.compile(r"`((?:taichi_lsm|workflows|tests|benchmarks|data)/[\w./-]*)`")
PYTEST = re.compile(r"\.venv/bin/python -m pytest ([^`#\n]*)")
# Files that a recipe invents or a command writes.
MADE = ("workflows/my_test.py", "taichi_lsm/effects/stiffening_spring.py", "benchmarks/results.json")


@pytest.fixture(params=PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def page(request):
    return request.param


def test_links_resolve(page):
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        if not re.match(r"https?://", target):
            assert (page.parent / target.split("#")[0]).exists(), target


def test_named_files_exist(page):
    for path in PATH.findall(page.read_text(encoding="utf-8")):
        assert path in MADE or (ROOT / path).exists(), path


def test_commands_exist(page):
    found = find_workflows()
    for match in CALL.finditer(page.read_text(encoding="utf-8")):
        words = (match[1] or match[2]).split()
        if words[0] in ("...", "my-test", "--help", "--version"):
            continue
        others = {"list", "info", "resume", "sweep", "sweep-plot", "calibrate", "sensitivity", "export"}
        others |= {"report", "init", "doctor", "completion", "plot", "animate"}
        assert words[0] in {*found, *others}, match[0]
        options = {word[2:].replace("-", "_") for word in words if word.startswith("--")}
        known = {"out", "config", "preset", "overwrite", "quiet", "strict", "help"}
        known |= {"effects", "presets"} if words[0] == "list" else set()
        known |= {"metric", "against", "colour", "facet", "format"} if words[0] == "sweep-plot" else set()
        known |= {"metric"} if words[0] == "sensitivity" else set()
        known |= {"format", "times", "every"} if words[0] in ("export", "animate") else set()
        known |= {"what", "times", "format"} if words[0] == "plot" else set()
        known |= {"what", "fps"} if words[0] == "animate" else set()
        known |= {"scheduler", "jobs", "retries", "format"} if words[0] == "sweep" else set()
        of_runs = found.values() if words[0] == "resume" else [found[words[0]]] if words[0] in found else []
        known |= {name for module in of_runs for name in module.Params.model_fields}
        assert options <= known, match[0]


def rows_of_equations():
    """(functions with their files, test files) of every row of the tables."""
    text = (ROOT / "docs" / "equations.md").read_text(encoding="utf-8")
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| ") and "`" in line:
            yield cells[0], cells[-2], cells[-1]


def names_defined(path):
    """Functions and classes of a file, methods included."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)}


def test_every_equation_has_a_function_and_a_test():
    numbers = set()
    for label, functions, tests in rows_of_equations():
        pending, found = [], 0
        for name in re.findall(r"`([^`]+)`", functions):
            if name.endswith(".py"):
                assert pending and set(pending) <= names_defined(ROOT / name), f"{label}: {pending} in {name}"
                found, pending = found + len(pending), []
            else:
                pending.append(name)
        assert found and not pending, f"{label}: {functions}"
        files = re.findall(r"`([^`]+)`", tests)
        assert files and all((ROOT / file).exists() for file in files), f"{label}: {tests}"
        numbers |= {int(n) for n in re.findall(r"\d+", label) if re.fullmatch(r"[\d, ]+", label)}
    assert numbers == set(range(1, 25))


def names_of_the_library():
    """Functions, classes and methods of taichi_lsm, as `name` and as `Class.method`."""
    names = set()
    for path in (ROOT / "taichi_lsm").rglob("*.py"):
        names |= names_defined(path)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                names |= {f"{node.name}.{child.name}" for child in node.body if isinstance(child, ast.FunctionDef)}
    return names


def names_in(text):
    """What stands in backticks and is a name or a dotted name."""
    return {name for name in re.findall(r"`([^`]+)`", text) if re.fullmatch(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)?", name)}


def test_names_in_the_step_of_the_architecture_exist():
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    (section,) = re.findall(r"^## A step, read aloud\n(.*?)^## ", text, re.DOTALL | re.MULTILINE)
    named = names_in(section)
    assert len(named) > 20 and any("." in name for name in named)
    assert not named - names_of_the_library()


def test_a_name_that_does_not_exist_is_found():
    text = "`Simulation.run` calls `VelocityVerlet.jump` in `taichi_lsm/simulation.py`, and `leap`"
    assert names_in(text) - names_of_the_library() == {"VelocityVerlet.jump", "leap"}


CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
EFFECT_RECIPE, WORKFLOW_RECIPE = re.findall(r"```python\n(.*?)```", CONTRIBUTING, re.DOTALL)


COLLECT = """
import sys, pytest
for line in sys.argv[1:]:
    status = pytest.main([*line.split(), "--collect-only", "-q", "-n", "0"])
    print(f"{line}: status {int(status)}")
"""


@pytest.mark.validate  # collects all tests
def test_pytest_lines_select_tests():
    """pytest ends with status 5 if it finds none."""
    lines = PYTEST.findall(CONTRIBUTING)
    found = run_python("-c", COLLECT, *lines).splitlines()
    assert lines and all(f"{line}: status 0" in found for line in lines)


@pytest.fixture
def recipes(tmp_path, monkeypatch):
    """The two recipes of CONTRIBUTING.md as plugins; the folder and their names."""
    for folder, name, code in (
        ("effects", "stiffening_spring", EFFECT_RECIPE),
        ("workflows", "my_test", WORKFLOW_RECIPE),
    ):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / f"{name}.py").write_text(code, encoding="utf-8")
    monkeypatch.setenv("LSM_PLUGINS", str(tmp_path))
    before, modules = list(workflows.__path__), set(sys.modules)
    yield tmp_path
    workflows.__path__[:] = before
    for module in set(sys.modules) - modules:
        if module.startswith("workflows."):
            del sys.modules[module]


def test_recipes_are_found(recipes):
    effect = find_effects()["stiffening_spring"]
    assert effect.cases() and effect.equation == "F_n = a d^2"
    with pytest.raises(InputError, match=r"factor = -1.0: must be > 0"):
        effect(factor=-1.0)
    module = find_workflows()["my-test"]
    for preset in ("smoke", "demo", "standard", "reference"):
        assert merge(module.Params, preset).preset_name == preset
        module.check(merge(module.Params, preset))
    with pytest.raises(InputError, match=r"speed 20 m/s: must be <= 16 m/s"):
        module.check(module.Params(speed=20.0))


def test_recipes_have_the_style_of_the_package(recipes):
    for command in (["check"], ["format", "--check"]):
        ruff = [sys.executable, "-m", "ruff", *command, "--config", str(ROOT / "pyproject.toml"), str(recipes)]
        done = subprocess.run(ruff, cwd=ROOT, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.usefixtures("runtime")
def test_recipe_of_an_effect_keeps_the_contract(recipes):
    check_contract(find_effects()["stiffening_spring"], 0, 2)


def test_recipe_of_an_effect_is_one_new_file_of_the_package(tmp_path):
    """In a copy of the package it is found, has its name in the namespace, and the tests of the names and of the
    order of the package pass."""
    for folder in ("data", "taichi_lsm", "workflows", "tests"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    (tmp_path / "taichi_lsm" / "effects" / "stiffening_spring.py").write_text(EFFECT_RECIPE, encoding="utf-8")
    code = "import taichi_lsm as lsm; effect = lsm.effects.find_effects()['stiffening_spring']"
    code += "; print(effect is lsm.effects.StiffeningSpring, 'StiffeningSpring' in dir(lsm.effects), effect.__module__)"
    printed = run_python("-c", code, root=tmp_path).splitlines()[-1]
    assert printed == "True True taichi_lsm.effects.stiffening_spring"
    files = ("tests/test_api.py", "tests/test_architecture.py")
    options = ("-q", "-n", "0", "-k", "test_api or stiffening_spring", "-p", "no:cacheprovider")
    summary = run_python("-m", "pytest", *files, *options, root=tmp_path).splitlines()[-1]
    assert re.match(r"\d\d passed, \d+ deselected", summary), summary


def test_recipe_of_an_experiment_runs(recipes, tmp_path):
    command = [
        sys.executable,
        "-m",
        "workflows.cli.main",
        "my-test",
        "--preset",
        "smoke",
        "--out",
        str(tmp_path / "out"),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    metrics = json.loads((tmp_path / "out" / "summary.json").read_text())["metrics"]
    assert metrics["restitution"]["value"] == pytest.approx(0.5, abs=0.01)
    assert metrics["restitution_error"]["holds"]


def test_cases_of_the_stability_page_are_those_of_the_code():
    """Titles, reasons and measures of all hard cases stand on the page as the code has them, in its order."""
    text = (ROOT / "docs" / "stability.md").read_text(encoding="utf-8")
    kinds = re.findall(r"^### (\w+)$", text, re.MULTILINE)
    assert kinds == [kind.capitalize() for kind in hard.modules()]
    rows = re.findall(r"^\| \*\*(.+?)\.\*\* (.+?) \| (.+?) \| ", text, re.MULTILINE)
    cases = [case for kind in hard.modules() for case in hard.cases_of(kind)]
    assert rows == [(case.title, case.why, case.measure) for case in cases]


def test_decisions_are_listed():
    index = (ROOT / "docs" / "decisions" / "README.md").read_text(encoding="utf-8")
    for path in (ROOT / "docs" / "decisions").glob("[0-9]*.md"):
        assert f"({path.name})" in index


DEMO_ROWS = {"discs": "friction_round", "angular grains": "friction_angular", "difference": "friction_difference"}


def demo_metrics():
    """{row of the README: (mean, standard error, (least, greatest) of the interval)} of the shipped summary."""
    summary = json.loads((ROOT / "docs" / "images" / "friction_summary.json").read_text(encoding="utf-8"))
    assert (summary["workflow"], summary["preset"]) == ("compare-shapes", "demo")  # as `make demo` runs it
    found = {}
    for row, name in DEMO_ROWS.items():
        mean = summary["metrics"].get(f"{name}_mean") or summary["metrics"][name]
        found[row] = (mean["value"], summary["metrics"][f"{name}_se"]["value"], mean["interval"])
    return found


def test_numbers_of_the_readme_are_those_of_the_demo():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for row, (mean, error, (low, high)) in demo_metrics().items():
        assert f"| {row} | {mean:.3f} | {error:.3f} | {low:.3f} to {high:.3f} |" in text


def test_the_picture_of_the_readme_shows_the_numbers_of_the_demo():
    """A PNG says in its description what its legend shows."""
    with Image.open(ROOT / "docs" / "images" / "friction.png") as picture:
        shown = picture.text["Description"]
    demo = demo_metrics()
    rows = {name: demo[name] for name in ("discs", "angular grains")}
    texts = [
        f"{name}: {mean:.3f}, 95 % interval {ends[0]:.3f} to {ends[1]:.3f}" for name, (mean, _, ends) in rows.items()
    ]
    assert shown == "; ".join(texts)


README_OUTPUT = (  # what each Python block of the README prints, in their order
    r"^Energies\(kinetic 6296\.\d+ J, elastic 5831\.\d+ J, .*balance 5\d{4}\.\d+ J\)\n\[ *63245\.\d+ 328741\.\d+\]$",
    r"^friction 0\.\d+ \+- 0\.\d+, 95 % interval 0\.\d+ to 0\.\d+ \(\d\d effective samples\)\n"
    r"solid fraction \[0\.\d+ +0\.\d+ +0\.\d+ +0\.\d+ *\]$",
)
README_BLOCKS = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)


def test_every_example_of_the_readme_is_run():
    assert len(README_BLOCKS) == len(README_OUTPUT)
    assert (ROOT / "README.md").read_text(encoding="utf-8").count("```python") == len(README_BLOCKS)


@pytest.mark.parametrize("number", range(len(README_OUTPUT)))
def test_examples_of_the_readme_run(tmp_path, number):
    code, expected = README_BLOCKS[number], README_OUTPUT[number]
    compile(code, "README.md", "exec")
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{code}"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert re.search(expected, done.stdout, re.MULTILINE), done.stdout
    if "out/small" in code:
        assert (tmp_path / "out" / "small" / "run.nc").exists()
