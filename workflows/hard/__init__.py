"""Hard cases: situations that break codes like this one, each with a measure and the bound that it must respect.

A module of this package holds the cases of one kind, as functions under the decorator `hard`; the cases of a module
run in one process. The name of the function is the name of the case, and its docstring the reason why it is hard.
"""

from __future__ import annotations

import importlib
import inspect
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import taichi_lsm as lsm

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Case:
    """One hard case: `run(bench)` returns a value that must not exceed the bound.

    Attributes
    ----------
    name, title, why
        Name and title of the case; the reason why it is hard.
    measure, unit
        The value in words, and its unit, "1" for a pure number.
    bound, f32_bound
        Greatest value allowed, in double and in single precision; None for the same.
    excepted
        Reason why the case is not claimed in single precision, "" if it is.
    """

    name: str
    title: str
    why: str
    measure: str
    unit: str
    bound: float
    run: Callable
    f32_bound: float | None = None
    excepted: str = ""

    def bound_in(self, precision: str) -> float:
        """The bound in f64 or f32."""
        return self.bound if precision == "f64" or self.f32_bound is None else self.f32_bound


def hard(
    title: str, measure: str, bound: float, unit: str = "1", f32_bound: float | None = None, excepted: str = ""
) -> Callable[[Callable[[Bench], float]], Case]:
    """Decorator of a function (bench) -> value that is a hard case; see Case."""

    def case_of(run):
        why = " ".join((inspect.getdoc(run) or "").split())
        return Case(run.__name__, title, why, measure, unit, bound, run, f32_bound, excepted)

    return case_of


def modules() -> list[str]:
    """Names of the modules of this package; a new file is found."""
    return sorted(path.stem for path in HERE.glob("[!_]*.py"))


def cases_of(module: str) -> list[Case]:
    """The cases of a module of this package, in the order of its text."""
    found = vars(importlib.import_module(f"{__name__}.{module}")).values()
    return [thing for thing in found if isinstance(thing, Case)]


class Bench:
    """Runs scenes for the cases of one process: scenes of an equal KernelSpec share one compiled simulation.

    Parameters
    ----------
    precision
        f64 or f32.
    short
        Whether runs have fewer steps.
    off
        Names of guards that are switched off in all scenes.
    """

    def __init__(self, precision: str = "f64", short: bool = True, off: Sequence[str] = ()) -> None:
        self.precision, self.short, self.off = precision, short, dict.fromkeys(off)
        self._made = {}

    def steps(self, full: int, short: int) -> int:
        """Number of steps of a full or of a short run."""
        return short if self.short else full

    def simulate(self, scene: lsm.Scene) -> lsm.Simulation:
        """A simulation at the start of `scene`; an earlier one of an equal KernelSpec must no longer be used."""
        scene.guards = replace(scene.guards, **self.off)
        kernel_spec = None if scene.platens else lsm.KernelSpec.of(scene)
        if kernel_spec in self._made:
            self._made[kernel_spec].reset(scene)
            return self._made[kernel_spec]
        sim = lsm.Simulation(scene, precision=self.precision)
        if kernel_spec is not None:
            self._made[kernel_spec] = sim
        return sim


def worst_balance(sim: lsm.Simulation, steps: int, samples: int = 20) -> float:
    """Greatest abs(balance/balance at the start - 1) of the energy over a run in `samples` pieces [1].

    The balance at the start must not be 0.
    """
    start, worst = lsm.energies(sim).balance, 0.0
    for _ in range(samples):
        sim.run(max(1, steps // samples))
        worst = max(worst, abs(lsm.energies(sim).balance / start - 1.0))
    return worst


def error_of_impact(bench: Bench, scene: lsm.Scene, most: int = 20000) -> float:
    """abs(energy after the impact over that before it - 1) [1]."""
    sim = bench.simulate(scene)
    start, before = lsm.energies(sim).balance, sim.state.velocity.to_numpy()
    for _ in range(most // 50):
        sim.run(50)
        begun = (sim.state.velocity.to_numpy() != before).any()
        if begun and sim.measure.sums()["contact_count"] == 0:
            return abs(lsm.energies(sim).balance / start - 1.0)
    raise lsm.SimulationError(f"no impact began and ended within {most} steps")


def refused(make: Callable[[], object], *words: str) -> float:
    """0 if `make()` raises InputError with all the words in its message, else infinity."""
    try:
        make()
    except lsm.InputError as error:
        return 0.0 if all(word in str(error) for word in words) else math.inf
    return math.inf


def steps_until_stopped(sim: lsm.Simulation, steps: int, *words: str) -> float:
    """Steps that were made until SimulationError, with all the words in its message, stopped the run; else infinity."""
    begin = sim.step
    try:
        sim.run(steps)
    except lsm.SimulationError as error:
        return float(sim.step - begin) if all(word in str(error) for word in words) else math.inf
    return math.inf
