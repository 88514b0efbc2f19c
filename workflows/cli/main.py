"""The command line `lsm`: one command per workflow, its options made from the workflow's Params."""

from __future__ import annotations

import inspect
import os
import platform
import sys
from collections.abc import Callable, Sequence
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

from cyclopts import (
    App,
    CycloptsError,
    Group,
    Parameter,
    UnknownCommandError,
    UnknownOptionError,
    UnusedCliTokensError,
)
from pydantic.fields import FieldInfo

import taichi_lsm as lsm
from taichi_lsm.core.errors import InputError, SimulationError
from workflows.cli import inspect_run
from workflows.cli.discovery import DiscoveryError, find_workflows
from workflows.cli.exit_codes import BAD_INPUT, CLAIM_NOT_MET, CLOSED_PIPE, COMPLETE, FAILED
from workflows.cli.progress import ProgressLine
from workflows.cli.resume import resume
from workflows.common import signals
from workflows.common.former_names import renamed
from workflows.common.metrics import FILE, failed_claims, read_summary
from workflows.common.parallel_runs import reason_of
from workflows.common.parameter_files import CONFIG
from workflows.common.parameter_types import allowed, choices_in_words, kind, limits, metavar
from workflows.common.parameters import DEFAULT_PRESET, ParameterError, Params, merge, nearest, option_name
from workflows.common.refusals import in_terms_of
from workflows.common.run_cost import objections
from workflows.common.run_folder import Existing, check_folder, has_results

# cyclopts itself has groups called Commands, Parameters and Arguments; the names must differ from those.
PHYSICS = Group("Experiment", sort_key=1)
MACHINE = Group("Computation", sort_key=2)
FILES = Group("Files and display", sort_key=3)
RESERVED = ("out", "config", "preset", "quiet", "strict", "overwrite", "yes")


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
        _complain([reason_of(error)])
        return FAILED
    except signals.Interrupted as interrupted:
        _complain([f"{interrupted}."])
        return 128 + interrupted.signum
    finally:
        signals.restore(previous)


def _main(argv: list[str]) -> int:
    try:
        if argv == ["--version"]:  # before discovery: a broken plugin must not hide it
            print(version_text())
            return COMPLETE
        if argv[:1] == ["resume"] and argv[1:] and argv[1].startswith("-") and argv[1] not in ("--help", "-h"):
            return _complain([f"{argv[1]}: the folder of the run comes first, as in: lsm resume DIR {argv[1]} ..."])
        app = build_app(find_workflows())
        command, bound, _ = app.parse_args(argv, exit_on_error=False, print_error=False)
    except DiscoveryError as error:
        return _complain([str(error)])
    except CycloptsError as error:
        return _complain([_parse_problem(error)])
    code = command(*bound.args, **bound.kwargs)
    return code if isinstance(code, int) else COMPLETE


def _parse_problem(error: CycloptsError) -> str:
    """One line for a mistake in the command line itself (an unknown option, a missing value)."""
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
    error.verbose = False  # or the message names functions and files of the program
    return str(error)


def _complain(problems: list[str]) -> int:
    for problem in problems:
        print(f"lsm: {problem}", file=sys.stderr)
    return BAD_INPUT


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


def build_app(found: dict[str, ModuleType]) -> App:
    """The cyclopts App with one command per workflow, `list` and `info`."""
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
        app.command(workflow_command(name, module), name=name, group=workflows_group)

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

    def info(folder: Annotated[Path, Parameter(name="DIR", help="folder of a run")], /) -> int:
        """Show status, metrics and files of the run in a folder."""
        try:
            return inspect_run.print_info(folder)
        except inspect_run.NoRunError as error:
            return _complain([str(error)])

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
            return resume(app, found, folder, options, execute)
        except CycloptsError as error:
            return _complain([_parse_problem(error)])
        except InputError as error:
            return _complain(_problems_of(error))

    app.command(list_names, name="list", group=others_group)
    app.command(resume_run, name="resume", group=others_group)
    app.command(info, name="info", group=others_group)
    return app


def _listed(found: dict[str, ModuleType], effects: bool, presets: bool) -> int:
    try:
        if presets:
            return inspect_run.print_presets(found)
        return inspect_run.print_effects() if effects else inspect_run.print_list(found)
    except InputError as error:  # of a plugin
        return _complain(_problems_of(error))


