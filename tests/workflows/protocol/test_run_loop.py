"""The run loop with stand-ins for grains and files: stages, samples, and a run that stops anywhere and goes on."""

import contextlib
import itertools
import json
import math
import signal
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import taichi_lsm as lsm
from workflows.common import signals
from workflows.common.stopwatch import Stopwatch
from workflows.protocol import run_loop
from workflows.protocol.conditions import Reached, Settled
from workflows.protocol.moments import Events, Moments, checked_words, interval
from workflows.protocol.resume import STATE, Start, _check_same_run, start_of
from workflows.protocol.run_loop import RunLoop
from workflows.protocol.schedule import Change, Position, Spacing, Stage


class World:
    """Stands in for a simulation, the layer that it measures and its files: a state that depends on every step."""

    def __init__(self, stop_at=None, resumed=None):
        self.step, self.state, self.velocity, self.stop_at = 0, 1.0, 0.0, stop_at
        self.strain = self.slip = self.load = 0.0
        self.thickness = 2.0
        self.dt, self.sim, self.memory, self.grains = 1.0, self, self, self
        self.rows, self.snapshots, self.lines, self.pictures, self.contacts = 0, 0, [], [], []
        self.id = "run"
        self.samples, self.saved, self.last_time = [], resumed, -1.0
        self.set_at = []

    def __len__(self):
        return 10

    @property
    def time(self):
        return self.step * self.dt

    def run(self, steps):
        for _ in range(steps):
            self.state = (1.0001 * self.state + self.velocity) % 7.0
            self.strain += self.velocity / self.thickness
            self.slip += self.velocity
            self.step += 1
            if self.step == self.stop_at:
                signal.raise_signal(signal.SIGTERM)

    def value(self, name, thickness):
        return self.velocity if name == "velocity" else self.velocity / (thickness or 1.0)

    def set(self, name, value, thickness):
        self.velocity = value if name == "velocity" else value * (thickness or 1.0)
        self.set_at.append((self.step, self.velocity))

    def begin_shear(self):
        self.strain = self.slip = 0.0

    def sample(self):
        self.samples.append(self.state)

    def begin_stage(self, name, index, cycle=0, slip=0.0):
        self.stage = name, index

    def row(self):
        self.load = min(1.0, self.load + 0.3)
        self.thickness = max(1.0, self.thickness - 0.4)
        self.lines.append((self.step, *self.stage, sum(self.samples), len(self.samples)))
        self.rows, self.samples = self.rows + 1, []
        moving = {"plate_velocity": 1e-3 * (self.step % 50) ** 2, "load_point_velocity": 0.04, "spring_stretch": 0.0}
        return {"platen_normal_stress": self.load, "shear_strain": self.strain} | moving

    def snapshot(self):
        self.pictures.append((self.step, self.state, self.stage[0]))
        self.snapshots, self.last_time = self.snapshots + 1, self.time

    def moment(self):
        if not self.contacts or self.contacts[-1][0] < self.step:
            self.contacts.append((self.step, self.state, self.stage[0]))

    @property
    def moments(self):
        return len(self.contacts)

    def flush(self):
        pass

    def as_plain(self):
        names = ("step", "state", "velocity", "strain", "slip", "load", "thickness", "samples", "lines", "pictures")
        return {name: getattr(self, name) for name in (*names, "contacts")}

    def restore(self, values):
        vars(self).update(values)
        self.lines = [tuple(line) for line in self.lines]
        self.pictures = [tuple(picture) for picture in self.pictures]
        self.contacts = [tuple(moment) for moment in self.contacts]

    def keep_checkpoint(self, run_state):
        self.saved = json.dumps(run_state)


def schedule(strain=3.0, stages=4):
    """Consolidation, shear, and a hold; contacts by strain, at events, at the end of the hold and of the last stage."""
    all_stages = [
        Stage("press", Settled(1.0, within=1000.0), Spacing(14, 2), contacts=Moments(at_end=True)),
        Stage(
            "shear",
            Reached(strain=2.0),
            Spacing(15, 3),
            {"shear_rate": Change(0.01)},
            snapshots=Moments(0.5),
            contacts=Moments(0.3),
        ),
        Stage("hold", Reached(time=40.0), Spacing(3, 1), {"velocity": Change(0.0)}, contacts=Moments(events=True)),
        Stage("again", Reached(strain=strain, slip=100.0), Spacing(15, 3), {"velocity": Change(0.02)}),
    ][:stages]
    all_stages[-1] = replace(all_stages[-1], contacts=replace(all_stages[-1].contacts, at_end=True))
    return all_stages


