"""The page of a run: one HTML file with all that is in it, which needs no network and runs no script."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError
from workflows.common.metrics import read_summary
from workflows.common.run_contents import RunState, attributes_of, state_of
from workflows.report.configuration import configuration, parameters_of
from workflows.report.energy import energy
from workflows.report.figures import figures, pictures_in
from workflows.report.metric_table import claims_not_met, metrics
from workflows.report.parts import Section
from workflows.report.provenance import files_of, provenance, study_of
from workflows.report.row_tables import row_tables, table_of_runs
from workflows.report.scaling import scaling

GENERATOR = "taichi-lsm report"  # by which a page is known that may be written over
HEAD_BYTES = 4096  # of a file, in which that stands
PAGE = "report.html"


class Outcome(NamedTuple):
    """How a run ended.

    Attributes
    ----------
    kind
        "complete", "unmet" if claims do not hold, "failed", "stopped" or "running".
    headline
        In a few words.
    texts
        More of it, and what to do.
    """

    kind: str
    headline: str
    texts: list[str]


def write_report(folder: Path, files: Sequence[Path], runs: Sequence[Path], target: Path, far: str = "") -> int:
    """Write the page of the run in a folder; returns the number of figures on it.

    Parameters
    ----------
    folder, files, runs
        Of the run, which may go on, have failed or been killed; the files in it, and the folders of its runs.
    target
        File to write; a former report is written over.
    far
        How far a run has come that is not complete, in words.

    Raises
    ------
    InputError
        If the target is a file of another kind, or its folder is missing.
    SimulationError
        If it cannot be written.
    """
    _require_report(target)
    files, runs = [path for path in files if not path.name.startswith(".")], list(runs)
    given, state = parameters_of(folder), state_of(folder, runs)
    title = attributes_of(folder, ("title",), whole=True).get("title") or given.experiment or folder.name
    study = study_of(folder)
    name = given.experiment or (study[1] if study else (read_summary(folder) or {}).get("workflow", "run"))
    pictures = figures(folder, title)
    sections = [
        pictures,
        metrics(folder),
        scaling(folder, given),
        energy(folder, runs),
        row_tables(folder, files),
        table_of_runs(folder, runs),
        configuration(folder, given),
        provenance(folder, given),
        files_of([*(path for path in files if path != target), *_drawn(folder)], folder),
    ]
    preset = (read_summary(folder) or {}).get("preset") or (given.params and given.params.preset_name)
    about = f"lsm {name}" + (f", preset {preset}" if preset else "") + f", in {folder}"
    text = _rendered(title, about, outcome(folder, state, far), [s for s in sections if not s.is_empty])
    with lsm.replacing(target) as new:
        new.write_text(text, encoding="utf-8")
    return len(pictures.figures)


def _drawn(folder: Path) -> list[Path]:
    """Pictures of lsm plot, which do not lie in the folder itself."""
    return [path for path in pictures_in(folder) if path.parent != folder]


def _require_report(target: Path) -> None:
    """InputError if there is something else than a report at this path."""
    if target.is_dir():
        raise InputError(f"--out {target}: is a folder, must be a file, such as {target / PAGE}")
    if target.is_file() and GENERATOR.encode() not in target.read_bytes()[:HEAD_BYTES]:
        raise InputError(f"--out {target}: is there and no report of lsm; remove it, or choose another name")


def outcome(folder: Path, state: RunState, far: str) -> Outcome:
    """How a run ended, with what is to be done.

    Parameters
    ----------
    folder, state
        Of the run.
    far
        How far it has come, "" if it is not known.
    """
    so_far = [f"So far: {far}."] if far else []
    study = study_of(folder)
    command = shlex.join([*study, "--out", str(folder)] if study else ["lsm", "resume", str(folder)])
    resume = [f"To go on with it: {command}"] if study or state.stopped else []
    if state.holder:
        return Outcome("running", "Still running", [f"{state.holder} writes to it; more will follow.", *so_far])
    if state.status == "failed":
        texts = ["An error stopped it; what it computed until then is below.", *so_far]
        if (folder / "stopped.nc").is_file():
            texts.append("The state in which it was stopped is in stopped.nc.")
        return Outcome("failed", "Failed", texts + resume)
    if state.goes_on or state.status == "interrupted":
        killed = state.status == "running"
        how = "It ended without a word, as if killed." if killed else "It was stopped before its end."
        headline = "Killed" if killed else "Interrupted" if state.status == "interrupted" else "Not complete"
        left = [f"{state.stopped[0].upper()}{state.stopped[1:]}."] if state.stopped else []
        return Outcome("stopped", headline, [how, *left, *so_far, *resume])
    if state.status != "complete":
        return Outcome("stopped", f"Ended as: {state.status}", [])
    if missed := claims_not_met(folder):
        number = "one of its claims does not hold" if len(missed) == 1 else f"{len(missed)} of its claims do not hold"
        return Outcome("unmet", "Complete", [f"But {number}, see the metrics."])
    return Outcome("complete", "Complete", [])


def _rendered(title: str, about: str, ended: Outcome, sections: list[Section]) -> str:
    """The page as HTML text: all that is put into the template is escaped."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("workflows.report")
    templates = Environment(
        loader=loader,
        autoescape=True,
        finalize=_visible,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return templates.get_template("page.html").render(
        title=title,
        about=about,
        ended=ended,
        sections=sections,
        generator=f"{GENERATOR} {lsm.__version__}",
        date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    )


def _visible(value: object) -> object:
    """A text without control characters, which no page may hold; other values as they are."""
    if not isinstance(value, str) or value.isprintable():
        return value
    return "".join(letter if letter.isprintable() or letter in "\n\t" else " " for letter in value)
