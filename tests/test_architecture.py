"""Order of the package: direction of imports, the place of Taichi, length of modules and functions, docstrings."""

import ast
import importlib
import inspect
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import taichi_lsm as lsm

ROOT = Path(__file__).resolve().parents[1]
LINT_IMPORTS = "from importlinter.cli import lint_imports_command; lint_imports_command()"


def modules_of(*folders):
    """Dotted names of the modules below some folders, with their files."""
    return {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for folder in folders
        for path in sorted((ROOT / folder).rglob("*.py"))
    }


MODULES = modules_of("taichi_lsm", "workflows", "benchmarks")
TESTS = modules_of("tests")
LIBRARY = [module for module in MODULES if module.startswith("taichi_lsm")]


def without_type_checking(tree):
    """The module without its `if TYPE_CHECKING:` blocks, which never run."""
    tree.body = [
        node
        for node in tree.body
        if not (isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING")
    ]
    return tree


def imports(path, module):
    """Dotted names of the modules that a file imports at any place when it runs, relative imports resolved."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(without_type_checking(ast.parse(path.read_text(encoding="utf-8")))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            name = ".".join([*base, *([node.module] if node.module else [])])
            yield from (f"{name}.{a.name}" if f"{name}.{a.name}" in MODULES else name for a in node.names)


def broken_contracts(folder):
    """Exit status and output of import-linter on the packages of a folder, by the contracts of its pyproject.toml."""
    command = [sys.executable, "-c", LINT_IMPORTS, "--no-cache", "--no-logo"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def test_contracts_of_the_imports_are_kept():
    status, output = broken_contracts(ROOT)
    assert status == 0 and " 0 broken" in output, output


@pytest.mark.parametrize(
    ("file", "line", "contract"),
    [
        ("taichi_lsm/core/errors.py", "from .. import scene", "Imports of the library run downward"),
        ("taichi_lsm/of_no_layer.py", '"""A module that no layer names."""', "Imports of the library run downward"),
        ("taichi_lsm/packing.py", "import workflows.shear_gouge", "The library knows no experiment"),
        ("taichi_lsm/effects/gravity.py", "from ..core import fields", "Effects see a contact and never the state"),
        ("benchmarks/scenes.py", "from benchmarks import effects", "No two modules of the benchmarks"),
        ("workflows/common/signals.py", "from workflows.cli import progress", "What the command line drives"),
    ],
)
def test_a_broken_contract_is_found(tmp_path, file, line, contract):
    for folder in ("taichi_lsm", "workflows", "benchmarks"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__", "*.npz"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    with (tmp_path / file).open("a", encoding="utf-8") as text:
        text.write(f"\n{line}\n")
    status, output = broken_contracts(tmp_path)
    verdict = next(row for row in output.splitlines() if row.startswith(contract))
    assert status == 1 and verdict.endswith("BROKEN"), output


def test_no_two_modules_import_each_other():
    edges = {m: {n for n in imports(p, m) if n in MODULES and n != m} for m, p in MODULES.items()}
    for start in edges:
        reached, front = set(), set(edges[start])
        while front:
            reached |= front
            front = {n for m in front for n in edges[m]} - reached
        assert start not in reached, f"{start} imports itself through {reached}"


def test_workflows_use_public_names_alone():
    # Errors, without loading Taichi, and the namespaces of effects, shapes and statistics.
    allowed = {
        "taichi_lsm",
        "taichi_lsm.core.errors",
        "taichi_lsm.effects",
        "taichi_lsm.shapes",
        "taichi_lsm.statistics",
    }
    for module, path in MODULES.items():
        if module.startswith("workflows"):
            deep = {n for n in imports(path, module) if n.startswith("taichi_lsm") and n not in allowed}
            assert not deep, f"{module} imports {deep}"


EFFECTS_IMPORT = {
    "taichi_lsm.core.allocation",
    "taichi_lsm.core.elementary",
    "taichi_lsm.core.errors",
    "taichi_lsm.core.hurwitz_zeta",
    "taichi_lsm.core.rotation",
    "taichi_lsm.core.runtime",
    "taichi_lsm.effects",
    "taichi_lsm.effects.base",
    "taichi_lsm.effects.implicit_slip",
    "taichi_lsm.effects.restitution",
    "taichi_lsm.effects.tangential_spring",
}


def imports_beyond(allowed, path, module):
    """Modules of the library that a file imports and that are not among the allowed ones."""
    return {name for name in imports(path, module) if name.split(".")[0] == "taichi_lsm"} - allowed


@pytest.mark.parametrize("module", [module for module in LIBRARY if module.startswith("taichi_lsm.effects")])
def test_effects_import_an_allowed_list_alone(module):
    assert not imports_beyond(EFFECTS_IMPORT, MODULES[module], module)


def test_a_forbidden_import_of_an_effect_is_found(tmp_path):
    path = tmp_path / "planted.py"
    path.write_text("from ..core.data_files import data_path\nfrom .base import Effect\nimport taichi_lsm.packing\n")
    found = imports_beyond(EFFECTS_IMPORT, path, "taichi_lsm.effects.planted")
    assert found == {"taichi_lsm.core.data_files", "taichi_lsm.packing"}


def test_taichi_is_imported_in_one_place():
    named = {m for m, p in MODULES.items() if any(n.split(".")[0] == "taichi" for n in imports(p, m))}
    assert named == {"taichi_lsm.core.runtime"}
    assert MODULES["taichi_lsm.core.runtime"].read_text(encoding="utf-8").count("ti.init(") == 1


def test_no_module_with_kernels_imports_xarray():
    for module, path in MODULES.items():
        names = set(imports(path, module))
        if "taichi_lsm.core.runtime" in names:
            assert not names & {"xarray", "matplotlib", "matplotlib.pyplot"}, module


def long_functions(tree, most=65):
    """(name, first line, number of lines) of every function that is longer than `most` lines."""
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    lengths = [(node.name, node.lineno, node.end_lineno - node.lineno + 1) for node in functions]
    return [function for function in lengths if function[2] > most]


@pytest.mark.parametrize("module", [*MODULES, *TESTS])
def test_modules_and_functions_are_short(module):
    text = (MODULES | TESTS)[module].read_text(encoding="utf-8")
    tree = ast.parse(text)
    assert len(text.splitlines()) <= 400
    assert not long_functions(tree)
    assert module in TESTS or ast.get_docstring(tree)


def test_a_long_function_is_found():
    body = "\n".join(["    x = 1"] * 65)
    source = f"def f():\n{body}\n\ndef f():\n    pass\n"  # the name of a short function as well
    assert long_functions(ast.parse(source)) == [("f", 1, 66)]


def own_docstring(thing):
    """Docstring that a class or function has itself, None if it is inherited or made by `dataclass`."""
    text = vars(thing).get("__doc__") if inspect.isclass(thing) else thing.__doc__
    generated = inspect.isclass(thing) and text and text.startswith(f"{thing.__name__}(") and text.endswith(")")
    return None if generated else text


def public_things(module):
    """Public classes and functions that a module defines itself."""
    found = importlib.import_module(module)
    for name, thing in vars(found).items():
        own = getattr(thing, "__module__", None) == module and not name.startswith("_")
        if own and (inspect.isclass(thing) or inspect.isfunction(thing)):
            yield name, thing


@pytest.mark.parametrize("module", LIBRARY)
def test_every_public_function_and_class_has_a_docstring(module):
    bare = [name for name, thing in public_things(module) if not own_docstring(thing)]
    assert not bare, bare


def test_docstrings_made_by_dataclass_do_not_count():
    from dataclasses import dataclass

    @dataclass
    class Bare:
        x: float

    class Heir(lsm.Scene):
        pass

    assert Bare.__doc__ and own_docstring(Bare) is None
    assert inspect.getdoc(Heir) and own_docstring(Heir) is None
    assert own_docstring(lsm.Scene)


def test_every_public_name_exists_and_is_described():
    for name in lsm.__all__:
        thing = getattr(lsm, name)
        assert name in dir(lsm)
        if inspect.isclass(thing) or inspect.isroutine(thing):
            assert own_docstring(thing), name
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        lsm.nothing  # noqa: B018


@pytest.mark.parametrize("name", ["taichi_lsm", "workflows.cli.main"])
def test_import_loads_nothing_heavy_and_prints_nothing(name):
    code = f"import sys, {name}; print(*sorted({{m.split('.')[0] for m in sys.modules}}))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = done.stdout.splitlines()
    assert len(loaded) == 1
    assert not {"taichi", "xarray", "matplotlib", "netCDF4", "scipy"} & set(loaded[0].split())