@pytest.fixture
def go(monkeypatch, tmp_path):
    """go(world, stages, start): run a schedule to its end or to the signal; returns the loop, or None."""
    monkeypatch.setattr(signals, "SAME_REQUEST_S", 0.0)  # or signals of one test after the other would count as one
    previous = signals.install()
    for name in ("run.nc", "grains.nc", "contacts.nc"):
        (tmp_path / name).write_text("")

    def run(world, stages, start=None):
        start = start or Start()
        loop = RunLoop(world, world, stages, world, lambda stage, row: None, Stopwatch(), start, {"seed": 1})
        try:
            loop.run()
        except signals.Interrupted:
            return None
        return loop

    def resume(saved, stages):
        world = World()
        state = json.loads(saved)
        restored = lsm.checkpoints.Restored(state, "checkpoint.nc", "")

        def restore_last(sim, out, accept):
            accept(state, restored.path)
            return restored

        monkeypatch.setattr(lsm.checkpoints, "restore_last", restore_last)
        files = SimpleNamespace(attrs={"id": "run"})
        monkeypatch.setattr(lsm, "opened_run", lambda path: contextlib.nullcontext(files))
        start, damage = start_of(world, stages, tmp_path, Stopwatch(), {"seed": 1})
        world.rows, world.snapshots, moments = start.keep
        world.lines, world.pictures = world.lines[: world.rows], world.pictures[: world.snapshots]
        assert len(world.contacts) >= moments
        del world.contacts[moments:]
        world.last_time = world.pictures[-1][0]
        assert damage == "" and len(world.lines) == world.rows and len(world.pictures) == world.snapshots
        assert run(world, stages, start)
        return world

    yield SimpleNamespace(run=run, resume=resume)
    signals.restore(previous)


def test_a_schedule_is_gone_through_stage_by_stage(go):
    world = World()
    loop = go.run(world, schedule())
    names = [line[1:3] for line in world.lines]
    assert list(dict.fromkeys(names)) == [("generate", 0), ("press", 1), ("shear", 2), ("hold", 3), ("again", 4)]
    assert world.lines[1][0] == 14 and all(
        line[4] == {"press": 2, "shear": 3, "hold": 1, "again": 3}[line[1]] for line in world.lines[1:]
    )
    assert sum(name == ("hold", 3) for name in names) == 14  # rows three steps apart, until 40 have passed
    shots = [picture[2] for picture in world.pictures]
    assert shots == ["generate", "press", *["shear"] * 4, "hold", "again"]
    assert loop.position.stage == 4 and world.velocity == 0.02
    moments = [moment[2] for moment in world.contacts]
    assert moments == ["press", *["shear"] * 6, *["hold"] * moments.count("hold"), "again"] and "hold" in moments


def row(strain=0.0, velocity=0.0, **more):
    """A row of a layer on a spring, whose load point moves at 0.1."""
    sprung = {"spring_stretch": 0.0, "load_point_velocity": 0.1, "layer_thickness": 2.0}
    return {"shear_strain": strain, "plate_velocity": velocity} | sprung | more


def test_moments_lie_at_the_first_row_beyond_each_multiple_of_the_strain():
    """Rows 0.004 apart, and multiples of 0.01; then back, where noise about the last multiple gives none."""
    due, marks = Moments(0.01).due, {}
    strains = [round(0.004 * i, 6) for i in range(1, 14)]
    assert [s for s in strains if due("a", row(s), False, marks)] == [0.012, 0.02, 0.032, 0.04, 0.052]
    back = [0.05, 0.052, 0.046, 0.0499, 0.04, 0.041, 0.039, 0.03]
    assert [s for s in back if due("a", row(s), False, marks)] == [0.04, 0.03]
    assert not Moments().due("a", row(7.0), True, {}) and Moments(events=True).due("a", row(), True, {})


