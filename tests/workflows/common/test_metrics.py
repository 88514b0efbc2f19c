"""Metrics in summary.json and as a table: intervals, notes, claims that are not met, and times."""

import ast
import json
import math
import os
from pathlib import Path

import pytest

import workflows
from taichi_lsm.statistics import Estimate
from workflows.common import stopwatch
from workflows.common.metrics import Metric, failed_claims, metrics_of_estimate, read_summary, shown, write_summary


def test_an_estimate_has_its_interval_beside_the_mean(tmp_path, capsys):
    metrics = metrics_of_estimate("friction_mean", "friction_se", Estimate(0.3, 0.01, 3.0, 2.0))
    entries = write_summary(tmp_path, "w", None, metrics)["metrics"]
    low, high = 0.3 - 0.043026527, 0.3 + 0.043026527  # Student's t of two degrees of freedom
    assert entries["friction_mean"] == {"value": 0.3, "unit": "1", "interval": pytest.approx([low, high])}
    assert entries["friction_se"] == {"value": 0.01, "unit": "1"}
    assert "friction_mean  0.3   0.257 to 0.343" in capsys.readouterr().out
    assert read_summary(tmp_path) == json.loads((tmp_path / "summary.json").read_text())


def test_an_unknown_error_is_null_and_says_why(tmp_path, capsys):
    estimate = Estimate(0.3, math.nan, 12.0, math.nan, "12 effective samples, at least 20 are needed: shear further")
    entries = write_summary(tmp_path, "w", None, metrics_of_estimate("mean", "error", estimate))["metrics"]
    assert entries["mean"] == {"value": 0.3, "unit": "1"}
    assert entries["error"]["value"] is None and estimate.unknown in entries["error"]["note"]
    assert f"unknown: {estimate.unknown}" in capsys.readouterr().out
    assert metrics_of_estimate("mean", "error", None)["mean"].as_dict()["note"] == "no complete run"


def test_only_claims_that_are_not_met_are_named_with_their_remedy(tmp_path):
    metrics = {
        "good": Metric(0.1, "1", 0.2, True, remedy="no need"),
        "bad": Metric(0.3, "Pa", 0.2, False, remedy="the platen is loose: tighten it"),
        "worse": Metric(None, "Pa", "at least 3", False),
    }
    bad, worse = failed_claims(write_summary(tmp_path, "w", None, metrics, quiet=True))
    assert bad == "claim not met: bad is 0.3 Pa, claimed 0.2 Pa: the platen is loose: tighten it."
    assert worse.startswith("claim not met: worse is unknown, claimed at least 3: ")


def test_what_is_not_a_number_is_printed_as_unknown(tmp_path, capsys):
    metrics = {"order": Metric(math.nan, "1", note="no collision"), "count": Metric(3, "1")}
    metrics["mean"] = Metric(0.3, "1", interval=(math.nan, 1.0))
    write_summary(tmp_path, "w", None, metrics)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert lines[1:] == [["order", "unknown", "no", "collision"], ["count", "3"], ["mean", "0.3", "unknown", "to", "1"]]
    assert shown(math.nan, ".2g") == "unknown" and shown(0.123, ".2g") == "0.12"


def test_a_summary_that_cannot_be_read_is_none(tmp_path):
    assert read_summary(tmp_path) is None
    (tmp_path / "summary.json").write_text("{")
    assert read_summary(tmp_path) is None


def test_time_on_the_clock_is_apart_from_that_of_the_processors(monkeypatch):
    """While the clock went on by 24 s, this process computed for 1 s, and two that it started for 30 s."""
    clock, times = [100.0], [os.times_result((5.0, 1.0, 2.0, 0.5, 0.0))]
    monkeypatch.setattr(stopwatch.time, "perf_counter", lambda: clock[0])
    monkeypatch.setattr(stopwatch.os, "times", lambda: times[0])
    watch = stopwatch.Stopwatch()
    clock[0], times[0] = 124.0, os.times_result((5.75, 1.25, 31.0, 1.5, 0.0))
    metrics = watch.metrics()
    assert (metrics["seconds"].value, metrics["cpu_seconds"].value) == (24.0, 31.0)
    assert "wall-clock" in (metrics["seconds"].note or "") and "processor" in (metrics["cpu_seconds"].note or "")


def calls_of_metric(path):
    """Calls Metric(...) of a file that claim a bound."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Metric":
            if len(node.args) > 2 or any(word.arg == "bound" for word in node.keywords):
                yield node


def test_every_claim_says_what_to_change():
    root = Path(workflows.__file__).parent
    claims = [(path.name, call) for path in root.rglob("*.py") for call in calls_of_metric(path)]
    assert len(claims) >= 6
    for name, call in claims:
        assert any(word.arg == "remedy" for word in call.keywords), f"{name}, line {call.lineno}: a claim, no remedy"
