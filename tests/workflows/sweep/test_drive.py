"""What becomes of a sweep whose scheduler goes away; with stand-ins for Dask."""

from contextlib import contextmanager
from types import SimpleNamespace

import pytest

from taichi_lsm.core.errors import InputError, SimulationError
from workflows.common.one_run import COMPLETED, Limits, Outcome
from workflows.sweep import drive as sweep_drive
from workflows.sweep.plan import PlannedRun, SweepPlan

ADDRESS = "tcp://127.0.0.1:8786"
NONE_THERE = InputError(f"--scheduler {ADDRESS}: there is no scheduler")
GONE = OSError("the connection is closed")


class Told:
    """Takes what a sweep tells."""

    def __init__(self):
        self.losses = 0

    def begin(self, ended):
        assert not ended

    def tell(self, text):
        assert "dashboard" in text

    def lost(self, why):
        assert ADDRESS in why
        self.losses += 1


@pytest.fixture
def driven(tmp_path, toy, monkeypatch):
    """driven(events): (outcomes, number of losses) of a sweep of one run; an event for each time that it connects."""

    def drive(*events):
        coming, ended, told = iter(events), {}, Told()

        @contextmanager
        def client_of(address, jobs):
            event = next(coming)
            if isinstance(event, InputError):
                raise event
            yield SimpleNamespace(dashboard_link="", event=event)

        def carry_out_on(client, plan, out, retries, limits, ended, progress):
            if client.event is not None:
                raise client.event
            ended["1"] = Outcome(COMPLETED, "", 1.0)

        monkeypatch.setattr(sweep_drive, "client_of", client_of)
        monkeypatch.setattr(sweep_drive, "_carry_out_on", carry_out_on)
        monkeypatch.setattr(sweep_drive.time, "sleep", lambda seconds: None)
        plan = SweepPlan("toy-run", toy, (), (PlannedRun("1", {}, toy.Params()),))
        sweep_drive.drive(plan, tmp_path, ADDRESS, 1, 0, Limits(), ended, told)
        return ended, told.losses

    return drive


def test_a_scheduler_that_went_away_is_waited_for_also_while_none_is_there(driven):
    ended, losses = driven(GONE, NONE_THERE, NONE_THERE, GONE, None)
    assert ended["1"].status == COMPLETED and losses == 4


def test_a_scheduler_that_was_never_there_is_not_waited_for(driven):
    with pytest.raises(InputError, match="there is no scheduler"):
        driven(NONE_THERE)


def test_a_scheduler_that_does_not_come_back_ends_the_sweep(driven, monkeypatch):
    monkeypatch.setattr(sweep_drive, "LOST_S", -1.0)
    with pytest.raises(SimulationError, match="repeat the command to go on"):
        driven(GONE)
