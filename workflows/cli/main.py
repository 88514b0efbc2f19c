"""The command line `lsm`: one command per workflow, its options made from the workflow's Params."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Annotated

from cyclopts import (
    App,
    CycloptsError,
    Group,
    Parameter,
    UnknownCommandError,
    UnknownOptionError,
    UnusedCliTokensError,
)

from taichi_lsm.core.errors import InputError
from workflows.cli import inspect_run
from workflows.cli.animate import animate
from workflows.cli.calibrate import calibrate_command
from workflows.cli.completion import completion_command
from workflows.cli.doctor import doctor
from workflows.cli.execution import complain, problems_of
from workflows.cli.export import export
from workflows.cli.init import init_command
from workflows.cli.options import options_of, workflow_command
from workflows.cli.plot import plot
from workflows.cli.report import report
from workflows.cli.resume import resume
from workflows.cli.sensitivity import sensitivity_command
from workflows.cli.sweep import sweep_command
from workflows.cli.sweep_plot import sweep_plot
from workflows.common import signals
from workflows.common.discovery import DiscoveryError, find_workflows
from workflows.common.exit_codes import CLOSED_PIPE, COMPLETE, FAILED, reason_of
from workflows.common.former_names import renamed
from workflows.common.parameter_files import listed
from workflows.common.parameters import nearest, option_name


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command.

    Returns
    -------
    int
        Exit code: 0 complete, 1 failed, 2 bad input, 3 with --strict if a claimed bound does not hold, 128 + n on
        signal n; a closed pipe counts as its signal.
    """
    previous = signals.install()
    try:
        code = _main(list(sys.argv[1:] if argv is None else argv))
        sys.stdout.flush()  # here, where a closed pipe is caught, and not at the end of the process
        return code
    except OSError as error:
        # What is left in the buffer would fail once more when the interpreter ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            return CLOSED_PIPE
        complain([reason_of(error)])
        return FAILED
    except signals.Interrupted as interrupted:
        complain([f"{interrupted}."])
        return 128 + interrupted.signum
    finally:
        signals.restore(previous)


def _main(argv: list[str]) -> int:
    found: dict[str, ModuleType] = {}
    try:
        if argv == ["--version"]:  # before discovery: a broken plugin must not hide it
            print(version_text())
            return COMPLETE
        if argv[:1] == ["resume"] and argv[1:] and argv[1].startswith("-") and argv[1] not in ("--help", "-h"):
            return complain([f"{argv[1]}: the folder of the run comes first, as in: lsm resume DIR {argv[1]} ..."])
        if argv[:1] != ["doctor"]:  # which tells itself what is wrong with them
            found = find_workflows()
        app = build_app(found)
        command, bound, _ = app.parse_args(argv, exit_on_error=False, print_error=False)
    except DiscoveryError as error:
        return complain([str(error)])
    except CycloptsError as error:
        return complain([_parse_problem(error, found)])
    code = command(*bound.args, **bound.kwargs)
    return code if isinstance(code, int) else COMPLETE


def _parse_problem(error: CycloptsError, found: Mapping[str, ModuleType]) -> str:
    """One line for a mistake in the command line itself (an unknown option, a missing value).

    An unknown option that other experiments have is told to be one of these; found: the module of each by its name.
    """
    if isinstance(error, UnknownCommandError):
        token = (error.unused_tokens or [""])[0]
        names = [n for n in error.app or () if n != "-h"]
        return f"{token}: unknown command, must be one of {', '.join(names)}.{nearest(token, names)}"
    if isinstance(error, UnusedCliTokensError):
        return f"{' '.join(error.unused_tokens or ())}: unexpected; every value follows its option."
    if isinstance(error, UnknownOptionError):
        option = (error.token.keyword or error.token.value).split("=")[0]
        known = [name for argument in error.argument_collection if argument.parse for name in argument.names]
        fields = [name.strip("-").replace("-", "_") for name in known]
        if now := renamed(option.strip("-").replace("-", "_"), fields):
            return f"Unknown option: {option} is now called {option_name(now)}."
        here = (error.command_chain or ("",))[-1]
        if owners := [name for name, module in found.items() if name != here and option in options_of(module)]:
            return f"Unknown option: {option} is one of lsm {listed(owners)}, not of lsm {here}."
    error.verbose = False  # or the message names functions and files of the program
    return str(error)


