"""The process of one run, which ends when the one that started it is gone.

`python -m workflows.common.run_child EXPERIMENT CONFIG OUT EXISTING REPORTS LABEL`, as `workflows/common/one_run.py`
starts it, with a pipe as standard input that the starting process holds open: killed or not, its end closes the pipe.
The exit codes are those of `lsm`, and the reason is the last message printed; an error of programming leaves its
traceback.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError, SimulationError
from workflows.common import signals
from workflows.common.child_reports import ReportFile
from workflows.common.discovery import DiscoveryError, workflow
from workflows.common.exit_codes import BAD_INPUT, COMPLETE, FAILED, reason_of
from workflows.common.one_run import SAYS
from workflows.common.parameters import Params, merge
from workflows.common.run_folder import Existing, is_begun, is_complete, is_done
from workflows.common.toml_reader import read_toml

LOCKED_S = 60.0  # for which a former process in the folder of a run is waited for


def main(experiment: str, config: str, out: str, existing: Existing, reports: str, label: str) -> int:
    """Make the run, see `carry_out`; returns the exit code."""
    _end_with_input()
    try:
        signals.install()
        signals.unblock()
        _set_title(f"lsm {Path(out).name}")
        module = workflow(experiment)
        report = ReportFile(reports, label) if reports else None
        _make_run(module, _parameters(module, experiment, Path(config)), Path(out), existing, report)
        return COMPLETE
    except signals.Interrupted as interrupted:
        _say(f"{interrupted}.")
        return 128 + interrupted.signum
    except (InputError, DiscoveryError) as error:
        _say(str(error))
        return BAD_INPUT
    except (SimulationError, MemoryError, OSError) as error:
        _say(reason_of(error))
        return FAILED


def _end_with_input() -> None:
    """Make this process end, as if asked by SIGTERM, once its standard input is closed."""

    def wait() -> None:
        while os.read(0, 1):
            pass
        os.kill(os.getpid(), signal.SIGTERM)

    with signals.blocked():  # the thread leaves them to the main one
        threading.Thread(target=wait, daemon=True).start()


def _set_title(title: str) -> None:
    """The name that top and ps show; only Linux has a file for it."""
    with suppress(OSError):
        Path("/proc/self/comm").write_text(title[:15])


def _parameters(module: ModuleType, experiment: str, config: Path) -> Params:
    """The parameters in a file that a program wrote: its preset, if it has one, counts, and nothing as given by a user.

    Whoever made the parameters has checked which options have no effect.
    """
    params = merge(module.Params, None, config, None, experiment)
    # In the place of the cached properties.
    vars(params).update(preset_name=read_toml(config).get("preset"), given=frozenset())
    return params


def _make_run(module: ModuleType, params: Params, out: Path, existing: Existing, report: ReportFile | None) -> None:
    """Begin a run, or go on with one that was begun, once no former process writes to its folder."""
    until = time.monotonic() + LOCKED_S
    while lsm.holder_of(out) and time.monotonic() < until:
        time.sleep(0.5)
    if existing == "resume":
        if is_begun(out) and is_done(out, params):
            return
        existing = "resume" if is_begun(out) else "overwrite"
    out.mkdir(parents=True, exist_ok=True)
    module.run(params, out=out, progress=report, existing=existing)
    if not is_complete(out):
        raise SimulationError(f"{out}: the run ended, but the folder has no summary of a complete one")


def _say(message: str) -> None:
    """Print a message, each line of it marked as said by this program."""
    for line in message.splitlines():
        print(f"{SAYS}{line}", file=sys.stderr)


if __name__ == "__main__":
    words: list[Any] = sys.argv[1:]
    sys.exit(main(*words))
