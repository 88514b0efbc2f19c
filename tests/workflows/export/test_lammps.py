"""Files for LAMMPS: text dumps, and clumps of spheres; where `lmp` is installed it reads and runs them."""

import re
import shutil
import subprocess

import numpy as np
import pandas
import pytest

import taichi_lsm as lsm
from tests.helpers.exported_runs import LENGTH, TIMES, write_run
from tests.helpers.shaped_grains import DT
from workflows.export.formats import export_run

NEEDS_LAMMPS = pytest.mark.skipif(shutil.which("lmp") is None, reason="LAMMPS (lmp) is not installed")
STEPS = """
pair_style gran/hooke 1e-3 NULL 0.0 NULL 0.0 0
pair_coeff * *
timestep 1e-9
variable mass equal mass(all)
variable drift equal vcm(all,x)
thermo_style custom step atoms v_mass v_drift
thermo_modify norm no format float %.12g
run 10
"""


@pytest.fixture(scope="module", params=[2, 3])
def run(request, tmp_path_factory):
    """(dimensions, folder) of a run."""
    return request.param, write_run(tmp_path_factory.mktemp(f"run{request.param}"), request.param)


def frames_of(path):
    """(header lines, table) of every frame of a dump."""
    text = path.read_text(encoding="ascii")
    for block in text.split("ITEM: TIME\n")[1:]:
        head, _, atoms = block.partition("ITEM: ATOMS ")
        names, *rows = atoms.splitlines()
        yield head.splitlines(), pandas.DataFrame([map(float, row.split()) for row in rows], columns=names.split())


def test_a_dump_holds_what_the_snapshots_hold(run):
    dim, folder = run
    (path,), count = export_run(folder, folder / "dump", "lammps-dump")
    grains, frames = lsm.open_run(folder / "grains.nc"), list(frames_of(path))
    assert len(frames) == count == 3
    for i, (head, atoms) in enumerate(frames):
        now = grains.isel(time=i)
        assert float(head[0]) == TIMES[i] and int(head[2]) == round(TIMES[i] / DT) and int(head[4]) == 9
        assert head[5] == "ITEM: BOX BOUNDS pp ff pp" and head[6].split() == ["0", f"{LENGTH:g}"]
        assert atoms.id.tolist() == list(range(1, 10)) and atoms.type.tolist() == [2, 2, *[1] * 7]
        assert atoms.x.between(0.0, LENGTH).all()
        periods = [LENGTH, 0.0, LENGTH][:dim]
        for axis, name, period in zip(range(dim), "xyz", periods):
            assert np.allclose(atoms[name] + period * atoms[f"i{name}"], now.position[:, axis], atol=1e-11)
            assert np.allclose(atoms[f"v{name}"], now.velocity[:, axis])
        turning = atoms[["omegax", "omegay", "omegaz"]]
        assert np.allclose(turning.omegaz if dim == 2 else turning, now.angular_velocity)
        assert np.allclose(atoms[["quatw", "quati", "quatj", "quatk"]], now.orientation)
        assert np.allclose(2.0 * atoms.radius, now.shape_scale) and np.allclose(atoms.mass, now.mass)


