"""`lsm doctor`: what is found, what it is called, and the exit code."""

import io
import os
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from workflows.cli.main import main
from workflows.doctor import machine, packages, trials
from workflows.doctor.finding import Finding

ROOT = Path(__file__).resolve().parents[3]


def states(findings):
    return {finding.name: finding.state for finding in findings}


@pytest.fixture
def quiet_trials(monkeypatch):
    """No processes: a step can be made on the CPU, there is no GPU, and nothing is rendered."""
    monkeypatch.setattr(trials, "step", lambda arch: ("this machine has no GPU" if arch == "gpu" else "", 1.0))
    monkeypatch.setattr(trials, "rendering_problem", lambda: "pyvista is not installed; pip install it")


def test_a_machine_that_can_make_runs(quiet_trials, capsys):
    assert main(["doctor"]) == 0
    lines = capsys.readouterr().out.splitlines()
    found = {line[9:28].strip(): line.split()[0] for line in lines if line[:8].strip() in ("ok", "missing", "problem")}
    assert {"Python", "taichi-lsm", "libraries", "cores", "memory", "kernel cache", "disk", "terminal"} <= set(found)
    assert (found["CPU"], found["GPU"], found["3D pictures"]) == ("ok", "missing", "missing")
    assert lines[-1] == "A run can be made."


def test_an_output_that_has_not_all_letters_has_their_numbers(quiet_trials, tmp_path, monkeypatch):
    (tmp_path / "µ").mkdir()
    monkeypatch.chdir(tmp_path / "µ")
    output = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", output)
    assert main(["doctor"]) == 0
    said = output.buffer.getvalue().decode("ascii")
    assert f"free in {tmp_path}/\\xb5" in " ".join(said.split()) and "problem  terminal" in said


def test_a_machine_on_which_no_step_can_be_made(quiet_trials, monkeypatch, capsys):
    monkeypatch.setattr(trials, "step", lambda arch: ("the process was ended by signal 11", 1.0))
    assert main(["doctor"]) == 1
    out = capsys.readouterr().out
    assert "problem  CPU                no step can be made: the process was ended by signal 11" in out
    assert "problem  GPU" in out and out.endswith("No run can be made: CPU.\n")


def test_a_plugin_that_cannot_be_imported_is_told(plugins, quiet_trials, capsys):
    """Which every other command refuses to go on with."""
    (plugins / "broken.py").write_text("class Params: pass\ndef run(): pass\nimport no_such_module\n")
    assert main(["list"]) == 2
    assert "cannot be imported" in capsys.readouterr().err
    assert main(["doctor"]) == 1
    out = " ".join(capsys.readouterr().out.split())
    assert "problem experiments" in out and "broken.py, line 3: cannot be imported" in out and "LSM_PLUGINS" in out


def test_libraries_are_those_of_the_requirements():
    version = metadata.version("numpy")
    lines = ["numpy", "nosuchlibrary>=2", 'numpy<1; extra == "export"', 'taichi-lsm[export]; extra == "calibration"']
    lines += ['xarray; python_version < "3"', 'nosuchextra; extra == "cluster"']
    assert packages.unmet(lines, "") == ["nosuchlibrary: not installed"]
    assert packages.unmet(lines, "export") == packages.unmet(lines, "calibration") == [f"numpy {version}: must be <1"]
    found = list(packages.libraries(lines))
    assert states(found) == {
        "libraries": "problem",
        **dict.fromkeys(("extra cluster", "extra calibration", "extra export"), "missing"),
        "extra decompose": "ok",
    }
    assert [finding.prevents_runs for finding in found] == [True, False, False, False, False]
    assert "pip install 'taichi-lsm[export]'" in found[-1].text
    assert not next(packages.libraries(["numpy"])).prevents_runs


def test_every_extra_of_the_package_is_told_but_that_of_developers():
    extras = set(metadata.metadata("taichi-lsm").get_all("Provides-Extra"))
    assert extras - {"dev"} <= set(packages.EXTRAS)


