"""Runs of a layer that are stopped at given steps and go on: `python -m tests.helpers.stopped_runs RUN OUT STEP ...`.

RUN is the folder of the run that was not stopped, OUT that of the others. Prints what differs, for each step. One
process has room for a few simulations only.
"""

import signal
import sys
from pathlib import Path

from tests.crash.random_kills import differences
from workflows import shear_gouge
from workflows.common import signals
from workflows.common.parameters import merge


def main(reference: Path, out: Path, stops: list[int]) -> None:
    """Print one line for each step."""
    signals.SAME_REQUEST_S = 0.0
    signals.install()
    params = merge(shear_gouge.Params, None, reference / "config.toml")
    stop = 0

    class Stopping(shear_gouge.RunLoop):
        def _advance(self, pending):
            """Stop at exactly the step `stop`."""
            if self.sim.step < stop <= self.position.next_sample:
                self.sim.run(stop - self.sim.step)
                pending.signum = int(signal.SIGTERM)
            super()._advance(pending)

    shear_gouge.RunLoop = Stopping
    for stop in stops:
        folder = out / str(stop) / reference.name
        try:
            shear_gouge.run(params, folder)
            print(f"step {stop}: was not reached")
        except signals.Interrupted:
            shear_gouge.run(params, folder, existing="resume")
            print(f"step {stop}: differs in {differences(folder, reference)}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), [int(text) for text in sys.argv[3:]])
