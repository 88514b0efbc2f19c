"""Workflows are found by what they define."""

import subprocess
import sys
from pathlib import Path

import pytest

from workflows.common.discovery import DiscoveryError, find_workflows

ROOT = Path(__file__).parents[3]


def test_a_plugin_is_found_under_its_name_with_dashes(plugins):
    (plugins / "shared_code.py").write_text("raise RuntimeError('not a workflow: must not be imported')\n")
    module = find_workflows()["toy-run"]
    assert module.__file__ == str(plugins / "toy_run.py")
    assert not {"cli", "common", "gouge", "shared-code"} & set(find_workflows())


def test_without_plugins_the_toy_is_unknown(plugins, monkeypatch):
    monkeypatch.delenv("LSM_PLUGINS")
    assert "toy-run" not in find_workflows()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("class Params:\n", "line 1: not valid Python"),
        (
            "import no_such_package\nclass Params: pass\ndef run(): pass\n",
            "line 1: cannot be imported: ModuleNotFoundError",
        ),
        ("class Params: pass\ndef run(): pass\n", "Params must be a subclass of"),
    ],
)
def test_a_broken_plugin_is_named(plugins, text, words):
    broken = plugins / "broken_one.py"
    broken.write_text(text)
    with pytest.raises(DiscoveryError) as caught:
        find_workflows()
    assert str(broken) in str(caught.value) and words in str(caught.value)


def test_a_workflow_without_its_hooks_is_named(plugins):
    toy = plugins / "toy_run.py"
    toy.write_text(toy.read_text().replace("def estimate(", "def cost("))
    with pytest.raises(DiscoveryError, match=r"toy_run.py: estimate\(params\) must be defined too"):
        find_workflows()


def test_a_plugin_may_not_take_a_name_of_the_package(plugins):
    (plugins / "common.py").write_text((plugins / "toy_run.py").read_text())
    with pytest.raises(DiscoveryError, match="common is taken"):
        find_workflows()


def test_a_missing_plugin_folder_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("LSM_PLUGINS", str(tmp_path / "nowhere"))
    with pytest.raises(DiscoveryError, match="nowhere: there is no such folder"):
        find_workflows()


def test_finding_imports_neither_taichi_nor_the_plotting(plugins):
    code = (
        "import sys; from workflows.common.discovery import find_workflows; print(*find_workflows());"
        "print(*({'taichi', 'xarray', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    names, heavy = done.stdout.split("\n")[:2]
    assert "toy-run" in names.split(), done.stderr
    assert heavy == ""


def test_a_run_that_lacks_an_argument_is_refused(plugins):
    text = (plugins / "toy_run.py").read_text()
    (plugins / "old_run.py").write_text(text.replace(', existing="refuse"', ""))
    with pytest.raises(DiscoveryError, match=r"old_run.py: run must take params, out, progress, existing, in this"):
        find_workflows()


@pytest.mark.parametrize(
    "text",
    [
        "class Params: 1\ndef run(): 1\nraise SystemExit(3)",
        "class Params: 1\ndef run(): 1\nraise OSError('a\\nb')",
        f"x = {5000 * '('}",
        f"x = {200_000 * '-'}1",
    ],
)
def test_whatever_a_plugin_raises_is_one_line(plugins, text):
    (plugins / "odd.py").write_text(text)
    with pytest.raises(DiscoveryError, match=r"odd\.py.*: (cannot be|not valid Python)") as caught:
        find_workflows()
    assert "\n" not in str(caught.value)
