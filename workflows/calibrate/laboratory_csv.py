"""Columns of numbers from a text file of a laboratory. Anyone may have written it: its size is bounded."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_lsm.core.errors import InputError, shown
from workflows.common.parameter_problems import as_written, nearest

MOST_BYTES = 2**26  # of a file: a million rows of eight columns
MOST_ROWS = 2_000_000
MOST_COLUMNS = 1000
LONGEST_FIELD = 2**16  # characters between two separators
SEPARATORS = (",", ";", "\t")  # the one that is most frequent in the header is that of the file


def read_columns(path: Path, wanted: Mapping[str, str]) -> dict[str, NDArray]:
    """Columns of a CSV file with one header line; lines that begin with # are comments.

    Parameters
    ----------
    path
        The file: UTF-8, columns separated by commas, semicolons or tabs, numbers with a decimal point.
    wanted
        Header of the column by what it is wanted for.

    Returns
    -------
    dict
        (rows,) finite numbers of each, as the file has them.

    Raises
    ------
    InputError
        With the file, the row (its line, from 1), the column, the value, and what to do.
    """
    lines = _lines(path)
    if not lines:
        raise InputError(f"{path}: is empty, must be a CSV file with one header line")
    header_line, header_text = lines[0]
    separator = max(SEPARATORS, key=header_text.count)
    header = [name.strip() for name in _fields(path, header_line, header_text, separator)]
    if len(header) > MOST_COLUMNS:
        raise InputError(f"{path}: has {len(header)} columns, must have at most {MOST_COLUMNS}")
    places = {what: _place(path, header, name) for what, name in wanted.items()}
    columns: dict[str, list[float]] = {what: [] for what in wanted}
    for number, text in lines[1:]:
        fields = _fields(path, number, text, separator)
        if len(fields) != len(header):
            raise InputError(
                f"{path}, row {number}: has {len(fields)} columns, the header has {len(header)}; complete the row, or "
                "remove it"
            )
        for what, place in places.items():
            columns[what].append(_number(path, number, header[place], fields[place]))
    return {what: np.array(values, dtype=float) for what, values in columns.items()}


def _lines(path: Path) -> list[tuple[int, str]]:
    """(number, text) of each line that is neither blank nor a comment."""
    try:
        with open(path, "rb") as file:
            data = file.read(MOST_BYTES + 1)
    except FileNotFoundError:
        others = [p.name for p in path.parent.iterdir() if p.is_file()] if path.parent.is_dir() else []
        raise InputError(f"{path}: there is no such file.{nearest(path.name, others)}") from None
    except (OSError, ValueError) as error:  # a name may hold what no path may
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(data) > MOST_BYTES:
        raise InputError(f"{path}: is larger than {MOST_BYTES} bytes, keep fewer rows or columns")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{path}, row {row}: is not UTF-8 text, save it as a CSV file in UTF-8") from None
    found = enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1)
    kept = [(i, line) for i, line in found if line.strip() and not line.lstrip().startswith("#")]
    if len(kept) > MOST_ROWS:
        raise InputError(f"{path}: has {len(kept)} rows, must have at most {MOST_ROWS}; keep every tenth")
    return kept


def _fields(path: Path, number: int, text: str, separator: str) -> list[str]:
    """The fields of one line, without quotes."""
    if len(text) > LONGEST_FIELD:
        raise InputError(f"{path}, row {number}: has {len(text)} characters, must have at most {LONGEST_FIELD}")
    try:
        return next(csv.reader([text], delimiter=separator, strict=True), [])
    except csv.Error as error:
        raise InputError(f"{path}, row {number}: is no row of a CSV file: {error}") from None


def _place(path: Path, header: list[str], name: str) -> int:
    """Number of the column with this header."""
    if header.count(name) == 1:
        return header.index(name)
    there = as_written(header)
    if name in header:
        raise InputError(f"{path}: column {as_written(name)} is there {header.count(name)} times, rename all but one")
    raise InputError(f"{path}: has no column {as_written(name)}, there are {there}.{nearest(name, header)}")


def _number(path: Path, number: int, column: str, text: str) -> float:
    """The number in a field."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or "_" in text:
        comma = "; write decimals with a point" if "," in text else ""
        raise InputError(
            f"{path}, row {number}, column {as_written(column)}: {shown(text)}, must be a finite number; correct it, "
            f"or remove the row{comma}"
        )
    return value
