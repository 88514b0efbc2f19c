"""Markdown: table rows, and tables that a benchmark writes between markers of a page.

A page has `<!-- bench:NAME -->` and, further down, `<!-- /bench:NAME -->`; what stands between them is replaced. A page
without those markers is left as it is.
"""

import re
from pathlib import Path


def row(*cells):
    """One row of a table."""
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def head(*cells):
    """Heading of a table and the line below it."""
    return [row(*cells), "|" + "---|" * len(cells)]


def replaced(text, name, block):
    """`text` with `block` between the markers `name`, or unchanged if there are none.

    ValueError if one marker is missing or there are several.
    """
    opening, closing = f"<!-- bench:{name} -->", f"<!-- /bench:{name} -->"
    found = text.count(opening), text.count(closing)
    if found == (0, 0):
        return text
    if found != (1, 1) or text.index(opening) > text.index(closing):
        raise ValueError(f"bench:{name}: {found[0]} opening, {found[1]} closing markers: must be one of each, in order")
    between = re.compile(re.escape(opening) + ".*?" + re.escape(closing), re.DOTALL)
    return between.sub(lambda _: f"{opening}\n{block.strip()}\n{closing}", text)


def write(path, blocks):
    """Put every block {name: text} between its markers of the page at `path`; returns the names that were found."""
    path = Path(path)
    text = path.read_text(encoding="utf-8")
    done = [name for name in blocks if f"<!-- bench:{name} -->" in text]
    for name in done:
        text = replaced(text, name, blocks[name])
    path.write_text(text, encoding="utf-8")
    return done
