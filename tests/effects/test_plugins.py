"""An effect in a file of its own, in the folder that LSM_PLUGINS names, is listed, held to the contract and runs."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.effects import find_effects
from tests.effects.test_every_effect import EFFECTS, check_contract, check_description
from tests.helpers import scenes

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.usefixtures("runtime")

PLUGIN = '''"""A spring that stiffens, as a user would write it."""

from dataclasses import dataclass

from taichi_lsm.effects import Effect
from taichi_lsm.core.runtime import ti


@ti.data_oriented
@dataclass
class StiffeningSpring(Effect):
    """F_n = a d^2, energy a d^3/3: which this package does not have."""

    factor: float

    equation = "F_n = a d^2"
    units = {"factor": "N m-2"}

    def parameters(self):
        return {"a": self.factor}

    @ti.func
    def on_contact(self, contact: ti.template(), history: ti.template()):
        contact.normal_force += self.a_[0] * contact.depth * contact.depth
        contact.stiffness += 2.0 * self.a_[0] * contact.depth
        return 0.0

    @ti.func
    def contact_energy(self, contact, history):
        return self.a_[0] * contact.depth ** 3 / SLOPE

    @classmethod
    def cases(cls):
        return [cls(factor=1.0e5)]
'''


def plugin(folder, slope):
    (folder / "effects").mkdir(exist_ok=True)
    (folder / "effects" / "stiffening_spring.py").write_text(PLUGIN.replace("SLOPE", slope))
    found = find_effects()
    assert list(found) == sorted(found) and set(EFFECTS) < set(found)
    return found["stiffening_spring"]


@pytest.mark.validate
def test_plugin_is_discovered_and_held_to_the_contract(tmp_path, monkeypatch):
    monkeypatch.setenv("LSM_PLUGINS", str(tmp_path))
    effect = plugin(tmp_path, "3.0")
    check_contract(effect, 0, 2)
    check_description("stiffening_spring", effect)
    effects = [effect(factor=3.0e4)]
    sim = scenes.simulate(scenes.scene([(0.0, 0.0), (0.9, 0.0)], effects, dt=4e-4, integrator=lsm.VelocityVerlet))
    start, _ = scenes.energy(sim)
    assert start == pytest.approx(3.0e4 * 0.1**3 / 3.0, rel=scenes.tolerance(1e-9))
    sim.run(5000)
    assert np.ptp(sim.state.position.to_numpy()[:, 0]) > 1.0
    assert scenes.energy(sim)[0] == pytest.approx(start, rel=scenes.tolerance(1e-5, 1e-3))
    command = [sys.executable, "-m", "workflows.cli.main", "list", "--effects"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert "stiffening_spring: F_n = a d^2" in listed and "factor [N m-2]" in listed


def test_contract_finds_an_effect_whose_energy_is_wrong(tmp_path, monkeypatch):
    monkeypatch.setenv("LSM_PLUGINS", str(tmp_path))
    with pytest.raises(AssertionError):
        check_contract(plugin(tmp_path, "2.0"), 0, 2)


def test_plugin_that_cannot_be_read_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("LSM_PLUGINS", str(tmp_path))
    (tmp_path / "effects").mkdir()
    (tmp_path / "effects" / "broken.py").write_text("from taichi_lsm import nothing_of_the_kind\n")
    with pytest.raises(lsm.InputError, match=r"plugin .*broken\.py: cannot be imported: cannot import name"):
        find_effects()
