"""A thread team does every share of every stage once, whichever of its threads are awake."""

import numpy as np
import pytest

from taichi_lsm.core.allocation import allocating
from taichi_lsm.core.runtime import ti
from taichi_lsm.stepping.thread_team import SPREAD, ThreadTeam

pytestmark = pytest.mark.usefixtures("runtime")

STAGES, GRAINS = 6, 1000


@ti.data_oriented
class Roll:
    """Counts how often each grain was worked on at each stage, and by whom a stage for one thread was done."""

    def __init__(self, size):
        self.team = ThreadTeam(size, STAGES + 1)
        self.row_start = ti.field(ti.i32, GRAINS + 1)
        self.worked = ti.field(ti.i32, (STAGES, GRAINS))
        self.led = ti.field(ti.i32, size)

    @ti.kernel
    def launch(self):
        self.team.begin(GRAINS, self.row_start)
        for i in range(self.team.size * SPREAD):
            if i % SPREAD == 0:
                t = i // SPREAD
                for stage in range(STAGES):
                    share = self.team.claim(t, stage)
                    while share >= 0:
                        for k in range(self.team.first_slot[share], self.team.first_slot[share + 1]):
                            self.worked[stage, k] = self.worked[stage, k] + 1
                        share = self.team.finish(t, stage)
                    self.team.barrier(t, stage)
                if self.team.lead(STAGES):
                    self.led[t] = self.led[t] + 1
                    self.team.finish_alone(t, STAGES)
                self.team.barrier(t, STAGES)


@pytest.mark.parametrize("size", [1, 3])
def test_every_share_is_done_once(size):
    """Here one thread plays all members in turn, so that the first does what the others have not begun: with threads
    that sleep for ever the work would still be done. Threads side by side are tested by test_bits.py."""
    with allocating():
        roll = Roll(size)
    pairs = np.random.default_rng(3).integers(0, 9, GRAINS)
    roll.row_start.from_numpy(np.concatenate([[0], np.cumsum(pairs)]).astype(np.int32))
    for launch in (1, 2):  # counters begin anew
        roll.launch()
        assert (roll.worked.to_numpy() == launch).all()
        assert roll.led.to_numpy().sum() == launch
    first = roll.team.first_slot.to_numpy()
    assert first[0] == 0 and first[-1] == GRAINS and (np.diff(first) >= 0).all()
    work = np.diff((roll.row_start.to_numpy() + np.arange(GRAINS + 1))[first])
    assert work.max() - work.min() <= 2 * (pairs.max() + 1)


def test_grains_without_pairs_are_shared_evenly():
    with allocating():
        roll = Roll(2)
    roll.row_start.fill(0)
    roll.launch()
    shares = np.diff(roll.team.first_slot.to_numpy())
    assert shares.sum() == GRAINS and shares.max() - shares.min() <= 1
