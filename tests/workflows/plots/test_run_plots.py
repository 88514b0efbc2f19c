"""Pictures: the grains' true outlines in their places, and curves of what the files hold."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import taichi_lsm as lsm
from tests.helpers.pictures import curves, panels
from workflows.plots import layer_pictures, run_panels, run_plots, run_titles


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
    assert drawn_area(snapshot) * 1e-6 == pytest.approx(exact, rel=1e-3)


def test_grains_hardly_overlap_in_their_places(sheared):
    """Wrong orientations or positions would make the outlines of angular grains cross."""
    shapely = pytest.importorskip("shapely")
    folder, params, _ = sheared("angular")
    snapshot = layer_pictures.read_snapshot(folder / "grains.nc")
    polygons = [shapely.Polygon(o + p) for o, p, glued in zip(*snapshot[:2], snapshot.glued, strict=True) if not glued]
    together = shapely.union_all(polygons).area
    assert together == pytest.approx(sum(p.area for p in polygons), rel=2e-3)


def test_positions_are_wrapped_and_velocities_relative_to_the_platen(sheared):
    folder, params, _ = sheared("round")
    snapshot = layer_pictures.read_snapshot(folder / "grains.nc")
    assert snapshot.period == pytest.approx(10 * 1e3 * params.diameter)
    assert np.all((snapshot.position[:, 0] >= 0) & (snapshot.position[:, 0] < snapshot.period))
    upper = snapshot.glued & (snapshot.position[:, 1] > snapshot.position[:, 1].mean())
    assert np.allclose(snapshot.velocity[upper], 1.0)
    on_file = lsm.open_run(folder / "grains.nc").isel(time=-1).velocity.values[:, 0]
    assert np.allclose(snapshot.velocity, on_file / on_file[upper].mean())


def test_a_long_title_is_cut_into_lines_of_about_equal_length():
    text = "normal stress 5 MPa, " * 7 + "stiffness number 1000"
    lines = run_titles.wrapped(text).split("\n")
    assert " ".join(lines) == text and len(lines) == 2
    assert max(map(len, lines)) <= 130 and min(map(len, lines)) > 0.5 * max(map(len, lines))
    assert run_titles.wrapped("short") == "short"


@pytest.mark.parametrize(("kind", "magic"), [("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_the_picture_of_a_run_is_written(sheared, kind, magic):
    folder, _, _ = sheared("angular")
    path = run_plots.plot_run(folder, kind)
    assert path == folder / f"run.{kind}" and path.read_bytes().startswith(magic)


def test_the_platens_are_unlike_every_colour_of_the_map(sheared):
    """White and hatched: the middle of the map is grey."""
    import matplotlib

    folder, _, _ = sheared("round")
    axes = Figure().subplots()
    layer_pictures.draw_packing(axes, layer_pictures.read_snapshot(folder / "grains.nc"))
    glued = axes.collections[0]
    nearest = np.abs(matplotlib.colormaps[layer_pictures.MAP].colors - glued.get_facecolor()[0, :3]).max(axis=1).min()
    assert nearest > 0.5 and glued.get_hatch()


def test_the_arrow_of_the_shear_is_inside_the_frame_whatever_the_width(sheared):
    folder, _, _ = sheared("round")
    snapshot = layer_pictures.read_snapshot(folder / "grains.nc")
    axes = Figure().subplots()
    layer_pictures.draw_packing(axes, snapshot)
    (arrow,) = axes.texts
    _, high = axes.get_ylim()
    top = (snapshot.position[:, 1] + [o[:, 1].max() for o in snapshot.outlines]).max()
    assert top < arrow.xy[1] < high and 0.0 < arrow.xy[0] < snapshot.period


def test_a_title_is_cut_at_commas_and_never_inside_an_option():
    text = (
        "2D gouge of discs, 105 to 149 µm across, normal stress 5 MPa, Coulomb friction (coefficient 0.5), of number 1"
    )
    for width in (60, 80, 100):
        assert all(line.endswith(",") for line in run_titles.wrapped(text, width).split("\n")[:-1])
    long = (
        "the grains overlap by more than a tenth of what they can carry at this place: raise --stiffness-number to 3000"
    )
    for width in range(30, 100, 7):
        assert "--stiffness-number" in run_titles.wrapped(long, width)


@pytest.mark.parametrize("shift", [-0.5, 0.0])
def test_friction_below_zero_is_inside_the_panel(sheared, shift):
    _, params, dataset = sheared("round")
    rows = dataset.isel(time=dataset.stage.values == "shear")
    rows = rows.assign(
        friction=rows.friction + shift, platen_shear_stress=rows.platen_shear_stress + shift * rows.platen_normal_stress
    )
    axes = Figure().subplots()
    run_panels.draw_friction(axes, rows, params)
    drawn = [curves(axes)[label][1] for label in ("in the bulk", "the same at the top platen")]
    least, greatest = min(y.min() for y in drawn), max(y.max() for y in drawn)
    low, high = axes.get_ylim()
    assert low <= least and greatest < high and (low < 0.0) == (least < 0.0)
    assert (0.0 in [line.get_ydata()[0] for line in axes.lines if np.ptp(line.get_ydata()) == 0.0]) == (least < 0.0)


def test_the_title_says_what_ran_and_what_pulled_it(sheared):
    _, params, dataset = sheared("angular")
    rows = dataset.isel(time=dataset.stage.values == "shear")
    grains = run_titles.grains_of_run(dataset, params)
    assert run_titles.conditions(params, rows, grains).startswith(
        "2D gouge of angular grains, 105 to 149 µm across, sheared at constant velocity, normal stress 5 MPa"
    )
    changed = params.model_copy(update={"load_stiffness_ratio": 0.01, "largest_diameter": params.smallest_diameter})
    words = run_titles.conditions(changed, rows, "discs")
    assert "discs, 105 µm across, pulled by a spring of 0.01 times the shear stiffness of the layer, normal" in words


def test_a_title_has_no_number_for_what_is_unknown(sheared):
    _, params, dataset = sheared("round")
    rows = dataset.isel(time=dataset.stage.values == "shear").assign(stiffness_number=np.nan)
    assert run_titles.conditions(params, rows, "discs").endswith(", stiffness number unknown")
    rows = rows.assign(inertial_number=rows.inertial_number * np.nan)
    assert ", inertial number unknown, stiffness number unknown" in run_titles.conditions(params, rows, "discs")


def test_a_shape_without_a_complete_run_says_how_its_runs_ended():
    table = xr.Dataset({"shape": ("run", ["round", "angular", "angular"]), "seed": ("run", [1, 1, 2])})
    table["status"] = ("run", ["complete", "failed", "interrupted"])
    axes = Figure().subplots()
    run_plots.say_why_none(axes, table, "angular", 2, "d")
    (text,) = axes.texts
    assert text.get_text() == "(d) no complete run of angular grains\nseed 1: failed\nseed 2: interrupted"
    assert not axes.axison  # no empty frame


def test_the_picture_of_a_run_shows_what_its_files_hold(sheared, pictures):
    folder, params, dataset = sheared("angular")
    run_plots.plot_run(folder)
    rows = dataset.isel(time=dataset.stage.values == "shear")
    strain = rows.shear_strain.values
    title = pictures[0].get_suptitle().replace("\n", " ")
    assert title.startswith("2D gouge of angular grains, ")
    assert "Coulomb friction (coefficient 0.5), inertial number" in title and "stiffness number 1000" in title
    friction, layer, thickness, energy = panels(pictures[0], "abcd")
    assert not any(axes.get_title("left").startswith("(e)") for axes in pictures[0].axes)  # no spring, no bonds

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
