"""The contacts of a simulation as an xarray.Dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..measure.contacts import FLAGS

if TYPE_CHECKING:
    import xarray

    from ..simulation import Simulation

PARTED_POWER = ("W", "energy that contacts which ended in the last step dissipated in it, over its time")


def contacts_dataset(sim: Simulation) -> xarray.Dataset:
    """All contacts of `sim` now; see `Simulation.contacts`."""
    import xarray  # takes long to load

    rows, table = sim.contact_table.rows(sim.scene, sim.dt), sim.contact_table
    data = {}
    for variable in table.variables:
        values = rows[variable.name].astype(bool) if variable.name in FLAGS else rows[variable.name]
        data[variable.name] = (variable.dims, values, {"units": variable.units, "long_name": variable.long_name})
    units, long_name = PARTED_POWER
    data["parted_power"] = ((), table.parted_power(sim.scene, sim.dt), {"units": units, "long_name": long_name})
    time = ((), sim.time, {"units": "s", "long_name": "simulated time"})
    coords = {"space": list("xyz"[: sim.scene.dim]), "time": time}
    return xarray.Dataset(data, coords, {"title": "Contacts at one instant"})
