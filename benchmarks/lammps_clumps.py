"""Rigid clumps of spheres in LAMMPS: data file, deck and output of the clump scenes; see `clumps` and `lammps`.

Each mobile clump is a body of `fix rigid/small`; glued clumps are the spheres of the walls, which no clump leaves.
Spheres of one clump do not interact. The pressure of pairs alone (`compute pressure ... pair`) would be taken
between centres of spheres, a third of that of the grains for 30 spheres, so that the load is compared by the force on
the walls.
"""

import numpy as np

from benchmarks import effect_sets, lammps, scenes
from benchmarks.clumps import Clumps

# `cutoff 2.5` of comm_modify: a clump reaches across the border of a process.
DECK = """\
units lj
atom_style hybrid sphere molecular
dimension 3
boundary p f p
newton off
comm_modify mode single vel yes cutoff 2.5
read_data {data}
pair_style gran/hooke/history {k_n} {k_t!r} {rate} 0.0 {friction} 0
pair_coeff * *
neighbor {skin} bin
group mob type {mobile}
group bot type {bottom}
group top type {top}
neigh_modify delay 0 every 1 check yes exclude molecule/intra all
neigh_modify exclude group bot bot exclude group top top
timestep {dt}
velocity all set 0 0 0
fix rigid mob rigid/small molecule
fix shear top move linear {speed} 0 0
compute z mob contact/atom
compute zz mob reduce sum c_z
compute p all pressure NULL pair
compute move mob ke/rigid rigid
compute up top reduce sum fy
compute down bot reduce sum fy
thermo_style custom step c_p c_move c_up c_down
thermo_modify norm no format float %.12g
thermo {skip}
run {skip}
thermo {steps}
run {steps}
compute touch all property/local patom1 patom2 cutoff radius
dump touch all local 1 touching.txt c_touch[1] c_touch[2]
thermo_style custom step c_zz c_p c_move c_up c_down
thermo_modify norm no format float %.12g
run 0
"""


def data_file(clumps: Clumps) -> str:
    """Text of the data file: spheres of density 1 at rest, in clumps numbered from 1, wrapped into the box."""
    count, each = clumps.offset.shape[:2]
    lines = [f"{clumps.tag}, d = 1, rho = 1", "", f"{count * each} atoms", "3 atom types", ""]
    lines += [f"0 {side:.17g} {a}lo {a}hi" for a, side in zip("xyz", clumps.box)]
    lines += ["", "Atoms # hybrid", ""]
    x = clumps.spheres
    image = np.floor(x / clumps.box).astype(int) * [1, 0, 1]  # the box repeats along x and z
    x = x - image * clumps.box
    kind, d = np.repeat(clumps.kind, each), np.repeat(clumps.d, each)
    lines += [
        f"{i + 1} {kind[i]} {x[i, 0]:.17g} {x[i, 1]:.17g} {x[i, 2]:.17g} {d[i]:.17g} 1 {i // each + 1} "
        f"{image[i, 0]} {image[i, 1]} {image[i, 2]}"
        for i in range(count * each)
    ]
    return "\n".join(lines) + "\n"


def deck(data: str, skip: int, steps: int) -> str:
    """Text of the input deck: `skip` steps, then `steps` timed ones, then the metrics to compare."""
    return DECK.format(
        data=data,
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


def touching_clumps(text: str, each: int) -> np.ndarray:
    """Pairs of clumps (pairs, 2), numbered from 0, that touch at one sphere or more.

    text: the dump of touching spheres; each: spheres per clump.
    """
    rows = text.splitlines()
    start = next(i for i, row in enumerate(rows) if row.startswith("ITEM: ENTRIES")) + 1
    pairs = np.array([row.split() for row in rows[start:]], int).reshape(-1, 2)
    return np.unique(np.sort((pairs - 1) // each, axis=1), axis=0)


def parse(text: str, touching: str, clumps: Clumps) -> dict[str, float]:
    """Clocks of the timed loop and metrics at its end.

    contacts_per_grain counts a pair of clumps once, sphere_contacts_per_grain each pair of spheres; normal_stress is
    the mean of the forces on both walls over their area.

    Parameters
    ----------
    text : str
        Printed output of `lmp`.
    touching : str
        Its dump of touching spheres.
    clumps : Clumps
        The clumps that were run.

    Raises
    ------
    ValueError
        If the output is incomplete.
    """
    clocks, (_, contacts, pressure, translational, up, down) = lammps.clocks_and_last_row(text)
    pairs = touching_clumps(touching, clumps.offset.shape[1])
    mobile = clumps.kind == scenes.MOBILE
    return clocks | {
        "contacts_per_grain": float(mobile[pairs].sum() / mobile.sum()),
        "sphere_contacts_per_grain": contacts / float(mobile.sum()),
        "normal_stress": 0.5 * (up - down) / float(clumps.box[0] * clumps.box[2]),
        "pressure_of_spheres": pressure,
        "translational_energy": translational,
        "mass": float(clumps.mass.sum()),
    }


def run(clumps: Clumps, processes: int, skip: int, steps: int) -> dict[str, float]:
    """Run LAMMPS on `processes` MPI processes from the stored state; see `parse`."""
    text, touching = lammps.execute(data_file(clumps), deck("grains.data", skip, steps), processes, ["touching.txt"])
    return parse(text, touching, clumps)
