"""The documents say what is there: links, commands, equations, the example."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

from workflows.cli.discovery import find_workflows

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
PAGES += sorted(ROOT.glob("docs/**/*.md"))
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
CALL = re.compile(r"`(?:\.venv/bin/)?lsm ([^`]+)`|^ +(?:\.venv/bin/)?lsm (.+)$", re.MULTILINE)
PATH = re.compile(r"`((?:taichi_lsm|workflows|tests|benchmarks|data)/[\w./-]*)`")
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
        assert words[0] in {*found, "list", "info"}, match[0]
        options = {word[2:].replace("-", "_") for word in words if word.startswith("--")}
        known = {"out", "config", "preset", "overwrite", "quiet", "help"}
        known |= {"effects"} if words[0] == "list" else set()
        if words[0] in found:
            known |= set(found[words[0]].Params.model_fields)
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


def test_decisions_are_listed():
    index = (ROOT / "docs" / "decisions" / "README.md").read_text(encoding="utf-8")
    for path in (ROOT / "docs" / "decisions").glob("[0-9]*.md"):
        assert f"({path.name})" in index


def test_example_of_the_readme_runs(tmp_path):
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    compile(code, "README.md", "exec")
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{code}"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert re.search(r"^friction 0\.\d\d \+- 0\.\d\d$", done.stdout, re.MULTILINE), done.stdout
    assert (tmp_path / "out" / "small" / "run.nc").exists()
