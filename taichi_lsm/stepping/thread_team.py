"""Threads that share the stages of many steps in one launch.

Waking the threads of a pool takes longer than a step of a thousand grains, so they stay awake for a launch. A stage
(all grains drift, all contacts are evaluated) is cut into shares. A thread claims the shares of its own queue first,
which keeps the same grains in its cache from step to step, then those of the others. A stage is over when all its
shares are finished, by whichever thread: one that the operating system has put to sleep delays no more than the share
it was working on.
"""

from ..core.runtime import ti

SHARES = 16  # of a stage for each thread
LINE = 16  # i32 values: counters that different threads write to lie in cache lines of their own
SPREAD = 512  # indices of a parallel loop per thread: Taichi hands out tasks of at least so many


@ti.data_oriented
class ThreadTeam:
    """Counters by which `size` threads divide each of the `stages` of a launch.

    In a loop that is shared in this way `x[k] += a` would be atomic, and slow: write x[k] = x[k] + a.
    """

    def __init__(self, size, stages):
        self.size, self.stages = size, stages
        self.queue = SHARES if size > 1 else 1  # shares that a thread claims before it helps others
        self.shares = self.queue * size
        self.claimed = ti.field(ti.i32, (size, stages))  # shares of a thread's queue, by any thread
        self.finished = ti.field(ti.i32, (size, stages))  # shares that a thread has finished
        self.waited = ti.field(ti.i32, (size, LINE))
        self.first_slot = ti.field(ti.i32, self.shares + 1)  # of the grains of each share

    @ti.func
    def begin(self, count, row_start: ti.template()):
        """Before a launch: cut the grains into shares that hold about as many grains and listed pairs each."""
        ti.loop_config(serialize=True)
        for t in range(self.size):
            for i in range(self.stages):
                self.claimed[t, i] = 0
                self.finished[t, i] = 0
        # The work before slot k is row_start[k] + k, which rises: the border of each share is found by bisection.
        ti.loop_config(serialize=True)
        for p in range(self.shares + 1):
            wanted = ti.cast(ti.cast(row_start[count] + count, ti.i64) * p // self.shares, ti.i32)
            low, high = 0, count
            while low < high:
                middle = (low + high) // 2
                if row_start[middle] + middle < wanted:
                    low = middle + 1
                else:
                    high = middle
            self.first_slot[p] = low

    @ti.func
    def claim(self, t, stage):
        """A share of the stage that is not claimed yet, from the queue of thread t first; -1 if there is none left."""
        share = -1
        for other in range(self.size):
            q = (t + other) % self.size
            if share < 0 and self.claimed[q, stage] < self.queue:
                ticket = ti.atomic_add(self.claimed[q, stage], 1)
                if ticket < self.queue:
                    share = q * self.queue + ticket
        return share

    @ti.func
    def finish(self, t, stage):
        """Count a share of the stage as finished and claim the next one."""
        ti.atomic_add(self.finished[t, stage], 1)
        return self.claim(t, stage)

    @ti.func
    def lead(self, stage):
        """1 for the one thread that does a stage which cannot be divided, 0 for the others."""
        return ti.cast(ti.atomic_add(self.claimed[0, stage], 1) == 0, ti.i32)

    @ti.func
    def finish_alone(self, t, stage):
        """Count all of a stage that thread t has led as finished."""
        ti.atomic_add(self.finished[t, stage], self.shares)

    @ti.func
    def barrier(self, t, stage):
        """Return when all shares of the stage are finished.

        The addition, to a cache line of the thread's own, keeps the compiler from reading `finished` only once, and
        from moving reads of what the other threads have written before the end of the wait.
        """
        waiting = 1
        while waiting == 1:
            ti.atomic_add(self.waited[t, 0], 1)
            finished = 0
            for other in range(self.size):
                finished += self.finished[other, stage]
            waiting = ti.cast(finished < self.shares, ti.i32)
        ti.atomic_add(self.waited[t, 0], 1)
