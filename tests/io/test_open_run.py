"""Opening files of runs beside other readers of the same process."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest
import xarray

import taichi_lsm as lsm
from taichi_lsm.io.netcdf_variables import Scalar
from tests.helpers.output_files import effects, run_row, run_writer

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_a_file_that_xarray_has_open_is_opened_again_and_again(tmp_path):
    """The library below crashes the process if it opens such a file by its name a third time."""
    path = tmp_path / "run.nc"
    writer = run_writer(path)
    for i in range(5):
        writer.append(run_row(i))
    writer.close("complete")
    lazily = xarray.open_dataset(path)
    for _ in range(3):
        dataset = lsm.open_run(path)
    name = next(name for name, variable in dataset.data_vars.items() if variable.dims == ("time",))
    assert np.array_equal(lazily[name].values, dataset[name].values)


@pytest.fixture
def study(tmp_path):
    """Folder of three runs of different shapes and lengths, one of them with an effect more."""
    acting = effects()
    for i, (label, shape) in enumerate((("1", "round"), ("2", "angular"), ("3", "round"))):
        folder = tmp_path / "out" / "study" / "runs" / label
        folder.mkdir(parents=True)
        scalars = [Scalar("run", label, "name of the run"), Scalar("shape", shape, "shape"), Scalar("seed", 7, "seed")]
        writer = run_writer(folder / "run.nc", scalars=scalars, effects=acting[: 3 - (i == 1)])
        for row in range(3 + i):
            writer.append(run_row(row) | {"time": 0.5 * row + 0.1 * i, "friction": row + 10.0 * i})
        writer.close("complete")
    return tmp_path / "out" / "study"


def recipe(page):
    """The lines of a page that open many files, and the imports that they need."""
    text = (DOCS / page).read_text(encoding="utf-8")
    (lines,) = re.findall(r"^( *)(many = .*\n +files = .*\n +runs = .*|many = .*\nfiles = .*\nruns = .*)$", text, re.M)
    return "import xarray\nimport taichi_lsm as lsm\n" + "\n".join(line.strip() for line in lines[1].splitlines())


@pytest.mark.parametrize("page", ["sweeps.md", "conventions.md"])
def test_the_recipe_of_many_files_gives_the_runs_unread_and_side_by_side(study, page, monkeypatch):
    monkeypatch.chdir(study.parents[1])
    Path("recipe.py").write_text(recipe(page).replace("compare-shapes", "study"), encoding="utf-8")
    with runpy.run_path("recipe.py")["runs"] as lazily:
        assert lazily.run.values.tolist() == ["1", "2", "3"] and lazily["shape"].values.tolist()[1] == "angular"
        assert lazily.friction.chunks and not isinstance(lazily.friction.variable._data, np.ndarray)
        assert lazily.seed.dims == () and lazily.friction.dims == ("run", "row")
        highest = lazily.friction.where(lazily.stage == "shear").max("row").compute()
        assert highest.values.tolist() == [1.0, 13.0, 23.0]
        xarray.testing.assert_equal(lazily.load(), lsm.open_runs(study))
