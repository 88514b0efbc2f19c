"""Pictures of packings: what colours the grains, force chains, roses, and surfaces in 3D."""

import numpy as np
import pytest
import xarray
from matplotlib.figure import Figure

import taichi_lsm as lsm
from tests.helpers.contact_tables import moment_of
from tests.helpers.drawn_runs import STIFFNESS, contacts_of, write_drawn_run
from tests.helpers.exported_runs import GLUED, LENGTH, TIMES
from tests.helpers.shaped_grains import append_snapshot, grains_file
from workflows.plots import contact_values, solid_pictures
from workflows.plots.figures import force_chains, grain_sizes, profiles, rose
from workflows.plots.packing import Colours, draw, layer_of, scale_of
from workflows.plots.run_files import Moment, Moments, RunFiles
from workflows.plots.solid_pictures import basis, box_of, corners_of, draw_solids, extent_of, nice_length

SIZE, GAP = 1e-3, 0.98e-3


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """runs(dim): the files of a small run."""
    opened = {}

    def get(dim):
        if dim not in opened:
            opened[dim] = RunFiles(write_drawn_run(tmp_path_factory.mktemp("run") / str(dim), dim))
        return opened[dim]

    yield get
    for run in opened.values():
        run.__exit__()


def row_of_discs(folder, count=4):
    """A moment of discs of 1 mm that overlap by 0.02 mm along x, beside no border, and a wall at the first one."""
    place = np.stack([2e-3 + GAP * np.arange(count), np.full(count, 1e-3)], axis=1)
    writer = grains_file(folder / "grains.nc", [lsm.disc()], np.zeros(count, int), np.full(count, SIZE), [1.0])
    append_snapshot(writer, 1e-3, place)
    writer.close("complete")
    contacts = contacts_of(place, SIZE, np.inf)
    wall = moment_of([0], [-1], place[:1] - (0.49e-3, 0.0), [(-0.49e-3, 0.0)], [(-1.0, 0.0)], [0.2], [(0.0, 0.0)])
    flags = {name: ("contact", np.zeros(1, np.int8)) for name in ("bonded", "sliding")}
    rows = xarray.concat([contacts, wall.assign(flags)], "contact", data_vars="minimal").assign(time=1e-3)
    run = RunFiles(folder)
    (moment,) = Moments(run, ("grains",))
    return moment._replace(contacts=rows)


def test_grains_that_touch_twice_and_walls_count_once(tmp_path):
    moment = row_of_discs(tmp_path)
    assert contact_values.coordination(moment).tolist() == [2, 2, 2, 1]
    twice = xarray.concat([moment.touching, moment.touching.isel(contact=[0])], "contact", data_vars="minimal")
    assert contact_values.coordination(moment._replace(contacts=twice)).tolist() == [2, 2, 2, 1]
    bonded = moment.touching.assign(bonded=("contact", np.array([1, 0, 0, 0], np.int8)))
    assert contact_values.coordination(moment._replace(contacts=bonded)).tolist() == [1, 1, 2, 1]
    moment.run.__exit__()


def test_forces_and_stresses_are_those_of_pressed_discs(tmp_path):
    """A disc between two forces F at arms r has the mean normal stress 2 F r/(2 V), where V is its volume."""
    moment = row_of_discs(tmp_path)
    force = STIFFNESS * (SIZE - GAP)
    assert contact_values.normal_force(moment) == pytest.approx([force + 0.2, 2.0 * force, 2.0 * force, force])
    volume = np.pi / 4.0 * SIZE**2
    stress = 2.0 * force * 0.5 * GAP / (2.0 * volume)
    assert contact_values.mean_stress(moment)[1:3] == pytest.approx([stress, stress])
    moment.run.__exit__()


def test_the_colours_hold_the_mobile_grains_and_zero(runs):
    (moment,) = Moments(runs(2), ("grains",))
    values = np.arange(9.0)
    values[list(GLUED)] = 1e9
    low, high = scale_of(moment, values, Colours("a"))["colours"]
    assert low == 0.0 and 7.0 < high <= 8.0
    assert scale_of(moment, -values, Colours("a", signed=True))["colours"] == pytest.approx((-high, high), abs=0.1)
    assert scale_of(moment, values, Colours("a", whole=True))["colours"] == (0.0, 8.0)
    assert scale_of(moment, values * np.nan, Colours("a"))["colours"] == (0.0, 1.0)


