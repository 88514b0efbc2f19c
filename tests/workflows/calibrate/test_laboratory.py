"""Series of a laboratory: files that anyone may have written, units, and the error of a correlated series."""

import contextlib
import csv
import io

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from taichi_lsm.core.errors import InputError
from workflows.calibrate.laboratory import laboratory_targets
from workflows.calibrate.laboratory_csv import read_columns

# Taichi makes its process take numbers below 2e-308 for 0, and no laboratory measures them.
finite = st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=False)
letters = st.characters(codec="utf-8", exclude_categories=("Cc", "Cs", "Zs", "Zl", "Zp"), exclude_characters=",;")
names = st.text(letters, min_size=1, max_size=8)
ONE_FILE = settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)


@ONE_FILE
@given(
    st.lists(st.tuples(finite, finite), max_size=8),
    st.lists(names, min_size=2, max_size=2, unique=True),
    st.sampled_from(",;\t"),
)
def test_what_a_table_holds_is_read(tmp_path, rows, header, separator):
    text = io.StringIO()
    csv.writer(text, delimiter=separator, quoting=csv.QUOTE_ALL).writerows([header, *rows])
    path = tmp_path / "lab.csv"
    path.write_text("# a comment\n\n" + text.getvalue(), encoding="utf-8")
    found = read_columns(path, {"x": header[1]})
    assert found["x"].tolist() == [row[1] for row in rows]


@ONE_FILE
@given(st.one_of(st.binary(max_size=200), st.text("0123456789.,;-e#\"'\n\r\tab", max_size=200).map(str.encode)))
def test_whatever_a_file_holds_is_read_or_refused(tmp_path, content):
    path = tmp_path / "lab.csv"
    path.write_bytes(content)
    with contextlib.suppress(InputError):
        assert np.isfinite(read_columns(path, {"x": "a"})["x"]).all()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", r"lab.csv: is empty"),
        (b"a,b\n1,2\n3,x\n", r"lab.csv, row 3, column b: 'x', must be a finite number; correct it, or remove the row$"),
        (b"a,b\n1,nan\n", r"row 2, column b: 'nan', must be a finite number"),
        (b"a;b\n1;0,5\n", r"row 2, column b: '0,5'.*write decimals with a point"),
        (b"# note\na,b\n1,2\n3\n", r"row 4: has 1 columns, the header has 2"),
        (b"a,c\n1,2\n", r"lab.csv: has no column b, there are a,c"),
        (b"a,b,b\n1,2,3\n", r"lab.csv: column b is there 2 times, rename"),
        (b"a,b\n1,\xff\n", r"row 2: is not UTF-8"),
        (b'a,b\n1,"2\n', r"row 2: is no row of a CSV file"),
    ],
)
def test_mistakes_in_a_file_are_named(tmp_path, content, message):
    (tmp_path / "lab.csv").write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_columns(tmp_path / "lab.csv", {"x": "b"})


MU, DEVIATION, MEMORY, ROWS = 0.45, 0.02, 0.9, 6000
COLUMNS = {
    "displacement": {"column": "disp_mm", "unit": "mm"},
    "shear_stress": {"column": "tau", "unit": "MPa"},
    "normal_stress": {"column": "sigma", "unit": "kPa"},
    "layer_thickness": {"column": "h_um", "unit": "um"},
}


@pytest.fixture
def laboratory(tmp_path):
    """laboratory(keep, **changes): targets from a series of known friction and correlation, rows `keep` of it."""

    def get(keep=slice(None), rise=0.0, **changes):
        rng, noise = np.random.default_rng(3), [0.0]
        for step in rng.normal(0.0, DEVIATION * np.sqrt(1 - MEMORY**2), ROWS):
            noise.append(MEMORY * noise[-1] + step)
        displacement = np.linspace(0.0, 12.0, ROWS)
        transient = -0.4 * np.exp(-displacement / 0.3)
        friction = MU + rise * (displacement > 6.0) + np.array(noise[1:]) + transient
        columns = [displacement, 5.0 * friction, np.full(ROWS, 5000.0), np.full(ROWS, 2000.0)]
        lines = [",".join(f"{value:.9g}" for value in row) for row in zip(*(c[keep] for c in columns), strict=True)]
        (tmp_path / "lab.csv").write_text("\n".join(["disp_mm,tau,sigma,h_um", *lines]))
        table = {"file": "lab.csv", "columns": COLUMNS, "steady_from": 1.5} | changes
        return laboratory_targets(table, tmp_path)

    return get


