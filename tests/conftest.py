"""One Taichi per test process, and a few simulations that many tests share: each costs seconds to compile."""

import pytest

from tests import scenes


@pytest.fixture(scope="session")
def runtime():
    """Taichi on one CPU thread, f64 unless LSM_TEST_PRECISION=f32."""
    from taichi_lsm.runtime import start

    return start("cpu", scenes.PRECISION, 1)


@pytest.fixture(scope="session")
def gallery(runtime):
    """gallery(name): a simulation of 48 packed grains, see `scenes.gallery_scene`; `scenes.reload` resets it."""
    made = {}

    def get(name):
        if name not in made:
            made[name] = scenes.simulate(scenes.gallery_scene(name))
        return made[name]

    return get