@pytest.mark.parametrize("whole", [True, False])
def test_whole_numbers_have_colours_of_their_own(runs, whole):
    (moment,) = Moments(runs(2), ("grains",))
    colours, values = Colours("grains [1]", whole=whole), np.arange(9) % 4
    figure = Figure(layout="constrained")
    draw(figure, moment, values, colours, scale_of(moment, values, colours))
    axes, bar = figure.axes
    mobile = axes.collections[1]
    mobile.update_scalarmappable()
    of_value = {v: tuple(c) for v, c in zip(mobile.get_array(), mobile.get_facecolor(), strict=True)}
    assert len(of_value) == 4 and bar.get_xlabel() == "grains [1]"
    if whole:
        assert [float(t) for t in bar.get_xticks() if -0.5 < t < 3.5] == [0.0, 1.0, 2.0, 3.0]
        assert bar.get_xlim() == (-0.5, 3.5)


def test_lines_across_a_border_are_drawn_from_both_grains(runs):
    moments = Moments(runs(2), ("grains", "contacts"), "all")
    for moment in moments:
        begin, end = force_chains.lines_of(moment)
        contacts, centre = moment.touching, layer_of(moment).position
        assert (centre[:, 0] >= 0.0).all() and (centre[:, 0] < 1e3 * LENGTH).all()  # also of a tilted cell
        assert np.allclose(end - begin, 1e3 * contacts.branch.values[:, None])
        assert np.allclose(begin[:, 0], centre[contacts.first_id.values])
        assert np.allclose(end[:, 1], centre[contacts.second_id.values])
    across = np.linalg.norm(begin[:, 0] - begin[:, 1], axis=1)
    assert (np.isclose(across, 0.0) | np.isclose(across, 1e3 * LENGTH)).all() and (across > 0.1).any()


def test_widths_of_lines_follow_the_force_up_to_the_widest():
    scale = {"force": (0.0, 2.0)}
    half, full, beyond = force_chains.width_of(np.array([1.0, -2.0, 100.0]), scale)
    assert full == pytest.approx(force_chains.WIDEST)
    assert half - force_chains.LEAST == pytest.approx(0.5 * (full - force_chains.LEAST))
    assert full < beyond < 1.5 * full


def rose_moment(angle, force, dim=2, tilt=0.0):
    """A moment of contacts with these angles of their normals, which rise from the plane by `tilt`."""
    normal = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    normal = np.cos(tilt) * normal + np.sin(tilt) * np.array([0.0, 0.0, 1.0])
    normal, zero = normal[:, :dim], np.zeros((len(angle), dim))
    rows = moment_of(0 * angle, 0 * angle + 1, zero, normal * SIZE, normal, force, zero)
    flags = {name: ("contact", np.zeros(len(angle), np.int8)) for name in ("bonded", "sliding")}
    return Moment(None, 0.0, None, rows.assign(flags))


@pytest.mark.parametrize("dim", [2, 3])
def test_roses_have_the_density_and_the_force_of_each_direction(dim):
    """Contacts of density 1 + 0.5 cos 2(theta - 120 degrees) and forces 3 + cos 2(theta - 120 degrees) N."""
    even = (np.arange(20000) + 0.5) / 20000 * np.pi
    where = np.radians(120.0)
    share = even / np.pi + 0.25 * (np.sin(2.0 * (even - where)) + np.sin(2.0 * where)) / np.pi
    angle = np.interp(even / np.pi, share, even)
    force = 3.0 + np.cos(2.0 * (angle - where))
    moment = rose_moment(angle, force, dim, tilt=np.radians(20.0 if dim == 3 else 0.0))
    found = rose.fabric_of(moment)
    number, mean = rose.radii_of(found)
    middle = found.rose.angle.values
    assert number == pytest.approx(1.0 + 0.5 * np.cos(2.0 * (middle - where)), abs=0.02)
    assert mean == pytest.approx((3.0 + np.cos(2.0 * (middle - where))) / force.mean(), abs=0.02)
    if dim == 3:
        steep = rose_moment(angle, force, dim, tilt=np.radians(31.0))
        with pytest.raises(lsm.InputError, match="needs 10 contacts that press, and there are 0"):
            rose.fabric_of(steep)


def test_profiles_are_those_of_the_snapshots_from_the_steady_state_on(runs):
    times, words = profiles.steady_times(runs(2))
    assert times == (TIMES[1], TIMES[2]) and words == "mean of 2 snapshots, strain 0.001 to 0.002"
    assert profiles.slabs_of(runs(2).snapshots.dataset) == profiles.SLABS[0]


def test_elongation_is_that_of_a_rectangle(tmp_path):
    """Of an outline a x b the second moments of the points of its sides are (a^3 + 3 a^2 b)/12 a side, and so on."""
    a, b = 3.0, 1.0
    corners = 0.5 * np.array([(-a, -b), (a, -b), (a, b), (-a, b)])
    fine = np.concatenate([np.linspace(p, q, 400, endpoint=False) for p, q in zip(corners, np.roll(corners, -1, 0))])

    class Rectangle:
        dim = 2

        def vertices_of(self, shape):
            return fine

    run = RunFiles(tmp_path)
    vars(run)["snapshots"] = type("Snapshots", (), {"outlines": Rectangle()})
    expected = np.sqrt((b**3 + 3.0 * b**2 * a) / (a**3 + 3.0 * a**2 * b))
    assert grain_sizes.ends_of(run, 0) == pytest.approx(expected, rel=1e-4)


