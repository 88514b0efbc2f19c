"""Markdown: table rows, and tables that a benchmark writes between markers of a page.

A page has `<!-- bench:NAME -->` and, further down, `<!-- /bench:NAME -->`; what stands between them is replaced. A page
without those markers is left as it is.
"""

import re
from pathlib import Path


def row(*cells: object) -> str:
    """One row of a table."""
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def head(*cells: object) -> list[str]:
    """Heading of a table and the line below it."""
    return [row(*cells), "|" + "---|" * len(cells)]


def replaced(text: str, name: str, block: str) -> str:
    """Put `block` between the markers `name`; a text without these markers comes back unchanged.

    Raises
    ------
    ValueError
        If one of the two markers is missing, if there are several, or if they are in the wrong order.
    """
    opening, closing = f"<!-- bench:{name} -->", f"<!-- /bench:{name} -->"
    count = text.count(opening), text.count(closing)
    if count == (0, 0):
        return text
    if count != (1, 1) or text.index(opening) > text.index(closing):
        raise ValueError(f"bench:{name}: {count[0]} opening, {count[1]} closing markers: must be one of each, in order")
    between = re.compile(re.escape(opening) + ".*?" + re.escape(closing), re.DOTALL)
    return between.sub(lambda _: f"{opening}\n{block.strip()}\n{closing}", text)


def write(path: str | Path, blocks: dict[str, str]) -> list[str]:
    """Put every block {name: text} between its markers of the page at `path`; returns the names with markers."""
    path = Path(path)
    text = path.read_text(encoding="utf-8")
    done = [name for name in blocks if f"<!-- bench:{name} -->" in text]
    for name in done:
        text = replaced(text, name, blocks[name])
    path.write_text(text, encoding="utf-8")
    return done
