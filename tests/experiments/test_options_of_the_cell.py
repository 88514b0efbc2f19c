"""Every option of shear-cell changes what is computed, or is refused; with the stand-ins of `test_options_act`."""

import contextlib
from types import SimpleNamespace

import pytest

import taichi_lsm as lsm
from tests.experiments import test_options_act as acts
from workflows import shear_cell
from workflows.common.parameters import merge
from workflows.gouge import layer_run
from workflows.plots import cell_plots

pytestmark = [pytest.mark.usefixtures("few_shapes"), pytest.mark.validate]

BASES = [
    acts.LAYER,
    acts.LAYER | {"shape": "angular"},
    acts.LAYER | {"dim": 3, "width": 5.0},
    acts.LAYER | {"effects": [acts.RATE_AND_STATE, acts.HERTZ], "solid_fraction": 0.5},
    {name: value for name, value in acts.LAYER.items() if name != "grains"} | {"cell_height": 8.0},
]
EFFECTS = ([acts.DASHPOT | {"restitution": 0.7}],)


class Simulation(acts.Simulation):
    """Stands in for the simulation of a cell."""

    def __init__(self, scene, *machine):
        super().__init__(scene, *machine)
        self.log.append((scene.periodic, scene.cell_servo))
        self.domain = SimpleNamespace(
            shear_rate=[0.0], servo=scene.cell_servo, set_shear_rate=self.shear, set_servo=self.log.append
        )

    def shear(self, rate):
        self.log.append(rate)
        self.speed = rate  # of a cell one metre high


class Cell(acts.Layer):
    """Stands in for a sheared cell that is at its stress, or has come down to its solid fraction."""

    def __init__(self, sim, stress, diameter):
        super().__init__(sim, stress, diameter)
        self.thickness = sim.domain.servo.least_height or self.thickness

    def sample(self):
        self.sim.log.append(self.sim.step)
        self.strain += self.sim.speed * self.sim.dt * (self.sim.step - self.before)
        self.before = self.sim.step


class Recorder(acts.Recorder):
    """Stands in for the files of a cell."""

    def row(self):
        return super().row() | {"cell_normal_stress": self.layer.stress}


def series():
    """A file run.nc of a cell."""
    dataset = acts.series()
    names = ("cell_normal_stress", "cell_normal_rms", "normal_stress_along", "cell_height")
    return dataset.assign({name: dataset.normal_stress * (1.0 + i * dataset.porosity) for i, name in enumerate(names)})


@pytest.fixture
def observed(monkeypatch, tmp_path):
    """observed(params): all that the experiment does, as a text."""
    log = []

    def simulation(*given):
        sim = Simulation(*given)
        log.append(sim.log)
        return sim

    def summary(out, workflow, preset, metrics, quiet):
        timed = ("seconds", "cpu_seconds", "grain_steps_per_second")
        log.append({name: metric.value for name, metric in metrics.items() if name not in timed})

    for name, stand_in in (("Simulation", simulation), ("ShearedCell", Cell), ("LayerRecorder", Recorder)):
        monkeypatch.setattr(lsm, name, stand_in)
    monkeypatch.setattr(lsm, "open_run", lambda path: series())
    monkeypatch.setattr(lsm, "runtime_profile_text", lambda sim: log.append("profile") or "")
    monkeypatch.setattr(lsm.checkpoints, "remove_checkpoints", lambda out: log.append("removed"))
    monkeypatch.setattr(layer_run, "RunLoop", acts.Loop)
    monkeypatch.setattr(layer_run, "write_summary", summary)
    monkeypatch.setattr(cell_plots, "plot_cell", lambda out, form: log.append(form))

    def observe(params):
        log.clear()
        with contextlib.suppress(acts.Stop):
            shear_cell.run(params, tmp_path, existing="overwrite")
        return repr(log)

    return observe


def outcomes(base, key, field, observe, before):
    """For each other value of an option "acts", "ignored", or the reason why it is refused."""
    value = getattr(merge(shear_cell.Params, options=base), key)
    for other in EFFECTS if key == "effects" else acts.other_values(key, field, value):
        try:
            params = merge(shear_cell.Params, options=base | {key: other})
            yield "acts" if observe(params) != before else "ignored"
        except lsm.InputError as error:
            yield str(error)


def test_every_option_of_a_cell_acts_or_is_refused(observed):
    acting = set()
    for base in BASES:
        before = observed(merge(shear_cell.Params, options=base))
        assert before == observed(merge(shear_cell.Params, options=base))  # only options make a difference
        for key, field in shear_cell.Params.model_fields.items():
            found = list(outcomes(base, key, field, observed, before))
            assert "acts" in found or (found and "ignored" not in found), (base, key, found)
            acting |= {key} if "acts" in found else set()
    assert acting == set(shear_cell.Params.model_fields), set(shear_cell.Params.model_fields) - acting
