"""Body forces are minus the slope of their energies, for every such effect that `find_effects` discovers."""

import numpy as np
import pytest

from taichi_lsm.core.runtime import ti
from taichi_lsm.effects import find_effects
from tests.helpers.scenes import tolerance

pytestmark = pytest.mark.usefixtures("runtime")

COUNT = 1000
EFFECTS = find_effects()


@ti.data_oriented
class BodyBench:
    """Calls `on_grain` and `grain_energy` of one body force at COUNT places."""

    def __init__(self, effect, dim):
        self.effect, self.dim = effect.bound(), dim
        self.inverse_mass, self.energy = ti.field(ti.f64, COUNT), ti.field(ti.f64, COUNT)
        self.position, self.force = (ti.Vector.field(dim, ti.f64, COUNT) for _ in range(2))

    @ti.kernel
    def launch(self):
        for c in range(COUNT):
            force = 0.0 * self.position[c]
            self.effect.on_grain(self.inverse_mass[c], force)
            self.force[c] = force
            self.energy[c] = self.effect.grain_energy(self.inverse_mass[c], self.position[c])


@pytest.mark.parametrize("name", [n for n, cls in EFFECTS.items() if cls.phase == "body"])
def test_body_force_is_minus_the_slope_of_its_energy(name):
    rng = np.random.default_rng(0)
    for effect in EFFECTS[name].cases():
        dim = next(len(v) for v in effect.parameters().values() if np.size(v) in (2, 3))
        bench = BodyBench(effect, dim)
        position = rng.standard_normal((COUNT, dim))
        bench.inverse_mass.from_numpy(10 ** rng.uniform(-2, 2, COUNT))

        def energy(x, bench=bench):
            bench.position.from_numpy(x)
            bench.launch()
            return bench.energy.to_numpy()

        slope = np.stack([energy(position + s) - energy(position - s) for s in 1e-3 * np.eye(dim)], axis=1) / 2e-3
        force = bench.force.to_numpy()
        assert np.abs(force).max() > 0
        assert np.abs(slope + force).max() < tolerance(1e-9) * np.abs(force).max()
