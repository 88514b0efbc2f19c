"""The contract of an effect, checked on every effect that `find_effects` discovers, plugins included."""

import dataclasses
import inspect
import re

import numpy as np
import pytest

from taichi_lsm.core.errors import InputError
from taichi_lsm.effects import HistoryValue, effect_name, find_effects
from taichi_lsm.effects.base import ON_CONTACTS, OPTIONAL, PHASES
from tests.helpers.effect_bench import COUNT, axial_size, bench_of
from tests.helpers.scenes import KEY_PRECISIONS, tolerance

pytestmark = pytest.mark.usefixtures("runtime")

EFFECTS = find_effects()
CASES = [
    (cls, i, dim)
    for cls in EFFECTS.values()
    if cls.phase in ON_CONTACTS
    for i in range(len(cls.cases()))
    for dim in (2, 3)
]
IN_F32 = (
    "linear_elastic",
    "viscous_damping",
    "coulomb_friction",
)  # what every gouge lists; the others compile for long


def is_long(name, i, dim, precision):
    """Whether a case is left to `make validate`: the quick tier has one dimension of each, and both of IN_F32."""
    if precision != KEY_PRECISIONS[0]:
        return name not in IN_F32 or dim == 2
    return name not in IN_F32 and (i + dim) % 2 == 0


RUNS = [
    pytest.param(
        precision,
        cls,
        i,
        dim,
        id=f"{effect_name(cls)}-{i}-{dim}D-{precision}",
        marks=[pytest.mark.validate] * is_long(effect_name(cls), i, dim, precision),
    )
    for precision in KEY_PRECISIONS
    for cls, i, dim in CASES
    if precision == KEY_PRECISIONS[0] or i == 0
]
# Velocities of a thousand contacts, with elastic forces from this spring: [N m-1], [s], [m]
SPRING, DT, DEPTH = 1.0e3, 1.0e-3, 1.0e-2


def random_contacts(rng, dim, touching=1):
    """Inputs of COUNT contacts in random directions, with the force of an elastic effect already there."""
    normal = rng.standard_normal((COUNT, dim))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    slip = rng.standard_normal((COUNT, dim)) * 0.05
    slip -= np.sum(slip * normal, axis=1)[:, None] * normal
    change = rng.standard_normal((COUNT, dim)) * 0.01 if dim == 3 else np.zeros((COUNT, dim))  # none in 2D
    change -= np.sum(change * normal, axis=1)[:, None] * normal
    depth = DEPTH * rng.random(COUNT) * touching
    return {
        "normal": normal,
        "slip": slip,
        "normal_change": change,
        "depth": depth,
        "approach": rng.standard_normal(COUNT),
        "gap": 0.0 if touching else 100.0 * DEPTH,
        "normal_angular_velocity": rng.standard_normal(COUNT) if dim == 3 else 0.0,
        "relative_angular_velocity": rng.standard_normal((COUNT, axial_size(dim))),
        "reduced_radius": rng.uniform(0.1, 1.0, COUNT),
        "rolling_radius": rng.uniform(0.1, 1.0, COUNT),
        "mass": 10 ** rng.uniform(-1, 1, COUNT),
        "footprint": np.linspace(0.02, 0.2, COUNT) * touching,
        "dt": DT,
        "normal_force": SPRING * depth,
        "stiffness": SPRING,
        "touching": touching,
    }


def rotations(rng, dim):
    """COUNT random proper rotations (COUNT, dim, dim)."""
    q, r = np.linalg.qr(rng.standard_normal((COUNT, dim, dim)))
    q *= np.sign(np.einsum("cii->ci", r))[:, None, :]
    q[:, :, 0] *= np.sign(np.linalg.det(q))[:, None]
    return q


def two_steps(bench, inputs):
    """Outputs of the second of two steps from an empty history: forces that depend on the past are tested too."""
    return bench(history=bench(**inputs)["history"], **inputs)


def check_normal_force_is_the_slope_of_the_energy(bench, inputs):
    h = tolerance(1e-6, 1e-2) * DEPTH
    depth = inputs["depth"] + 0.01 * DEPTH
    force = bench(**inputs | {"depth": depth, "normal_force": 0.0})["normal_force"]
    high, low = (bench(**inputs | {"depth": depth + s * h, "normal_force": 0.0})["energy"] for s in (1, -1))
    assert np.all(force > 0) or bench.reaches
    rounding = tolerance(1e-9, 1e-3) * force.max()
    assert (high - low) / (2 * h) == pytest.approx(force, rel=tolerance(1e-7, 1e-2), abs=rounding)


