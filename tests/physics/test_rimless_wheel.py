"""Grains that roll from side to side against the rimless wheel, and grains that come to rest on a side.

A rigid wheel without a rim pivots about the end of a spoke, from the middle of which a side is d_a away, until the end
of the next one, d_b away, strikes the floor. Its angular momentum about that end is kept, so that the angular velocity
falls in the ratio (I + m (h^2 - d_a d_b))/(I + m (h^2 + d_b^2)), h the height of the centre over the side.

    python -m pytest -m validate -s tests/physics/test_rimless_wheel.py

prints the tables of docs/flat-sides.md.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import taichi_lsm as lsm
from taichi_lsm.shapes.polyhedra import from_planes_and_frame
from tests.helpers import scenes

pytestmark = pytest.mark.validate

G, START = 10.0, 0.2  # [m s-2]; angular velocity over a corner, in sqrt(g/R)
SIDES, HALF_WIDTHS = (4, 5, 6, 8, 10, 12), (3.0, 1.0, 0.3, 0.1, 0.03, 0.01)  # [deg]
FACES, FLATNESS = (6, 12), (5.0, 20.0, 50.0, 100.0, 300.0)
SOFT, STIFF = 1e3, 1e5  # stiffness k over weight per diameter


def effects_of(dim, stiffness, restitution):
    """Elastic, damped, rough, heavy; k in weights of a grain of 1 m per metre."""
    k = stiffness * G * 1000.0 * np.pi / (2 * dim)
    return [
        lsm.LinearElastic(k),
        lsm.ViscousDamping(restitution=restitution),
        lsm.CoulombFriction(1.0, 0.5 * k),
        lsm.effects.RollingDamping(restitution),
        lsm.Gravity((0.0, -G, 0.0)[:dim]),
    ]


def over(dim):
    """The floor, across y."""
    return [lsm.PlaneWall("floor", (0.0,) * dim, (0.0, 1.0, 0.0)[:dim])]


def per_mass(sim):
    """(moment of inertia over mass (n,), kinetic and potential energy over mass (n,)) of grains of one moment."""
    x, v, omega = (getattr(sim.state, name).to_numpy() for name in ("position", "velocity", "angular_velocity"))
    mass, inertia = sim.scene.masses()
    inertia = inertia.mean(axis=1) / mass
    return inertia, 0.5 * np.sum(v**2, axis=1) + 0.5 * inertia * np.sum(omega**2, axis=1) + G * x[:, 1]


def losses(sim, start, stiffness, restitution, rolling, before, after, height):
    """Loss of kinetic energy at the first slap over that of the wheel (n,).

    start: state columns; before, after (n,) [m]: d_a and d_b; height (n,) [m]: of the centre over the side.
    """
    effects = effects_of(sim.scene.dim, stiffness, restitution)
    effects[3] = lsm.effects.RollingDamping(restitution if rolling else 1.0)
    for effect in effects[:4]:
        scenes.effect(sim, effect.name).write_parameters(effect)
    dt = 0.03 / np.sqrt(effects[0].stiffness / sim.scene.masses()[0].min())
    scenes.reload(sim, dt, **start)
    path, energy, inertia = [], [], per_mass(sim)[0]
    for _ in range(1200):
        sim.run(int(np.ceil(2.0 / 1200 / dt)))
        path.append(np.abs(sim.state.position.to_numpy() - start["position"])[:, 0])
        energy.append(per_mass(sim)[1] - G * height)
    path, energy = np.array(path), np.array(energy)
    # Behind the slap the grain goes on over the next corner, or turns back: there nothing oscillates any more.
    found = []
    for k in range(path.shape[1]):
        slap = np.argmax(path[:, k] > before[k])
        behind = path[slap:, k]
        ended = (np.maximum.accumulate(behind) - behind > 2e-3) | (behind > before[k] + after[k])
        assert slap > 0
        last = slap + np.argmax(ended) if ended.any() else -1
        found.append(energy[last, k] / energy[np.argmax(path[:, k] > 0.5 * before[k]), k])
    about = inertia + height**2
    wheel = ((about - before * after) / (about + after**2)) ** 2 * (about + after**2) / (about + before**2)
    return (1.0 - np.array(found)) / (1.0 - wheel)


def show(title, rows, columns, values):
    """Print a table of losses over those of the wheel."""
    print(f"\n{title}\n| | " + " | ".join(f"{c:g}" for c in columns) + " |")
    for name, row in zip(rows, values.reshape(len(rows), -1)):
        print(f"| {name} | " + " | ".join(f"{v:.2f}" for v in row) + " |")


def polygons():
    """(simulation, start, before, after, height) of polygons that stand on a corner and begin to fall."""
    shapes = [lsm.shapes.regular_polygon(n, 0.02, side_half_width=np.radians(w)) for n in SIDES for w in HALF_WIDTHS]
    angle = np.linspace(0.0, 2.0 * np.pi, 100_001)
    support = [s.support(np.stack([np.cos(angle), np.sin(angle)], axis=1)) for s in shapes]
    radius, height = (np.array([f(h) for h in support]) for f in (np.max, np.min))
    x = np.stack([20.0 * np.arange(len(shapes)), radius], axis=1)
    omega = -START * np.sqrt(G / radius)
    start = {"position": x, "velocity": np.stack([-omega * radius, 0.0 * omega], axis=1)}
    start |= {"angular_velocity": omega[:, None]}
    more = {"angle": [-np.pi / 2 - angle[np.argmax(h)] for h in support], "shape_index": np.arange(len(shapes))}
    scene = scenes.scene(x, effects_of(2, SOFT, 0.3), shapes=shapes, walls=over(2), thickness=1.0, **more)
    half = radius * np.sin(np.repeat(np.pi / np.array(SIDES), len(HALF_WIDTHS)))
    height = radius * np.cos(np.repeat(np.pi / np.array(SIDES), len(HALF_WIDTHS)))
    return scenes.simulate(scene), start | {"orientation": scene.orientation_state()}, half, half, height


def test_flat_sides_lose_what_a_rimless_wheel_loses(runtime):
    case = polygons()
    table = {}
    for stiffness, restitution, rolling in (
        (SOFT, 0.1, 0),
        (SOFT, 0.3, 0),
        (SOFT, 0.1, 1),
        (SOFT, 0.3, 1),
        (STIFF, 0.3, 0),
        (STIFF, 0.3, 1),
    ):
        got = losses(case[0], case[1], stiffness, restitution, rolling, *case[2:])
        title = f"2D, stiffness {stiffness:g}, restitution {restitution}, rolling damping {rolling}"
        show(f"{title}: sides by half-width [deg]", SIDES, HALF_WIDTHS, got)
        table[stiffness, restitution, rolling] = got.reshape(len(SIDES), -1)
    for restitution in (0.1, 0.3):
        assert np.all(np.abs(table[SOFT, restitution, 1][:, 3:] - 1.0) < 0.2)  # half-widths of 0.1 degrees and less
        assert np.all(np.abs(table[SOFT, restitution, 0][:, 4:] - 1.0) < 0.2)
    assert np.all(np.abs(table[STIFF, 0.3, 1][:, 5:] - 1.0) < 0.2)
    assert np.all(table[SOFT, 0.3, 0][1:, 0] < 0.2)  # sides of three degrees roll


def solids():
    """As `polygons`, a cube and a dodecahedron that stand on an edge and fall on the face beside it."""
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    planes = {6: np.concatenate([np.eye(3), -np.eye(3)])}
    planes[12] = np.array([np.roll([0.0, s, t * golden], k) for k in range(3) for s in (1, -1) for t in (1, -1)])
    shapes, x, turned, velocity, omega, before, after, height = ([] for _ in range(8))
    for faces in FACES:
        n = planes[faces] / np.linalg.norm(planes[faces], axis=1)[:, None]
        for flatness in FLATNESS:
            shape, _, frame = from_planes_and_frame(n, np.ones(faces), 0.02, flatness)
            shape = shape.normalised()
            face, beside = n[0] @ frame, n[np.argsort(n @ n[0])[-2]] @ frame  # body frame
            down = (face + beside) / np.linalg.norm(face + beside)
            edge = np.cross(face, beside) / np.linalg.norm(np.cross(face, beside))
            axes = np.stack([np.cross(-down, edge), -down, edge])  # of the body that become x, y and z
            over_edge, inscribed = shape.support(np.stack([down, face]))
            # Half of a side of a cube; from the middle of a pentagon to its side and to its corner.
            side = 2.0 * inscribed if faces == 6 else inscribed / (0.5 * np.sqrt(2.5 + 1.1 * np.sqrt(5.0)))
            d_a = 0.5 * side / np.tan(np.pi / (4 if faces == 6 else 5))
            d_b = 0.5 * side if faces == 6 else 0.5 * side / np.sin(np.pi / 5)
            sign = -np.sign((axes @ face)[0])  # that turns the face down
            shapes.append(shape)
            x.append((20.0 * len(x), over_edge, 0.0))
            turned.append(np.roll(Rotation.from_matrix(axes).as_quat(), 1))
            omega.append((0.0, 0.0, sign * START * np.sqrt(G / over_edge)))
            velocity.append((-omega[-1][2] * over_edge, 0.0, 0.0))
            for values, value in ((before, d_a), (after, d_b), (height, inscribed)):
                values.append(value)
    start = {"position": np.array(x), "velocity": np.array(velocity), "orientation": np.array(turned)}
    more = {"shape_index": np.arange(len(x)), "orientation": start["orientation"], "angular_velocity": np.array(omega)}
    scene = scenes.scene(x, effects_of(3, SOFT, 0.3), shapes=shapes, walls=over(3), **more)
    sim = scenes.simulate(scene)
    start["angular_momentum"] = sim.state.angular_momentum.to_numpy()  # nothing has turned it yet
    return sim, start, np.array(before), np.array(after), np.array(height)


def test_flat_faces_lose_what_a_rimless_wheel_loses(runtime):
    case = solids()
    for restitution, rolling in ((0.1, 0), (0.3, 0), (0.3, 1)):
        got = losses(case[0], case[1], SOFT, restitution, rolling, *case[2:])
        title = f"3D, stiffness {SOFT:g}, restitution {restitution}, rolling damping {rolling}"
        show(f"{title}: faces by flatness", FACES, FLATNESS, got)
        flat = got.reshape(len(FACES), -1)[:, 3:]
        assert np.all(np.abs(flat - 1.0) < 0.2)
    assert np.all(got.reshape(len(FACES), -1)[:, 0] < 0.5)


def dropped(shapes, stiffness, thrown):
    """A simulation of grains that fall on a floor from 0.3 m, thrown along it with `thrown` [m s-1]."""
    count, dim = len(shapes), shapes[0].dim
    rng = np.random.default_rng(1)
    x = np.zeros((count, dim))
    x[:, 0], x[:, 1] = 200.0 * np.arange(count), [s.bounding_radius + 0.3 for s in shapes]
    turned = {"angle": rng.uniform(0.0, 6.0, count)}
    if dim == 3:
        turned = {"orientation": np.roll(Rotation.random(count, rng=rng).as_quat(), 1, axis=1)}
    effects = effects_of(dim, stiffness, 0.3)
    effects[2] = lsm.CoulombFriction(0.6, effects[2].tangential_stiffness)
    velocity = np.zeros((count, dim))
    velocity[:, 0] = thrown
    more = {"shape_index": np.arange(count), "velocity": velocity, "walls": over(dim), **turned}
    return scenes.simulate(scenes.scene(x, effects, shapes=shapes, thickness=1.0 if dim == 2 else None, **more))


def left(sim):
    """Kinetic energy over weight times diameter of every grain (n,)."""
    v, omega = sim.state.velocity.to_numpy(), sim.state.angular_velocity.to_numpy()
    mass, inertia = sim.scene.masses()
    return (0.5 * np.sum(v**2, axis=1) + 0.5 * np.sum(inertia * omega**2, axis=1) / mass) / G


POLYGONS = {
    "default sides": lambda: lsm.shapes.random_angular_shapes(4, 1),
    "flat sides": lambda: lsm.shapes.random_angular_shapes(4, 1, side_half_width=np.radians(0.1)),
}
POLYHEDRA = {
    "default faces": lambda: lsm.shapes.random_angular_polyhedra(4, 1),
    "flat faces": lambda: lsm.shapes.random_angular_polyhedra(4, 1, flatness=100.0),
}


@pytest.mark.parametrize("name", [*POLYGONS, *POLYHEDRA])
def test_grains_come_to_rest(runtime, name):
    """Thrown at 1.5 m/s, or 0.47 sqrt(g d): after 60 sqrt(d/g) nothing moves that can be seen."""
    sim = dropped((POLYGONS | POLYHEDRA)[name](), SOFT, 1.5)
    path = np.zeros(len(sim))
    start = {n: getattr(sim.state, n).to_numpy() for n in ("position", "velocity", "angular_velocity", "orientation")}
    start |= {"angular_momentum": 0.0 * sim.scene.position} if sim.scene.dim == 3 else {}
    for rolling, restitution in enumerate((1.0, 0.3)):
        scenes.effect(sim, "rolling_damping").write_parameters(lsm.effects.RollingDamping(restitution))
        scenes.reload(sim, **start)
        whole = sum(scenes.energy(sim))
        for time in (10, 30, 60):
            sim.run(int(time / np.sqrt(G) / sim.dt) - sim.step)
            print(f"{name}, rolling damping {rolling}, time {time}: " + ", ".join(f"{e:.0e}" for e in left(sim)))
        path = np.abs(sim.state.position.to_numpy() - start["position"])[:, 0]
        print("    path " + ", ".join(f"{p:.1f}" for p in path) + " diameters")
        assert sum(scenes.energy(sim)) == pytest.approx(whole, rel=2e-3)
    assert np.all(left(sim) < (1e-10 if "flat" in name else 1e-4)) and np.all(path < 10.0)


def gas(half_width):
    """64 elastic polygons of 4 to 7 sides in a periodic square, flying at random; half_width [deg] of their sides."""
    rng = np.random.default_rng(3)
    side, count = 11.0, 64
    shapes = [lsm.shapes.regular_polygon(n, side_half_width=np.radians(half_width)) for n in (4, 5, 6, 7)]
    lattice = np.stack(np.divmod(np.arange(count), 8), axis=1)
    more = {"angle": rng.uniform(0.0, 6.0, count), "velocity": rng.normal(0.0, 1.0, (count, 2)), "thickness": 1.0}
    more |= {"lengths": (side, side), "periodic": (True, True), "shape_index": np.arange(count) % 4}
    return scenes.scene((lattice + 0.5) * (side / 8), [lsm.LinearElastic(1e6)], shapes=shapes, **more)


def test_an_elastic_gas_of_flat_grains_keeps_its_energy_less_well(runtime):
    """Over some 18 000 steps of the default size."""
    sim, error = scenes.simulate(gas(3.0)), {}
    for half_width in (3.0, 1.0, 0.3, 0.1):
        sim.reset(gas(half_width))
        start, widest = sum(scenes.energy(sim)), 0.0
        for _ in range(100):
            sim.run(int(0.6 / sim.dt))
            widest = max(widest, abs(sum(scenes.energy(sim)) / start - 1.0))
        error[half_width] = widest
        print(f"sides of {half_width:g} degrees: greatest error of the energy {widest:.1e}")
    assert error[3.0] < 3e-3 and error[0.1] < 5e-2
