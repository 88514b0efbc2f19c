"""Pictures: the grains' true outlines in their places, and curves of what the files hold."""

import numpy as np
import pytest

import taichi_lsm as lsm
from tests.helpers.pictures import curves, panels
from workflows.plots import layer_pictures, run_plots


def area(outline):
    x, y = outline.T
    return 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def drawn_area(snapshot):
    return sum(area(o) for o in snapshot.outlines)


@pytest.mark.parametrize("shape", ["sphere", "angular"])
def test_outlines_have_the_area_of_the_grains(sheared, shape):
    folder, params, _ = sheared(shape)
    grains = lsm.open_run(folder / "grains.nc")
    exact = float(grains.mass.sum()) / (params.density * params.diameter)
    snapshot = layer_pictures.read_snapshot(folder / "grains.nc")
    assert drawn_area(snapshot) * 1e-6 == pytest.approx(exact, rel=0.02)  # chords lie inside the arcs


def test_an_outline_is_closed_and_convex(sheared):
    folder, _, _ = sheared("angular")
    for outline in layer_pictures.shape_outlines(lsm.open_run(folder / "grains.nc"))[1:]:
        side = np.diff(outline, axis=0, append=outline[:1])
        side = side[np.linalg.norm(side, axis=1) > 1e-9]  # an arc begins where the last one ended
        following = np.roll(side, -1, axis=0)
        turn = side[:, 0] * following[:, 1] - side[:, 1] * following[:, 0]
        assert turn.min() > -1e-9
        angles = np.unwrap(np.arctan2(side[:, 1], side[:, 0]))
        assert angles[-1] - angles[0] == pytest.approx(2 * np.pi, abs=1.5)


def test_grains_hardly_overlap_in_their_places(sheared):
    """Wrong orientations or positions would make the outlines of angular grains cross."""
    shapely = pytest.importorskip("shapely")
    folder, params, _ = sheared("angular")
    snapshot = layer_pictures.read_snapshot(folder / "grains.nc")
    polygons = [shapely.Polygon(o + p) for o, p, glued in zip(*snapshot[:2], snapshot.glued, strict=True) if not glued]
    together = shapely.union_all(polygons).area
    assert together == pytest.approx(sum(p.area for p in polygons), rel=2e-3)


def test_positions_are_wrapped_and_velocities_relative_to_the_platen(sheared):
    folder, params, _ = sheared("sphere")
    snapshot = layer_pictures.read_snapshot(folder / "grains.nc")
    assert snapshot.period == pytest.approx(10 * 1e3 * params.diameter)
    assert np.all((snapshot.position[:, 0] >= 0) & (snapshot.position[:, 0] < snapshot.period))
    upper = snapshot.glued & (snapshot.position[:, 1] > snapshot.position[:, 1].mean())
    assert np.allclose(snapshot.velocity[upper], 1.0)
    assert 0.1 < snapshot.velocity[~snapshot.glued].mean() < 0.9


def test_a_mean_is_written_with_its_interval_or_with_the_word_unknown():
    estimate = lsm.statistics.Estimate(0.2612, 0.002, 3.0, 2.0)
    assert run_plots.estimate_text(estimate) == "0.261, 95 % interval 0.253 to 0.270"
    assert run_plots.estimate_text(estimate._replace(standard_error=np.nan)) == "0.261, error unknown"


def test_running_mean():
    assert np.allclose(run_plots.running_mean(np.full(7, 3.0), 4), 3.0)
    assert np.allclose(run_plots.running_mean(np.arange(5.0), 3), [0.5, 1, 2, 3, 3.5])
    assert run_plots.running_mean(np.arange(3.0), 10).shape == (3,)


def test_a_long_title_is_cut_into_lines_of_about_equal_length():
    text = "normal stress 5 MPa, " * 7 + "stiffness number 1000"
    lines = run_plots.wrapped(text).split("\n")
    assert " ".join(lines) == text and len(lines) == 2
    assert max(map(len, lines)) <= 130 and min(map(len, lines)) > 0.5 * max(map(len, lines))
    assert run_plots.wrapped("short") == "short"


@pytest.mark.parametrize(("shape", "dim", "words"), [("round", 2, "discs"), ("round", 3, "spheres")])
def test_round_grains_are_named_by_their_dimension(shape, dim, words):
    assert run_plots.name_of(shape, dim) == words and run_plots.name_of("angular", dim) == "angular grains"


def test_only_checked_references_are_drawn():
    rows = run_plots.published_rows()
    assert sum(len(row[-1]) for row in rows) == sum(r["note"] != "unchecked" for r in lsm.published_friction())
    assert {row[3] for row in rows} == {"laboratory", "simulation"}
    assert [row[2] for row in rows if row[5]] == ["discs 2D, Latham 2005", "spheres 3D, Latham 2005"]


def test_the_picture_of_a_run_is_written(sheared):
    folder, _, _ = sheared("angular")
    path = run_plots.plot_run(folder)
    assert path == folder / "run.png" and path.read_bytes().startswith(b"\x89PNG")


def test_the_picture_of_a_run_shows_what_its_files_hold(sheared, pictures):
    folder, params, dataset = sheared("angular")
    run_plots.plot_run(folder)
    rows = dataset.isel(time=dataset.stage.values == "shear")
    strain = rows.shear_strain.values
    title = pictures[0].get_suptitle().replace("\n", " ")
    assert "Coulomb friction (coefficient 0.5), inertial number" in title and "stiffness number 1000" in title
    friction, layer, thickness, energy = panels(pictures[0], "abcd")

    drawn = curves(friction)
    assert np.array_equal(drawn["in the bulk"][0], strain)
    assert np.array_equal(drawn["in the bulk"][1], rows.friction.values)
    steady = lsm.statistics.steady_ratio(rows.shear_stress, rows.normal_stress, params.steady_from)
    label = f"steady: {run_plots.estimate_text(steady)}"
    assert np.allclose(drawn[label], [(params.steady_from, strain[-1]), (steady.mean, steady.mean)])
    assert friction.get_xlim() == (0.0, strain[-1]) and friction.get_xlabel() == "shear strain [1]"

    snapshot = layer_pictures.read_snapshot(folder / "grains.nc")
    glued, mobile, _ = (len(collection.get_paths()) for collection in layer.collections)
    assert glued >= snapshot.glued.sum() and mobile >= (~snapshot.glued).sum()  # those at a border twice
    assert layer.get_xlim() == (0.0, snapshot.period) and layer.get_xlabel() == "x [mm]"

    (height,) = thickness.lines
    assert np.array_equal(height.get_ydata(), 1e3 * rows.layer_thickness.values)
    assert thickness.get_ylabel() == "layer thickness [mm]"

    work = (rows.external_work - rows.external_work[0]).values
    shown = curves(energy)["work of the platens"][1]
    factor = shown[-1] / work[-1]
    assert np.allclose(shown, factor * work) and np.log10(factor) == pytest.approx(round(np.log10(factor)))
    unit = {0: "J", 3: "mJ", 6: "µJ", 9: "nJ", 12: "pJ"}[round(np.log10(factor))]
    assert energy.get_ylabel() == f"energy since shear began [{unit}]"
