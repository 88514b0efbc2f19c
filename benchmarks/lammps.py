"""The same scene in LAMMPS: writes its data file and its deck, runs `lmp` and reads what it printed.

LAMMPS computes in double precision. Its force law `gran/hooke/history` differs from ours in three small points:
the damped normal force may attract, the lever arms are the radii instead of reaching to the middle of the overlap,
and the tangential spring is projected but not rotated with the angular velocity about the normal. Tangential damping
is switched off.
"""

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks import effect_sets, scenes

HOW_TO_INSTALL = "LAMMPS (`lmp`) was not found. Debian, Ubuntu: apt-get install lammps; see https://www.lammps.org"

# `read_data` gives every grain the mass of a sphere; in 2D `density/disc` makes it rho pi d^2/4, as ours.
DECK = """\
units lj
atom_style sphere
dimension {dim}
boundary p f p
newton off
comm_modify mode single vel yes
read_data {data}
{disc_mass}
pair_style gran/hooke/history {k_n} {k_t!r} {rate} 0.0 {friction} 0
pair_coeff * *
neighbor {skin} bin
neigh_modify delay 0 every 1 check yes
timestep {dt}
group mob type {mobile}
group bot type {bottom}
group top type {top}
neigh_modify exclude group bot bot exclude group top top
{in_plane}
fix motion mob nve/sphere{disc_inertia}
fix shear top move linear {speed} 0 0
compute z mob contact/atom
compute zz mob reduce ave c_z
compute p all pressure NULL pair
compute move mob ke
compute spin mob erotate/sphere
variable weight equal mass(all)
thermo_style custom step c_p c_move c_spin v_weight
thermo_modify norm no format float %.12g
thermo {skip}
run {skip}
thermo {steps}
run {steps}
thermo_style custom step c_zz c_p c_move c_spin v_weight
thermo_modify norm no format float %.12g
run 0
"""


def data_file(state: scenes.State) -> str:
    """Text of the data file: grains of density 1 with their diameters, at rest."""
    x = state.x if state.dim == 3 else [(a, b, 0.0) for a, b in state.x]
    depth = (0.0, state.box[2]) if state.dim == 3 else (-0.5, 0.5)
    lines = [f"{state.tag}, d = 1, rho = 1", "", f"{len(state.d)} atoms", "3 atom types", ""]
    edges = [(0.0, state.box[0]), (0.0, state.box[1]), depth]
    lines += [f"{low:.17g} {high:.17g} {a}lo {a}hi" for a, (low, high) in zip("xyz", edges)]
    lines += ["", "Atoms # sphere", ""]
    lines += [
        f"{i} {kind} {d:.17g} 1 {c[0]:.17g} {c[1]:.17g} {c[2]:.17g}"
        for i, (kind, d, c) in enumerate(zip(state.kind, state.d, x), start=1)
    ]
    return "\n".join(lines) + "\n"


def deck(state: scenes.State, data: str, skip: int, steps: int) -> str:
    """Text of the input deck: `skip` steps, then `steps` timed ones, then the metrics to compare."""
    plane = state.dim == 2
    return DECK.format(
        dim=state.dim,
        data=data,
        disc_mass="set group all density/disc 1.0" if plane else "",
        disc_inertia=" disc" if plane else "",
        in_plane="fix plane all enforce2d" if plane else "",
        k_n=effect_sets.NORMAL_STIFFNESS,
        k_t=effect_sets.TANGENTIAL_STIFFNESS,
        rate=effect_sets.DAMPING_RATE,
        friction=effect_sets.FRICTION,
        skin=scenes.SKIN,
        dt=scenes.TIME_STEP,
        speed=scenes.WALL_SPEED,
        mobile=scenes.MOBILE,
        bottom=scenes.BOTTOM,
        top=scenes.TOP,
        skip=skip,
        steps=steps,
    )


def clocks_and_last_row(text: str) -> tuple[dict[str, float], list[float]]:
    """Clocks of the timed run and last row of the final table, from the output of a deck.

    The deck has three runs: the second is timed, and the third prints a table that begins with `Step c_zz`.

    Returns
    -------
    clocks : dict
        {"seconds": wall clock, "cpu_seconds": processor time of one process}.
    row : list of float
        Last row of the table.

    Raises
    ------
    ValueError
        If the output is incomplete.
    """
    loops = re.findall(r"^Loop time of (\S+) on", text, re.MULTILINE)
    shares = re.findall(r"^(\S+)% CPU use with", text, re.MULTILINE)
    tables = re.findall(r"^\s*Step +c_zz.*\n((?: *[-\d].*\n)+)", text, re.MULTILINE)
    if len(loops) != 3 or len(shares) != 3 or not tables:
        raise ValueError(f"LAMMPS did not finish:\n{text[-2000:]}")
    seconds = float(loops[1])
    clocks = {"seconds": seconds, "cpu_seconds": seconds * float(shares[1]) / 100}  # of one process
    return clocks, [float(word) for word in tables[-1].splitlines()[-1].split()]


def parse(text: str, dim: int) -> dict[str, float]:
    """Seconds of the timed loop (wall clock, processor) and the metrics at its end, from the output of `lmp`.

    Raises
    ------
    ValueError
        If the output is incomplete.
    """
    clocks, (_, contacts, pressure, translational, rotational, mass) = clocks_and_last_row(text)
    if dim == 2:
        rotational *= 0.5 / 0.4  # `erotate/sphere` takes the inertia of a sphere, the integrator that of a disc
    return clocks | {
        "contacts_per_grain": contacts,
        "pressure": pressure,
        "translational_energy": translational,
        "rotational_energy": rotational,
        "mass": mass,
    }


def find() -> str | None:
    """Path of `lmp`, or None."""
    return shutil.which("lmp")


def install() -> None:
    """Install the Debian package, as root; SystemExit for any other user."""
    if os.geteuid() != 0:
        raise SystemExit(f"--install-lammps needs root. {HOW_TO_INSTALL}")
    subprocess.run(["apt-get", "install", "--yes", "--no-install-recommends", "lammps"], check=True)


def execute(data: str, deck: str, processes: int, also: Sequence[str] = ()) -> list[str]:
    """Run a deck.

    Parameters
    ----------
    data : str
        Text of `grains.data`, which the deck reads.
    deck : str
        Text of the input deck.
    processes : int
        MPI processes.
    also : sequence of str
        Files that the deck writes.

    Returns
    -------
    list of str
        The printed output, then the text of each file of `also` ("" if it was not written).
    """
    program = [find() or "lmp", "-in", "in.deck", "-log", "none"]
    if processes > 1:
        program = ["mpirun", "--oversubscribe", "-np", str(processes), *program]
    root = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "grains.data").write_text(data, encoding="ascii")
        Path(folder, "in.deck").write_text(deck, encoding="ascii")
        environment = os.environ | root | {"OMP_NUM_THREADS": "1"}
        done = subprocess.run(program, cwd=folder, capture_output=True, text=True, env=environment)
        made = [Path(folder, name) for name in also]
        return [done.stdout, *(path.read_text(encoding="ascii") if path.exists() else "" for path in made)]


def run(state: scenes.State, processes: int, skip: int, steps: int) -> dict[str, float]:
    """Run LAMMPS on `processes` MPI processes from the stored state; see `parse`."""
    (printed,) = execute(data_file(state), deck(state, "grains.data", skip, steps), processes)
    return parse(printed, state.dim)
