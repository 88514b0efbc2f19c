"""The file of the energies of one conservative run."""

from .core.schema import Variable
from .io.run_file import RunWriter

ENERGY_ROWS = [
    Variable("translational_energy", ("time",), "f64", "J", "kinetic energy of translation, Eq. (23)"),
    Variable("rotational_energy", ("time",), "f64", "J", "kinetic energy of rotation, Eq. (23)"),
    Variable("elastic_energy", ("time",), "f64", "J", "energy stored in the contacts, Eq. (24)"),
    Variable("shadow_correction", ("time",), "f64", "J", "shadow energy of the integrator less the energy"),
    Variable("total_energy", ("time",), "f64", "J", "sum of the three energies, Eq. (22)"),
]


def write_energies(path, series, attributes):
    """Write energy.nc. series: dict of arrays over time, time [s] and the terms [J] but for the total."""
    writer = RunWriter(path, ENERGY_ROWS, attributes)
    for i, time in enumerate(series["time"]):
        row = {v.name: series[v.name][i] for v in ENERGY_ROWS[:-1]}
        total = row["translational_energy"] + row["rotational_energy"] + row["elastic_energy"]
        writer.append({"time": time, "total_energy": total, **row})
    writer.close("complete")