def test_an_event_begins_far_above_the_load_velocity_and_ends_below_it():
    changed, marks = Events(rate=0.05).changed, {}
    velocities = [0.1, 0.9, 1.1, 5.0, 0.2, 0.09, 0.8, -3.0, -0.05, 0.1]
    assert [v for v in velocities if changed(row(velocity=np.float64(v)), marks)] == [1.1, 0.09, -3.0, -0.05]
    assert json.dumps(marks)  # which checkpoints keep
    # While the load point rests, the rate times the thickness stands for its velocity.
    rests = {"load_point_velocity": 0.0}
    assert [v for v in velocities if changed(row(velocity=v, **rests), marks)] == [1.1, 0.09, -3.0, -0.05]
    imposed = {"shear_strain": 0.0, "plate_velocity": 9.0, "load_point_velocity": 0.1, "layer_thickness": 2.0}
    assert not changed(imposed, marks)
    assert not changed(imposed | {"imposed_shear_stress": math.nan}, marks)
    assert changed(imposed | {"imposed_shear_stress": 3e6}, marks)


def test_rows_in_which_bonds_broke_are_events():
    changed, marks = Events(rate=0.05).changed, {}
    assert [n for n in (9, 9, 7, 7, 6, 5) if changed({"bond_count": n}, marks)] == [7, 6, 5]


def test_words_for_moments():
    assert checked_words(["every=0.01", "events"]) == ["every=0.01", "events"]
    assert checked_words(["none"]) == checked_words([]) == []
    assert interval(["stages", "every=0.25"]) == 0.25 and interval(["events"]) is None
    for words, message in (
        (["often"], "^must be every=STRAIN"),
        (["every=0"], "from 1e-06 to 1000"),
        (["every=nan"], "from 1e-06 to 1000"),
        (["end", "end"], "only once"),
        (["none", "end"], "or none, or several"),
        (["every=0.1", "every=0.2"], "only once"),
    ):
        with pytest.raises(ValueError, match=message):
            checked_words(words)


def test_a_run_that_stops_anywhere_goes_on_as_if_it_had_not(go, monkeypatch):
    """Stopped at every step, with pieces of every length."""
    whole = World()
    go.run(whole, schedule())
    for stop in range(1, whole.step):
        monkeypatch.setattr(run_loop, "FIRST_PIECE", 10.0 * (1 + stop % 11))
        stopped = World(stop_at=stop)
        assert go.run(stopped, schedule()) is None and stopped.step - stop < 11
        resumed = go.resume(stopped.saved, schedule())
        assert resumed.lines == whole.lines and resumed.pictures == whole.pictures
        assert resumed.contacts == whole.contacts
        assert resumed.state == whole.state


def test_a_finished_run_can_be_made_longer(go):
    short, long = World(), World()
    assert go.run(short, schedule(strain=0.61)) and go.run(long, schedule(strain=1.5))
    resumed = go.resume(short.saved, schedule(strain=1.5))
    assert short.lines != long.lines
    assert resumed.lines == long.lines and resumed.pictures == long.pictures and resumed.state == long.state
    assert resumed.contacts == long.contacts
    same = go.resume(short.saved, schedule(strain=0.61))
    assert same.lines == short.lines and same.pictures == short.pictures


@pytest.mark.parametrize("stages", [1, 2, 3])
def test_a_finished_run_goes_on_through_more_stages(go, stages):
    short, long = World(), World()
    assert go.run(short, schedule(stages=stages)) and go.run(long, schedule())
    assert len(short.lines) < len(long.lines)
    resumed = go.resume(short.saved, schedule())
    assert resumed.lines == long.lines and resumed.pictures == long.pictures and resumed.state == long.state
    assert resumed.contacts == long.contacts


@pytest.mark.parametrize(("strain", "speed"), [(0.5, 40.0), (0.01, float("nan"))])
def test_the_speed_of_a_run_leaves_out_the_row_in_which_it_compiles(go, monkeypatch, strain, speed):
    """Ten grains; a step takes a quarter of a second, the first one a hundred seconds more."""
    world = World()
    monkeypatch.setattr(run_loop.time, "perf_counter", lambda: 100.0 * (world.step > 0) + 0.25 * world.step)
    loop = go.run(world, [Stage("shear", Reached(strain=strain), Spacing(8, 2), {"velocity": Change(0.01)})])
    assert loop.grain_steps_per_second == pytest.approx(speed, nan_ok=True)


def test_a_layer_that_does_not_settle_ends_the_run(go):
    stages = [Stage("press", Settled(5.0, within=100.0), Spacing(14, 2))]
    with pytest.raises(
        lsm.SimulationError, match=r"step 112: the layer did not settle within 100 s: normal stress 1 Pa"
    ):
        go.run(World(), stages)


