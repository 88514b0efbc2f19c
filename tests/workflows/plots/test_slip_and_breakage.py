"""Panels of a run that not every run has: friction and slips on a spring, breakage."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from workflows.plots import slip_and_breakage


def layer_on_a_spring():
    """Rows of a layer that sticks for 9 of 10 rows and then catches up with the load point."""
    time = np.linspace(0.0, 0.04, 41)  # [s]
    load = 2e-3 * time  # [m]
    displacement = 2e-3 * 0.01 * np.floor(time / 0.01 + 1e-9)
    friction = 0.3 + 0.2 * (load - displacement) / load[10]
    rows = {
        "load_point_velocity": np.full(41, 2e-3),
        "displacement": displacement,
        "platen_shear_stress": 5e6 * friction,
        "platen_normal_stress": np.full(41, 5e6),
        "shear_strain": np.linspace(0.0, 1.0, 41),
        "bond_count": np.linspace(200, 150, 41).astype(int),
        "fragment_count": np.linspace(20, 44, 41).astype(int),
    }
    return xr.Dataset({name: ("time", values) for name, values in rows.items()}, coords={"time": time})


def test_friction_on_a_spring_is_drawn_against_the_load_point_and_time():
    rows = layer_on_a_spring()
    axes = Figure().subplots()
    slip_and_breakage.draw_spring(axes, rows, "e")
    axes.figure.draw_without_rendering()
    (friction,) = axes.lines
    assert np.allclose(friction.get_xdata(), 1e6 * 2e-3 * rows.time.values)  # [um]
    assert np.allclose(friction.get_ydata(), rows.platen_shear_stress / 5e6)
    slip = next(other for other in axes.figure.axes if other is not axes)
    velocity, edges, _ = slip.patches[0].get_data()
    assert np.allclose(edges, friction.get_xdata())
    assert np.allclose(velocity[:9], 0.0, atol=1e-9) and velocity[9] == pytest.approx(10.0)  # 10 rows' way in one
    (above,) = axes.child_axes
    assert above.get_xlabel() == "time since shear began [ms]" and above.get_xlim() == pytest.approx((0.0, 40.0))


def test_breakage_is_drawn_with_bonds_and_fragments():
    axes = Figure().subplots()
    slip_and_breakage.draw_breakage(axes, layer_on_a_spring(), "f")
    assert axes.lines[0].get_ydata()[[0, -1]] == pytest.approx([0.0, 25.0])  # [%]
    other = next(a for a in axes.figure.axes if a is not axes)
    assert other.lines[0].get_ydata()[[0, -1]].tolist() == [20, 44]
    assert axes.get_title() == "(f) breakage: 200 bonds, 20 to 44 fragments"


def test_bonds_that_had_broken_before_shear_are_not_drawn_as_broken_in_it():
    axes, rows = Figure().subplots(), layer_on_a_spring()
    slip_and_breakage.draw_breakage(axes, rows.assign(bond_count=0 * rows.bond_count), "f")
    assert not axes.lines and "no bond was left when shear began, 20 to 44 fragments" in axes.get_title()


def title_of(rows):
    axes = Figure().subplots()
    slip_and_breakage.draw_spring(axes, rows, "e")
    return axes.get_title("left") + axes.get_title()


def test_the_title_of_a_layer_on_a_spring_tells_slips_or_that_there_are_none():
    """The layer above slips at rows 10, 20, 30, 40; with a stiff spring the platen moves as the load point."""
    rows = layer_on_a_spring()
    assert "(e) friction on the spring: 4 slips, with the platen above 2 times the velocity" in title_of(rows)
    stiff = rows.assign(displacement=2e-3 * rows.time)
    assert "(e) friction on the spring: no slip, the platen never above 2 times the velocity" in title_of(stiff)
    assert "1 slip, with" in title_of(rows.isel(time=slice(0, 15)))


def test_a_slip_whose_velocity_fluctuates_about_the_bound_is_one():
    velocity = np.array([0.5, 1.5, 2.1, 1.9, 2.2, 0.9, 1.5, 1.8, 0.2, 3.0])
    assert slip_and_breakage.count_slips(velocity) == 2
    assert slip_and_breakage.count_slips(np.full(9, 1.9)) == 0


def test_friction_below_zero_and_a_platen_at_rest_are_drawn_whole():
    rows = layer_on_a_spring()
    falling = rows.assign(platen_shear_stress=rows.platen_shear_stress - 2e6, displacement=0.0 * rows.displacement)
    axes = Figure().subplots()
    slip_and_breakage.draw_spring(axes, falling, "e")
    low, high = axes.get_ylim()
    friction = axes.lines[0].get_ydata()
    assert low < friction.min() < 0.0 < friction.max() < high
    assert any(np.array_equal(line.get_ydata(), [0.0, 0.0]) for line in axes.lines[1:])  # the line at zero
    slip = next(other for other in axes.figure.axes if other is not axes)
    assert slip.get_ylim()[1] > 1.0  # holds the velocity of the load point