def version_text() -> str:
    """Versions of the package, of Taichi and of Python, without importing Taichi."""

    def of(package):
        try:
            return metadata.version(package)
        except metadata.PackageNotFoundError:
            return None

    version = of("taichi-lsm")
    if version is None:  # run from a source tree that is not installed
        import taichi_lsm

        version = taichi_lsm.__version__
    return f"taichi-lsm {version}\nTaichi {of('taichi') or 'not installed'}\nPython {platform.python_version()}"


def build_app(found: dict[str, ModuleType], to_complete: bool = False) -> App:
    """The cyclopts App with one command per workflow and those of results and lists.

    to_complete: its options of workflows have the types by which a shell completes them; it is not to be called.
    """
    app = App(
        name="lsm",
        help="Discrete-element simulation of sheared fault gouge with real grain shapes.",
        version=version_text,
        version_flags=["--version"],
        help_format="plaintext",  # "[Pa]" would be markup
        print_error=False,
        exit_on_error=False,
    )
    workflows_group = Group("Workflows", sort_key=1)
    others_group = Group("Results and lists", sort_key=2)
    for name, module in found.items():
        app.command(workflow_command(name, module, to_complete), name=name, group=workflows_group)

    def list_names(
        *,
        effects: Annotated[
            bool, Parameter(name="--effects", help="equation, parameters and cost of every effect", negative=())
        ] = False,
        presets: Annotated[
            bool, Parameter(name="--presets", help="steps, time and memory of every preset", negative=())
        ] = False,
    ) -> int:
        """List the workflows and the effects."""
        return _listed(found, effects, presets)

    def resume_run(
        folder: Annotated[Path, Parameter(name="DIR", help="folder of a run that was stopped, or of a complete one")],
        /,
        *options: Annotated[
            str,
            Parameter(
                name="OPTIONS",
                help="options of its experiment that may change in a run that goes on, such as --strain or --threads",
                allow_leading_hyphen=True,
            ),
        ],
    ) -> int:
        """Go on with the run in a folder, to the same bits as if it had not been stopped.

        A complete run can be made longer if it was begun with --keep-checkpoint: lsm resume DIR --strain 10.
        """
        try:
            return resume(app, found, folder, options)
        except CycloptsError as error:
            return complain([_parse_problem(error, found)])
        except InputError as error:
            return complain(problems_of(error))

    app.command(list_names, name="list", group=others_group)
    app.command(sweep_command(found), name="sweep", group=others_group)
    app.command(sweep_plot, name="sweep-plot", group=others_group)
    app.command(plot, name="plot", group=others_group)
    app.command(animate, name="animate", group=others_group)
    studies = {"calibrate": calibrate_command(found), "sensitivity": sensitivity_command(found)}
    studies |= {"init": init_command(found), "doctor": doctor, "report": report}
    studies["completion"] = completion_command(lambda: build_app(found, to_complete=True))
    for name, command in (studies | {"export": export, "resume": resume_run, "info": info}).items():
        app.command(command, name=name, group=others_group)
    return app


def info(folder: Annotated[Path, Parameter(name="DIR", help="folder of a run")], /) -> int:
    """Show status, metrics and files of the run in a folder."""
    try:
        return inspect_run.print_info(folder)
    except inspect_run.NoRunError as error:
        return complain([str(error)])


def _listed(found: dict[str, ModuleType], effects: bool, presets: bool) -> int:
    try:
        if presets:
            return inspect_run.print_presets(found)
        return inspect_run.print_effects() if effects else inspect_run.print_list(found)
    except InputError as error:  # of a plugin
        return complain(problems_of(error))


if __name__ == "__main__":
    sys.exit(main())
