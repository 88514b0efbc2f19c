"""TOML that would be costly or impossible to parse is refused with the file and the reason."""

import tomllib
from pathlib import Path

import pytest

from taichi_lsm.core.errors import InputError
from workflows.common.parameters import Params, merge
from workflows.common.toml_reader import DEEPEST, LONGEST_WORD, MOST_BYTES, parsed

HERE = Path("a.toml")
# Texts that hold brackets, dots and long words only in strings and comments.
HARMLESS = [
    f"a = {40 * '['!r}",
    f'a = "{40 * "["}\\"{40 * "a."}"',
    f'a = """\n"" {40 * "["} \\""" {40 * "["}"""',
    f"a = '''\n' {40 * '['} '''",
    f"a = 1 # {40 * '['} {200 * '9'}",
    f"a = [{200 * '0.1, '}]",
    f"{'.'.join(20 * 'a')} = {10 * '['}{10 * ']'}",
]


@pytest.mark.parametrize("text", HARMLESS)
def test_what_stands_in_strings_and_comments_does_not_count(text):
    assert parsed(text, HERE) == tomllib.loads(text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"a = {100_000 * '['}", f"nested more than {DEEPEST} levels"),
        (5000 * "{a=", f"nested more than {DEEPEST} levels"),
        (f"{'.'.join(20_000 * 'a')} = 1", f"nested more than {DEEPEST} levels"),
        (f"[{' . '.join(20_000 * ['x'])}]", f"nested more than {DEEPEST} levels"),
        (f"a = {100_000 * '9'}", f"999999999999... has 100000 characters, .* at most {LONGEST_WORD}"),
        (f"a = 0x{1000 * 'f'}", "has 1002 characters"),
        (f'a = """{12_000 * "a" + 3000 * chr(92) + chr(34)}', "not valid TOML"),
        ("a = 2003-02-31", "not valid TOML"),
        (f"# {MOST_BYTES * 'x'}", f"longer than {MOST_BYTES} bytes"),
    ],
)
def test_what_no_file_of_parameters_holds_is_refused(text, words):
    with pytest.raises(InputError, match=rf"^a\.toml: .*{words}"):
        parsed(text, HERE)


def test_messages_stay_on_short_lines(tmp_path):
    """Values and keys of strangers may be long, many, or move the cursor of a terminal."""
    path = tmp_path / "a.toml"
    path.write_text(f'"\\u001b[2J" = 1\nformat = "{9999 * "x"}"\npreset = "a\\nb"\n')
    with pytest.raises(InputError) as caught:
        merge(Params, toml_path=path)
    assert caught.value.problems == [
        "--preset 'a\\nb': unknown preset, must be one of smoke, demo, standard, reference.",
        f"'\\x1b[2J' = 1 ({path}): unknown parameter.",
        f"--format {80 * 'x'}... ({path}): must be one of png, pdf, svg.",
    ]
    path.write_text("".join(f"k{i} = 1\n" for i in range(20_000)))
    with pytest.raises(InputError) as caught:
        merge(Params, toml_path=path)
    assert len(caught.value.problems) == 41 and caught.value.problems[-1] == "... and 19960 mistakes more."