def test_the_first_of_the_ends_of_a_stage_ends_it():
    layer = World()
    for condition, met in ((Reached(slip=1.0), True), (Reached(time=9.0), False), (Reached(strain=0.4), True)):
        memory = condition.begin(World())
        layer.slip, layer.strain, layer.step = -1.5, 0.5, 5
        assert condition.met(layer, {}, memory) == met


def send(*signums):
    """Send signals to this process while they are held back."""
    with signals.held():
        for signum in signums:
            signal.raise_signal(signum)
        after.append("held")


after = []


@pytest.mark.parametrize(("signums", "waits"), [([signal.SIGTERM], True), ([signal.SIGINT, signal.SIGINT], False)])
def test_a_signal_waits_for_the_end_and_a_second_one_does_not(monkeypatch, signums, waits):
    previous = signals.install()
    monkeypatch.setattr(signals, "SAME_REQUEST_S", 0.0)
    after.clear()
    try:
        with pytest.raises(signals.Interrupted):
            send(*signums)
    finally:
        signals.restore(previous)
    assert after == ["held"] * waits


def test_signals_that_the_process_ignores_stay_ignored():
    """SIGHUP below nohup; otherwise it is obeyed, so that a closed terminal loses nothing."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert int(signal.SIGHUP) not in signals.obeyed() and int(signal.SIGTERM) in signals.obeyed()
        signals.restore(signals.install())
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
        assert int(signal.SIGHUP) in signals.obeyed()
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_position_is_plain():
    position = Position(stage=1, begun=True, memory={"strain": 0.5})
    assert Position(**json.loads(json.dumps(position.as_plain()))) == position


@pytest.mark.parametrize(
    ("state", "message"),
    [
        ({}, r"^checkpoint.nc: holds no cpu_seconds, id, .*must be a checkpoint of lsm shear-gouge"),
        ({"parameters": {"seed": 2}}, r"^checkpoint.nc: is of a run with seed 2 where this run has 1"),
    ],
)
def test_checkpoints_of_something_else_are_refused(tmp_path, state, message):
    """As stopped.nc under another name, which holds no place in a schedule."""
    whole = dict.fromkeys(STATE) | state if state else {}
    with pytest.raises(lsm.InputError, match=message):
        _check_same_run(whole, Path("checkpoint.nc"), [tmp_path / "run.nc"], {"seed": 1})


def test_rows_lie_closer_after_a_change_and_then_ever_wider(go):
    world = World()
    widening = Spacing(4, 2, growth=1.5, most=20.0)
    go.run(world, [Stage("step", Reached(time=150.0), widening, {"velocity": Change(0.01)})])
    apart = [b[0] - a[0] for a, b in itertools.pairwise(world.lines)]
    assert apart[0] == 4 and apart == sorted(apart) and apart[-1] == 20
    assert [widening.sample_steps(row) for row in (0, 1, 4, 500)] == [2, 3, 10, 10]


@pytest.mark.parametrize("stop_at", [None, 31, 47, 66])
def test_a_value_is_ramped_and_then_oscillates_wherever_the_run_is_stopped(go, stop_at):
    stages = [
        Stage("run-in", Reached(time=30.0), Spacing(10, 1), {"velocity": Change(0.1)}),
        Stage("ramp", Reached(time=40.0), Spacing(4, 2), {"velocity": Change(0.3, within=20.0)}),
        Stage("shaken", Reached(time=24.0), Spacing(2, 1), {"velocity": Change(0.2, amplitude=0.5, period=8.0)}),
    ]
    whole = World()
    go.run(whole, stages)
    if stop_at is None:
        values = dict(whole.set_at)
        # In the middle of the two steps that follow; the end is reached and kept.
        assert values[30] == pytest.approx(0.11) and values[40] == pytest.approx(0.21)
        assert values[50] == 0.3 and max(step for step, _ in whole.set_at if step < 70) == 50
        assert values[70] == pytest.approx(0.2 * (1.0 + 0.5 * math.sin(2.0 * math.pi / 8.0)))
        return
    stopped = World(stop_at=stop_at)
    assert go.run(stopped, stages) is None
    assert go.resume(stopped.saved, stages).lines == whole.lines
