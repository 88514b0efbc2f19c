"""Data files: found, complete and plausible."""

import csv
import tomllib

import pytest

import taichi_lsm as lsm
from taichi_lsm.core.data_files import data_path, published_friction

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


def test_example_scene():
    scene = tomllib.loads(data_path("mair2002.toml").read_text(encoding="utf-8"))
    assert scene == {
        "dim": 2,
        "shape": "sphere",
        "smallest_diameter": 105e-6,
        "largest_diameter": 149e-6,
        "density": 2500.0,
        "normal_stress": 5e6,
        "layer_thickness": 24,
        "length": 30,
        "stiffness_number": 1000.0,
        "inertial_number": 1e-3,
        "friction": 0.5,
    }
    mean_diameter = (scene["smallest_diameter"] + scene["largest_diameter"]) / 2
    assert 2e-3 <= scene["layer_thickness"] * mean_diameter <= 3.1e-3  # the laboratory's layers


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
