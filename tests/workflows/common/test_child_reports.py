"""Reports of child processes reach the progress of their parent, in order and whole."""

import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from workflows.common.child_reports import SILENT, ChildReports, ReportFile, child_reports


@pytest.fixture
def shown():
    return []


def test_reports_of_a_child_come_before_its_end(tmp_path, shown):
    path = tmp_path / "reports"
    path.touch()
    reports = ChildReports(path, shown.append)
    reports.of("a")({"stage": "shearing", "strain": np.float64(0.5)})
    with path.open("a") as file:
        file.write('{"stage": "half a re')
    reports.show({"label": "a", "state": "done"})
    with path.open("a") as file:
        file.write('port"}\n')
    reports.show_new()
    first = {"stage": "shearing", "strain": 0.5, "label": "a"}
    assert shown == [first, {"label": "a", "state": "done"}, {"stage": "half a report"}]


def test_the_end_of_a_part_is_shown_with_its_last_report(tmp_path, shown):
    path = tmp_path / "reports"
    path.touch()
    reports = ChildReports(path, shown.append)
    reports.of("a")({"strain": 0.5})
    reports.of("b")({"strain": 0.7})
    reports.show_end("a", "done")
    reports.show_end("c", "failed")
    assert shown[2:] == [{"strain": 0.5, "label": "a", "state": "done"}, {"label": "c", "state": "failed"}]


def test_many_writers_do_not_mix(tmp_path, shown):
    path = tmp_path / "reports"
    path.touch()
    reports = ChildReports(path, shown.append)
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda i: reports.of(str(i))({"stage": "x" * 500}), range(40)))
    reports.show_new()
    assert {report["label"] for report in shown} == {str(i) for i in range(40)}


def test_reports_arrive_while_the_parent_waits(shown):
    with child_reports(shown.append) as reports:
        reports.of("a")({"stage": "compiling"})
        for _ in range(200):  # a thread reads them five times a second
            if shown:
                break
            time.sleep(0.05)
    assert shown == [{"stage": "compiling", "label": "a"}]


def test_reports_are_worth_no_run(tmp_path, shown):
    """Neither a folder that was cleaned up nor a disk that cuts a line off ends what is reported."""
    path = tmp_path / "reports"
    reports = ChildReports(path, shown.append)
    ReportFile("/dev/full" if Path("/dev/full").exists() else str(tmp_path), "a")({"stage": "compiling"})
    reports.show({"label": "a", "state": "done"})
    path.write_text('{"stage": "cut o{"stage": "two"}\n{"stage": "three"}\n')
    reports.show_new()
    assert shown == [{"label": "a", "state": "done"}, {"stage": "three"}]


def test_without_a_progress_nothing_is_written():
    with child_reports(None) as reports:
        assert reports.of("a").path == "" and reports.show({"stage": "compiling"}) is None
    assert SILENT({"stage": "compiling"}) is None
