"""The examples of docs/analysis.md run."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.special import erf

from tests.helpers.contact_tables import grains_of, moments_of, touching, write_contacts, write_records
from tests.helpers.output_files import run_row, run_writer

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "analysis.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
LENGTH, SIZE, ROWS = 6e-3, 1e-3, 13
PRINTED = (
    r"\['contacts', 'grains', 'run'\] complete\n3 2\.25",
    r"\[( *[\d.-]+){8} *\]\nTrue 0\.\d+",
    r"0\.00[456]\d* 1\.0",
    r"1\d\d \[\[0\.\d+, -?0\.\d+\], \[-?0\.\d+, 0\.\d+\]\] 36",
    r"\[[\d ]+\] \d+ \d+",
    r"1\d True",
)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a run in out/a: a layer of discs between two rows of glued ones, in which a band is sheared."""
    base = tmp_path_factory.mktemp("page")
    folder = base / "out" / "a"
    folder.mkdir(parents=True)
    rng = np.random.default_rng(1)
    x, row = (axis.ravel() for axis in np.meshgrid(np.arange(6.0), np.arange(float(ROWS)), indexing="ij"))
    place = SIZE * np.stack([x + 0.5 * (row % 2), np.sqrt(0.75) * row], axis=1)
    glued = np.flatnonzero((row == 0) | (row == ROWS - 1))
    place += 0.02 * SIZE * rng.normal(size=place.shape) * (~np.isin(np.arange(len(x)), glued))[:, None]
    velocity = np.zeros_like(place)
    velocity[:, 0] = 1e-3 * (0.5 + 0.5 * erf((place[:, 1] - 5e-3) / 2e-3))
    position = np.stack([place + velocity * time for time in (0.0, 0.5, 1.0)])
    grains = grains_of(position, 1.02 * SIZE, [LENGTH], glued, velocity).assign_coords(time=[0.0, 0.5, 1.0])
    write_records(folder / "grains.nc", grains, "time")
    moments = [touching(now, 1.02 * SIZE, [LENGTH], slope=0.2) for now in position]
    write_contacts(folder / "contacts.nc", moments_of(moments, [0.0, 0.5, 1.0]))
    rows = run_writer(folder / "run.nc")
    for i in range(3):
        rows.append(run_row(i))
    rows.close("complete")
    return base


def test_every_example_is_run():
    assert len(BLOCKS) == len(PRINTED) == PAGE.count("```python")


def test_examples_of_the_page_run(place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    names = {}
    for code, expected in zip(BLOCKS, PRINTED, strict=True):
        exec(compile(code, "docs/analysis.md", "exec"), names)
        printed = capsys.readouterr().out.strip()
        assert re.fullmatch(expected, printed), printed
