"""Partial slip at constant normal force against the closed forms of Mindlin and Deresiewicz (1953)."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.runtime import ti
from taichi_lsm.effects import contact_type
from tests.helpers import scenes
from tests.helpers.scenes import tolerance

MU, E, NU = 0.4, 1.0e6, 0.3
RADIUS, DEPTH = 0.5, 1.0e-3
STEPS = 500  # of a leg of a path
NORMAL = 4 / 3 * E / (2 * (1 - NU**2)) * np.sqrt(RADIUS) * DEPTH**1.5
LIMIT = MU * NORMAL
SHEAR = E / (2 * (1 + NU))
A = np.sqrt(RADIUS * DEPTH)
K_T = 4 * SHEAR * A / (2 - NU)
FULL = 1.5 * LIMIT / K_T  # [m]: displacement at which the whole contact slips
COUNT = 64


@ti.data_oriented
class Path:
    """COUNT contacts that each follow a path of slip; normal forces may change on the way."""

    def __init__(self, dim):
        effect = lsm.effects.Mindlin(MU, E, NU)
        self.effect, self.dim, self.contact_type = effect.bound(), dim, contact_type(dim, [effect])
        self.size = effect.history_size(dim)
        self.normal = ti.Vector.field(dim, ti.f64, COUNT)
        self.memory = ti.Vector.field(self.size, ti.f64, COUNT)
        self.slip, self.force = (ti.Vector.field(dim, ti.f64, COUNT) for _ in range(2))
        self.lost = ti.field(ti.f64, COUNT)

    @ti.kernel
    def step(self, depth: ti.f64, normal_force: ti.f64):
        for c in range(COUNT):
            contact = self.contact_type(0)
            contact.touching, contact.depth, contact.normal_force = 1, depth, normal_force
            contact.reduced_radius, contact.dt = RADIUS, 1.0
            contact.normal, contact.slip = self.normal[c], self.slip[c]
            memory = ti.Vector([self.memory[c][i] for i in range(self.size)])
            self.lost[c] = self.effect.on_contact(contact, memory)
            for i in ti.static(range(self.size)):
                self.memory[c][i] = memory[i]
            self.force[c] = contact.tangential_force

    def begin(self, normal):
        self.normal.from_numpy(np.ascontiguousarray(normal))
        self.memory.fill(0.0)

    def move(self, slip, depth=DEPTH, normal_force=NORMAL):
        """(tangential force on the second grain (COUNT, dim) [N], dissipated (COUNT,) [J]) after a step of slip [m]."""
        self.slip.from_numpy(np.ascontiguousarray(np.broadcast_to(slip, (COUNT, self.dim))))
        self.step(depth, normal_force)
        return self.force.to_numpy(), self.lost.to_numpy()


@pytest.fixture(scope="module")
def paths(runtime):
    return {dim: Path(dim) for dim in (2, 3)}


def displacement(f):
    """[FULL] of the first loading to the force f [LIMIT]."""
    return 1 - (1 - f) ** (2 / 3)


def force(u):
    """[LIMIT] of the first loading to a displacement u [FULL]."""
    return 1 - np.maximum(1 - u, 0) ** 1.5


def directions(dim):
    """Random unit normals and tangents (COUNT, dim)."""
    rng = np.random.default_rng(dim)
    n, t = rng.standard_normal((2, COUNT, dim))
    n /= np.linalg.norm(n, axis=1)[:, None]
    t -= np.sum(n * t, axis=1)[:, None] * n
    return n, t / np.linalg.norm(t, axis=1)[:, None]


def follow(path, legs, direction):
    """(u (legs * STEPS, COUNT) [FULL], force [LIMIT], dissipated [LIMIT FULL]) along legs (COUNT,) [FULL] of slip."""
    u, f, lost = [np.zeros(COUNT)], [], []
    for leg in legs:
        for _ in range(STEPS):
            out = path.move(leg[:, None] / STEPS * FULL * direction)
            u.append(u[-1] + leg / STEPS)
            f.append(-np.sum(out[0] * direction, axis=1) / LIMIT)
            lost.append(out[1] / (LIMIT * FULL))
    return np.array(u[1:]), np.array(f), np.array(lost)


@pytest.mark.parametrize("dim", [2, 3])
def test_loading_unloading_and_reloading(paths, dim):
    """Loaded to f1, unloaded to f2, reloaded to f1, and on until all slips: each leg has a closed form."""
    n, t = directions(dim)
    rng = np.random.default_rng(7)
    f1 = np.linspace(0.15, 0.97, COUNT)
    f2 = np.where(np.arange(COUNT) % 2, -f1, f1 * rng.uniform(-0.9, 0.7, COUNT))
    there, back = displacement(f1), 2 * displacement((f1 - f2) / 2)
    paths[dim].begin(n)
    legs = [there, -back, back, 1.3 - there]
    u, f, lost = (x.reshape(4, STEPS, COUNT) for x in follow(paths[dim], legs, t))
    exact = np.empty_like(f)
    exact[0] = force(u[0])
    exact[1] = f1 - 2 * force((there - u[1]) / 2)
    exact[2] = f2 + 2 * force((u[2] - (there - back)) / 2)
    exact[3] = force(u[3])
    assert np.abs(f - exact).max() < tolerance(1e-3, 5e-3)
    assert np.abs(f[3, -1] - 1).max() < tolerance(1e-9)
    p = np.cbrt(1 - f1)
    area = 1.8 * (2 - NU) * LIMIT**2 / (SHEAR * A) * (1 - p**5 - 5 / 6 * f1 * (1 + p**2)) / (LIMIT * FULL)
    full = f2 == -f1
    assert full.sum() > COUNT // 3
    assert lost[1:3].sum(axis=(0, 1))[full] == pytest.approx(area[full], rel=0.01)
    if dim == 3:
        assert np.abs(np.sum(paths[3].force.to_numpy() * n, axis=1)).max() < tolerance(1e-12) * LIMIT


def test_small_oscillations_do_not_stiffen_the_unloading(paths):
    """A turning point inside the loop is forgotten again when its own small loop closes."""
    n, t = directions(2)
    f1 = np.linspace(0.3, 0.97, COUNT)
    there, back = displacement(f1), 2 * displacement(f1)
    top = there * (1 + 0.5 / 400)  # farthest that the oscillations get
    paths[2].begin(n)
    u, worst = 0.0, 0.0
    for leg in (there, -back):
        for _ in range(400):
            for share in (1.5, -1.0, 0.7, -0.7, 0.5):  # in sum one; reversals of reversals too
                out, _ = paths[2].move(share / 400 * leg[:, None] * FULL * t)
                u = u + share / 400 * leg
                if share == 1.5:  # it has just left the loops
                    exact = force(u) if leg is there else force(top) - 2 * force((top - u) / 2)
                    worst = max(worst, np.abs(-np.sum(out * t, axis=1) / LIMIT - exact).max())
    assert u == pytest.approx(-there)
    assert worst < tolerance(1e-4, 5e-3)


def test_no_cycle_of_normal_and_tangential_load_yields_energy(paths):
    """Loaded deep and slipped forth, slipped back at less depth: without a fall of the force this is an engine."""
    n, t = directions(3)
    reach = np.linspace(0.01, 1.2, COUNT)[:, None] * FULL * t
    paths[3].begin(n)
    work, before, path_work = 0.0, np.zeros((COUNT, 3)), 0.0
    for _ in range(20):
        for share, normal in ((1.0, 1.0), (-1.0, 0.3)):
            for _ in range(50):
                out, _ = paths[3].move(share / 50 * reach, DEPTH * normal ** (2 / 3), NORMAL * normal)
                done = -0.5 * np.sum((before + out) * share / 50 * reach, axis=1)
                work, before, path_work = work + done, out, path_work + np.abs(done)
    assert np.all(work > 0.05 * path_work)


def test_force_turns_into_the_line_of_a_new_slip(paths):
    n, t = directions(3)
    across = np.cross(n, t)
    paths[3].begin(n)
    for direction in (t, across):
        for _ in range(300):
            out, _ = paths[3].move(0.05 * FULL * direction)
            assert np.linalg.norm(out, axis=1).max() < LIMIT * (1 + tolerance(1e-12))
        assert np.abs(out + LIMIT * direction).max() < 1e-3 * LIMIT


def test_refusals():
    for arguments in ((-0.1, E, NU), (MU, 0.0, NU), (MU, E, 0.6), (MU, E, -1.0), (np.nan, E, NU)):
        with pytest.raises(lsm.InputError, match="Mindlin"):
            lsm.effects.Mindlin(*arguments)
    for others in ([lsm.LinearElastic(1.0)], [lsm.effects.Hertz(2 * E, NU)], []):
        with pytest.raises(lsm.InputError, match="those of Hertz"):
            scenes.scene(np.zeros((1, 3)), [*others, lsm.effects.Mindlin(MU, E, NU)])
    with pytest.raises(lsm.InputError, match="those of Hertz, which the scene must list too"):
        scenes.scene(np.zeros((1, 3)), [lsm.effects.Mindlin(MU, E, NU)])
    with pytest.raises(lsm.InputError, match=r"of friction, one may be listed"):
        scenes.scene(
            np.zeros((1, 3)), [lsm.effects.Hertz(E, NU), lsm.effects.Mindlin(MU, E, NU), lsm.CoulombFriction(MU, 1.0)]
        )
