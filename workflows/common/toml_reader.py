"""TOML files that anyone may have written: what they hold is bounded before it is parsed.

`tomllib` calls itself for each level of nesting, and its time grows with the square of the parts of a dotted key.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from taichi_lsm.core.errors import InputError

MOST_BYTES = 2**18  # of a file; one with every parameter has some 10 kB
DEEPEST = 32  # levels of nesting, of brackets or of dotted keys
LONGEST_WORD = 100  # characters of a bare key or digits of a number: 64-bit integers have 19

# Strings and comments, in which anything may stand. One that is not closed reaches to the end, as the parser finds too.
QUOTED = re.compile(
    r'"""(?:[^"\\]++|\\.|"(?!""))*+(?:"""|\\?\Z)'
    r"|'''(?:[^']++|'(?!''))*+(?:'''|\Z)"
    r'|"(?:[^"\\\n]|\\[^\n])*+"?'
    r"|'[^'\n]*+'?"
    r"|(?P<comment>#[^\n]*+)",
    re.DOTALL,
)
LONG_WORD = re.compile(rf"[\w-]{{{LONGEST_WORD + 1},}}")
LONG_KEY = re.compile(rf"(?:[\w-]++[ \t]*+\.[ \t]*+){{{DEEPEST}}}")


def read_toml(path: Path) -> dict[str, Any]:
    """Content of the TOML file `path`.

    Raises
    ------
    InputError
        If it is no TOML, or larger or more deeply nested than any file of parameters; the message names the file.
    OSError
        If it cannot be opened or read.
    """
    with open(path, "rb") as file:
        data = file.read(MOST_BYTES + 1)
    try:
        return parsed(data.decode("utf-8"), path)
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not UTF-8 text, must be a TOML file") from None


def parsed(text: str, path: Path) -> dict[str, Any]:
    """Content of the TOML text that the file `path` holds; InputError as `read_toml`."""
    if len(text) > MOST_BYTES:
        raise InputError(f"{path}: is longer than {MOST_BYTES} bytes, must be a file of parameters")
    bare = QUOTED.sub(lambda match: "" if match["comment"] else "_", text)
    if match := LONG_WORD.search(bare):
        raise InputError(
            f"{path}: {match[0][:12]}... has {len(match[0])} characters, keys and numbers must have at most "
            f"{LONGEST_WORD}"
        )
    if _deepest(bare) > DEEPEST or LONG_KEY.search(bare):
        raise InputError(f"{path}: is nested more than {DEEPEST} levels deep, must be a file of parameters")
    try:
        return tomllib.loads(text)
    except ValueError as error:  # a TOMLDecodeError, or that of a date that does not exist
        raise InputError(f"{path}: is not valid TOML: {error}") from None


def _deepest(bare: str) -> int:
    """Greatest number of brackets that are open at once, in a text without strings and comments."""
    depth = deepest = 0
    for bracket in re.findall(r"[\[\]{}]", bare):
        depth += 1 if bracket in "[{" else -1
        deepest = max(deepest, depth)
    return deepest
