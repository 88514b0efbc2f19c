"""Error against cost: curves and their orders, plans for target errors, the file and the pictures."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray

import taichi_lsm as lsm
from workflows import accuracy_cost, shear_gouge
from workflows.accuracy import Trial, gouge, order, presets, prices
from workflows.accuracy import table as table_command
from workflows.accuracy.commands import as_command
from workflows.accuracy.curves import curves
from workflows.accuracy.table import lines_of
from workflows.accuracy.trials_file import read_trials, write_trials
from workflows.common.metrics import Metric, write_summary
from workflows.common.parameters import merge
from workflows.common.run_table import attributes_of
from workflows.gouge import target_error
from workflows.plots.tenfold import FARTHEST, NEVER, bars_of, plot_summary
from workflows.plots.work_precision import plot_work_precision

DRIFT, AFTER, DURING = "energy drift of a gas", "energy after a collision", "energy during a collision"


def falling(parameter, quantity, power, factor=1.0, rate=0.02, replicas=2):
    """Trials whose error falls as the steps per contact to this power; cost grows with the steps."""
    return [
        Trial(parameter, f"{n} steps", n, quantity, r, factor * n**-power, 1e-6 * n, rate * n)
        for n in (12, 24, 48, 96)
        for r in range(replicas)
    ]


@pytest.fixture
def trials():
    found = falling("explicit_euler", DRIFT, 0.1)
    for scheme, power in (("symplectic_euler", 1.0), ("velocity_verlet", 2.0), ("onset_verlet", 2.0)):
        found += falling(scheme, DRIFT, power)
    found += falling("symplectic_euler", DURING, 1.0) + falling("velocity_verlet", AFTER, 2.0)
    found += falling("onset_verlet", AFTER, 4.0) + falling("forest_ruth", AFTER, 2.0)
    for parameter, power, rate in (("patches", 1.5, 1e-4), ("discs of a clump", 0.75, 1e-2)):
        found += [Trial(parameter, f"{n}", n, "shape error", 0, n**-power, rate * n, rate * n) for n in (12, 30, 60)]
    return found


def test_curves_know_their_orders_and_what_ten_times_less_costs(trials):
    found = curves(trials)
    assert found["onset_verlet", AFTER].order() == pytest.approx(4.0)
    assert found["onset_verlet", AFTER].tenfold() == pytest.approx(10**0.25)
    assert found["symplectic_euler", DRIFT].tenfold() == pytest.approx(10.0)
    assert found["explicit_euler", DRIFT].tenfold() == np.inf  # of order 0.1: more time does not help
    assert found["velocity_verlet", DRIFT].cost_at(48.0**-2) == pytest.approx(0.02 * 48)
    assert order((1.0, 2.0, 4.0), (1.0, 0.25, 0.0625)) == pytest.approx(2.0)


def test_the_headline_is_taken_at_equal_error(trials):
    metrics = accuracy_cost.analyse(trials)
    for name in ("order_explicit_euler", "order_symplectic_euler", "order_verlet", "order_onset_verlet"):
        assert metrics[name].holds, name
    assert metrics["cost_ratio_paper_scheme"].value == pytest.approx(48.0)  # 48^2 steps against 48
    needed = 30.0**2  # discs for the error of 30 patches
    assert metrics["cost_ratio_clumps"].value == pytest.approx(1e-2 * needed / (1e-4 * 30))
    worse = [t for t in trials if t.quantity != AFTER or t.parameter != "onset_verlet"] + falling(
        "onset_verlet", AFTER, 2.0
    )
    assert not accuracy_cost.analyse(worse)["order_onset_verlet"].holds


def test_a_skin_that_misses_a_pair_does_not_pass(trials):
    def skins(difference):
        return [
            Trial("skin", f"{s} d", s, "difference of positions", 0, d, 1.0, 1.0)
            for s, d in ((0.03, difference), (0.07, 0.0))
        ]

    assert accuracy_cost.analyse(trials + skins(0.0))["skin_difference"].holds
    assert not accuracy_cost.analyse(trials + skins(1e-12))["skin_difference"].holds
    assert "  0.03 d                 error 1e-12 +- nan, time 1" in lines_of(skins(1e-12))


def test_the_file_holds_every_trial(trials, tmp_path):
    params = accuracy_cost.Params()
    table = write_trials(tmp_path / "accuracy.nc", trials, attributes_of(params, np.nan, "Accuracy", "Trials."))
    assert dict(table.sizes) == {"quantity": 4, "parameter": 7, "setting": 4, "replica": 2}
    parameter = table.parameter_name.values.tolist().index("velocity_verlet")
    quantity = table.quantity_name.values.tolist().index(DRIFT)
    errors = table.error.values[quantity, parameter]
    assert np.allclose(errors[:, 0], np.array([12.0, 24.0, 48.0, 96.0]) ** -2) and table.error.units == "1"
    assert np.isfinite(table.error.values).sum() == len(trials)
    assert table.run_status == "complete" and table.cost.units == "s"
    assert set(read_trials(tmp_path / "accuracy.nc")) == set(trials)


def test_the_work_precision_diagram_shows_error_against_cost(trials, tmp_path, pictures):
    found = curves(trials)
    plot_work_precision(tmp_path / "work.png", found)
    axes = next(axes for axes in pictures[0].get_axes() if axes.get_title() == "Gas of 225 grains of 30 arcs")
    drawn = {container.get_label(): container.lines[0].get_data() for container in axes.containers}
    curve = found["velocity_verlet", DRIFT]
    assert np.allclose(drawn["step of velocity Verlet (2.0)"], (curve.relative, curve.error))
    assert len(drawn) == 4 and axes.get_xscale() == axes.get_yscale() == "log"
    assert axes.get_xlabel() == "time over that of discs at default settings [1]"


def test_the_summary_draws_a_bar_for_each_parameter_that_has_one(trials, tmp_path, pictures):
    bars = bars_of(curves(trials))
    plot_summary(tmp_path / "tenfold.png", curves(trials))
    (axes,) = pictures[0].get_axes()
    drawn = [(bar.get_x(), bar.get_x() + bar.get_width()) for bar in axes.patches]
    assert np.allclose(drawn, [(bar.begin, min(bar.end, FARTHEST)) for bar in bars if not bar.note])
    assert [label.get_text() for label in axes.get_yticklabels()] == [bar.name for bar in bars]
    assert axes.get_xlim() == (0.3, FARTHEST)


def test_the_summary_ranks_parameters_by_the_time_for_a_tenth_of_the_error_of_the_default(trials):
    bars = bars_of(curves(trials))
    gas = [bar for bar in bars if bar.quantity == DRIFT]
    assert [bar.name for bar in gas][-1] == "step of explicit Euler, as printed" and gas[-1].note == NEVER
    assert gas[0].end == pytest.approx(10**0.5)  # of order 2
    slower = next(bar for bar in gas if "symplectic" in bar.name)
    assert (slower.begin, slower.end) == pytest.approx((48.0, 480.0)) and not slower.default  # 48^2 steps against 48
    patches, clumps = (bar for bar in bars if bar.quantity == "shape error")
    assert patches.default and patches.begin == pytest.approx(1.0) and clumps.end > 1000.0


def noise(rng, strain, between, within, rows=100):
    """(strain, friction) of a run whose window means have the variance between + within/strain."""
    at = np.arange(int(strain * rows)) / rows
    return at, 0.3 + rng.normal(0.0, np.sqrt(between)) + rng.normal(0.0, np.sqrt(within * rows), len(at))


def test_variances_of_windows_are_found_again():
    rng = np.random.default_rng(1)
    between, within = gouge.variance_law([noise(rng, 40.0, 0.0, 4e-4) for _ in range(40)])
    assert within == pytest.approx(4e-4, rel=0.1) and between < 1e-5
    between, within = gouge.variance_law([noise(rng, 40.0, 1e-4, 4e-4) for _ in range(200)])
    assert between == pytest.approx(1e-4, rel=0.25) and within == pytest.approx(4e-4, rel=0.25)


@pytest.fixture
def table(tmp_path, monkeypatch):
    row = {"shape": "round", "dim": 2, "stiffness_number": 1000.0, "inertial_number": 5e-3, "area": 168.0}
    row |= {"between_seeds": 1e-5, "times_strain": 4e-4, "bias_of_step": {"0.8": 0.002, "0.4": 0.001}}
    path = tmp_path / "friction_errors.json"
    path.write_text(json.dumps({"rows": [row]}), encoding="utf-8")
    shipped = lsm.data_path
    monkeypatch.setattr(lsm, "data_path", lambda name: path if name == target_error.TABLE else shipped(name))
    return row


def test_a_plan_promises_what_was_asked_and_no_cheaper_one_does(table):
    params = shear_gouge.Params(length=14, layer_thickness=12, inertial_number=5e-3)
    loose, tight = target_error.plan(params, 0.02), target_error.plan(params, 0.004)
    for plan, target in ((loose, 0.02), (tight, 0.004)):
        assert plan.expected_error <= target
        step = f"{plan.step_safety:g}"
        assert target_error.half_width(table, params, plan.strain - params.steady_from, plan.seeds, step) <= target
    assert tight.expected_seconds > 4 * loose.expected_seconds and tight.seeds > loose.seeds
    assert (loose.step_safety, tight.step_safety) == (0.8, 0.4)  # the bias of the longer step is half the target
    wide = target_error.plan(shear_gouge.Params(length=56, layer_thickness=12, inertial_number=5e-3), 0.004)
    assert wide.strain * wide.seeds < tight.strain * tight.seeds  # more grains average more


def test_start_steps_and_strain_are_told_apart_by_three_runs_and_a_first_one():
    """8 s for the first start and 3 s for later ones; of each of 500 grains 40 ns a step, 2 ms a unit of strain."""

    def run(start, steps, strain):
        return prices.Spent(steps, strain, start + 500 * (40e-9 * steps + 2e-3 * strain))

    runs = [run(3.0, 1e4, 0.3), run(3.0, 5e4, 2.3), run(3.0, 1e5, 0.3)]
    expected = {"start_seconds": 8.0, "grain_step_seconds": 40e-9, "grain_strain_seconds": 2e-3}
    assert prices.price(runs, run(8.0, 1e4, 0.3), 500) == pytest.approx(expected)


def test_prices_are_processor_times(tmp_path):
    metrics = {"seconds": Metric(24.0, "s"), "cpu_seconds": Metric(5.0, "s")}
    write_summary(tmp_path, "shear-gouge", "smoke", metrics, quiet=True)
    assert prices.cpu_seconds(tmp_path) == 5.0
    assert np.isnan(prices.cpu_seconds(tmp_path / "nowhere"))


@pytest.fixture
def two_cores(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 2)


def test_all_commands_foresee_the_same_time(two_cores):
    """`lsm list --presets`, the command before a run, plans for a target error and the tables of the page."""
    for preset, shape, _, _, seconds in presets.preset_rows():
        params = merge(shear_gouge.Params, preset, options={"shape": shape})
        assert seconds == shear_gouge.estimate(params).seconds
    for target in (0.007, 0.03):
        params = shear_gouge.Params(shape="angular", target_error=target)
        planned = target_error.plan(params, target)
        assert planned.expected_seconds == shear_gouge.estimate(params).seconds > 0.0


@pytest.mark.parametrize("command", [presets, prices, table_command])
def test_a_command_says_what_it_does(command, capsys):
    with pytest.raises(SystemExit) as ended:
        as_command(lambda: command.main(["--help"]))
    text = capsys.readouterr().out
    assert ended.value.code == 0 and f"usage: python -m {command.__name__} " in text and len(text.split()) > 20
    with pytest.raises(SystemExit) as ended:
        as_command(lambda: command.main(["--nonsense"]))
    assert ended.value.code == 2


@pytest.mark.parametrize(
    ("name", "words"), [("nowhere.nc", "no such file"), ("run.nc", "holds no trials, must be an accuracy.nc")]
)
def test_a_file_that_is_none_is_refused_in_one_line(name, words, tmp_path, capsys):
    xarray.Dataset({"friction": ("time", [0.3])}, attrs={"run_status": "complete"}).to_netcdf(tmp_path / "run.nc")
    with pytest.raises(SystemExit) as ended:
        as_command(lambda: table_command.main([str(tmp_path / name)]))
    problem = capsys.readouterr().err
    assert ended.value.code == 2 and words in problem and problem.count("\n") == 1


def test_prices_are_not_measured_in_vain(tmp_path):
    with pytest.raises(lsm.InputError, match=r"nowhere/costs.json: cannot be written"):
        prices.main(["--to", str(tmp_path / "nowhere" / "costs.json")])


def test_the_page_holds_the_prices_that_the_command_prints(two_cores, capsys):
    presets.main([])
    page = (Path(__file__).parents[2] / "docs" / "accuracy.md").read_text(encoding="utf-8")
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 16
    assert not [line for line in lines if line not in page.splitlines()]


def test_targets_out_of_range_are_refused_with_what_is_possible(table):
    params = shear_gouge.Params(length=14, layer_thickness=12)
    with pytest.raises(lsm.InputError, match="--target-error 1e-07: must be >= "):
        target_error.plan(params, 1e-7)
    with pytest.raises(lsm.InputError, match=r"not measured for .* only for --shape round --dim 2"):
        target_error.plan(shear_gouge.Params(shape="angular"), 0.01)


def test_what_the_check_accepts_has_a_plan(table):
    """It compares the target with the longest and most runs alone, of which one has the least error."""
    params = shear_gouge.Params(length=14, layer_thickness=12)
    most = target_error.STRAINS[-1], target_error.MOST_SEEDS
    least = min(target_error.half_width(table, params, *most, step) for step in table["bias_of_step"])
    target_error.check(params, least)
    assert target_error.plan(params, least).expected_error == least
    with pytest.raises(lsm.InputError, match="must be >= "):
        target_error.check(params, np.nextafter(least, 0.0))


def test_what_runs_have_reached_counts_the_scatter_within_and_between(table):
    params = shear_gouge.Params(length=14, layer_thickness=12, inertial_number=5e-3)
    two = target_error.reached(table, params, [0.25, 0.26], [0.004, 0.004], "0.4")
    alone = np.sqrt((0.004**2 + table["between_seeds"]) / 2)
    assert two == pytest.approx(target_error.CAUTION * 1.96 * alone + 0.001)
    far = target_error.reached(table, params, [0.20, 0.25, 0.30], [0.004] * 3, "0.4")
    assert far == pytest.approx(4.3026527 * 0.05 / np.sqrt(3) + 0.001)  # Student's t of two degrees of freedom
    apart = target_error.reached(table, params, [0.227, 0.308], [0.004, 0.004], "0.4")
    assert apart > 0.5  # two that differ by far more than foreseen: Student's t of one degree of freedom
    assert np.isnan(target_error.reached(table, params, [0.25, 0.26], [np.nan, np.nan], "0.4"))  # only the plan says so
    unknown = target_error.reached(table, params, [0.25, 0.255, 0.26], [np.nan] * 3, "0.4")
    of_table = table["times_strain"] / (params.strain - params.steady_from) + table["between_seeds"]
    assert unknown == pytest.approx(target_error.CAUTION * 1.96 * np.sqrt(of_table / 3) + 0.001)


def test_seeds_of_all_runs_fit_their_column():
    with pytest.raises(
        lsm.InputError, match=r"^--seed 2147483643: must be <= 2147483632, for the last of so many runs\.$"
    ):
        merge(accuracy_cost.Params, options={"seed": "2147483643", "seeds": "16"})


def test_the_foreseen_cost_grows_with_the_seeds():
    few, many = (
        accuracy_cost.estimate(merge(accuracy_cost.Params, options={"seeds": n, "long_strain": "0"})) for n in "24"
    )
    none = 2 * few.seconds - many.seconds  # of all but the layers
    assert 0 < none < few.seconds < many.seconds and few.memory == many.memory
