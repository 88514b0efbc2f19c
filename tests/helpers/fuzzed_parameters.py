"""TOML files of parameters, for the most part wrong ones, drawn by hypothesis for any experiment."""

import dataclasses
import functools
import json
import math
from datetime import UTC, datetime

from hypothesis import strategies as st

from taichi_lsm.effects import find_effects
from workflows.common.parameter_types import choices, kind, members

HUGE = (2**31 - 1, 2**31, 2**63, 10**19, 10**400, 1e308, 5e-324, -1e308)
SPECIAL = (0, -1, 1, True, False, "", "none", "\x00", "a\nb", "\x1b[31m", "é‮", "../../etc/passwd", "nan", "1e5")
OTHER = (math.nan, math.inf, -math.inf, datetime(2003, 6, 2, tzinfo=UTC), [], {}, [[]], "x" * 1000)

scalars = st.sampled_from(SPECIAL + HUGE + OTHER[:4]) | st.integers() | st.floats() | st.text(max_size=20)
junk = st.recursive(
    st.sampled_from(OTHER) | scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=12,
)


@functools.cache
def bounds_of(field):
    """Bounds that a field states, with what lies just beside them."""
    found = []
    for rule in field.metadata:
        for name in ("ge", "gt", "le", "lt"):
            bound = getattr(rule, name, None)
            if bound is not None:
                found += [
                    bound,
                    bound + 1,
                    bound - 1,
                    math.nextafter(bound, math.inf),
                    math.nextafter(bound, -math.inf),
                ]
    return found or [1, 2.5]


def value_of(field):
    """Values of a field: allowed ones, some at the edge, and wrong ones."""
    names = choices(field.annotation)
    if kind(field.annotation) == "toml":
        good = st.lists(effects(), max_size=3)
    elif kind(field.annotation) == "list":
        one = st.sampled_from(names) if names else st.sampled_from([1, 6, 12, 30, 0.05, 0.2, "steps"])
        good = st.lists(one, max_size=4)
    elif names:
        good = st.sampled_from(names)
    elif bool in members(field.annotation):
        good = st.booleans()
    else:
        low, high = (f(bounds_of(field)) for f in (min, max))
        high = low + 20 if high <= low + 1 else high  # only one bound is stated
        near = st.floats(low, high) | st.floats(low, min(high, low + 30.0))
        whole = st.integers(math.ceil(low), math.floor(high)) | st.integers(math.ceil(low), math.ceil(low) + 10)
        good = st.sampled_from(bounds_of(field)) | (whole if int in members(field.annotation) else near)
        good |= st.just(field.default)
    return st.one_of(good, good, good, good, good, junk)


@functools.cache
def effect_names():
    """Names of the effects, with their parameters."""
    return {name: [f.name for f in dataclasses.fields(cls)] for name, cls in find_effects().items()}


@st.composite
def effects(draw):
    """A table of an effect: all of its parameters, some of them, or others."""
    name = draw(st.sampled_from([*effect_names(), "gravty"]))
    numbers = st.floats(1e-6, 1e9) | st.sampled_from([0.1, 0.5, 1e5, [0.0, -9.81]])
    keys = [key for key in effect_names().get(name, ["stiffness"]) if draw(st.integers(0, 9))]
    table = {"name": name} | {key: draw(numbers if draw(st.integers(0, 5)) else junk) for key in keys}
    if not draw(st.integers(0, 9)):
        table |= draw(st.dictionaries(st.text(max_size=8), junk, max_size=2))
    return table if draw(st.integers(0, 19)) else draw(junk)


@st.composite
def tables(draw, params_class):
    """Keys and values for an experiment: of its fields, of the presets or near them, and unknown ones."""
    fields = params_class.model_fields
    names = draw(st.lists(st.sampled_from(sorted(fields)), max_size=4, unique=True))
    table = {name: draw(value_of(fields[name])) for name in names}
    if not draw(st.integers(0, 9)):
        table |= draw(st.dictionaries(st.text(max_size=12) | st.just("grans"), junk, max_size=3))
    return table


@st.composite
def files(draw, name, params_class, experiments):
    """Text of a TOML file for the experiment `name`, one of `experiments`; now and then it is broken."""
    content = draw(tables(params_class))
    if not draw(st.integers(0, 4)):
        content[draw(st.sampled_from([name, *experiments, "toy"]))] = draw(tables(params_class) | junk)
    if not draw(st.integers(0, 4)):
        content["experiment"] = draw(st.sampled_from([name, *experiments]) | junk)
    if not draw(st.integers(0, 4)):
        content["preset"] = draw(st.sampled_from([*params_class.presets, "smok"]) | junk)
    text = "\n".join(f"{json.dumps(key)} = {toml(value)}" for key, value in content.items())
    if not draw(st.integers(0, 9)):
        at, cut = draw(st.integers(0, len(text))), draw(st.integers(0, 5))
        text = (
            text[:at]
            + draw(st.text(max_size=5) | st.sampled_from(["[" * 3000, "a." * 3000, "9" * 5000]))
            + text[at + cut :]
        )
    return text


def toml(value):
    """A value as TOML writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value).replace("\x7f", "\\u007f")
    if isinstance(value, float):
        return repr(value)  # nan and inf are those of TOML
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{json.dumps(key)} = {toml(one)}' for key, one in value.items())}}}"
    return '"none"' if value is None else value.isoformat() if isinstance(value, datetime) else str(value)