def lmp(folder, deck):
    """What LAMMPS prints of a deck."""
    (folder / "in.deck").write_text(deck)
    done = subprocess.run(["lmp", "-in", "in.deck", "-log", "none"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    return done.stdout


@NEEDS_LAMMPS
def test_lammps_reads_a_dump(run):
    dim, folder = run
    (path,), _ = export_run(folder, folder / "read", "lammps-dump")
    fields = " ".join(f"{name} v{name} i{name}" for name in "xyz"[:dim])
    z = "-1e-3 1e-3" if dim == 2 else f"0 {LENGTH}"
    deck = f"""
units si
dimension {dim}
boundary p f p
atom_style sphere
region box block 0 {LENGTH} -1e-3 5e-3 {z}
create_box 2 box
read_dump {path} {round(TIMES[2] / DT)} {fields} purge yes replace no add keep box yes
write_dump all custom read.txt id xu yu vx modify sort id
"""
    lmp(folder, deck)
    rows = np.loadtxt((folder / "read.txt").read_text().splitlines()[9:])
    now = lsm.open_run(folder / "grains.nc").isel(time=2)
    assert rows[:, 0].tolist() == list(range(1, 10))
    assert np.allclose(rows[:, 1:3], now.position[:, :2], rtol=1e-5, atol=1e-9)
    assert np.allclose(rows[:, 3], now.velocity[:, 0], rtol=1e-5)


def sections_of(path):
    """{title: rows} of a data file, and its header."""
    text = path.read_text(encoding="ascii")
    header, *parts = re.split(r"^(Atoms # sphere|Velocities|Molecules)\n", text, flags=re.MULTILINE)
    return header, {t: np.loadtxt(rows.splitlines()) for t, rows in zip(parts[::2], parts[1::2], strict=True)}


def test_clumps_have_the_mass_and_the_place_of_their_grains(run):
    dim, folder = run
    (path,), count = export_run(folder, folder / "data", "lammps-data")
    assert count == 1 and path.name == "grains_2.data"
    _, sections = sections_of(path)
    now, atoms, owner = (
        lsm.open_run(folder / "grains.nc").isel(time=2),
        *map(sections.get, ("Atoms # sphere", "Molecules")),
    )
    mass, diameter = atoms[:, 3] * np.pi / 6.0 * atoms[:, 2] ** 3, atoms[:, 2]
    unwrapped = atoms[:, 4:7] + atoms[:, 7:10] * [LENGTH, 0.0, LENGTH]
    for grain in range(9):
        own = owner[:, 1] == grain + 1
        assert mass[own].sum() == pytest.approx(float(now.mass[grain]), rel=1e-6)
        apart = unwrapped[own][:, :dim] - now.position.values[grain]
        reach = (np.linalg.norm(apart, axis=1) + 0.5 * diameter[own]).max()
        # Corners are covered within 2 % of the size.
        assert reach == pytest.approx(float(now.bounding_radius[grain]), abs=0.025 * float(now.shape_scale[grain]))
        assert own.sum() == 1 if grain % 3 == 1 else own.sum() > 1
    kinds = {grain: set(atoms[owner[:, 1] == grain + 1, 1]) for grain in range(9)}
    assert [kinds[grain] for grain in (0, 1, 2, 4)] == [{3.0}, {3.0}, {1.0}, {2.0}]


def test_spheres_move_as_points_of_their_grain(run):
    dim, folder = run
    (path,), _ = export_run(folder, folder / "moving", "lammps-data")
    _, sections = sections_of(path)
    now, atoms = lsm.open_run(folder / "grains.nc").isel(time=2), sections["Atoms # sphere"]
    own = sections["Molecules"][:, 1] == 3  # of grain 2
    arm = (atoms[own, 4:7] + atoms[own, 7:10] * [LENGTH, 0.0, LENGTH])[:, :dim] - now.position.values[2]
    omega = now.angular_velocity.values[2]
    turning = omega * np.stack([-arm[:, 1], arm[:, 0]], axis=1) if dim == 2 else np.cross(omega, arm)
    assert np.allclose(sections["Velocities"][own, 1 : 1 + dim], now.velocity.values[2] + turning, rtol=1e-5, atol=1e-7)


@NEEDS_LAMMPS
def test_lammps_runs_the_clumps_as_the_file_says(run):
    dim, folder = run
    (path,), _ = export_run(folder, folder / "clumps", "lammps-data")
    header, _ = sections_of(path)
    deck = "\n".join(re.findall(r"^#   (.+)$", header, re.MULTILINE))
    printed = lmp(path.parent, deck + STEPS)
    size = float(lsm.open_run(folder / "grains.nc").shape_scale.mean())
    assert float(re.findall(r"neighbor (\S+) bin", header)[0]) == pytest.approx(0.1 * size, rel=1e-3)
    assert "WARNING" not in printed  # of a skin wider than the box, or of a reach shorter than a clump
    assert "5 rigid bodies with" in printed  # grains 2, 3, 5, 6 and 8
    rows = re.findall(r"^ *(\d+) +\d+ +(\S+) +(\S+) *$", printed, re.MULTILINE)
    now = lsm.open_run(folder / "grains.nc").isel(time=2)
    assert [int(row[0]) for row in rows] == [0, 10]
    assert float(rows[0][1]) == pytest.approx(float(now.mass.sum()), rel=1e-6)
    drift = float((now.mass * now.velocity[:, 0]).sum() / now.mass.sum())
    assert float(rows[1][2]) == pytest.approx(float(rows[0][2]), rel=1e-3) == pytest.approx(drift, rel=0.3)
