"""The expected cost of several runs, and in words."""

import pytest

from workflows.common.run_cost import RunCost, duration, of_replicas

ONE, LONG = RunCost(1e6, 60.0, 1e9), RunCost(3e6, 200.0, 2e9)


@pytest.mark.parametrize(
    ("at_a_time", "seconds", "memory"),
    [(1, 320.0, 2e9), (2, 200.0, 3e9), (9, 200.0, 4e9)],
)
def test_replicas_share_the_cores_and_no_run_is_divided(monkeypatch, at_a_time, seconds, memory):
    monkeypatch.setattr("os.cpu_count", lambda: 8)
    assert of_replicas([ONE, LONG, ONE], at_a_time) == RunCost(5e6, seconds, memory)


def test_more_runs_than_cores_take_turns(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    assert of_replicas([ONE] * 8, 8) == RunCost(8e6, 240.0, 8e9)


def test_a_run_that_is_left_over_takes_its_own_time(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    assert of_replicas([ONE] * 3, 2).seconds == 120.0


@pytest.mark.parametrize(
    ("seconds", "text"), [(40.4, "40 s"), (700.0, "12 min"), (10_800.0, "3 h"), (172_800.0, "2 days")]
)
def test_a_duration_has_the_unit_that_suits_it(seconds, text):
    assert duration(seconds) == text
