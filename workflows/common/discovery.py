"""Workflows are found, not registered: every module that defines `Params` and `run` is a command.

LSM_PLUGINS=DIR adds DIR/workflows/*.py. They become modules of this package (`workflows.<name>`), so that a
run in a process of its own can import them by name as well.
"""

import ast
import importlib
import inspect
import os
import traceback
from pathlib import Path
from types import ModuleType

import workflows
from taichi_lsm.core.errors import reason
from workflows.common.parameters import Params

PLUGINS = "LSM_PLUGINS"
RUN_TAKES = ("params", "out", "progress", "existing")
HOOKS = ("check", "estimate")  # what a workflow must define beside Params and run
HERE = Path(__file__).parents[1]


class DiscoveryError(RuntimeError):
    """A workflow file, or the folder named by LSM_PLUGINS, cannot be used."""


def plugin_folder() -> Path | None:
    """DIR/workflows of LSM_PLUGINS=DIR, or None; raises DiscoveryError if DIR is no folder."""
    root = os.environ.get(PLUGINS)
    if not root:
        return None
    if not Path(root).is_dir():
        raise DiscoveryError(f"{PLUGINS}={root}: there is no such folder.")
    folder = Path(root).resolve() / "workflows"
    return folder if folder.is_dir() and folder != HERE else None


def workflow_files() -> list[Path]:
    """The files that define a workflow, those of this package first; read, but not imported."""
    found = [path for path in sorted(HERE.glob("*.py")) if is_workflow(path)]
    folder = plugin_folder()
    if folder is None:
        return found
    for path in sorted(folder.glob("*.py")):
        if is_workflow(path):
            if (HERE / path.name).exists() or (HERE / path.stem).is_dir():
                raise DiscoveryError(f"{path}: the name {path.stem} is taken by lsm itself. Rename the file.")
            found.append(path)
    return found


def is_workflow(path: Path) -> bool:
    """Whether a file defines `Params` and `run` at its top level; DiscoveryError if it is no Python."""
    try:
        tree = ast.parse(path.read_text(encoding="utf-8"), str(path))
    except (RecursionError, MemoryError):
        raise DiscoveryError(f"{path}: cannot be read: it is nested too deeply.") from None
    except SyntaxError as error:
        raise DiscoveryError(f"{path}, line {error.lineno}: not valid Python: {error.msg}.") from error
    except (OSError, ValueError) as error:
        raise DiscoveryError(f"{path}: cannot be read: {reason(error)}.") from error
    names = set()
    for node in tree.body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            names.add(node.name)
        elif isinstance(node, ast.Assign):
            names.update(target.id for target in node.targets if isinstance(target, ast.Name))
        elif isinstance(node, ast.ImportFrom):
            names.update(alias.asname or alias.name for alias in node.names)
    return {"Params", "run"} <= names


def load_path() -> None:
    """Make the plugins' modules importable as `workflows.<name>`; those of this package are found first."""
    folder = plugin_folder()
    if folder is not None and str(folder) not in workflows.__path__:
        workflows.__path__.append(str(folder))
        importlib.invalidate_caches()


def find_workflows() -> dict[str, ModuleType]:
    """Command name -> module of every workflow; raises DiscoveryError that names the file."""
    load_path()
    return {command_of(path.stem): _loaded(path) for path in workflow_files()}


def workflow(command: str) -> ModuleType:
    """The module of one workflow, without loading the others; raises DiscoveryError that names it or its file."""
    load_path()
    files = {command_of(path.stem): path for path in workflow_files()}
    if command not in files:
        raise DiscoveryError(f"{command}: unknown experiment, must be one of {', '.join(files)}; set {PLUGINS}.")
    return _loaded(files[command])


def command_of(module_name: str) -> str:
    """Name of the command of a module: `workflows.shear_gouge` is shear-gouge."""
    return module_name.rpartition(".")[2].replace("_", "-")


def _loaded(path: Path) -> ModuleType:
    """The module in a file, if it has all that a workflow needs."""
    try:
        module = importlib.import_module(f"workflows.{path.stem}")
    except (Exception, SystemExit) as error:
        where = [f for f in traceback.extract_tb(error.__traceback__) if f.filename == str(path)]
        line = f", line {where[-1].lineno}" if where else ""
        raise DiscoveryError(f"{path}{line}: cannot be imported: {type(error).__name__}: {reason(error)}") from error
    if not (isinstance(module.Params, type) and issubclass(module.Params, Params)):
        raise DiscoveryError(f"{path}: Params must be a subclass of workflows.common.parameters.Params.")
    if list(inspect.signature(module.run).parameters) != list(RUN_TAKES):
        raise DiscoveryError(f"{path}: run must take {', '.join(RUN_TAKES)}, in this order.")
    missing = [f"{hook}(params)" for hook in HOOKS if not callable(getattr(module, hook, None))]
    if missing:
        raise DiscoveryError(
            f"{path}: {' and '.join(missing)} must be defined too, as under 'Add an experiment' in CONTRIBUTING.md."
        )
    return module
