"""A function in place of a sheared layer: two metrics of two parameters, with scatter between seeds."""

import numpy as np

from workflows.calibrate.priors import Prior
from workflows.calibrate.samples import Sample
from workflows.calibrate.targets import Target

PRIORS = (Prior("friction", 0.1, 0.9), Prior("corner_radius", 0.02, 0.2, log=True))
SCATTER = np.array([0.01, 0.004])
CORRELATED = 0.6  # between the metrics of one run


def means(point):
    """friction_mean and porosity over all seeds."""
    mu, roundness = point["friction"], np.log10(point["corner_radius"] / 0.02)
    return np.array([0.5 * np.tanh(2.5 * mu) - 0.08 * roundness, 0.25 - 0.04 * roundness * mu + 0.01 * mu])


def one_run(point, rng):
    """The metrics of a run."""
    a, b = rng.standard_normal(2)
    friction, porosity = means(point) + SCATTER * [a, CORRELATED * a + np.sqrt(1.0 - CORRELATED**2) * b]
    return Sample(point, {"friction_mean": friction, "porosity": porosity}, units={"porosity": "1"})


def simulator(seed, fails=lambda point: False):
    """What `calibrate` takes for its runs; some fail."""
    rng = np.random.default_rng(seed)

    def simulate(number, points):
        return [Sample(p, note="diverged at step 7") if fails(p) else one_run(p, rng) for p in points()]

    return simulate


def targets_at(point, rng):
    """The metrics of one more run as targets."""
    found = one_run(point, rng).metrics
    return tuple(Target(name, value, None, runs=1) for name, value in found.items())
