"""Threads that share the stages of many steps in one launch.

Waking the threads of a pool takes longer than a step of a thousand grains, so they stay awake for a launch. A stage
(all grains drift, all contacts are evaluated) is cut into parts. A thread takes the parts of its own queue first, which
keeps its share of the grains in its cache, then helps the others. A stage is over when all its parts are done, whoever
did them: a thread that the operating system has put to sleep holds up no more than the part it was working on.
"""

from ..core.runtime import ti

PARTS = 16  # of a stage for each thread
LINE = 16  # i32 values: counters that different threads write to lie in cache lines of their own
SPREAD = 512  # indices of a parallel loop per thread: Taichi hands out tasks of at least so many


@ti.data_oriented
class ThreadTeam:
    """Counters by which `size` threads divide each of the `stages` of a launch.

    In a loop that is shared in this way `x[k] += a` would be atomic, and slow: write x[k] = x[k] + a.
    """

    def __init__(self, size, stages):
        self.size, self.stages = size, stages
        self.queue = PARTS if size > 1 else 1
        self.parts = self.queue * size
        self.taken = ti.field(ti.i32, (size, stages))  # parts of a thread's queue, by whomever
        self.done = ti.field(ti.i32, (size, stages))  # parts that a thread has done
        self.waited = ti.field(ti.i32, (size, LINE))
        self.first = ti.field(ti.i32, self.parts + 1)  # grain of each part

    @ti.func
    def begin(self, count, row_start: ti.template()):
        """Before a launch: parts hold about as many grains and listed pairs each."""
        ti.loop_config(serialize=True)
        for t in range(self.size):
            for i in range(self.stages):
                self.taken[t, i] = 0
                self.done[t, i] = 0
        ti.loop_config(serialize=True)
        for p in range(self.parts + 1):
            wanted = ti.cast(ti.cast(row_start[count] + count, ti.i64) * p // self.parts, ti.i32)
            low, high = 0, count
            while low < high:
                middle = (low + high) // 2
                if row_start[middle] + middle < wanted:
                    low = middle + 1
                else:
                    high = middle
            self.first[p] = low

    @ti.func
    def take(self, t, stage):
        """A part of the stage that nobody has taken, thread t's own first; -1 if there is none left."""
        part = -1
        for other in range(self.size):
            q = (t + other) % self.size
            if part < 0 and self.taken[q, stage] < self.queue:
                ticket = ti.atomic_add(self.taken[q, stage], 1)
                if ticket < self.queue:
                    part = q * self.queue + ticket
        return part

    @ti.func
    def hand_in(self, t, stage):
        """A part of the stage is done; takes another one."""
        ti.atomic_add(self.done[t, stage], 1)
        return self.take(t, stage)

    @ti.func
    def alone(self, stage):
        """1 for the one thread that shall do a stage that cannot be divided; it calls `alone_done` after it."""
        return ti.cast(ti.atomic_add(self.taken[0, stage], 1) == 0, ti.i32)

    @ti.func
    def alone_done(self, t, stage):
        """Thread t has done such a stage."""
        ti.atomic_add(self.done[t, stage], self.parts)

    @ti.func
    def wait(self, t, stage):
        """Return when all parts of the stage are done.

        The addition, to a line of the thread's own, keeps the compiler from reading `done` once and for all, and from
        reading what the others have written too early.
        """
        waiting = 1
        while waiting == 1:
            ti.atomic_add(self.waited[t, 0], 1)
            done = 0
            for other in range(self.size):
                done += self.done[other, stage]
            waiting = ti.cast(done < self.parts, ti.i32)
        ti.atomic_add(self.waited[t, 0], 1)
