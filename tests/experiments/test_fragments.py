"""The metrics and the figure of fragments, of runs whose fragments and energies are known."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from workflows import shear_gouge
from workflows.gouge.fragments import fragment_metrics, size_range, write_fragments
from workflows.plots.fragments import Place, plot_fragments
from workflows.plots.run_titles import title_of

PARAMS = shear_gouge.Params(shape="angular", breakable=True, dim=3, pieces=27)
STRAINS = (0.0, 0.0, 0.5)


def run_of(work=2.0, lost=0.3):
    """run.nc: bonds of 4e-9 m2 break while they dissipate a share of the work, a part of each before shear began."""
    time = np.arange(4.0)
    series = {"fracture_area": [0.0, 1e-9, 2e-9, 5e-9], "work_throughput": work * np.array([0.0, 0.0, 0.5, 1.0])}
    series |= {"shear_strain": [0.0, 0.0, 0.2, 0.5], "inertial_number": np.full(4, 1e-3), "energy_residual": 0.0 * time}
    data = {name: ("time", values) for name, values in series.items()} | {"stiffness_number": 1000.0}
    data["dissipated_energy"] = (("time", "effect"), np.outer([0.0, 0.1, 0.2, 0.1 + lost], [0.0, 1.0]))
    effects = {
        "parameter_effect": ["coulomb_friction", "elastic_brittle_bond"],
        "parameter_role": ["friction", "bonds"],
    }
    effects |= {"parameter_name": ["", ""], "parameter_unit": ["", ""], "parameter_text": ["", ""]}
    data |= {name: ("effect_parameter", values) for name, values in effects.items()}
    data["parameter_value"] = ("effect_parameter", [np.nan, np.nan])
    coords = {"time": time, "stage": ("time", ["consolidate", "shear", "shear", "shear"])}
    coords["effect_name"] = ("effect", ["coulomb_friction", "elastic_brittle_bond"])
    attributes = {"config_toml": "\n".join(toml_lines()), "title": "Shear of a layer of breakable grains in 3D"}
    return xr.Dataset(data, coords, attributes)


def toml_lines():
    numbers = ("dim", "smallest_diameter", "largest_diameter", "normal_stress", "pieces", "bond_strength")
    return [f"{name} = {getattr(PARAMS, name)!r}" for name in numbers] + ['shape = "angular"']


def catalogue(dimension=2.0, count=400):
    """Three snapshots: whole grains, twice, and a power law of sizes."""
    low, high = size_range(PARAMS)
    chance = (np.arange(count) + 0.5) / count
    law = low * (1.0 - chance * (1.0 - (high / low) ** -dimension)) ** (-1.0 / dimension)
    parts = [np.full(30, PARAMS.diameter), np.full(30, PARAMS.diameter), law]
    of_snapshot = np.repeat(np.arange(3), [len(part) for part in parts])
    d = np.concatenate(parts)
    columns = {"diameter": d, "mass": d**3, "elongation": np.full(len(d), 0.7), "flatness": np.full(len(d), 0.6)}
    columns |= {"new_surface": 1e-9 * (of_snapshot == 2), "shear_strain": np.array(STRAINS)[of_snapshot]}
    return xr.Dataset({n: ("fragment", v) for n, v in columns.items()}, {"snapshot": ("fragment", of_snapshot)})


def test_the_metrics_are_those_of_the_last_snapshot_and_of_what_broke_since_shear_began():
    metrics = fragment_metrics(run_of(), catalogue(), PARAMS)
    last = catalogue().isel(fragment=slice(60, None))
    mean = float((last.mass * last.diameter).sum() / last.mass.sum())
    assert metrics["fragment_diameter"].value == pytest.approx(mean / PARAMS.diameter)
    assert metrics["fragment_elongation"].value == pytest.approx(0.7)
    assert metrics["fractal_dimension"].value == pytest.approx(2.0, abs=1e-3)
    low, high = metrics["fractal_dimension"].interval
    assert low < 2.0 < high and metrics["fractal_misfit"].value < 0.01
    assert metrics["new_surface"].value == pytest.approx(2 * 4e-9)
    assert metrics["surface_energy"].value == pytest.approx(0.3 / 8e-9)
    assert metrics["fracture_share"].value == pytest.approx(0.15)


def test_grains_that_are_all_whole_have_no_dimension_and_no_surface():
    whole = catalogue().isel(fragment=slice(0, 60))
    still = run_of().isel(time=slice(0, 2))
    metrics = fragment_metrics(still, whole.assign(diameter=whole.diameter * 2.0), PARAMS)
    assert metrics["fractal_dimension"].value is None and "0 lie between" in metrics["fractal_dimension"].note
    assert metrics["surface_energy"].value is None and metrics["surface_energy"].note.endswith("none broke")


def test_the_figure_shows_every_snapshot_but_the_first_and_the_file_is_whole(tmp_path, monkeypatch):
    path, drawn, save = tmp_path / "fragments.png", [], Figure.savefig
    monkeypatch.setattr(Figure, "savefig", lambda figure, *to, **how: [drawn.append(figure), save(figure, *to, **how)])
    plot_fragments(path, run_of(), catalogue(), size_range(PARAMS))
    assert path.stat().st_size > 10_000
    panels = [axes for axes in drawn[0].axes if axes.get_title(loc="left")]
    ends = [axes._left_title.get_window_extent().x1 for axes in panels]
    space = [0.5 * drawn[0].bbox.x1, drawn[0].bbox.x1] * 2
    assert len(ends) == 4 and all(end < most - 5 for end, most in zip(ends, space))
    write_fragments(tmp_path / "fragments.nc", catalogue(), PARAMS)
    with xr.open_dataset(tmp_path / "fragments.nc") as stored:
        assert stored.run_status == "complete" and stored.sizes["fragment"] == 460


def test_a_layer_that_is_compressed_is_shown_by_its_normal_stress():
    """No strain tells the snapshots of an oedometer apart, and its title speaks of no shear."""
    last = catalogue().isel(fragment=slice(60, None)).assign(time=("fragment", np.full(400, 2.5)))
    assert (Place(run_of()).label, Place(run_of()).words(last)) == ("shear strain [1]", "strain 0.5")
    stress = {"platen_normal_stress": ("time", [5e6, 5e6, 1e7, 2e7]), "cycle": ("time", np.zeros(4, int))}
    still = run_of().assign(shear_strain=("time", np.zeros(4)), **stress)
    assert (Place(still).label, Place(still).words(last)) == ("normal stress [MPa]", "15 MPa")
    assert "compressed in levels" in title_of(still) and "inertial" not in title_of(still)
    sheared = title_of(run_of().assign(stress))
    assert "sheared in stages" in sheared and "inertial number 0.001" in sheared
