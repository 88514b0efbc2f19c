"""The contacts of a simulation as an xarray.Dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..measure.contacts import CONTACT_ROWS

if TYPE_CHECKING:
    import xarray

    from ..simulation import Simulation

FORCES = {
    "normal_force": ("N", "normal force, positive in compression"),
    "tangential_force": ("N", "tangential force on the second grain"),
}


def contacts_dataset(sim: Simulation) -> xarray.Dataset:
    """All contacts of `sim` now; see `Simulation.contacts`."""
    import xarray  # takes long to load

    rows = sim.contact_table.rows()
    force = rows.pop("force")
    rows["normal_force"] = np.einsum("ij,ij->i", force, rows["normal"])
    rows["tangential_force"] = force - rows["normal_force"][:, None] * rows["normal"]
    meaning = {v.name: (v.units, v.long_name) for v in CONTACT_ROWS} | FORCES
    data = {}
    for name, values in rows.items():
        units, long_name = meaning[name]
        dims = ("contact", "space") if values.ndim == 2 else ("contact",)
        values = values.astype(bool) if name in ("sliding", "bonded") else values
        data[name] = (dims, values, {"units": units, "long_name": long_name})
    time = ((), sim.time, {"units": "s", "long_name": "simulated time"})
    coords = {"space": list("xyz"[: sim.scene.dim]), "time": time}
    return xarray.Dataset(data, coords, {"title": "Contacts at one instant"})
