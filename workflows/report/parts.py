"""What a page consists of: sections with texts, figures and tables. All are plain text, which the page escapes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple


class Figure(NamedTuple):
    """A picture.

    Attributes
    ----------
    name
        Of its file, relative to the folder.
    source
        The picture itself as a data: URI.
    words
        What it shows.
    size
        (width, height) at which it is shown where there is room [CSS pixels], or None: as the file says.
    """

    name: str
    source: str
    words: str
    size: tuple[int, int] | None = None


@dataclass(frozen=True)
class Table:
    """A table whose first column names its rows.

    Attributes
    ----------
    caption
        What it holds.
    head
        Titles of the columns.
    rows
        Cells, as many as there are titles.
    failing
        Rows, counted from 0, in which something does not hold.
    texts
        Columns, counted from 0, of words: they are aligned to the left and may break.
    note
        What is said below it.
    """

    caption: str
    head: tuple[str, ...]
    rows: list[tuple[str, ...]]
    failing: frozenset[int] = frozenset()
    texts: frozenset[int] = frozenset()
    note: str = ""


@dataclass(frozen=True)
class Section:
    """A part of the page with a heading.

    Attributes
    ----------
    key, title
        Name of its anchor; its heading.
    texts
        Paragraphs.
    figures, tables
        In the order of the page.
    listings
        (title, text) of texts that are shown as they are when they are asked for.
    """

    key: str
    title: str
    texts: list[str] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    listings: list[tuple[str, str]] = field(default_factory=list)

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to show."""
        return not (self.texts or self.figures or self.tables or self.listings)


def with_unit(name: str, unit: str) -> str:
    """The title of a column: its name in words and its unit, but for pure numbers."""
    words = name.replace("_", " ")
    return words if unit in ("1", "") else f"{words} [{unit}]"


def without_empty_columns(table: Table) -> Table:
    """The table without columns that hold nothing."""
    kept = [i for i in range(len(table.head)) if i == 0 or any(row[i] for row in table.rows)]
    return replace(
        table,
        head=tuple(table.head[i] for i in kept),
        rows=[tuple(row[i] for i in kept) for row in table.rows],
        texts=frozenset(kept.index(i) for i in table.texts & set(kept)),
    )


def split_columns(table: Table, most: int) -> list[Table]:
    """Tables of at most `most` columns with the same rows: the first column is in each of them."""
    rest = range(1, len(table.head))
    if len(table.head) <= most:
        return [table]
    found = []
    for begin in range(0, len(rest), most - 1):
        columns = [0, *rest[begin : begin + most - 1]]
        found.append(
            Table(
                f"{table.caption}, columns {begin + 2} to {begin + len(columns)}",
                tuple(table.head[i] for i in columns),
                [tuple(row[i] for i in columns) for row in table.rows],
                table.failing,
                frozenset(i for i, column in enumerate(columns) if column in table.texts),
            )
        )
    return [*found[:-1], replace(found[-1], note=table.note)]
