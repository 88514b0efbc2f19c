"""Parts of an experiment that are finished are not made twice, and come back to the last bit."""

import hashlib
import json
import signal
import time

import numpy as np
import pytest

from taichi_lsm.core.errors import InputError
from workflows.common import signals
from workflows.common.parameters import Params
from workflows.protocol.finished_parts import FinishedParts, folder_of_parts

PARAMS = Params()


def test_parts_come_back_to_the_last_bit_and_only_in_a_run_that_goes_on(tmp_path):
    series = {"time": np.linspace(0.0, 1.0, 7) / 3.0, "counts": np.arange(3, dtype=np.int32)}
    rows = [{"scheme": "euler", "drift": 0.1 + 0.2, "seed": np.int64(3), "left": np.inf}]
    first = FinishedParts(tmp_path, PARAMS, resume=False)
    first.put("euler f64", (rows, series))
    again = FinishedParts(tmp_path, PARAMS, resume=True)
    found_rows, found = again.get("euler f64")
    assert found_rows == rows
    assert all(np.array_equal(found[n], series[n]) and found[n].dtype == series[n].dtype for n in series)
    assert again.made("euler f64", pytest.fail)
    assert again.get("verlet") is None and again.made("verlet", lambda: 3.0) == 3.0 == again.get("verlet")
    assert FinishedParts(tmp_path, PARAMS, resume=False).get("verlet") is None


def test_parts_made_in_processes_are_kept_as_they_end(tmp_path, monkeypatch):
    """Each once, also those that end after one that fails."""
    parts, put = FinishedParts(tmp_path, PARAMS, resume=True), []
    parts.put("second", -1)
    monkeypatch.setattr(parts, "put", lambda *part: (put.append(part), FinishedParts.put(parts, *part))[1])
    calls = {"first": (divmod, 7, 2), "second": (divmod, 1, 0), "third": (divmod, 1, 0), "fourth": (divmod, 9, 2)}
    taken = []
    with pytest.raises(ZeroDivisionError):
        take(parts, calls, taken, lambda: None)
    assert taken == [("first", [3, 1]), ("second", -1)]  # which would fail, were it made
    assert sorted(put) == [("first", (3, 1)), ("fourth", (4, 1))]
    assert FinishedParts(tmp_path, PARAMS, resume=True).get("fourth") == [4, 1]


def take(parts, calls, taken, after):
    """Take the results of all parts as an experiment does."""
    with parts.made_in_processes(calls) as made:
        for part in made:
            taken.append(part)
            after()


def raising(error):
    def after():
        raise error

    return after


@pytest.mark.parametrize("error", [signals.Interrupted(signal.SIGTERM), BrokenPipeError()])
def test_parts_that_run_are_given_up_when_the_experiment_is_asked_to_end(tmp_path, error):
    """Also between two results."""
    parts = FinishedParts(tmp_path, PARAMS, resume=True)
    calls = {"first": (divmod, 7, 2), **{f"slow {i}": (time.sleep, 60) for i in range(3)}}
    began = time.monotonic()
    with pytest.raises(type(error)):
        take(parts, calls, [], raising(error))
    assert time.monotonic() - began < 50.0
    assert parts.get("first") == [3, 1] and parts.get("slow 0") is None


def test_parts_of_unknown_parameters_do_not_count(tmp_path):
    FinishedParts(tmp_path, PARAMS, resume=True).put("one", 1.0)
    (tmp_path / "parts" / "parameters.json").write_text("")
    assert FinishedParts(tmp_path, Params(seed=7), resume=True).get("one") is None


def test_the_time_of_a_run_that_goes_on_is_that_of_all_its_parts(tmp_path):
    FinishedParts(tmp_path, PARAMS, resume=False).put("one", 1.0)
    times = tmp_path / "parts" / "times.json"
    text = json.dumps([100.0, 200.0])
    times.write_text(json.dumps({"digest": hashlib.sha256(text.encode()).hexdigest(), "result": text}))
    watch = FinishedParts(tmp_path, PARAMS, resume=True).watch
    assert 100.0 <= watch.seconds < 110.0 and 200.0 <= watch.cpu_seconds < 210.0
    for text in ("[]", "[NaN, 1.0]", "[-5.0, 1.0]", "[true, true]", "[1e300, 1.0]", f"[{10**400}, 1.0]"):
        digest = hashlib.sha256(text.encode()).hexdigest()
        times.write_text(json.dumps({"digest": digest, "result": text}))
        assert FinishedParts(tmp_path, PARAMS, resume=True).watch.seconds < 10.0
    FinishedParts(tmp_path, PARAMS, resume=True).put("two", 2.0)
    assert FinishedParts(tmp_path, PARAMS, resume=False).watch.seconds < 10.0


def test_a_part_that_was_not_written_to_its_end_does_not_count(tmp_path):
    parts = FinishedParts(tmp_path, PARAMS, resume=True)
    parts.put("one", [1.0, 2.0])
    (tmp_path / "parts" / "one.json").write_text("[1.0, 2")
    assert parts.get("one") is None
    with pytest.raises(TypeError, match="set cannot be kept"):
        parts.put("two", {1.0, 2.0})


def test_parts_of_other_parameters_are_refused(tmp_path):
    FinishedParts(tmp_path, PARAMS, resume=True).put("one", 1.0)
    assert FinishedParts(tmp_path, Params(threads=2), resume=True).get("one") == 1.0
    with pytest.raises(InputError, match="was made with other seed; begin anew"):
        FinishedParts(tmp_path, Params(seed=7), resume=True)
    assert FinishedParts(tmp_path, Params(seed=7), resume=False).get("one") is None


def test_a_folder_whose_parts_do_not_suit_stays_as_it_was(tmp_path, monkeypatch):
    with folder_of_parts(Params(seed=7), "toy-run", tmp_path, "refuse") as (_, parts):
        parts.put("one", 1.0)
    (tmp_path / "summary.json").write_text("{}")
    config = tmp_path / "config.toml"
    config.write_text(config.read_text().replace("seed = 7", "seed = 1"))  # by hand
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match="was made with other seed"):
        folder_of_parts(Params(seed=1), "toy-run", tmp_path, "resume").__enter__()
    left = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert {path: text for path, text in left.items() if path.name != ".lock"} == {
        path: text for path, text in before.items() if path.name != ".lock"
    }


@pytest.mark.parametrize("text", ["[" * 10_000, '{"digest": 1}', "[]", "\xff", '{"result": "{}", "digest": "0"}'])
def test_a_part_that_was_altered_does_not_count(tmp_path, text):
    parts = FinishedParts(tmp_path, PARAMS, resume=True)
    parts.put("one", {"energy": np.arange(3.0)})
    path = tmp_path / "parts" / "one.json"
    flipped = path.read_text().replace("1.0", "7.0")
    assert flipped != path.read_text() and parts.get("one")["energy"].tolist() == [0.0, 1.0, 2.0]
    for altered in (flipped, text):
        path.write_text(altered, encoding="latin-1")
        assert parts.get("one") is None


def test_no_array_of_a_kept_part_is_of_a_type_that_takes_all_memory(tmp_path):
    parts = FinishedParts(tmp_path, PARAMS, resume=True)
    for kind in ("V1000000000000", "O", "S9999999"):
        parts.folder.mkdir(exist_ok=True)
        parts._write("one", {"array": [0], "dtype": kind})
        assert parts.get("one") is None
