"""The budget of slip events, of a slider whose energies are known."""

import numpy as np
import pytest
import xarray as xr

from taichi_lsm import InputError
from taichi_lsm.statistics import event_energies

STIFFNESS = 2.0e3
EVENTS = xr.Dataset({"start": ("event", [2.0, 6.0]), "end": ("event", [4.0, 7.0])})


def run():
    """Rows of a spring that is released twice: of what it gives, 3/4 are dissipated, 1/4 stays as elastic energy."""
    stretch = np.array([0.8, 0.9, 1.0, 0.7, 0.4, 0.5, 0.6, 0.3, 0.4])
    given = np.concatenate([[0.0], np.cumsum(0.5 * STIFFNESS * -np.diff(stretch**2))])
    work = given  # the load point stands still
    kinetic = np.array([0.0, 0.0, 0.0, 50.0, 0.0, 0.0, 0.0, 2.0, 0.0])
    series = {"spring_stretch": stretch, "external_work": work, "elastic_energy": 0.25 * work}
    series |= {"translational_energy": 0.75 * kinetic, "rotational_energy": 0.25 * kinetic}
    series |= {"energy_residual": 1e-3 * work, "layer_thickness": 1.0 - 0.01 * stretch, "displacement": 2.0 - stretch}
    data = {name: ("time", values) for name, values in series.items()}
    data["dissipated_energy"] = (("time", "effect"), np.stack([0.5 * work, 0.25 * work], axis=1))
    return xr.Dataset(data, {"time": np.arange(9.0), "effect_name": ("effect", ["friction", "damping"])})


def test_what_each_event_did_with_its_energy():
    found = event_energies(run(), EVENTS, STIFFNESS)
    released = 0.5 * STIFFNESS * np.array([1.0**2 - 0.4**2, 0.6**2 - 0.3**2])
    assert found.released_energy.values == pytest.approx(released)
    assert found.external_work.values == pytest.approx(released)
    assert found.dissipated_energy.sel(effect="friction").values == pytest.approx(0.5 * released)
    assert found.elastic_energy_change.values == pytest.approx(0.25 * released)
    assert found.energy_residual.values == pytest.approx(1e-3 * released)
    assert found.peak_kinetic_energy.values == pytest.approx([50.0, 2.0])
    assert found.kinetic_energy_change.values == pytest.approx([0.0, 2.0])
    assert found.thickness_change.values == pytest.approx([0.006, 0.003])
    assert found.slip_before.values == pytest.approx([-0.2, -0.2])  # since the first row, since the event before
    assert found.released_energy.attrs["units"] == "J" and "start" in found


def test_no_event_gives_no_rows():
    none = event_energies(run(), EVENTS.isel(event=slice(0)), STIFFNESS)
    assert none.sizes["event"] == 0 and none.dissipated_energy.shape == (0, 2)


def test_a_run_without_a_spring_is_refused():
    with pytest.raises(InputError, match=r"run: has no spring_stretch, must be the run\.nc of a layer"):
        event_energies(run().drop_vars("spring_stretch"), EVENTS, STIFFNESS)
