"""Runs a part of the tests in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def run_module(name, *arguments, root=ROOT, **environment):
    """What `python -m name arguments` prints, with the packages under `root`."""
    return run_python("-m", name, *map(str, arguments), root=root, **environment)


def run_python(*arguments, root=ROOT, **environment):
    """What a Python with these arguments prints, with the packages under `root`."""
    more = {"PYTHONPATH": str(root)} | environment
    command = [sys.executable, *arguments]
    done = subprocess.run(command, cwd=root, env=os.environ | more, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout
