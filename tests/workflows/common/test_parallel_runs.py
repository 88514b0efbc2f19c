"""Runs side by side, each in its own process."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from taichi_lsm.core.errors import InputError
from workflows.common.parallel_runs import ReplicaError, run_replicas
from workflows.common.toml_writer import to_toml

ROOT = Path(__file__).parents[3]


def test_every_run_has_a_one_thread_process_of_its_own(toy, tmp_path, monkeypatch, capfd):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    reports = []
    jobs = [(f"run-{seed}", "workflows.toy_run", toy.Params(seed=seed), tmp_path / f"r{seed}") for seed in (1, 2, 3)]
    assert run_replicas(jobs, progress=reports.append) == [tmp_path / f"r{seed}" for seed in (1, 2, 3)]
    processes = [(tmp_path / f"r{seed}/process").read_text().split() for seed in (1, 2, 3)]
    assert len({pid for pid, _ in processes} | {str(os.getpid())}) == 4
    assert {threads for _, threads in processes} == {"1"}
    assert "OMP_NUM_THREADS" not in os.environ
    of_one = [r for r in reports if r["label"] == "run-1"]
    assert [r.get("state") for r in of_one] == ["started", None, "done"]
    assert of_one[1]["strain"] == 0.5
    assert "noise" not in capfd.readouterr().out


def test_complete_runs_of_the_same_parameters_are_not_repeated(toy, tmp_path):
    params = {seed: toy.Params(seed=seed) for seed in (1, 2, 3)}
    jobs = [(f"run-{seed}", "workflows.toy_run", of_run, tmp_path / f"r{seed}") for seed, of_run in params.items()]
    run_replicas(jobs[:2])
    for seed, of_config in ((1, params[1]), (2, toy.Params(seed=2, grains=700))):  # the second was another run
        (tmp_path / f"r{seed}" / "config.toml").write_text(to_toml(of_config, "toy-run"))
    first = [(tmp_path / f"r{seed}" / "process").read_text() for seed in (1, 2)]
    assert run_replicas(jobs, resume=True) == [tmp_path / f"r{seed}" for seed in (1, 2, 3)]
    second = [(tmp_path / f"r{seed}" / "process").read_text() for seed in (1, 2, 3)]
    assert second[0] == first[0] and second[1] != first[1] and second[2]


def test_a_failure_is_named_and_the_others_go_on(toy, tmp_path):
    acts = ("crash", "kill", "finish")
    jobs = [(act, "workflows.toy_run", toy.Params(act=act), tmp_path / act) for act in acts]
    with pytest.raises(ReplicaError) as caught:
        run_replicas(jobs)
    assert set(caught.value.failures) == {"crash", "kill"}
    assert "KeyError: 'a programming error'" in caught.value.failures["crash"]
    assert "SIGKILL" in caught.value.failures["kill"]
    assert "run crash failed" in str(caught.value)
    assert (tmp_path / "finish/summary.json").exists()


def test_what_all_runs_refuse_is_one_mistake_of_the_user(toy, tmp_path):
    jobs = [
        (f"run-{seed}", "workflows.toy_run", toy.Params(act="reject", seed=seed), tmp_path / "x") for seed in (1, 2)
    ]
    with pytest.raises(InputError) as caught:
        run_replicas(jobs)
    assert str(caught.value) == "grains 600: do not fit"


def test_a_run_that_fails_says_why_without_a_traceback(toy, tmp_path):
    jobs = [(act, "workflows.toy_run", toy.Params(act=act), tmp_path / act) for act in ("diverge", "disk")]
    with pytest.raises(ReplicaError) as caught:
        run_replicas(jobs)
    assert caught.value.failures["diverge"] == "diverged at step 7"
    disk = caught.value.failures["disk"]
    assert disk.startswith("a file could not be read or written") and "No space left" in disk and "\n" not in disk


def test_labels_must_differ(toy, tmp_path):
    job = ("same", "workflows.toy_run", toy.Params(), tmp_path / "x")
    with pytest.raises(ValueError, match="same"):
        run_replicas([job, job])


PARENT = """
import sys, threading
from workflows.common import discovery, parallel_runs, signals
toy = discovery.find_workflows()["toy-run"]
signals.install()
shown = []
jobs = [(name, "workflows.toy_run", toy.Params(act="wait"), name) for name in ("a", "b", "c")]
try:
    parallel_runs.run_replicas(jobs, progress=shown.append)
except signals.Interrupted as interrupted:
    print(threading.active_count(), *sorted(r["label"] + r["state"] for r in shown), flush=True)
    sys.exit(128 + interrupted.signum)
"""


def parent_of_runs(tmp_path):
    """A process that makes three runs which wait, two at a time; in a group of its own, as a terminal starts it."""
    return subprocess.Popen(
        [sys.executable, "-c", PARENT],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


@pytest.mark.parametrize("while_they", ["start", "run"])
def test_ctrl_c_of_a_terminal_ends_all_processes_without_a_word(plugins, tmp_path, while_they):
    """It goes to all of them at once, and comes from the parent as well."""
    if while_they == "start":
        with (plugins / "toy_run.py").open("a") as toy:
            toy.write("import sys\nif 'run_child' in sys.argv[0]:\n")
            toy.write("    Path(f'importing-{os.getpid()}').touch()\n    time.sleep(60)\n")
    signs = "importing-*" if while_they == "start" else "*/ready"
    parent = parent_of_runs(tmp_path)
    wait_until(lambda: len(list(tmp_path.glob(signs))) == 2, parent)
    os.killpg(parent.pid, signal.SIGINT)
    left, problems = parent.communicate(timeout=20)
    assert parent.returncode == 128 + signal.SIGINT
    assert left == "1 astarted bstarted\n" and problems == ""  # threads and reports
    with pytest.raises(ProcessLookupError):  # no process of the group is left
        os.killpg(parent.pid, 0)
    assert len(list(tmp_path.glob("*/flushed"))) == (0 if while_they == "start" else 2)
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize("signum", [signal.SIGTERM, signal.SIGKILL])
def test_the_children_flush_when_their_parent_is_asked_to_end_or_killed(plugins, tmp_path, signum):
    parent = parent_of_runs(tmp_path)
    wait_until(lambda: all((tmp_path / name / "ready").exists() for name in "ab"), parent)
    parent.send_signal(signum)
    parent.communicate(timeout=20)
    assert parent.returncode == (128 + signum if signum == signal.SIGTERM else -signum)
    wait_until(lambda: all((tmp_path / name / "flushed").exists() for name in "ab"))
    assert not (tmp_path / "c").exists()


def wait_until(condition, process=None):
    """Wait for a condition, of a process that must not end before."""
    deadline = time.monotonic() + 20
    while not condition():
        assert (process is None or process.poll() is None) and time.monotonic() < deadline
        time.sleep(0.05)
