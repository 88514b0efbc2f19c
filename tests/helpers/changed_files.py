"""Files changed at random: bits and pieces of their bytes, or what a NetCDF file declares."""

import random
from contextlib import suppress

import netCDF4
import numpy as np
from hypothesis import strategies as st

NUMBERS = (0, 1, -1, 3, 2**15, 2**31 - 1, 2**40, 10**12, -(2**31), np.nan, np.inf, 1e308)
TEXTS = ("", "none", "../../etc/passwd", "\x00", "a\nb", "3", "f64", "time", "stage")


@st.composite
def changes(draw, netcdf):
    """(name, seed) of one to three changes of a file."""
    names = ["flip", "flip", "cut", "overwrite", "insert", "remove", "repeat"]
    names += ["rebuild"] * 7 if netcdf else ["number", "line"]
    count = draw(st.integers(1, 3))
    return [(draw(st.sampled_from(names)), draw(st.integers(0, 2**32))) for _ in range(count)]


def changed(path, steps):
    """Bytes of the file `path` after these changes; those of its structure come first."""
    data = path.read_bytes()
    for name, seed in sorted(steps, key=lambda step: step[0] != "rebuild"):
        rng = random.Random(seed)
        if name == "rebuild":
            data = rebuilt(data, rng)
            continue
        at, size = rng.randrange(len(data) + 1), rng.choice((1, 2, 4, 8, 100))
        if name == "flip":
            bits = bytearray(data)
            for _ in range(rng.choice((1, 1, 8))):
                if bits:
                    bits[rng.randrange(len(bits))] ^= 1 << rng.randrange(8)
            data = bytes(bits)
        elif name == "number":
            data = with_another_number(data, rng)
        elif name == "line":
            lines = data.split(b"\n")
            lines.insert(rng.randrange(len(lines)), lines.pop(rng.randrange(len(lines))))
            data = b"\n".join(lines)
        else:
            filling = bytes(rng.choice(((0,), (255,), (127, 255, 255, 255), range(256)))) * size
            data = {
                "cut": data[:at],
                "overwrite": data[:at] + filling[:size] + data[at + size :],
                "insert": data[:at] + filling[:size] + data[at:],
                "remove": data[:at] + data[at + size :],
                "repeat": data[:at] + data[at : at + 50 * size] * rng.choice((2, 100)) + data[at:],
            }[name]
    return data


def with_another_number(data, rng):
    """Text with one word of digits replaced by another number."""
    words = data.split(b" ")
    places = [i for i, word in enumerate(words) if any(48 <= c < 58 for c in word)]
    if places:
        words[rng.choice(places)] = str(rng.choice(NUMBERS)).encode()
    return b" ".join(words)


def rebuilt(data, rng):
    """The NetCDF file with something declared otherwise: a dimension, a type, an attribute, a name, a value."""
    old = netCDF4.Dataset("old.nc", memory=data)
    new = netCDF4.Dataset("new.nc", "w", format=old.data_model, memory=2**16)
    old.set_auto_mask(False)
    copied(old, new, rng, 1.0 / (5 + 3 * sum(1 for _ in parts_of(old))))
    old.close()
    return bytes(new.close())


def parts_of(group):
    """All variables and groups."""
    yield from group.variables.values()
    for inner in group.groups.values():
        yield inner
        yield from parts_of(inner)


def copied(old, new, rng, chance):
    """Copy a group; each thing is left out or changed with this chance."""
    hit = lambda: rng.random() < chance  # noqa: E731
    sizes = {}
    for name, dimension in old.dimensions.items():
        size = None if dimension.isunlimited() else len(dimension)
        if hit():
            # The classic format would hold all values of a variable that is declared.
            size = rng.choice((None, 1, 2, 1000, *([] if old.data_model != "NETCDF4" else [10**6, 10**9, 10**12])))
        sizes[name] = new.createDimension(name, size)
    put_attributes(old, new, rng, hit)
    for name, variable in old.variables.items():
        if hit():
            continue
        kind = rng.choice(("f8", "i4", "i1", "S1", "f4", str)) if hit() else variable.dtype
        name = f"{name}_1" if hit() else name
        dims = (
            rng.sample(variable.dimensions, rng.randrange(len(variable.dimensions) + 1))
            if hit()
            else variable.dimensions
        )
        with suppress(RuntimeError, ValueError, TypeError, IndexError):
            added = new.createVariable(name, kind, dims, fill_value=False, zlib=bool(dims) and kind is not str)
            put_attributes(variable, added, rng, hit)
            values = np.asarray(variable[...], object if variable.dtype is str else None)
            if hit() and values.size and values.dtype.kind in "fi":
                values = values.copy()
                values.flat[rng.randrange(values.size)] = rng.choice(NUMBERS)
            if (kind is str) == (values.dtype == object):
                added[tuple(slice(0, min(n, m)) for n, m in zip(values.shape, added.shape, strict=True))] = values
    for name, inner in old.groups.items():
        if not hit():
            copied(inner, new.createGroup(f"{name}_1" if hit() else name), rng, chance)


def put_attributes(old, new, rng, hit):
    """Copy attributes; some are left out, or have another value."""
    for name in old.ncattrs():
        if hit():
            continue
        value = old.getncattr(name)
        if hit():
            value = rng.choice([*TEXTS, *map(np.float64, NUMBERS), np.int64(2**40), np.arange(3.0), "x" * 70_000])
        with suppress(RuntimeError, ValueError, TypeError, AttributeError, OSError):
            new.setncattr(name, value)
