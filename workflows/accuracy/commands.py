"""Commands of this package, `python -m workflows.accuracy.NAME`: mistakes and failures are told in one line."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable

from taichi_lsm.core.errors import InputError, SimulationError


def as_command(main: Callable[[], None]) -> None:
    """Call `main`; where it fails, print why and end with exit code 1, or 2 for a mistake of the user."""
    try:
        main()
        sys.stdout.flush()  # here, where a closed pipe is caught, and not at the end of the process
    except BrokenPipeError:  # who reads the output has seen enough; what is left in the buffer would fail once more
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except InputError as error:
        _end(str(error), 2)
    except OSError as error:
        _end(f"{error.filename or 'a file'}: {error.strerror or error}.", 1)
    except SimulationError as error:
        _end(str(error), 1)


def _end(problem: str, code: int) -> None:
    print(problem, file=sys.stderr)
    sys.exit(code)
