"""What the curves of a run are drawn against, and where its stages are marked."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from tests.helpers.pictures import curves
from workflows.plots import run_panels
from workflows.plots.course import course_of
from workflows.plots.friction_axes import mark_stages
from workflows.plots.slip_and_breakage import draw_spring

PARAMS = SimpleNamespace(
    smallest_diameter=1e-4,
    largest_diameter=3e-4,
    density=2500.0,
    normal_stress=1e6,
    shape="round",
    normal_stiffness=1e9,
)
SIZE = 2e-4  # mean diameter [m]
UNIT = SIZE * np.sqrt(2500.0 / 1e6)  # inertial time [s]
THICKNESS = 1e-2  # [m]

LINE = "imposed, over --normal-stress"


def rows(steps, velocities, names, **more):
    """Rows of stages of two rows each, which move the platen by these steps [mean diameters]; 3 t_i apart."""
    count, displacement = len(steps), SIZE * np.cumsum(steps)
    columns = {
        "displacement": displacement,
        "shear_strain": displacement / THICKNESS,
        "layer_thickness": np.full(count, THICKNESS),
        "load_point_velocity": np.array(velocities, float),
        "stage_index": 2 + np.arange(count) // 2,
        "stage": np.repeat(names, 2),
        "friction": np.full(count, 0.3),
        "platen_shear_stress": np.full(count, 3e5),
        "platen_normal_stress": np.full(count, 1e6),
        "cycle": np.zeros(count, int),
    }
    return xr.Dataset(
        {name: ("time", v) for name, v in (columns | more).items()}, {"time": 3.0 * UNIT * np.arange(count)}
    )


FORTH_AND_BACK = rows([1.0, 1.0, -2.0, -2.0, 1.0, 1.0], [1, 1, -2, -2, 1, 1], ["forth", "back", "forth-again"])
HELD = rows([1.0, 1.0, 0.1, 0.0, 1.0, 1.0], [1, 1, 0, 0, 1, 1], ["slide", "hold", "slide-again"])
IMPOSED = {"imposed_shear_stress": np.array([np.nan, np.nan, 2e5, 2e5, np.nan, np.nan])}
CREPT = rows([1.0, 1.0, 0.1, 0.2, 1.0, 1.0], [1, 1, 0.1, 0.2, 1, 1], ["slide", "creep", "slide-again"], **IMPOSED)


def test_stages_that_slide_are_drawn_against_slip_which_grows_in_either_direction():
    course = course_of(FORTH_AND_BACK, PARAMS)
    assert course.values == pytest.approx([1.0, 2.0, 4.0, 6.0, 7.0, 8.0])
    assert course.label == "slip in either direction [mean diameters]" and not course.timed


@pytest.mark.parametrize("sheared", [HELD, CREPT])
def test_a_hold_and_a_shear_stress_are_drawn_against_time(sheared):
    course = course_of(sheared, PARAMS)
    assert course.values == pytest.approx(3.0 * np.arange(6))
    assert course.label == "time since shear began [inertial times]" and course.timed
    still = HELD.assign(shear_strain=0.0 * HELD.shear_strain)
    assert course_of(still, PARAMS).label == "time since the first level [inertial times]"


def test_one_velocity_is_drawn_against_strain():
    course = course_of(FORTH_AND_BACK.drop_vars("cycle"), PARAMS)
    assert np.array_equal(course.values, FORTH_AND_BACK.shear_strain) and course.label == "shear strain [1]"


def test_stages_begin_where_the_stage_before_ended():
    axes = Figure().subplots()
    axes.set_xlim(0.0, 8.0)
    mark_stages(axes, course_of(FORTH_AND_BACK, PARAMS).values, FORTH_AND_BACK)
    assert [line.get_xdata()[0] for line in axes.lines] == pytest.approx([1.0, 2.0, 6.0])
    assert [(text.get_text(), text.get_position()[0]) for text in axes.texts] == [
        ("forth", pytest.approx(1.5)),
        ("back", pytest.approx(4.0)),
        ("forth-again", pytest.approx(7.0)),
    ]


def test_friction_under_a_stress_has_what_is_imposed_and_the_slip_beside_it():
    axes = Figure().subplots()
    run_panels.draw_stages(axes, CREPT, PARAMS, course_of(CREPT, PARAMS))
    drawn = curves(axes)
    assert drawn["at the top platen"][1] == pytest.approx(0.3)
    assert drawn[LINE][1][2:4] == pytest.approx(0.2) and np.isnan(drawn[LINE][1][[0, 1, 4, 5]]).all()
    slip = next(other for other in axes.figure.axes if other is not axes)
    assert slip.lines[0].get_ydata() == pytest.approx([1.0, 2.0, 2.1, 2.3, 3.3, 4.3])
    axes = Figure().subplots()
    run_panels.draw_stages(axes, FORTH_AND_BACK, PARAMS, course_of(FORTH_AND_BACK, PARAMS))
    assert len(axes.figure.axes) == 1 and LINE not in curves(axes)


def test_a_spring_whose_load_point_holds_has_its_stretch_and_finite_velocities():
    spring = {"spring_stretch": np.array([1, 2, 2, 2, 3, 4]) * 1e-6, "plate_velocity": np.array([1, 1, 0.1, 0, 2, 1])}
    sheared = HELD.assign({name: ("time", values) for name, values in spring.items()})
    axes = Figure().subplots()
    draw_spring(axes, sheared, "e", course_of(sheared, PARAMS))
    assert axes.lines[0].get_ydata() == pytest.approx([1, 2, 2, 2, 3, 4])
    velocity = next(other for other in axes.figure.axes if other is not axes).lines[0]
    assert velocity.get_ydata() == pytest.approx([1, 1, 0.1, 0, 2, 1])