def test_the_error_of_friction_is_that_of_a_correlated_series(laboratory):
    """Of n samples of an autoregressive series as many count as independent as n (1 - r)/(1 + r)."""
    (target,) = laboratory()
    independent = 0.75 * ROWS * (1 - MEMORY) / (1 + MEMORY)  # from strain 1.5 of 6 on
    assert target.metric == "friction_mean" and target.runs is None
    assert target.error == pytest.approx(DEVIATION / np.sqrt(independent), rel=0.25)
    assert abs(target.value - MU) < 3.0 * target.error


def test_the_start_may_be_a_displacement_and_friction_a_column(laboratory):
    (by_strain,), (by_length,) = laboratory(), laboratory(steady_from={"value": 3.0, "unit": "mm"})
    assert by_length.value == pytest.approx(by_strain.value, abs=1e-5)  # 3 mm of a layer of 2 mm
    ratio = {"displacement": COLUMNS["displacement"], "friction": {"column": "tau"}}
    (of_column,) = laboratory(columns=ratio, steady_from={"value": 3.0, "unit": "mm"})
    assert of_column.value == pytest.approx(5.0 * by_strain.value, rel=1e-3)


def test_rows_at_uneven_spacing_count_by_displacement(laboratory):
    """Every other row of the second half, which is stronger, left out: it counts for as much as before."""
    keep = np.r_[0 : ROWS // 2, ROWS // 2 : ROWS : 2]
    (even,), (uneven,) = laboratory(rise=0.4 * DEVIATION), laboratory(keep, rise=0.4 * DEVIATION)
    assert uneven.value == pytest.approx(even.value, abs=0.3 * even.error)


def without(*names):
    return {name: column for name, column in COLUMNS.items() if name not in names}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"file": "lob.csv"}, r"lob.csv: there is no such file. Did you mean lab.csv"),
        ({"file": 3}, r"laboratory.file = 3: must be the path"),
        ({"path": "x"}, r"laboratory.path: unknown, must be one of file"),
        ({"columns": {}}, r"laboratory.columns = \{\}: must be a table"),
        ({"columns": COLUMNS | {"stress": {}}}, r"columns.stress: unknown.*Did you mean"),
        ({"columns": COLUMNS | {"displacement": {"column": "disp_mm", "unit": "MPa"}}}, r"unit = 'MPa': must be a uni"),
        ({"columns": COLUMNS | {"displacement": "disp_mm"}}, r"columns.displacement = 'disp_mm': must be \{column"),
        ({"columns": without("shear_stress")}, r"columns: must have friction, or shear_stress and normal_stress"),
        ({"columns": without("displacement")}, r"columns: must have displacement or shear_strain"),
        ({"columns": without("layer_thickness")}, r"steady_from = 1.5: is a shear strain, which needs layer_thick"),
        ({"steady_from": "late"}, r"steady_from = 'late': must be a shear strain, or \{value"),
        ({"steady_from": {"value": 3.0}}, r"steady_from.unit = None: must be a unit of a length"),
        ({"steady_from": 6.0}, r"lab.csv: .*at least 10 are needed.*lower calibrate.laboratory.steady_from"),
        ({"steady_from": 5.97}, r"lab.csv: the error of the mean friction is unknown: .*targets.friction_mean"),
        ({"keep": np.r_[0:100, 50:100]}, r"lab.csv, row 101 after the header: displacement or strain must grow"),
    ],
)
def test_mistakes_are_named(laboratory, changes, message):
    with pytest.raises(InputError, match=message):
        laboratory(**changes)
