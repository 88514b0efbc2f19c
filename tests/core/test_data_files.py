"""Data files: found, complete and plausible."""

import csv
import re
import tomllib

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.core.data_files import data_path, published_friction
from workflows import shear_gouge
from workflows.common.parameters import merge

COLUMNS = ["source", "year", "conditions", "dimension", "shape", "mu", "kind", "reference", "note"]


def test_reference_rows_are_complete():
    with open(data_path("friction_references.csv"), encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == COLUMNS
    assert len(rows) > 10
    for row in rows[1:]:
        assert len(row) == len(COLUMNS) and all(cell == cell.strip() and cell for cell in row), row


def test_reference_values_are_plausible():
    for row in published_friction():
        assert 0.05 < row["mu"] < 1.0, row
        assert row["dimension"] in (1, 2, 3) and row["kind"] in ("laboratory", "simulation"), row
        assert row["note"] in ("abstract read", "unchecked"), row
        assert f"({row['year']})" in row["reference"] and str(row["year"]) in row["source"], row
        assert row["source"].split()[0] in row["reference"], row
        assert list(row) == COLUMNS, row


def test_known_values_are_there():
    """The values that the comparison of shapes is held against."""
    mu = {(r["source"], r["dimension"], r["shape"]): r["mu"] for r in published_friction()}
    assert mu["Mair 2002", 3, "smooth sphere"] == 0.45 and mu["Mair 2002", 3, "angular"] == 0.60
    assert mu["Frye 2002", 1, "rod"] == 0.15 and mu["Frye 2002", 2, "rod"] == 0.30
    latham = [r for r in published_friction() if r["source"] == "Latham 2005"]
    rotating = [r["mu"] for r in latham if "grains rotate" in r["conditions"]]
    assert rotating == [0.30, 0.38]


def test_the_example_builds_the_layer_of_its_source():
    """Sizes and thickness are those of the published row; the file says all that is not the default."""
    path = data_path("mair2002.toml")
    params = merge(shear_gouge.Params, toml_path=path)
    source = next(
        row for row in published_friction() if (row["source"], row["shape"]) == ("Mair 2002", "smooth sphere")
    )
    low, high = (1e-6 * float(n) for n in re.search(r"narrow sizes (\d+)-(\d+) um", source["conditions"]).groups())
    thin, thick = (1e-3 * float(n) for n in re.search(r"(\d)-(\d) mm layers", source["conditions"]).groups())
    scene = shear_gouge.build(params)
    diameter = scene.diameter[scene.platen_index < 0]
    assert low <= diameter.min() < 1.02 * low and 0.98 * high < diameter.max() <= high
    thickness, (length,) = params.layer
    assert thin <= thickness <= 1.05 * thick and scene.lengths[0] == length
    assert 0.75 < np.sum(0.25 * np.pi * diameter**2) / (thickness * length) < 0.85
    elastic, friction = scene.effects[0], scene.effects[-1]
    assert elastic.stiffness == pytest.approx(params.stiffness_number * params.normal_stress * params.diameter)
    assert (friction.coefficient, scene.density) == (params.friction, 2500.0)
    servo = scene.platens[1].drives[1]
    assert servo.stress == params.normal_stress == 5e6
    given = tomllib.loads(path.read_text(encoding="utf-8"))
    assert {name: getattr(params, name) for name in given} == given


def test_first_folder_wins_and_missing_files_are_named(tmp_path):
    installed, source = tmp_path / "installed", tmp_path / "source"
    for folder in (installed, source):
        folder.mkdir()
        (folder / "both.csv").touch()
    (source / "one.csv").touch()
    folders = (tmp_path / "absent", installed, source)
    assert data_path("both.csv", folders) == installed / "both.csv"
    assert data_path("one.csv", folders) == source / "one.csv"
    with pytest.raises(lsm.InputError, match=r"'two\.csv': not found; available are both\.csv, one\.csv$"):
        data_path("two.csv", folders)
    with pytest.raises(lsm.InputError, match="available are none"):
        data_path("two.csv", (tmp_path / "absent",))


def test_no_name_leads_out_of_the_folder(tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "secret.csv").touch()
    for name in ("../secret.csv", str(tmp_path / "secret.csv")):
        with pytest.raises(lsm.InputError, match="must be the name of a file, without a folder"):
            data_path(name, (tmp_path / "data",))
