"""The examples of docs/export.md run, for every format that the page and the command know."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.helpers.exported_runs import write_run
from workflows.export.formats import FORMATS, export_run

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "export.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
DECKS = re.findall(r"```lammps\n(.*?)```", PAGE, re.DOTALL)
PRINTED = (r"9 1\.\d+", r"3 0: shape 0, .* mm Polygon", r"\[0\.00\d+ +0\.0026 +0\. *\]", r"1\.25", r"9 \(60, 2\)")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a run in out/a and all its exports."""
    base = tmp_path_factory.mktemp("page")
    folder = write_run(base / "out" / "a", 2)
    for form in FORMATS:
        export_run(folder, folder / f"export-{form}", form)
    return base


def test_every_format_has_a_row_and_an_example():
    rows = re.findall(r"^\| `([\w-]+)` \|", PAGE, re.MULTILINE)
    examples = re.findall(r"^(vtk|gsd|lammps-dump|lammps-data|xyz|csv)\b", PAGE.split("## Examples")[1], re.MULTILINE)
    assert rows == examples == list(FORMATS) and len(BLOCKS) == len(PRINTED)


@pytest.mark.parametrize("number", range(len(PRINTED)))
def test_examples_of_the_page_run(place, monkeypatch, capsys, number):
    monkeypatch.chdir(place)
    exec(compile(BLOCKS[number], "docs/export.md", "exec"), {})
    assert re.fullmatch(PRINTED[number], capsys.readouterr().out.strip())


@pytest.mark.skipif(shutil.which("lmp") is None, reason="LAMMPS (lmp) is not installed")
def test_decks_of_the_page_run(place):
    read, run = DECKS
    data = place / "out" / "a" / "export-lammps-data" / "grains_2.data"
    head = "\n".join(re.findall(r"^#   (.+)$", data.read_text(), re.MULTILINE))
    box = "units si\ndimension 2\nboundary p f p\natom_style sphere\nregion b block 0 4e-3 -1e-3 5e-3 -1e-3 1e-3\n"
    decks = (f"{box}create_box 2 b\n{read}", head.replace(data.name, os.fspath(data)) + "\n" + run)
    for deck, words in zip(decks, ("9 atoms after read", "5 rigid bodies"), strict=True):
        (place / "in.deck").write_text(deck)
        done = subprocess.run(["lmp", "-in", "in.deck", "-log", "none"], cwd=place, capture_output=True, text=True)
        assert done.returncode == 0 and words in done.stdout, done.stdout
