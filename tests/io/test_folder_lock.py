"""The lock of a folder: against another process, against this one, after a kill, and in a race."""

import errno
import fcntl
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import taichi_lsm as lsm
from taichi_lsm.io.folder_lock import NAME, holder_of, locked

ROOT = Path(__file__).resolve().parents[2]
HOLD = """
import sys
from taichi_lsm.io.folder_lock import locked
with locked(sys.argv[1]):
    print("held", flush=True)
    sys.stdin.read()
"""


def start(folder):
    """A process that holds the lock until its input ends."""
    command = [sys.executable, "-c", HOLD, str(folder)]
    pipe = subprocess.PIPE
    process = subprocess.Popen(command, cwd=ROOT, stdin=pipe, stdout=pipe, stderr=pipe, text=True)
    assert process.stdout.readline() == "held\n", process.communicate()[1]
    return process


def check_refused(folder, message):
    with pytest.raises(lsm.InputError, match=message), locked(folder):
        pass


def test_a_second_process_is_refused_and_told_the_first(tmp_path):
    process = start(tmp_path)
    check_refused(tmp_path, rf"{tmp_path}: is in use by process {process.pid} on .*; wait")
    assert holder_of(tmp_path).startswith(f"process {process.pid} on ")
    process.communicate()
    assert holder_of(tmp_path) is None
    assert process.returncode == 0 and not os.listdir(tmp_path)
    with locked(tmp_path):
        assert os.listdir(tmp_path) == [NAME]
    assert not os.listdir(tmp_path)


def test_a_killed_process_holds_nothing(tmp_path):
    process = start(tmp_path)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert os.listdir(tmp_path) == [NAME] and holder_of(tmp_path) is None
    with locked(tmp_path):
        assert f"process {os.getpid()} on" in (tmp_path / NAME).read_text()
    assert not os.listdir(tmp_path)


def test_a_look_at_the_lock_makes_no_run_fail(tmp_path, monkeypatch):
    """Nor does it need the right to write, which locks of network file systems ask for."""
    (tmp_path / NAME).write_text("process 1 on gone\n")
    looking = threading.Event()

    def look():
        while not looking.is_set():
            holder_of(tmp_path)

    thread = threading.Thread(target=look)
    thread.start()
    for _ in range(100):
        with locked(tmp_path):
            pass
        (tmp_path / NAME).write_text("process 1 on gone\n")
    looking.set()
    thread.join()
    flock = fcntl.flock

    def of_network(file, how):
        if how & fcntl.LOCK_EX:
            raise OSError(errno.EBADF, "Bad file descriptor")
        flock(file, how)

    monkeypatch.setattr(fcntl, "flock", of_network)
    assert holder_of(tmp_path) is None


def test_the_same_process_is_refused_too_and_an_error_releases(tmp_path):
    def refused_then_failing():
        with locked(tmp_path):
            check_refused(tmp_path, f"is in use by process {os.getpid()} on")
            raise KeyError

    with pytest.raises(KeyError):
        refused_then_failing()
    with locked(str(tmp_path)):
        pass


def test_a_lock_of_a_removed_file_is_no_lock(tmp_path, monkeypatch):
    """The former holder removes the file between our opening and our locking it."""
    flock, removed = fcntl.flock, []

    def slow(file, how):
        if not removed:
            removed.append(1)
            os.unlink(tmp_path / NAME)
        flock(file, how)

    monkeypatch.setattr(fcntl, "flock", slow)
    with locked(tmp_path):
        assert (tmp_path / NAME).exists()
        check_refused(tmp_path, "is in use by process")


def test_folders_that_cannot_be_locked_are_refused(tmp_path, monkeypatch):
    check_refused(tmp_path / "none", r"none: cannot be locked \(No such file or directory\), must be")

    def none(file, how):
        raise OSError(errno.ENOSYS, "Function not implemented")

    monkeypatch.setattr(fcntl, "flock", none)
    with pytest.warns(UserWarning, match=r"has no locks \(Function not implemented\)"), locked(tmp_path):
        assert holder_of(tmp_path).startswith(f"process {os.getpid()} on ")
