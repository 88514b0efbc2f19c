"""One Taichi per process: started once, refused with other settings, never for nothing."""

import subprocess
import sys
from pathlib import Path

import pytest

import taichi_lsm as lsm
from taichi_lsm.core.runtime import current, start, ti
from tests.helpers.scenes import PRECISION

ROOT = Path(__file__).resolve().parents[2]


def test_second_start_with_the_same_settings_changes_nothing(runtime):
    assert start("cpu", PRECISION, 1) is runtime is current()


@pytest.mark.parametrize("settings", [{"threads": 2}, {"precision": "f32"}, {"arch": "gpu"}])
def test_second_start_with_other_settings_is_refused(runtime, settings):
    wanted = {"arch": "cpu", "precision": PRECISION, "threads": 1} | settings
    if wanted["precision"] == PRECISION and settings == {"precision": PRECISION}:
        wanted["precision"] = "f64"
    with pytest.raises(lsm.InputError, match="already runs"):
        start(**wanted)
    assert current() is runtime


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"arch": "tpu"}, r"arch 'tpu': allowed are cpu \| gpu"),
        ({"precision": "f16"}, r"precision 'f16': allowed are f64 \| f32"),
        ({"threads": 0}, "threads 0: must be at least 1"),
    ],
)
def test_unknown_settings_are_refused(settings, message):
    with pytest.raises(lsm.InputError, match=message):
        start(**settings)


def test_a_machine_without_a_gpu_says_so(monkeypatch):
    """In place of the search through all drivers, which ends the process where there is none."""
    monkeypatch.setattr(ti._lib.core, "with_cuda", lambda: False)
    monkeypatch.setattr(ti._lib.core, "with_amdgpu", lambda: False)
    with pytest.raises(lsm.InputError, match=r"arch 'gpu': this machine has no GPU .* must be cpu"):
        lsm.check_arch("gpu")
    monkeypatch.setattr(ti._lib.core, "with_cuda", lambda: True)
    lsm.check_arch("gpu")
    lsm.check_arch("cpu")


def test_precision_decides_the_type_of_contact_geometry(runtime):
    assert runtime.real == (ti.f64 if PRECISION == "f64" else ti.f32)


def test_start_prints_nothing():
    """The standard output of a program belongs to the program."""
    code = "from taichi_lsm.core.runtime import start; start(threads=2); start(threads=2)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout == ""
