"""Effects that a scene does not list cost it nothing: without their files the kernels and the bits are the same."""

import shutil
from pathlib import Path

import taichi_lsm
from tests.helpers.processes import run_python

PACKAGE = Path(taichi_lsm.__file__).parent
USED = {"__init__", "base", "linear_elastic", "coulomb_friction", "viscous_damping", "tangential_spring", "restitution"}
SCENE = """
import hashlib
import numpy as np
import taichi_lsm as lsm
from taichi_lsm.effects import find_effects

assert len(find_effects()) COUNT
rng = np.random.default_rng(0)
scene = lsm.Scene(
    dim=2, lengths=(6.0, 6.0), periodic=(True, True), shapes=[lsm.disc()], shape_index=np.zeros(36, int),
    position=np.stack(np.divmod(np.arange(36), 6), axis=1) + 0.5 + rng.uniform(-0.1, 0.1, (36, 2)),
    diameter=np.ones(36),
    density=1000.0, velocity=rng.normal(size=(36, 2)),
    effects=[lsm.LinearElastic(1e5), lsm.ViscousDamping(restitution=0.5), lsm.CoulombFriction(0.5, 5e4)],
)
sim = lsm.Simulation(scene)
sim.run(300)
print(hashlib.sha256(sim.state.position.to_numpy().tobytes()).hexdigest())
from taichi_lsm.core.runtime import ti
ti.reset()
"""


def compiled(root, count, cache):
    """(digest of the run of the package under `root`, names of the kernels in its cache after it)."""
    digest = run_python("-c", SCENE.replace("COUNT", count), root=root, TI_OFFLINE_CACHE_FILE_PATH=str(cache))
    return digest, sorted(file.name for file in cache.rglob("*") if file.suffix in (".tic", ".ll", ".bc"))


def test_a_scene_pays_nothing_for_effects_it_does_not_list(tmp_path):
    """The package without their files finds every kernel in the cache that the whole package has left."""
    bare = tmp_path / "bare"
    shutil.copytree(PACKAGE, bare / "taichi_lsm", ignore=shutil.ignore_patterns("__pycache__"))
    for file in (bare / "taichi_lsm" / "effects").glob("*.py"):
        if file.stem not in USED:
            file.unlink()
    whole = compiled(PACKAGE.parent, f">= {len(USED) + 1}", tmp_path / "cache")
    bare_run = compiled(bare, "== 3", tmp_path / "cache")
    assert len(whole[1]) > 5
    assert whole == bare_run