def workflow_command(name: str, module: ModuleType) -> Callable[..., int]:
    """A function that runs the workflow, with one keyword-only parameter per option.

    Every option but a flag is taken as text, so that pydantic checks all of them together.
    """
    params_class: type[Params] = module.Params
    default_values = {
        **{f: d.default for f, d in params_class.model_fields.items() if not d.is_required()},
        **params_class.presets.get(DEFAULT_PRESET, {}),
    }
    presets = ", ".join({**params_class.presets, DEFAULT_PRESET: {}})

    def parameter(key: str, annotation: Any, group: Group, text: str, default: str | None = None, **more):
        spec = Parameter(name=option_name(key), group=group, help=text, show_default=default or False, **more)
        return inspect.Parameter(
            key, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Annotated[annotation | None, spec]
        )

    listed = [
        parameter("preset", str, FILES, f"starting values; one of {presets}", DEFAULT_PRESET, metavar="NAME"),
        parameter("config", str, FILES, "TOML file, wins over the preset; [NAME]: of one experiment", metavar="FILE"),
        parameter("out", str, FILES, "folder to write", f"out/{name}", metavar="DIR"),
        parameter("overwrite", bool, FILES, "write to a folder that is not empty, over former runs", negative=()),
        parameter("quiet", bool, FILES, "print nothing but errors and claims that are not met", negative=()),
        parameter("yes", bool, FILES, "start also what takes more than a day or half of the memory", negative=()),
        parameter("strict", bool, FILES, "exit with code 3 if a claim is not met", negative=()),
    ]
    only_toml = []
    for key, field in params_class.model_fields.items():
        if key in RESERVED:
            raise DiscoveryError(f"{module.__file__}: the parameter name {key} is taken by lsm itself.")
        how = kind(field.annotation)
        if how == "toml":
            only_toml.append(key)
            continue
        group = MACHINE if key in Params.model_fields else PHYSICS
        listed.append(
            parameter(
                key,
                bool if how == "flag" else str,
                group,
                option_help(field),
                _shown(default_values.get(key)),
                metavar=metavar(field.annotation),
            )
        )

    def command(**options) -> int:
        given = {key: value for key, value in options.items() if value is not None}
        common = {key: given.pop(key) for key in RESERVED if key in given}
        return execute(name, module, given, **common)

    command.__name__ = name.replace("-", "_")
    command.__doc__ = _unwrapped(inspect.getdoc(module) or name)
    if only_toml:
        command.__doc__ += f"\n\nOnly in a TOML file (--config): {', '.join(only_toml)}."
    command.__signature__ = inspect.Signature(listed, return_annotation=int)
    command.__annotations__ = {p.name: p.annotation for p in listed} | {"return": int}
    return command


def _unwrapped(text: str) -> str:
    """The paragraphs of a docstring, each on one line: the terminal decides where lines end."""
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in text.strip().split("\n\n"))


def option_help(field: FieldInfo) -> str:
    """Description of an option, which ends with the unit, and the allowed values."""
    names = choices_in_words(field)
    bounds = f"one of {names}" if names else limits(field.metadata)
    if kind(field.annotation) == "list":
        bounds = allowed(field) + ", separated by commas"
    return "; ".join(filter(None, [" ".join((field.description or "").split()), bounds]))


def _shown(value: Any) -> str | None:
    if value is None:
        return "none"
    if isinstance(value, list | tuple):
        return ",".join(map(str, value))
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


def execute(
    name: str,
    module: ModuleType,
    options: dict[str, Any],
    out: str | None = None,
    config: str | None = None,
    preset: str | None = None,
    quiet: bool = False,
    strict: bool = False,
    overwrite: bool = False,
    yes: bool = False,
    existing: Existing = "refuse",
) -> int:
    """Check everything, run a workflow, and name the claims that its summary does not meet; returns the exit code."""
    folder = Path("out") / name if out is None else Path(out)
    existing = "overwrite" if overwrite else existing
    problems, params = refusals(folder, existing), None
    cost = None
    try:
        params = merge(module.Params, preset, config, options, name, _fields_of_others(module))
        if not quiet and not problems:
            print(f"{name}, preset {params.preset_name}: checking, then writing to {folder}", flush=True)
        _complain([f"note: {text}" for text in params.notes])
        if params.arch != "cpu":
            _check_arch(params.arch)
        module.check(params)
        cost = module.estimate(params)
        if not (yes or existing == "resume"):  # which is only a part of it
            problems = objections(cost, lsm.machine_memory()) + problems
    except InputError as error:
        problems = _problems_of(error) + problems
    if problems:
        return _complain(problems)
    made = [p for p in (folder, *folder.parents) if not p.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        return _complain([f"--out {folder}: cannot be made: {error.strerror}."])
    if cost and not quiet:
        print(f"{name}: {'the whole run takes ' if existing == 'resume' else ''}{cost}", flush=True)
    earlier = _written_at(folder / FILE)
    with ProgressLine(quiet) as progress:
        try:
            module.run(params, out=folder, progress=None if quiet else progress, existing=existing)
        except InputError as error:
            _remove_empty(made)
            return _complain(_problems_of(error))
        except (SimulationError, MemoryError, OSError) as error:
            if isinstance(error, BrokenPipeError):  # the output is no longer read: `main` ends quietly
                raise
            _complain([reason_of(error)])
            return FAILED
        except signals.Interrupted:
            if (folder / CONFIG).is_file():
                kept = "what is done is kept" if has_results(folder) else "nothing was finished yet"
                _complain([f"{kept}; to go on: lsm resume {folder}"])
            raise
    summary = read_summary(folder) if _written_at(folder / FILE) != earlier else None
    missed = failed_claims(summary) if summary else []
    _complain(missed)
    return CLAIM_NOT_MET if strict and missed else COMPLETE


def _written_at(path: Path) -> int | None:
    """When a file was last written [ns]; None if there is none."""
    return path.stat().st_mtime_ns if path.exists() else None


def _fields_of_others(module: ModuleType) -> dict[str, set[str]]:
    """Name -> parameters of every other experiment."""
    return {n: set(other.Params.model_fields) for n, other in find_workflows().items() if other is not module}


def _check_arch(arch: str) -> None:
    """Refuse a device that this machine does not have, before anything is made."""
    with in_terms_of(f"--arch {arch}", "choose --arch cpu"):
        lsm.check_arch(arch)


def _problems_of(error: InputError) -> list[str]:
    """One line for each mistake of the user."""
    return error.problems if isinstance(error, ParameterError) else [str(error)]


def refusals(folder: Path, existing: Existing) -> list[str]:
    """Reasons why the folder cannot be written to; [] if it can."""
    try:
        check_folder(folder, existing, "--out", "--overwrite")
    except InputError as error:
        return [str(error)]
    return []


def _remove_empty(folders: list[Path]) -> None:
    """Remove the folders that were made for a refused run, innermost first, up to one that holds something."""
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return


if __name__ == "__main__":
    sys.exit(main())
