"""What slip events did with the energy of the spring: released, dissipated by effect, left as motion."""

from typing import TYPE_CHECKING

import numpy as np

from ..core.errors import InputError
from .run_parts import part_of

if TYPE_CHECKING:
    from xarray import Dataset

    from .run_parts import Run

NEEDED = (
    *("spring_stretch", "external_work", "translational_energy", "rotational_energy", "elastic_energy"),
    *("dissipated_energy", "energy_residual", "layer_thickness", "displacement"),
)


def event_energies(run: "Run", events: "Dataset", stiffness: float) -> "Dataset":
    """The budget of every slip event, from the rows of run.nc at its start and end.

    The spring releases E_K = K (s_0^2 - s_1^2)/2, s its stretch; the drives do the work W on the platens, which the
    spring has from E_K and from its load point. W = change of kinetic and of elastic energy of the grains + what the
    effects and the servo dissipate + residual.

    Parameters
    ----------
    run
        What `open_run` gives of the folder, or of the run.nc, of a run whose platen a spring pulls.
    events
        As `detect_events` gives them.
    stiffness
        K [N m-1] of the spring.

    Returns
    -------
    Dataset
        `events` with, along event: released_energy [J] of the spring; external_work [J]; dissipated_energy (event,
        effect) [J]; peak_kinetic_energy [J], the greatest at a row of the event less that at its start;
        elastic_energy_change [J]; kinetic_energy_change [J]; energy_residual [J]; thickness_change [m]; slip_before [m]
        since the last event.

    Raises
    ------
    InputError
        If the run has no spring.
    """
    run = part_of(run, "run")
    missing = [name for name in NEEDED if name not in run.variables]
    if missing:
        raise InputError(f"run: has no {', '.join(missing)}, must be the run.nc of a layer that a spring pulls")
    time = np.asarray(run.time, float)
    # An event lies between two rows, whose times it has.
    first, last = (np.searchsorted(time, np.asarray(events[end], float) * (1.0 - 1e-12)) for end in ("start", "end"))
    value = {name: np.asarray(run[name], float) for name in NEEDED}
    kinetic = value["translational_energy"] + value["rotational_energy"]
    stored = 0.5 * stiffness * value["spring_stretch"] ** 2
    slip = value["displacement"]

    def change(series):
        return series[last] - series[first]

    peaks = [kinetic[i : j + 1].max() - kinetic[i] for i, j in zip(first, last, strict=True)]
    before = slip[first] - np.concatenate([slip[:1], slip[last[:-1]]]) if first.size else np.empty(0)
    columns = {
        "released_energy": (-change(stored), "J", "energy that the spring released"),
        "external_work": (change(value["external_work"]), "J", "work of spring and servo on the platens"),
        "peak_kinetic_energy": (np.array(peaks), "J", "greatest kinetic energy at a row, less that at the start"),
        "kinetic_energy_change": (change(kinetic), "J", "kinetic energy at the end less that at the start"),
        "elastic_energy_change": (change(value["elastic_energy"]), "J", "elastic energy likewise"),
        "energy_residual": (change(value["energy_residual"]), "J", "work less changes of energies less dissipation"),
        "thickness_change": (change(value["layer_thickness"]), "m", "thickness at the end less that at the start"),
        "slip_before": (before, "m", "slip of the platen since the event before, or since the first row"),
    }
    data = {name: ("event", v, {"units": unit, "long_name": words}) for name, (v, unit, words) in columns.items()}
    lost = change(value["dissipated_energy"])
    words = {"units": "J", "long_name": "energy dissipated during the event, by effect"}
    effects = np.asarray(run.effect_name if "effect_name" in run else run.effect)
    return events.assign(data | {"dissipated_energy": (("event", "effect"), lost, words)}).assign_coords(effect=effects)
