"""Each bound can be exceeded: without the drive, integrator, shape or guard that a case rests on, it fails.

`make test` tries this with most guards and one energy balance, `make validate` with the rest.
"""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers import scenes
from workflows.hard import Bench, cases_of, driven, error_of_impact, outlines, solids

GUARDS = {  # and the case that shows what each is for
    "step": "step_above_critical",
    "displacement": "crossing_in_one_step",
    "energy": "lost_balance",
    "overlap": "deeper_than_the_limit",
    "wall": "through_a_wall",
    "platen": "through_a_platen",
    "finite": "not_a_number",
}
SOLID_STEPS = 200_000  # at most, of one impact of polyhedra


def case_of(module, name):
    """The hard case of this name."""
    return next(case for case in cases_of(module) if case.name == name)


@pytest.fixture
def without(bench):
    """without(*guards): the bench with these guards switched off in all scenes."""

    def switch_off(*guards):
        bench.off = dict.fromkeys(guards)
        return bench

    yield switch_off
    bench.off = {}


QUICK = [pytest.param(g, marks=[pytest.mark.validate] * (g in ("energy", "displacement"))) for g in GUARDS]


@pytest.mark.parametrize("guard", QUICK)
def test_without_its_guard_a_case_fails(without, guard):
    case = case_of("steps", GUARDS[guard])
    assert case.run(without(guard)) > 2.0 * case.bound_in(scenes.PRECISION)


def test_every_guard_is_switched_off_in_a_test():
    assert set(GUARDS) == set(lsm.Guards.__dataclass_fields__)


@pytest.mark.validate
def test_a_crowd_without_the_guard_of_the_step_blows_up(without):
    case = case_of("steps", "step_of_a_pair_in_a_crowd")
    assert case.run(without("step", "displacement", "energy", "overlap")) == np.inf


class OtherIntegrator(Bench):
    """Runs the scenes with another integrator."""

    def __init__(self, precision, integrator):
        super().__init__(precision)
        self.integrator = integrator

    def simulate(self, scene):
        scene.integrator = self.integrator
        return super().simulate(scene)


@pytest.mark.validate
@pytest.mark.parametrize(
    ("name", "integrator"),
    [
        ("friction_of_ten", lsm.ExplicitEuler),
        ("elastic_impacts", lsm.VelocityVerlet),  # which makes an error wherever a contact begins
    ],
)
def test_a_lesser_integrator_exceeds_the_bound(runtime, name, integrator):
    case = case_of("effects", name)
    assert case.run(OtherIntegrator(scenes.PRECISION, integrator)) > 1.5 * case.bound


@pytest.mark.validate
def test_a_layer_that_is_sheared_exceeds_the_bounds_of_one_at_rest(bench):
    bound = case_of("driven", "creep_of_the_thickness").bound_in(scenes.PRECISION)
    sim = driven.at_rest(bench)
    before = driven.height(sim)
    sim.platens.set("bottom", 0, lsm.ConstantVelocity(1e-3))
    sim.run(10_000)
    assert abs(driven.height(sim) - before) > 10 * bound
    assert driven.height(driven.at_rest(bench)) == before


@pytest.mark.validate
def test_without_the_dissipated_energy_a_broken_chain_exceeds_the_bound_of_the_balance(bench):
    sim = bench.simulate(driven.chain())
    begin = lsm.energies(sim).balance
    sim.run(1000)
    now = lsm.energies(sim)
    assert abs((now.balance - now.dissipated) / begin - 1.0) > 10 * case_of("driven", "chain_that_snaps").bound


@pytest.mark.validate
def test_a_seam_that_jumps_costs_energy(bench):
    """Patches that do not join."""
    shapes = lsm.shapes.random_angular_shapes(2, 1)
    scene = outlines.impact(shapes, (0.3, 2.0), height=0.7, angular_velocity=(15.0, 12.0))
    smooth = error_of_impact(bench, scene)
    for shape in scene.shapes:
        centre = shape.parts[0].centre.copy()
        centre[::2] *= 1.01
        object.__setattr__(shape.parts[0], "centre", centre)
    assert error_of_impact(bench, scene) > max(1e-3, 10.0 * smooth)


@pytest.mark.validate
def test_features_that_do_not_join_cost_energy(bench):
    """Faces moved by a hundredth of the size."""
    rng, shapes = np.random.default_rng(1), lsm.shapes.random_angular_polyhedra(4, 1)
    orientations = rng.normal(size=(3, 2, 4))
    orientations /= np.linalg.norm(orientations, axis=2)[..., None]

    def worst_error():
        aim = {"offset": (0.2, 0.1), "angular_velocity": np.full((2, 3), 20.0)}
        return max(error_of_impact(bench, solids.impact(shapes, q, **aim), SOLID_STEPS) for q in orientations)

    smooth = worst_error()
    for shape in shapes:
        centre = shape.feature_centre.copy()
        centre[: shape.face_count] *= 1.01
        object.__setattr__(shape, "feature_centre", centre)
    assert worst_error() > max(1e-3, 10.0 * smooth)
