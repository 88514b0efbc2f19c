"""One word for one thing: the words that docs/glossary.md lists as former ones are found nowhere else."""

import io
import re
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
GLOSSARY = ROOT / "docs" / "glossary.md"
FOLDERS = ("taichi_lsm", "workflows", "benchmarks", "examples", "tests", "docs", "data")
PAGES = ("README.md", "CONTRIBUTING.md")
KINDS = (".py", ".md", ".toml", ".json", ".csv")
# The list itself, and the names that the command line answers with the present ones.
EXCEPTIONS = (GLOSSARY, ROOT / "workflows" / "common" / "former_names.py")


def refused_words(text):
    """(words, names) of the table of the glossary: those refused everywhere, and those refused as a name in code."""
    words, names = set(), set()
    table = text.split("## Formerly called")[1]
    for line in table.splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if line.startswith("|") and cells[2] in ("word", "name"):
            (words if cells[2] == "word" else names).update(word.strip() for word in cells[0].split(","))
    return words, names


def separated(text):
    """CamelCase as snake_case, in lower case."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", text).lower()


def pattern(words):
    """What finds one of the words as a whole, alone or as a part of a snake_case name."""
    forms = [r"[-_]".join(r"[\s_-]+".join(map(re.escape, piece.split())) for piece in w.split("-")) for w in words]
    return re.compile(rf"(?<![a-z])(?:{'|'.join(sorted(forms, key=len, reverse=True))})(?![a-z])")


def names_of(source):
    """(line, name) of every identifier of a Python source, and of every string that is one."""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        text = token.string.strip("rbuf\"'") if token.type == tokenize.STRING else token.string
        if token.type in (tokenize.NAME, tokenize.STRING) and re.fullmatch(r"[A-Za-z_]\w*", text):
            yield token.start[0], text


def found(text, python, words, names):
    """(line, word) of every refused word in a text, and of every refused name if it is Python."""
    lowered = separated(text)
    hits = [(lowered.count("\n", 0, match.start()) + 1, match[0]) for match in pattern(words).finditer(lowered)]
    if python:
        refused = pattern(names)
        hits += [(line, name) for line, name in names_of(text) if refused.search(separated(name))]
    return sorted(hits)


def pages():
    for folder in FOLDERS:
        yield from (p for p in sorted((ROOT / folder).rglob("*")) if p.suffix in KINDS and p not in EXCEPTIONS)
    yield from (ROOT / page for page in PAGES)


WORDS, NAMES = refused_words(GLOSSARY.read_text(encoding="utf-8"))
HERE = Path(__file__).resolve()


@pytest.mark.parametrize("folder", [*FOLDERS, *PAGES])
def test_former_words_are_gone(folder):
    hits, searched = [], 0
    for page in pages():
        path = page.relative_to(ROOT)
        if path.parts[0] == folder and page != HERE:
            searched += 1
            hits += [f"{path}: {word}" for _, word in found(str(path), False, WORDS | NAMES, set())]
            text = page.read_text(encoding="utf-8")
            hits += [f"{path}:{n}: {word}" for n, word in found(text, page.suffix == ".py", WORDS, NAMES)]
    assert searched, f"{folder} holds nothing to search"
    assert not hits, "\n".join(["see docs/glossary.md", *hits])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x = 1\n# the crew waits\n", [(2, "crew")]),
        ("threadCrew = 1\n", [(1, "crew")]),
        ("def hand_in(self):\n    pass\n", [(1, "hand_in")]),
        ("class SeedScheme:\n    pass\n", [(1, "seed_scheme")]),
        ('"""The seed\'s scheme: a seed\nscheme."""\n', [(1, "the seed's"), (1, "seed\nscheme")]),
        ("pair_twist = 1\n", [(1, "pair_twist")]),
        ('row = Variable("spin")\n', [(1, "spin")]),
        ("screw = shelving + reader  # a couple of spinning grains twist, with a random seed\n", []),
    ],
)
def test_a_planted_word_is_found(text, expected):
    assert found(text, True, WORDS, NAMES) == sorted(expected)


def test_names_are_judged_in_code_alone():
    assert found("Hertz's law, a couple, the spin", False, WORDS, NAMES) == []
    assert found("a ledger", False, WORDS, NAMES) == [(1, "ledger")]


def test_the_list_is_that_of_the_glossary():
    assert {"crew", "knob", "booked", "dear"} <= WORDS and {"spin", "couple", "twist"} <= NAMES
    assert not WORDS & NAMES
    words, names = refused_words(
        "## Formerly called\n| formerly | now | refused as |\n| a, b-c | d | word |\n| e | f | name |"
    )
    assert words == {"a", "b-c"} and names == {"e"}
