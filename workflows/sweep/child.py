"""The process of one run of a sweep: `lsm`, which ends when the process that started it is gone.

`python -m workflows.sweep.child ARGUMENTS OF LSM`, with a pipe as standard input that the starting process holds open:
killed or not, its end closes the pipe.
"""

from __future__ import annotations

import os
import signal
import sys
import threading

from workflows.cli.main import main


def end_with_input() -> None:
    """Make this process end, as if asked by SIGTERM, once its standard input is closed."""

    def wait() -> None:
        while os.read(sys.stdin.fileno(), 1):
            pass
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=wait, daemon=True).start()


if __name__ == "__main__":
    end_with_input()
    sys.exit(main(sys.argv[1:]))
