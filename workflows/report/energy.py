"""Where the work of a run went: stored, dissipated by each effect, and what is not accounted for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import taichi_lsm as lsm
from taichi_lsm.core.errors import reason
from workflows.common.effect_words import effect_words
from workflows.common.run_contents import MALFORMED
from workflows.protocol.stage_tables import RESERVED
from workflows.report.parts import Section, Table

if TYPE_CHECKING:
    import xarray

MOST_RUNS = 24
STORED = ("translational_energy", "rotational_energy", "kinetic_energy", "elastic_energy")
WORK = ("external_work", "work")
FILES = ("run.nc", "crush.nc")


class Budget(NamedTuple):
    """Energies over a part of a run [J].

    Attributes
    ----------
    since
        From when on, in words.
    work
        External work.
    stored
        Change of each form of energy, by its name.
    dissipated
        By effect, or as a whole.
    residual
        Work less what was stored and dissipated.
    throughput
        Sum of the absolute works, to which the residual is compared; nan if it is not on file.
    """

    since: str
    work: float
    stored: dict[str, float]
    dissipated: dict[str, float]
    residual: float
    throughput: float


def energy(folder: Path, runs: list[Path]) -> Section:
    """The budget of a run, or of each run that an experiment consists of; empty where none has energies on file."""
    section = Section("energy", "Energy budget")
    found: dict[str, Budget] = {}
    for place in (folder, *runs[:MOST_RUNS]):
        for path in (place / name for name in FILES):
            if not path.is_file():
                continue
            name = path.relative_to(folder).as_posix()
            try:
                with lsm.opened_run(path) as dataset:
                    budget = budget_of(dataset)
            except MALFORMED as error:
                section.texts.append(f"{name} cannot be read: {reason(error)}.")
                continue
            if budget:
                found[name] = budget
    if len(found) == 1:
        name, budget = next(iter(found.items()))
        section.tables.append(_table(f"Energies of {name}, {budget.since}", budget))
    elif found:
        section.tables.append(_comparison(found))
    if len(runs) > MOST_RUNS:
        section.texts.append(f"Only the first {MOST_RUNS} of {len(runs)} runs are shown.")
    return section


def budget_of(dataset: xarray.Dataset) -> Budget | None:
    """The budget of a file, of the shear if it has any; None if it has none."""
    work = next((name for name in WORK if name in dataset), None)
    if work is None or "energy_residual" not in dataset or dataset[work].ndim != 1 or dataset[work].size < 2:
        return None
    first, since = 0, "from its first row on"
    if "stage" in dataset and dataset.stage.dims == dataset[work].dims:
        sheared = ~np.isin(dataset.stage.values, RESERVED)
        if sheared.sum() > 1:
            first, since = int(np.argmax(sheared)), "since shear began"

    def change(name: str) -> float:
        values = dataset[name].values
        return float(values[-1] - values[first])

    throughput = change("work_throughput") if "work_throughput" in dataset else float("nan")
    stored = {name: change(name) for name in STORED if name in dataset and dataset[name].ndim == 1}
    return Budget(since, change(work), stored, _dissipated(dataset, first), change("energy_residual"), throughput)


def _dissipated(dataset: xarray.Dataset, first: int) -> dict[str, float]:
    """Dissipated energy from a row on, by effect if the file tells them apart."""
    if "dissipated_energy" not in dataset:
        return {}
    values = dataset.dissipated_energy
    change = np.atleast_1d(values.values[-1] - values.values[first])
    labels = [str(label) for label in dataset.effect_name.values] if "effect_name" in dataset else []
    if values.ndim != 2 or len(labels) != change.size:
        return {"all effects": float(change.sum())}
    return dict(zip(labels, map(float, change), strict=True))


def _table(caption: str, budget: Budget) -> Table:
    """The terms of one budget, with their shares of the work."""
    terms = {"external work": budget.work}
    terms |= {f"change of {key.replace('_', ' ')}": value for key, value in budget.stored.items()}
    terms |= {f"dissipated by {effect_words(key)}": value for key, value in budget.dissipated.items()}
    terms["residual"] = budget.residual
    rows = [(key, f"{value:.4g}", _share(value, budget.work)) for key, value in terms.items()]
    note = ""
    if budget.throughput > 0.0:
        share = abs(budget.residual) / budget.throughput
        note = (
            f"The residual is {share:.1e} of the throughput, the sum of the absolute works, {budget.throughput:.3g} J."
        )
    return Table(caption, ("term", "energy [J]", "share of the work [%]"), rows, note=note)


def _share(value: float, of: float) -> str:
    """A share in percent, "" of nothing."""
    return f"{100.0 * value / of:.2f}" if of else ""


def _comparison(found: dict[str, Budget]) -> Table:
    """Budgets of several runs, one row each."""
    effects = list(dict.fromkeys(effect for budget in found.values() for effect in budget.dissipated))
    head = ("run", "work [J]", "stored [J]", *(f"{effect_words(e)} [J]" for e in effects), "residual [J]")
    rows = []
    for name, budget in found.items():
        lost = (f"{budget.dissipated[e]:.3g}" if e in budget.dissipated else "" for e in effects)
        stored = sum(budget.stored.values())
        rows.append((name, f"{budget.work:.3g}", f"{stored:.3g}", *lost, f"{budget.residual:.2g}"))
    return Table("Energies of each run since its shear began, dissipation by effect", head, rows)
