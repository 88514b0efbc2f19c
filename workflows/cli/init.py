"""`lsm init`: a file of parameters to begin with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Annotated

from cyclopts import Parameter

from taichi_lsm.core.errors import InputError
from workflows.cli.execution import complain, problems_of
from workflows.common.exit_codes import COMPLETE
from workflows.common.parameter_problems import as_written
from workflows.common.parameters import DEFAULT_PRESET, merge, nearest
from workflows.common.toml_template import template


def init_command(found: Mapping[str, ModuleType]) -> Callable[..., int]:
    """The command; found: module of each experiment by its name."""

    def init(
        name: Annotated[str, Parameter(name="NAME", help="an experiment, see lsm list")],
        /,
        *,
        preset: Annotated[str, Parameter(name="--preset", help="whose values are printed")] = DEFAULT_PRESET,
    ) -> int:
        """Print a TOML file with all parameters of an experiment, their units, bounds and defaults."""
        if name not in found:
            hint = nearest(name, found)
            return complain([f"{as_written(name)}: unknown experiment, must be one of {', '.join(found)}.{hint}"])
        try:
            params = merge(found[name].Params, preset)
        except InputError as error:
            return complain(problems_of(error))
        print(template(params, name), end="")
        return COMPLETE

    return init
