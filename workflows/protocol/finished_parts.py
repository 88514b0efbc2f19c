"""Results of the parts of an experiment, kept until all are there: a run that goes on does not repeat them."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from workflows.common.run_folder import PARTS


class FinishedParts:
    """Keeps what parts of an experiment gave, as JSON in `out`/parts.

    Parameters
    ----------
    out
        Folder of the experiment.
    resume
        Whether parts that are there already count; else they are removed.
    """

    def __init__(self, out: str | os.PathLike[str], resume: bool) -> None:
        self.folder = Path(out) / PARTS
        if not resume:
            self.clear()

    def get(self, name: str) -> Any:
        """Result of the part `name`, exact to the last bit; None if it is not there or was not written to its end."""
        try:
            return json.loads(self._path(name).read_text(encoding="utf-8"), object_hook=_revived)
        except (FileNotFoundError, json.JSONDecodeError):
            return None

    def put(self, name: str, result: Any) -> Any:
        """Keep numbers, texts, arrays, lists and dicts as the result of a part; returns it."""
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self._path(name)
        temporary = path.with_suffix(".part")
        temporary.write_text(json.dumps(result, default=_plain), encoding="utf-8")
        os.replace(temporary, path)
        return result

    def made(self, name: str, make: Callable[[], Any]) -> Any:
        """The result of a part, which `make` gives if it is not there."""
        found = self.get(name)
        return self.put(name, make()) if found is None else found

    def clear(self) -> None:
        """Remove all parts: the experiment is complete, or begins anew."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.json"


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return {"array": value.tolist(), "dtype": value.dtype.str}
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} cannot be kept: {value!r}")


def _revived(value: dict[str, Any]) -> Any:
    return np.array(value["array"], value["dtype"]) if set(value) == {"array", "dtype"} else value