def check_a_parted_contact_is_cleared(bench, rng, dim):
    gone = random_contacts(rng, dim, touching=0)
    held = rng.standard_normal((COUNT, max(1, bench.size))) * DEPTH
    if dim == 3 and bench.size >= 3:  # first a vector in the contact plane
        held[:, :3] -= np.sum(held[:, :3] * gone["normal"], axis=1)[:, None] * gone["normal"]
    out = bench(history=held, **gone)
    for name in ("normal_force", "tangential_force", "contact_moment"):
        assert np.all(out[name] == 0.0), name
    if bench.size:
        assert np.all(out["history"] == 0.0)
    assert np.all(np.isfinite(out["lost"]))
    if bench.has_energy and bench.size:  # without motion, what is dissipated is what was held
        still = {"slip": 0.0, "approach": 0.0, "normal_angular_velocity": 0.0, "relative_angular_velocity": 0.0}
        stored = bench.stored(held, **gone)
        assert np.all(stored > 0)
        lost = bench(history=held, **gone | still)["lost"]
        assert lost == pytest.approx(stored, rel=tolerance(1e-9))


def smooth(rng, steps, harmonics=4):
    """COUNT smooth random signals over `steps` steps, of size 1."""
    phase = 2 * np.pi * np.arange(steps)[:, None, None] / steps
    order = np.arange(1, harmonics + 1)
    amplitude = rng.standard_normal((COUNT, harmonics)) / order
    return np.sum(amplitude * np.sin(phase * order + rng.uniform(0, 2 * np.pi, (COUNT, harmonics))), axis=2)


def check_closed_histories_create_no_energy(bench, rng, dim, dissipates):
    """From the first touch to the parting of smooth random contacts: every step dissipates just the work it takes."""
    steps = 200
    base = random_contacts(rng, dim) | {"normal_angular_velocity": 0.0}
    depth = DEPTH * (1.0 + 0.15 * smooth(rng, steps)) * np.sin(np.pi * np.linspace(0, 1, steps))[:, None]
    depth = np.maximum(depth, 0.0)
    depth[-1] = 0.0
    # the slip of a step stays below 0.1 of what the friction spring can take, else a step is no small part of a cycle
    tangent = rng.standard_normal((2, COUNT, dim))
    tangent -= np.einsum("scd,cd->sc", tangent, base["normal"])[..., None] * base["normal"]
    slip = np.einsum("tsc,scd->tcd", np.stack([smooth(rng, steps), smooth(rng, steps)], axis=1), tangent)
    slip *= 16 * DEPTH / (steps * DT) * np.sin(np.pi * np.linspace(0, 1, steps))[:, None, None]
    history, before = None, np.zeros(COUNT)
    force_n, force_t, contact_moment = np.zeros(COUNT), np.zeros((COUNT, dim)), np.zeros((COUNT, axial_size(dim)))
    normal = base["normal"]
    angular_velocity = slip if dim == 3 else (normal[:, :1] * slip[..., 1:] - normal[:, 1:] * slip[..., :1])
    spent, work_size = np.zeros(COUNT), np.zeros(COUNT)
    for t in range(steps):
        approach = (depth[t] - (depth[t - 1] if t else 0.0)) / DT
        inputs = base | {"approach": approach, "slip": slip[t], "depth": depth[t], "touching": depth[t] > 0}
        inputs["relative_angular_velocity"] = angular_velocity[t]
        out = bench(history=history, **inputs | {"normal_force": SPRING * depth[t]})
        work = 0.5 * (force_n + out["normal_force"]) * approach * DT
        work -= 0.5 * np.sum((force_t + out["tangential_force"]) * slip[t], axis=1) * DT
        work -= 0.5 * np.sum((contact_moment + out["contact_moment"]) * angular_velocity[t], axis=1) * DT
        work_size += np.abs(work)
        spent += out["lost"]
        stored = out["energy"] if bench.has_energy else np.zeros(COUNT)
        scale = tolerance(1e-12, 1e-5) * (SPRING * DEPTH**2 + np.abs(work) + np.abs(stored))
        assert np.all(np.abs(work - out["lost"] - (stored - before)) < scale)
        before, force_n, force_t, history = stored, out["normal_force"], out["tangential_force"], out["history"]
        contact_moment = out["contact_moment"]
    assert np.all(before == 0.0)
    assert np.all(spent >= -tolerance(1e-12, 1e-4) * work_size)
    if not dissipates:
        assert np.all(spent == 0.0)
    elif work_size.max() > 1e-6 * SPRING * DEPTH**2:  # not an effect that its case turns off
        assert (spent > 0.01 * work_size).mean() > 0.9


def check_reaction_is_opposite(bench, inputs):
    swapped = inputs | {name: -inputs[name] for name in ("normal", "slip", "normal_change")}
    swapped["relative_angular_velocity"] = -1.0 * np.asarray(inputs["relative_angular_velocity"])
    swapped["normal_angular_velocity"] = -1.0 * np.asarray(inputs["normal_angular_velocity"])
    first, second = two_steps(bench, inputs), two_steps(bench, swapped)
    for name in ("normal_force", "lost", "energy"):
        assert np.array_equal(first[name], second[name]), name
    for name in ("tangential_force", "contact_moment"):
        assert np.array_equal(first[name], -second[name]), name


