"""The list of hard cases and what the workflow makes of their values; `tests/hard` runs the cases."""

import math
from types import SimpleNamespace

import pytest

import taichi_lsm as lsm
from workflows import hard, hard_cases


def row(case, precision, value, status, kind="steps", bound=2.0, reason=""):
    texts = {
        "kind": kind,
        "title": case.title(),
        "why": "Why.",
        "measure": "path length",
        "unit": "m",
        "reason": reason,
    }
    numbers = {"value": value, "bound": bound, "margin": hard_cases.margin(value, bound), "seconds": 1.0}
    return {"case": case, "precision": precision, "status": hard_cases.STATUS.index(status), **texts, **numbers}


ROWS = [
    row("good", "f64", 1.0, "passed"),
    row("good", "f32", 1.5, "passed"),
    row("exact", "f64", 0.0, "passed"),
    row("exact", "f32", math.inf, "excepted", reason="rounding"),
]


def test_there_are_many_cases_with_names_of_their_own_and_texts():
    cases = [case for module in hard.modules() for case in hard.cases_of(module)]
    names = [case.name for case in cases]
    assert len(names) >= 30 and len(set(names)) == len(names)
    assert len({case.title for case in cases}) == len(cases)
    for case in cases:
        assert case.why and case.measure and not math.isnan(case.bound), case.name


def test_cases_are_counted_once_and_one_failure_fails_a_case():
    metrics = hard_cases.analyse(ROWS)
    assert {name: metrics[name].value for name in ("cases", "passed", "failed", "excepted")} == {
        "cases": 2,
        "passed": 2,
        "failed": 0,
        "excepted": 1,
    }
    assert metrics["failed"].holds and metrics["least_margin"].value == pytest.approx(2.0 / 1.5)
    assert metrics["least_margin"].note.startswith("bound over value of the tightest case: ")
    worse = [*ROWS[:1], row("good", "f32", 3.0, "failed"), *ROWS[2:]]
    metrics = hard_cases.analyse(worse)
    assert metrics["failed"].value == 1 and metrics["passed"].value == 1 and not metrics["failed"].holds


def test_the_table_has_a_row_for_each_case_with_its_margins():
    text = hard_cases.table_text(ROWS)
    assert "### Steps" in text and text.count("**Good.**") == 1
    assert "1, 2 times" in text and "exact" in text and "excepted: rounding" in text


def test_a_failed_case_is_written_down_and_fails_the_command(tmp_path, monkeypatch):
    failed = [*ROWS, row("bad", "f64", 9.0, "failed")]
    monkeypatch.setattr(hard_cases, "measure", lambda params, parts, progress: failed)
    with pytest.raises(lsm.SimulationError, match=r"1 hard cases failed: Bad \(f64\)"):
        hard_cases.run(hard_cases.Params(), tmp_path)
    table = lsm.open_run(tmp_path / "hard_cases.nc")
    assert table.case.values.tolist() == ["good", "good", "exact", "exact", "bad"]
    assert table.status.flag_meanings == "passed failed excepted"
    assert {"hard_cases.md", "hard_cases.png", "summary.json"} <= {path.name for path in tmp_path.iterdir()}


def test_a_measure_that_is_not_a_number_fails_its_case(monkeypatch):
    lost = SimpleNamespace(name="lost", title="Lost", why="", measure="", unit="1", excepted="")
    lost.run, lost.bound_in = (lambda bench: math.nan), (lambda precision: 1.0)
    monkeypatch.setattr(hard_cases, "cases_of", lambda kind: [lost])
    reports = []
    rows = hard_cases.run_kind("steps", "f64", True, reports.append)
    assert reports == [{"stage": "Lost", "done": 1, "total": 1}]  # before it is run
    assert hard_cases.STATUS[rows[0]["status"]] == "failed" and rows[0]["reason"] == "the measure is not a number"
    assert "nan" not in hard_cases.table_text(rows) and "nan" not in "".join(hard_cases.plain_lines(rows))


def test_the_printed_table_has_a_header_above_its_columns():
    header, *lines = hard_cases.plain_lines(ROWS)
    assert header.split() == ["case", "in", "value", "bound", "verdict", "measured", "[unit]"]
    assert len(lines) == len(ROWS)
    assert header.index("measured") == lines[0].index(ROWS[0]["measure"])
    assert header.index("verdict") == lines[0].index("passed")
    assert header.index("bound") == lines[0].index("2 ")


def test_unknown_kinds_are_refused(tmp_path):
    with pytest.raises(lsm.InputError, match=r"--kinds softs: must be some of .*steps"):
        hard_cases.run(hard_cases.Params(kinds=["softs"]), tmp_path / "new")
