"""Commands end with the exit code of what went wrong, told in one line."""

import pytest

from taichi_lsm.core.errors import InputError, SimulationError
from workflows.cli.execution import in_one_line
from workflows.common.exit_codes import BAD_INPUT, COMPLETE, FAILED


@in_one_line
def command(error: Exception | None, *, code: int = COMPLETE) -> int:
    """Do nothing."""
    if error is not None:
        raise error
    return code


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (InputError("--fps 0: must be > 0"), BAD_INPUT, "lsm: --fps 0: must be > 0\n"),
        (SimulationError("run.nc: cannot be written"), FAILED, "lsm: run.nc: cannot be written\n"),
        (OSError("disk full"), FAILED, "lsm: a file could not be read or written: disk full.\n"),
    ],
)
def test_mistakes_and_failures_are_told_in_one_line(capsys, error, code, line):
    assert command(error) == code
    assert capsys.readouterr().err == line


def test_other_ends_are_those_of_the_command(capsys):
    assert command(None, code=3) == 3 and command.__doc__ == "Do nothing."
    for error in (BrokenPipeError(), ZeroDivisionError()):  # the former is for `main`, which then ends quietly
        with pytest.raises(type(error)):
            command(error)
    assert capsys.readouterr().err == ""
