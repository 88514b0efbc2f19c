"""Former names of options, TOML keys and choices, which are answered with the present ones."""

from collections.abc import Iterable

FORMER = {
    "knobs": "parameters",  # of accuracy-cost
    "laws": "effects",  # of hard-cases --kinds, and of lsm list
    "platen_diameter": "platen_roughness",
}


def renamed(word: str, names: Iterable[str]) -> str | None:
    """The one of `names` that was formerly called `word`; None if none was."""
    now = FORMER.get(str(word))
    return now if now is not None and now in names else None
