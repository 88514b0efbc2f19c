"""What a run takes is said before it starts, and very much is started only on request."""

import dataclasses

import pytest

from workflows.cli.main import main
from workflows.common.run_cost import RunCost

COST = RunCost(steps=2.5e6, seconds=1200.0, memory=1.5e9)


def test_what_a_run_takes_is_said_before_it_starts(toy, monkeypatch, capsys):
    monkeypatch.setattr(toy, "estimate", lambda params: COST)
    assert main(["toy-run", "--preset", "demo"]) == 0
    first, second, *rest = capsys.readouterr().out.splitlines()
    assert first == "toy-run, preset demo: checking, then writing to out/toy-run"
    assert second == "toy-run: about 2.5e+06 steps, 20 min on idle cores, 1.5 GB of memory"
    assert rest[0] == "noise from a library"
    assert main(["list", "--presets"]) == 0
    assert (
        "  reference about 2.5e+06 steps, 20 min on idle cores, 1.5 GB of memory"
        in capsys.readouterr().out.splitlines()
    )


@pytest.mark.parametrize(
    ("cost", "words"),
    [
        (dataclasses.replace(COST, seconds=90_000.0), "--yes: is needed, as the run is expected to take 25 h"),
        (dataclasses.replace(COST, memory=5.1e9), "5.1 GB of the machine's 10 GB of memory, more than half"),
    ],
)
def test_what_takes_very_much_is_started_only_with_yes(toy, monkeypatch, tmp_path, capsys, cost, words):
    monkeypatch.setattr(toy, "estimate", lambda params: cost)
    monkeypatch.setattr("taichi_lsm.machine_memory", lambda: 1e10)
    assert main(["toy-run"]) == 2
    assert words in capsys.readouterr().err and not (tmp_path / "out").exists()
    assert main(["toy-run", "--yes"]) == 0