def test_the_view_is_from_the_right_above_the_layer_and_holds_it(runs):
    right, up, towards = view = basis()
    assert np.allclose(view @ view.T, np.eye(3)) and np.linalg.det(view) == pytest.approx(1.0)
    assert right[0] > 0.7 and up[1] > 0.7 and towards[2] > 0.7
    (moment,) = Moments(runs(3), ("grains",))
    seen = 1e3 * moment.grains.position @ view.T
    for axis, name in enumerate(extent_of(moment)):
        low, high = extent_of(moment)[name]
        assert low < seen[:, axis].min() and seen[:, axis].max() < high
    corners = corners_of(box_of(moment))
    assert len(np.unique(corners, axis=0)) == 8 and np.ptp(corners[:, 0]) == pytest.approx(1e3 * LENGTH)


@pytest.mark.parametrize(("most", "length"), [(0.3, 0.2), (1.0, 1.0), (7.0, 5.0), (0.0199, 0.01)])
def test_bars_of_length_are_round_numbers(most, length):
    assert nice_length(most) == pytest.approx(length)


def test_seams_lie_on_the_edges_of_a_tetrahedron_and_surfaces_are_closed(tmp_path):
    """A point of an edge is near two faces, in diameters, and a point within a face near one."""
    shapes = [lsm.shapes.regular_polyhedron(4), lsm.sphere()]
    writer = grains_file(tmp_path / "grains.nc", shapes, [0, 1], [1e-3] * 2)
    append_snapshot(writer, 1e-3, np.zeros((2, 3)))
    writer.close("complete")
    with RunFiles(tmp_path) as run:
        (moment,) = Moments(run, ("grains",))
        centre = run.snapshots.dataset.position.values[0, 0] - moment.grains.position[0]
        surface = run.snapshots.outlines.surfaces[0]
        faces = surface.rows(surface.radius > surface.edge_radius)
        for coarse, off in ((False, 2e-3), (True, 0.1)):
            run.drawn_shapes.clear()
            solids = solid_pictures._solids(moment, coarse)
            assert len(faces.radius) == 4 and len(solids.seams) >= 6
            assert solids.seams.max() < len(run.drawn_shapes[0].rows)  # none of the sphere
            middle = solids.vertices[solids.seams].mean(axis=1) + 1e3 * centre
            depth = np.sort(faces.radius - np.linalg.norm(middle[:, None] - faces.centre, axis=2), axis=1)
            assert (depth[:, 1] < 0.1).all() and depth[:, 2].max() > 0.3  # two faces are near, a third only at corners
            a, b, c = (solids.vertices[solids.triangles[:, i]] for i in range(3))
            volume = np.bincount(solids.grain, np.einsum("ij,ij->i", np.cross(a, b), c) / 6.0)
            assert volume == pytest.approx(np.full(2, np.pi / 6.0), rel=off)  # of a ball of 1 mm, triangles outward


def picture_of_two(folder, monkeypatch, problem):
    """Colours (rows, columns, 3) of a picture of a red ball behind a blue one, seen from the direction of the eye."""
    place = 2e-3 * np.stack([-basis()[2], basis()[2]])
    writer = grains_file(folder / "grains.nc", [lsm.sphere()], [0, 0], [1e-3, 1e-3])
    append_snapshot(writer, 1e-3, place)
    writer.close("complete")
    monkeypatch.setattr(solid_pictures, "rendering_problem", lambda: problem)
    with RunFiles(folder) as run:
        (moment,) = Moments(run, ("grains",))
        figure = Figure(figsize=(2, 2), dpi=100)
        axes = figure.add_axes((0, 0, 1, 1))
        draw_solids(axes, moment, np.array([(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)]), extent_of(moment))
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        canvas = FigureCanvasAgg(figure)
        canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].astype(int)


@pytest.mark.parametrize(
    "problem", [pytest.param(None, id="pyvista", marks=pytest.mark.validate), pytest.param("none", id="matplotlib")]
)
def test_the_nearer_grain_hides_the_one_behind(tmp_path, monkeypatch, problem):
    if problem is None and solid_pictures.rendering_problem() is not None:
        pytest.skip("nothing renders here without a display")
    picture = picture_of_two(tmp_path, monkeypatch, problem)
    red, blue = (
        (picture[..., i] > 60) & (picture[..., i] > 2 * picture[..., 2 - i]) & (picture[..., 1] < 80) for i in (0, 2)
    )
    assert blue.sum() > 1000 and red.sum() < 0.05 * blue.sum()
