"""An elastic gas of angular grains with contacts of Hertz keeps its energy: one radius for each grain, no seams."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes
from tests.stepping.test_onset_correction import hertz_of_the_duration
from workflows import energy_conservation

pytestmark = [
    pytest.mark.validate,
    pytest.mark.skipif(scenes.PRECISION == "f32", reason="the drift is below the rounding of f32"),
]
STEPS, SAMPLES = 5000, 100


def gas(dim, grains, seed, steps_per_contact, integrator=lsm.OnsetVerlet):
    """The gas of `lsm energy-conservation`, with contacts of Hertz that last as long at the closing speed."""
    params = energy_conservation.Params(dim=dim, grains=grains)
    scene = energy_conservation.build(params, grains, seed, steps_per_contact, "onset_verlet")
    mass, closing = scene.masses()[0].mean(), params.speed * np.sqrt(2.0 / dim)  # rms, along one normal
    radius = 0.25 * scene.diameter.mean()  # reduced
    hertz = hertz_of_the_duration(steps_per_contact * scene.dt, closing, 0.5 * mass, radius)
    scene.effects, scene.integrator = [hertz], integrator
    return scene


def drifts(sim, shadow, steps=STEPS):
    """Greatest relative change of the energy, and of the shadow energy, over a run."""
    energies, corrections = [], []
    for _ in range(SAMPLES + 1):
        energies.append(scenes.energy(sim)[0])
        corrections.append(shadow.correction())
        sim.run(steps // SAMPLES)
    energies, total = np.array(energies), np.array(energies) + corrections
    return [float(np.abs(e / e[0] - 1.0).max()) for e in (energies, total)]


@pytest.mark.parametrize(("dim", "grains"), [(2, 900), (3, 216)])
def test_shadow_energy_of_a_gas_of_angular_grains(runtime, dim, grains):
    """900 grains of 30 arcs, 216 of 20 faces: 5000 steps, 50 of them in a contact."""
    sim = scenes.simulate(gas(dim, grains, 1, 50.0))
    energy, shadow = drifts(sim, lsm.ShadowEnergy(sim))
    print(f"{dim}D: energy {energy:.2e}, shadow energy {shadow:.2e}")
    assert shadow < 5e-6
    assert energy < 2e-4  # Verlet's ripple, which comes back
