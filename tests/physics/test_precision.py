"""Single precision: geometry and forces in f32 meet the same laws, in a test process of their own."""

import os
import subprocess
import sys
from pathlib import Path

from taichi_lsm.effects import find_effects
from taichi_lsm.effects.base import ON_CONTACTS

ROOT = Path(__file__).resolve().parents[2]
FILES = (
    "laws/test_every_law.py",
    "contact/test_chain_contact.py",
    "physics/test_conservation.py",
    "effects/test_rate_and_state_friction.py",
)
CHOICE = "(test_contract and -0-) or least_separation or momenta or twenty_decades"


def test_key_tests_pass_in_f32():
    command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "-k", CHOICE]
    command += [str(ROOT / "tests" / file) for file in FILES]
    environment = os.environ | {"LSM_TEST_PRECISION": "f32"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:]
    effects = sum(effect.phase in ON_CONTACTS for effect in find_effects().values())
    assert f"\n{2 * effects + 5} passed" in done.stdout