def test_a_package_that_is_not_installed_is_told(monkeypatch):
    def missing(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(packages.metadata, "metadata", missing)
    assert states(packages.packages()) == {"Python": "ok", "taichi-lsm": "problem"}


def test_the_kernel_cache_is_where_taichi_has_it(tmp_path, monkeypatch):
    monkeypatch.setenv(machine.CACHE, str(tmp_path / "kernels"))
    assert "empty, the first run" in machine.kernel_cache().text
    (tmp_path / "kernels").mkdir()
    (tmp_path / "kernels" / "a.tic").write_bytes(bytes(3_000_000))
    assert machine.kernel_cache() == Finding("kernel cache", "ok", f"{tmp_path / 'kernels'}: 1 kernel, 3 MB")
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(machine.CACHE, str(tmp_path / "file" / "kernels"))
    assert machine.kernel_cache().state == "problem"
    monkeypatch.setenv("TI_OFFLINE_CACHE", "0")
    assert "switched off" in machine.kernel_cache().text
    monkeypatch.delenv(machine.CACHE)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert machine.cache_folder() == tmp_path / "taichi" / "ticache"


def test_a_kernel_cache_in_a_folder_that_may_not_be_searched(tmp_path, monkeypatch):
    """The system answers PermissionError for all that is in it; a superuser is never refused."""
    closed, stat = tmp_path / "closed", os.stat

    def refuse(path, *rest, **more):
        if str(path).startswith(f"{closed}{os.sep}"):
            raise PermissionError(13, "Permission denied")
        return stat(path, *rest, **more)

    closed.mkdir()
    monkeypatch.setenv(machine.CACHE, str(closed / "kernels"))
    monkeypatch.setattr(os, "stat", refuse)
    monkeypatch.setattr(os, "access", lambda path, mode: path != closed)
    found = machine.kernel_cache()
    assert found.state == "problem" and "cannot be written, every run compiles anew" in found.text


def test_little_memory_and_a_full_disk_are_problems(tmp_path, monkeypatch):
    told = tmp_path / "meminfo"
    told.write_text("MemTotal: 8000000 kB\nMemAvailable:  300000 kB\n")
    assert machine.free_memory(told) == 3.072e8 and machine.free_memory(tmp_path / "none") is None
    monkeypatch.setattr(machine, "free_memory", lambda: 3e8)
    assert machine.memory().prevents_runs
    monkeypatch.setattr(machine, "free_memory", lambda: 3e9)
    assert machine.memory().state == "ok" and "3.0 GB free" in machine.memory().text
    usage = machine.shutil.disk_usage(tmp_path)._replace(free=10**8)
    monkeypatch.setattr(machine.shutil, "disk_usage", lambda path: usage)
    assert machine.disk(tmp_path).state == "problem" and "make room" in machine.disk(tmp_path).text


@pytest.mark.parametrize(("name", "value"), [("PYTHONIOENCODING", "ascii"), ("LC_ALL", "xx_YY.UTF-8")])
def test_a_terminal_without_letters_or_locale_is_told(name, value):
    code = "from workflows.doctor.machine import terminal; print(*terminal())"
    environment = {key: text for key, text in os.environ.items() if not key.startswith("LC_")} | {name: value}
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True)
    assert "problem" in done.stdout and "set LANG=C.UTF-8" in done.stdout, done.stderr


@pytest.mark.parametrize(
    ("code", "problem"),
    [
        ("", ""),
        ("import sys; sys.exit('arch gpu: no such thing')", "arch gpu: no such thing"),
        ("import os; os.kill(os.getpid(), 11)", "the process was ended by signal 11"),
        ("import time; time.sleep(60)", "no answer within 0.5 s"),
    ],
)
def test_a_process_that_fails_crashes_or_hangs_is_told(code, problem):
    patience = 0.5 if "sleep" in code else 60.0
    assert trials.step("cpu", code, patience)[0][: len(problem) or None] == problem


@pytest.mark.validate
def test_a_step_is_made_here():
    assert trials.step("cpu")[0] == ""


@pytest.mark.validate
def test_a_step_that_moves_nothing_is_a_problem():
    assert "does not move" in trials.step("cpu", trials.STEP.replace("1.4", "1.6"))[0]
