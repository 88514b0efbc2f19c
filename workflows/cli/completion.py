"""`lsm completion`: what a shell needs to complete commands, options, choices and files."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Literal

from cyclopts import App, Parameter

from workflows.common.exit_codes import COMPLETE


def completion_command(make_app: Callable[[], App]) -> Callable[..., int]:
    """The command; make_app: makes the application whose options have the types by which they are completed."""

    def completion(shell: Annotated[Literal["bash", "zsh", "fish"], Parameter(name="SHELL")], /) -> int:
        """Print a script by which a shell completes commands, options and their choices.

        For bash: lsm completion bash > ~/.local/share/bash-completion/completions/lsm
        """
        print(make_app().generate_completion(shell=shell))
        return COMPLETE

    return completion
