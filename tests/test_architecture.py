"""The order of the package: who imports whom, where Taichi is named, how long a file is, what must be said."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import taichi_lsm as lsm

ROOT = Path(__file__).resolve().parents[1]
MODULES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for folder in ("taichi_lsm", "workflows")
    for path in sorted((ROOT / folder).rglob("*.py"))
}
# Lower layers first; a module may import its own layer and those before it.
LAYERS = [
    {"core"},
    {"shapes", "effects", "contact"},
    {"bonds", "boundaries", "packing"},
    {"measure"},
    {"stepping", "io"},
    {"scene", "simulation"},
]
LEVEL = {name: level for level, names in enumerate(LAYERS) for name in names}


def without_type_checking(tree):
    """The module without its `if TYPE_CHECKING:` block, which never runs."""
    tree.body = [
        node
        for node in tree.body
        if not (isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING")
    ]
    return tree


def imports(path, module):
    """Dotted names of the modules that a file imports at any place but for type checkers, relative ones resolved."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(without_type_checking(ast.parse(path.read_text(encoding="utf-8")))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            name = ".".join([*base, *([node.module] if node.module else [])])
            yield from (f"{name}.{a.name}" if f"{name}.{a.name}" in MODULES else name for a in node.names)


def part(module):
    """taichi_lsm.contact.neighbour_search -> contact."""
    return module.split(".")[1] if "." in module else ""


def test_every_module_has_a_layer():
    parts = {part(module) for module in MODULES if module.startswith("taichi_lsm.")}
    assert parts <= set(LEVEL), parts - set(LEVEL)


@pytest.mark.parametrize("module", [m for m in MODULES if m.startswith("taichi_lsm.")])
def test_imports_run_downward(module):
    for name in imports(MODULES[module], module):
        if name.startswith("taichi_lsm."):
            assert LEVEL[part(name)] <= LEVEL[part(module)], f"{module} imports {name}"
        assert name != "workflows" and not name.startswith("workflows."), f"{module} imports {name}"


def test_no_two_modules_import_each_other():
    edges = {m: {n for n in imports(p, m) if n in MODULES and n != m} for m, p in MODULES.items()}
    for start in edges:
        reached, front = set(), set(edges[start])
        while front:
            reached |= front
            front = {n for m in front for n in edges[m]} - reached
        assert start not in reached, f"{start} imports itself through {reached}"


def test_workflows_use_the_public_names_alone():
    allowed = {"taichi_lsm", "taichi_lsm.core.errors", "taichi_lsm.effects"}  # errors without Taichi; the list of laws
    for module, path in MODULES.items():
        if module.startswith("workflows"):
            deep = {n for n in imports(path, module) if n.startswith("taichi_lsm") and n not in allowed}
            assert not deep, f"{module} imports {deep}"


def test_laws_see_a_contact_and_never_the_state():
    allowed = {"taichi_lsm.effects", "taichi_lsm.effects.base", "taichi_lsm.core.errors", "taichi_lsm.core.rotation"}
    allowed |= {"taichi_lsm.core.runtime", "taichi_lsm.effects.tangential_spring"}
    for module, path in MODULES.items():
        if module.startswith("taichi_lsm.effects"):
            inside = {n for n in imports(path, module) if n.startswith("taichi_lsm")}
            assert inside <= allowed, f"{module} imports {inside - allowed}"


def test_taichi_is_imported_in_one_place():
    named = {m for m, p in MODULES.items() if any(n.split(".")[0] == "taichi" for n in imports(p, m))}
    assert named == {"taichi_lsm.core.runtime"}
    assert MODULES["taichi_lsm.core.runtime"].read_text(encoding="utf-8").count("ti.init(") == 1


def test_no_module_with_kernels_imports_xarray():
    for module, path in MODULES.items():
        names = set(imports(path, module))
        if "taichi_lsm.core.runtime" in names:
            assert not names & {"xarray", "matplotlib", "matplotlib.pyplot"}, module


@pytest.mark.parametrize("module", MODULES)
def test_modules_are_short_and_say_what_they_are(module):
    text = MODULES[module].read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 400
    assert ast.get_docstring(ast.parse(text))


def public_things(tree):
    """Names and nodes of the public functions, classes and their public methods."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield node.name, node
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            for child in node.body:
                if isinstance(child, ast.FunctionDef) and not child.name.startswith("_"):
                    yield f"{node.name}.{child.name}", child


@pytest.mark.parametrize("module", [m for m in MODULES if m.startswith("taichi_lsm")])
def test_every_public_function_and_class_has_a_docstring(module):
    tree = ast.parse(MODULES[module].read_text(encoding="utf-8"))
    bare = [name for name, node in public_things(tree) if "." not in name and not ast.get_docstring(node)]
    assert not bare, bare


def test_every_public_name_exists_and_is_described():
    for name in lsm.__all__:
        thing = getattr(lsm, name)
        assert name in dir(lsm)
        if callable(thing):
            assert inspect.getdoc(thing), name
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        lsm.nothing  # noqa: B018


@pytest.mark.parametrize("name", ["taichi_lsm", "workflows.cli.main"])
def test_import_loads_nothing_heavy_and_prints_nothing(name):
    code = f"import sys, {name}; print(*sorted({{m.split('.')[0] for m in sys.modules}}))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = done.stdout.splitlines()
    assert len(loaded) == 1
    assert not {"taichi", "xarray", "matplotlib", "netCDF4", "scipy"} & set(loaded[0].split())
