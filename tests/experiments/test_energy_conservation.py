"""The verification experiment in small: files, metrics, and the bounds that a small gas can meet."""

import signal
from contextlib import contextmanager

import numpy as np
import pytest

import taichi_lsm as lsm
from workflows import energy_conservation
from workflows.common import signals
from workflows.energy import gas_metrics
from workflows.protocol.finished_parts import FinishedParts

SMALL = {"grains": 36, "steps": 400, "long_steps": 400, "seeds": 1, "order_seeds": 1, "order_grains": 36, "samples": 20}


@pytest.mark.validate
def test_small_gas_keeps_its_energy_and_the_printed_scheme_does_not(tmp_path, monkeypatch):
    monkeypatch.setattr(gas_metrics, "CONES", {})  # they have tests of their own, and compile for long
    # Two schemes are stood in for by the first: tests/experiments/test_accuracy_collisions.py has their orders.
    schemes, measure = energy_conservation.SCHEMES, energy_conservation.measure
    measured = ["onset_verlet", "explicit_euler"]
    monkeypatch.setattr(energy_conservation, "schemes_of", lambda params: measured)

    def measure_two(params, parts, progress):
        rows, series, stop = measure(params, parts, progress)
        first = [row for row in rows if row["scheme"] == "onset_verlet"]
        others = set(schemes) - set(measured)
        rows += [row | {"scheme": name} for name in others for row in first]
        return rows, series | dict.fromkeys(others, series["onset_verlet"]), stop

    monkeypatch.setattr(energy_conservation, "measure", measure_two)
    params = energy_conservation.Params(**SMALL)
    table = energy_conservation.run(params, tmp_path)
    assert {p.name for p in tmp_path.iterdir()} >= {
        "energy.nc",
        "drift.nc",
        "energy.png",
        "summary.json",
        "config.toml",
    }
    energies = lsm.open_run(tmp_path / "energy.nc")
    terms = energies.translational_energy + energies.rotational_energy + energies.elastic_energy
    assert np.allclose(terms, energies.total_energy)
    assert float(energies.rotational_energy[-1]) > 0.0 and float(energies.rotational_energy[0]) == 0.0
    drift = table.drift.values
    scheme, purpose = table.scheme.values, table.purpose.values
    assert drift[(scheme == "onset_verlet") & (purpose == "drift")].max() < 1e-3
    assert drift[scheme == "explicit_euler"].max() > 0.02
    assert all(v.attrs["units"] and v.attrs["long_name"] for v in energies.data_vars.values())


def test_an_interrupted_run_keeps_the_schemes_that_are_done(tmp_path, monkeypatch):
    done = {"scheme": "onset_verlet", "purpose": "drift", "grains": 36, "seed": 1, "steps": 400}
    done |= {"steps_per_contact": 50, "drift": 1e-4, "shadow_drift": 1e-6}
    energies = {name: np.linspace(1.0, 2.0, 3) for name in ("time", "shadow_correction", *energy_conservation.TERMS)}

    @contextmanager
    def made(parts, calls):
        yield one(calls)

    def one(calls):
        assert next(iter(calls)) == "onset_verlet"
        yield "onset_verlet", ([done], energies)
        raise signals.Interrupted(signal.SIGTERM)

    monkeypatch.setattr(FinishedParts, "made_in_processes", made)
    with pytest.raises(signals.Interrupted):
        energy_conservation.run(energy_conservation.Params(**SMALL), tmp_path)
    table = lsm.open_run(tmp_path / "drift.nc")
    assert table.run_status == "interrupted" and table.drift.values == [1e-4]
    assert (tmp_path / "energy.nc").exists() and not (tmp_path / "summary.json").exists()


@pytest.mark.parametrize(("grains", "option"), [(16, "--order-grains 16"), (36, "--grains 36")])
def test_grains_that_do_not_fit_are_refused_with_the_option_that_gave_them(grains, option):
    params = energy_conservation.Params(grains=36, order_grains=16, corner_radius=0.3, gap=0.2)
    with pytest.raises(lsm.InputError, match=rf"--gap 0.2, {option}, --seed 1: refused, as "):
        energy_conservation.build(params, grains, 1, 50, "onset_verlet")


def test_drift_is_the_greatest_relative_deviation():
    series = {
        "translational_energy": np.array([1.0, 0.5, 1.0]),
        "rotational_energy": np.array([0.0, 0.2, 0.0]),
        "elastic_energy": np.array([0.0, 0.2, 0.01]),
        "shadow_correction": np.array([0.0, 0.1, 0.0]),
    }
    assert energy_conservation.drift(series) == pytest.approx(0.1)  # 0.9 J of 1 J
    assert np.isclose(energy_conservation.drift(series, shadow=True), 0.01)
