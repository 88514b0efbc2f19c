"""Calls in fresh processes, which end with the one that waits for them, however that ends."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from workflows.common import signals
from workflows.common.fresh_processes import fresh_processes

ROOT = Path(__file__).parents[3]


def test_an_interrupted_pool_ends_without_a_word(tmp_path):
    """A terminal sends Ctrl-C to all processes, also while they start; nothing of the pool is left after it."""
    script = tmp_path / "parent.py"
    script.write_text(
        "import multiprocessing, os, pathlib, sys, threading, time\n"
        "if __name__ == '__mp_main__':\n"
        "    pathlib.Path(f'importing-{os.getpid()}').touch()\n"
        "    time.sleep(60)\n"
        "from workflows.common import signals\n"
        "from workflows.common.fresh_processes import fresh_processes\n"
        "if __name__ == '__main__':\n"
        "    signals.install()\n"
        "    try:\n"
        "        with fresh_processes(2) as pool:\n"
        "            waiting = [pool.submit(time.sleep, 60) for _ in range(3)]\n"
        "            waiting[0].result()\n"
        "    except signals.Interrupted as interrupted:\n"
        "        print(threading.active_count(), len(multiprocessing.active_children()))\n"
        "        sys.exit(128 + interrupted.signum)\n"
    )
    parent = subprocess.Popen(
        [sys.executable, str(script)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    wait_until(lambda: len(list(tmp_path.glob("importing-*"))) == 2, parent)
    os.killpg(parent.pid, signal.SIGINT)
    left, problems = parent.communicate(timeout=20)
    assert parent.returncode == 128 + signal.SIGINT
    assert left == "1 0\n" and problems == ""  # threads and processes


def stubborn(folder):
    """Waits, and takes no notice of the first request to end, as a process that starts after it was made."""
    signal.signal(signal.SIGTERM, lambda *_: signal.signal(signal.SIGTERM, signal.SIG_DFL))
    (folder / f"begun-{os.getpid()}").touch()
    time.sleep(60)
    (folder / "waited to the end").touch()


def test_processes_that_a_first_request_did_not_reach_end_with_an_interrupted_pool(tmp_path):
    def interrupted():
        with fresh_processes(2) as pool:
            for _ in range(3):
                pool.submit(stubborn, tmp_path)
            wait_until(lambda: len(list(tmp_path.glob("begun-*"))) == 2)
            raise signals.Interrupted(signal.SIGTERM)

    with pytest.raises(signals.Interrupted):
        interrupted()
    assert multiprocessing.active_children() == []
    assert not (tmp_path / "waited to the end").exists()


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="asks /proc which processes are alive")
def test_a_pool_ends_when_its_parent_is_killed(tmp_path):
    script = tmp_path / "parent.py"
    script.write_text(
        "import os, pathlib, time\n"
        "from workflows.common.fresh_processes import fresh_processes\n"
        "def sleep():\n"
        "    pathlib.Path(f'child-{os.getpid()}').touch()\n"
        "    time.sleep(60)\n"
        "if __name__ == '__main__':\n"
        "    with fresh_processes(2) as pool:\n"
        "        waiting = [pool.submit(sleep) for _ in range(3)]\n"
        "        waiting[0].result()\n"
    )
    parent = subprocess.Popen(
        [sys.executable, str(script)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stderr=subprocess.PIPE,
        text=True,
    )
    wait_until(lambda: len(list(tmp_path.glob("child-*"))) == 2, parent)
    children = [int(path.name.split("-")[1]) for path in tmp_path.glob("child-*")]
    parent.kill()
    _, problems = parent.communicate(timeout=20)  # of all processes that write there
    wait_until(lambda: not any(is_alive(pid) for pid in children))
    assert problems == ""


def wait_until(condition, process=None):
    """Wait for a condition, of a process that must not end before."""
    deadline = time.monotonic() + 20
    while not condition():
        assert (process is None or process.poll() is None) and time.monotonic() < deadline
        time.sleep(0.05)


def is_alive(pid):
    """Whether a process is there and no zombie."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"
