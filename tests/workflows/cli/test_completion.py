"""`lsm completion`: the script names all commands and options, and bash completes with it."""

import shutil
import subprocess

import pytest

from workflows.cli.main import build_app, main
from workflows.cli.options import options_of
from workflows.common.discovery import find_workflows

# What bash does when Tab is pressed after these words.
PRESS_TAB = """
source "$1"
shift
COMP_WORDS=("$@")
COMP_CWORD=$(($# - 1))
_lsm 2>/dev/null
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    path = tmp_path_factory.mktemp("completion") / "lsm.bash"
    found = {"stick-slip": find_workflows()["stick-slip"]}
    path.write_text(build_app(found, to_complete=True).generate_completion(shell="bash"))
    return path


def completed(script, *words):
    done = subprocess.run(["bash", "-c", PRESS_TAB, "bash", script, *words], capture_output=True, text=True, check=True)
    return done.stdout.split()


@pytest.mark.validate  # takes seconds for each shell
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_names_all_commands_and_options(capsys, shell):
    found = find_workflows()
    assert main(["completion", shell]) == 0
    text = capsys.readouterr().out
    commands = [name for name in build_app(found) if not name.startswith("-")]
    assert set(found) < set(commands) and {"info", "report", "init", "doctor", "completion"} < set(commands)
    assert all(name in text for name in commands)
    for module in found.values():
        for option in options_of(module):
            assert option in text or f"-l {option[2:]}" in text, option
    if shutil.which(shell):
        subprocess.run([shell, "-n"], input=text, text=True, check=True)


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_bash_completes_commands_options_choices_and_files(script):
    assert completed(script, "lsm", "st") == ["stick-slip"]
    assert completed(script, "lsm", "stick-slip", "--normal-str") == ["--normal-stress"]
    assert completed(script, "lsm", "stick-slip", "--shape", "an") == ["angular"]
    assert completed(script, "lsm", "stick-slip", "--preset", "") == ["smoke", "demo", "standard", "reference"]
    assert str(script) in completed(script, "lsm", "stick-slip", "--config", f"{script.parent}/")
    assert completed(script, "lsm", "init", "sh") == []


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_a_flag_takes_no_value(script):
    """So that the word after it is not skipped."""
    assert completed(script, "lsm", "stick-slip", "--breakable", "--normal-str") == ["--normal-stress"]
    assert " --breakable " not in script.read_text().split("options_with_values='")[1].split("'")[0]


def test_only_shells_that_are_known(capsys):
    assert main(["completion", "csh"]) == 2
    assert "csh" in capsys.readouterr().err
