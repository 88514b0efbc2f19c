"""What a checkpoint says of its scene, so that it is restored into that scene and no other."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

# Inputs of a scene that a restored run need not share with the run that was saved, with what is in force then.
FREE = {
    "position": "the state of the file",
    "angle": "the state of the file",
    "orientation": "the state of the file",
    "velocity": "the state of the file",
    "angular_velocity": "the state of the file",
    "skin": "the margin of the list in the file",
    "dt": "the time step of the file",
    "safety": "nothing: the time step is that of the file",
    "parallel": "what the present scene says: threads do not change results",
    "guards": "what the present scene says: guards do not change results",
}
# Bonds keep the placement of the scene as the one without loads, so that it belongs to what must be the same.
WITH_BONDS = ("position", "angle", "orientation")
MOST_NUMBERS = 4  # of a list that is given in full, not as a digest


def scene_identity(scene: Any) -> dict[str, str]:
    """What two scenes must share for the state of one to go on in the other.

    Parameters
    ----------
    scene : Scene
        The scene of a simulation.

    Returns
    -------
    dict
        Text by name of the input: every input that is not in FREE, with its values in full or, of long arrays, with
        their number and a digest of them.
    """
    bonded = WITH_BONDS if scene.bonds is not None else ()
    names = [f.name for f in fields(scene) if f.name not in FREE or f.name in bonded]
    return {name: as_text(getattr(scene, name)) for name in names}


def as_text(value: Any) -> str:
    """A value in a form that is equal for equal content, whatever the names of what it consists of."""
    if isinstance(value, type):
        return value.__name__
    if isinstance(value, np.ndarray | Sequence) and not isinstance(value, str):
        given = list(value)
        if len(given) > MOST_NUMBERS or any(is_long(item) for item in given):
            return f"{len(given)} of digest {digest(value)}"
        return ", ".join(as_text(item) for item in given) or "none"
    if is_dataclass(value):
        numbers = ", ".join(f"{f.name}={as_text(getattr(value, f.name))}" for f in fields(value))
        return f"{type(value).__name__}({numbers})"
    return json.dumps(plain(value))


def is_long(value: Any) -> bool:
    """Whether a value has more numbers than a reader would compare by eye."""
    if is_dataclass(value) and not isinstance(value, type):
        return any(isinstance(getattr(value, f.name), np.ndarray) for f in fields(value))
    return isinstance(value, np.ndarray) and value.size > MOST_NUMBERS


def digest(value: Any) -> str:
    """The first 16 hexadecimal digits of the SHA-256 of all numbers and texts of a value, in their order."""
    sha = hashlib.sha256()
    for part in content(value):
        sha.update(part)
    return sha.hexdigest()[:16]


def content(value: Any) -> Any:
    """The bytes of all numbers and texts of a value, each with what tells it from its neighbours."""
    if is_dataclass(value) and not isinstance(value, type):
        yield type(value).__name__.encode()
        for f in fields(value):
            if f.name != "name":  # of a shape: what it is called does not change it
                yield f.name.encode()
                yield from content(getattr(value, f.name))
    elif isinstance(value, np.ndarray) and value.dtype != object:
        yield f"{value.shape}{value.dtype.kind}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif isinstance(value, Mapping):
        yield from content(list(value.items()))
    elif isinstance(value, np.ndarray | Sequence) and not isinstance(value, str):
        yield f"[{len(value)}".encode()
        for item in value:
            yield from content(item)
    else:
        yield json.dumps(plain(value)).encode()


def plain(value: Any) -> Any:
    """A number of NumPy as one of Python, a class as its name; what has no values of its own as that of its class."""
    if hasattr(value, "item"):
        return value.item()
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return value.__name__ if isinstance(value, type) else type(value).__name__