def check_force_turns_with_the_frame(bench, inputs, rotation):
    vectors = ("normal", "slip", "normal_change")
    vectors += ("relative_angular_velocity",) if rotation.shape[1] == 3 else ()
    rotated = inputs | {n: np.einsum("cij,cj->ci", rotation, inputs[n]) for n in vectors}
    first, second = two_steps(bench, inputs), two_steps(bench, rotated)
    for name in ("normal_force", "lost", "energy"):
        scale = np.abs(first[name]).max()
        assert second[name] == pytest.approx(first[name], rel=tolerance(1e-11), abs=tolerance(1e-13, 1e-5) * scale), (
            name
        )
    for name in ("tangential_force", "contact_moment"):
        expected = first[name] if first[name].shape[1] == 1 else np.einsum("cij,cj->ci", rotation, first[name])
        rounding = tolerance(1e-12, 1e-5) * np.abs(expected).max()
        assert second[name] == pytest.approx(expected, rel=tolerance(1e-10), abs=rounding), name


def check_nothing_is_finite(bench, inputs):
    """A contact with no overlap, no motion and no past has no force and no energy, and is a number."""
    for depth in (0.0, DEPTH):
        still = inputs | {"depth": depth, "approach": 0.0, "slip": 0.0, "relative_angular_velocity": 0.0}
        still["normal_force"] = SPRING * depth
        out = bench(**still)
        assert all(np.all(np.isfinite(values)) for values in out.values())
        assert all(np.all(out[name] == 0.0) for name in ("tangential_force", "contact_moment", "lost"))
        nowhere = bench(**still | {"normal": 0.0 * inputs["normal"]})  # of coincident centres, which have none
        assert all(np.all(np.isfinite(values)) for values in nowhere.values())
        if depth == 0.0 and not bench.reaches:
            assert np.all(out["normal_force"] == 0.0) and np.all(out["energy"] == 0.0)


def check_contract(cls, i, dim):
    """All of the above for one case of an effect."""
    bench, effect = bench_of(cls, i, dim), cls.cases()[i]
    rng = np.random.default_rng(i)
    inputs = random_contacts(rng, dim)
    if effect.phase == "normal" and bench.has_energy and not effect.history:
        check_normal_force_is_the_slope_of_the_energy(bench, inputs)
    check_a_parted_contact_is_cleared(bench, rng, dim)
    check_reaction_is_opposite(bench, inputs)
    check_force_turns_with_the_frame(bench, inputs, rotations(rng, dim))
    check_nothing_is_finite(bench, inputs)
    if effect.phase in ("damping", "tangential"):
        check_closed_histories_create_no_energy(bench, rng, dim, effect.dissipates)


@pytest.mark.parametrize(("runtime", "cls", "i", "dim"), RUNS, indirect=["runtime"])
def test_contract(runtime, cls, i, dim):
    check_contract(cls, i, dim)


def check_description(name, cls):
    """What `lsm list --effects` and the documentation need to know."""
    assert cls.phase in PHASES and set(cls.needs) <= set(OPTIONAL)
    assert len(inspect.getdoc(cls)) > 60 and "=" in cls.equation
    assert len(cls.cases()) >= 1 and all(isinstance(case, cls) for case in cls.cases())
    assert set(cls.units) == {field.name for field in dataclasses.fields(cls)} and all(cls.units.values())
    for case in cls.cases():
        assert case.name == name == effect_name(cls)
        assert all(np.all(np.isfinite(np.asarray(v, float))) for v in case.parameters().values())
        for value in case.history:
            assert isinstance(value, HistoryValue) and value.name.isidentifier()
            assert value.units and len(value.long_name) > 10


@pytest.mark.parametrize("name", EFFECTS)
def test_effect_describes_itself(name):
    check_description(name, EFFECTS[name])


@pytest.mark.parametrize("name", EFFECTS)
def test_printed_effect_is_the_call_that_makes_it(name):
    """Its parameters and nothing else, also of the copy whose parameters live in Taichi fields."""
    for case in EFFECTS[name].cases():
        assert repr(case) == repr(case.bound())
        assert eval(repr(case), {type(case).__name__: type(case), "inf": np.inf}) == case
        assert {word.split("=")[0] for word in re.findall(r"\w+=", repr(case))} == set(case.units)


@pytest.mark.parametrize("name", EFFECTS)
def test_parameters_that_are_no_numbers_are_refused(name):
    """Text, nothing and lists where a number belongs: an InputError that names the effect, never a traceback."""
    cls = EFFECTS[name]
    good = {field.name: getattr(cls.cases()[0], field.name) for field in dataclasses.fields(cls)}
    for field in dataclasses.fields(cls):
        for wrong in ("fast", [1.0], np.nan, True):
            with pytest.raises(InputError, match=rf"{cls.__name__}\."):
                cls(**good | {field.name: wrong})
