"""Results of the parts of an experiment, kept until all are there: a run that goes on does not repeat them."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError
from workflows.common.fresh_processes import fresh_processes
from workflows.common.parameters import Params
from workflows.common.run_folder import PARTS, Existing, begin_run, run_folder
from workflows.common.stopwatch import Stopwatch

PARAMETERS = "parameters"  # the file that tells with which the parts were made
TIMES = "times"  # the file that tells how long it took until the last of them
MOST_S = 1e10  # of a run [s]; more is no time
MOST_ITEM = 2**16  # bytes of a number or text in an array


@contextmanager
def folder_of_parts(
    params: Params, experiment: str, out: str | os.PathLike[str], existing: Existing, keep_runs: bool = False
) -> Iterator[tuple[Path, FinishedParts]]:
    """The folder of an experiment, as `run_folder` gives it, and the parts in it.

    Raises
    ------
    InputError
        As `run_folder`, or if parts that are there do not suit; the folder is then as it was.
    """
    with run_folder(params, experiment, out, existing, keep_runs=keep_runs, begin=False) as folder:
        parts = FinishedParts(folder, params, existing == "resume")
        begin_run(params, experiment, folder)
        yield folder, parts


class FinishedParts:
    """Keeps what parts of an experiment gave, as JSON in `out`/parts.

    Parameters
    ----------
    out
        Folder of the experiment.
    params
        Of the experiment.
    resume
        Whether parts that are there already count; else they are removed.

    Attributes
    ----------
    watch
        Time of the experiment, with that until the last part before it went on.

    Raises
    ------
    InputError
        If the parts that are there were made with other parameters.
    """

    def __init__(self, out: str | os.PathLike[str], params: Params, resume: bool) -> None:
        self.folder = Path(out) / PARTS
        if not resume:
            self.clear()
        acting = params.model_dump(mode="json", exclude=set(params.without_result))
        former = self.get(PARAMETERS)
        if isinstance(former, dict) and former != acting:
            differing = ", ".join(name for name in acting if former.get(name) != acting[name])
            raise InputError(f"{self.folder}: was made with other {differing}; begin anew, or with these as they were")
        if not isinstance(former, dict):  # parts of who knows which parameters
            self.clear()
        self._parameters, self.watch = acting, Stopwatch()
        spent = self.get(TIMES)
        if (
            isinstance(spent, list)
            and len(spent) == 2
            and all(isinstance(s, float) and 0.0 <= s < MOST_S for s in spent)
        ):
            self.watch.add(*spent)
        self._writing = threading.Lock()  # parts that end are kept by a thread of the pool

    def get(self, name: str) -> Any:
        """Result of the part `name`, exact to the last bit; None if it is not there, or not as it was written."""
        try:
            kept = json.loads(self._path(name).read_text(encoding="utf-8"))
            if kept["digest"] != _digest(kept["result"]):
                return None
            return json.loads(kept["result"], object_hook=_revived)
        except (OSError, ValueError, KeyError, TypeError, RecursionError, MemoryError):
            return None

    def put(self, name: str, result: Any) -> Any:
        """Keep the result of a part; returns it as `get` will: keys of dicts must be texts, tuples become lists."""
        self.folder.mkdir(parents=True, exist_ok=True)
        if not self._path(PARAMETERS).is_file():
            self._write(PARAMETERS, self._parameters)
        self._write(name, result)
        self._write(TIMES, [self.watch.seconds, self.watch.cpu_seconds])
        return self.get(name)

    def _write(self, name: str, content: Any) -> None:
        path = self._path(name)
        text = json.dumps(content, default=_plain)
        with self._writing, lsm.replacing(path) as temporary:
            temporary.write_text(json.dumps({"digest": _digest(text), "result": text}), encoding="utf-8")

    def made(self, name: str, make: Callable[[], Any]) -> Any:
        """The result of a part, which `make` gives if it is not there."""
        found = self.get(name)
        return self.put(name, make()) if found is None else found

    @contextmanager
    def made_in_processes(
        self, calls: Mapping[str, tuple[Any, ...]], at_a_time: int = 2
    ) -> Iterator[Iterator[tuple[str, Any]]]:
        """An iterator of (name, result) of every part, in their order; missing ones are made in fresh processes.

        If the block raises, what its processes have not finished is given up, but for the parts beside one that fails.

        Parameters
        ----------
        calls
            {name of a part: (function, *arguments)}.
        at_a_time
            Number of processes.
        """
        kept: dict[str, Future[Any]] = {}

        def keep(name: str, future: Future[Any]) -> None:
            """Called as each part ends, in whatever order."""
            try:
                kept[name].set_result(self.put(name, future.result()))
            except BaseException as error:  # raised where the result is asked for
                kept[name].set_exception(error)

        found = {name: self.get(name) for name in calls}
        with fresh_processes(at_a_time) as pool:
            for name, call in calls.items():
                if found[name] is None:
                    kept[name] = Future()
                    pool.submit(*call).add_done_callback(partial(keep, name))
            yield ((name, kept[name].result() if name in kept else found[name]) for name in calls)

    def clear(self) -> None:
        """Remove all parts: the experiment is complete, or begins anew."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.json"


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return {"array": value.tolist(), "dtype": value.dtype.str}
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} cannot be kept: {value!r}")


def _revived(value: dict[str, Any]) -> Any:
    if set(value) != {"array", "dtype"}:
        return value
    kind = np.dtype(value["dtype"])
    if kind.kind not in "biufU" or kind.itemsize > MOST_ITEM:  # of a file that another program wrote
        raise TypeError(f"an array of type {kind}")
    return np.array(value["array"], kind)
