"""The public names: each in one namespace, found by type checkers, described, loaded when used."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import taichi_lsm as lsm

ROOT = Path(__file__).resolve().parents[1]
NAMESPACES = ("effects", "shapes", "statistics")
SHORTCUTS = {"disc", "sphere", "LinearElastic", "ViscousDamping", "CoulombFriction", "Gravity", "steady_state"}
ANALYSES = {"profiles", "shear_band", "fabric", "force_chains", "d2min"}


def names_of(namespace):
    """Public names of `lsm.<namespace>`."""
    return set(getattr(lsm, namespace).__all__)


def test_every_name_has_one_home():
    inside = [name for namespace in NAMESPACES for name in names_of(namespace)]
    assert len(inside) == len(set(inside))
    assert set(inside) & set(lsm.__all__) == SHORTCUTS | ANALYSES
    for name in SHORTCUTS | ANALYSES:
        (home,) = (namespace for namespace in NAMESPACES if name in names_of(namespace))
        assert getattr(lsm, name) is getattr(getattr(lsm, home), name)


def test_tab_completion_shows_the_public_names_alone():
    assert lsm.__dir__() == sorted(lsm.__all__) and lsm.effects.__dir__() == sorted(lsm.effects.__all__)


def test_the_module_docstring_names_the_namespaces_and_the_shortcuts():
    for name in NAMESPACES:
        assert f"lsm.{name}\n" in lsm.__doc__
    top = lsm.__doc__.split("The ten names")[1].replace(",", " ").replace(".", " ").split()
    assert set(top) & (SHORTCUTS | set(lsm.__all__)) == SHORTCUTS | ANALYSES | {"Scene", "Simulation", "open_run"}


@pytest.mark.parametrize("module", [lsm, *(getattr(lsm, name) for name in NAMESPACES)], ids=lambda m: m.__name__)
def test_every_public_name_exists_and_is_described(module):
    assert set(module.__all__) <= set(dir(module))
    for name in module.__all__:
        thing = getattr(module, name)
        if callable(thing) or inspect.ismodule(thing):
            assert inspect.getdoc(thing), name
        if hasattr(thing, "__module__"):
            assert thing.__module__.startswith("taichi_lsm."), name
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        module.nothing  # noqa: B018


def type_checking_names(module):
    """Names that a package imports for type checkers alone."""
    tree = ast.parse(Path(module.__file__).read_text(encoding="utf-8"))
    (block,) = (n for n in tree.body if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING")
    return {alias.asname for node in block.body for alias in node.names}


def test_type_checkers_see_names_that_exist():
    """All of the package. The files of the effects are found: one that is new need not be in the list."""
    assert type_checking_names(lsm) == set(lsm.__all__) - {"__version__"}
    assert {"Effect", "LinearElastic"} < type_checking_names(lsm.effects) <= set(lsm.effects.__all__)


def test_every_effect_is_a_name_of_the_namespace():
    ours = {cls.__name__ for cls in lsm.effects.find_effects().values() if cls.__module__.startswith("taichi_lsm")}
    assert ours <= names_of("effects")


@pytest.mark.parametrize("namespace", NAMESPACES)
def test_the_list_of_a_namespace_does_not_load_taichi(namespace):
    code = f"import sys, taichi_lsm as lsm; print(len(lsm.{namespace}.__all__), 'taichi' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    count, loaded = done.stdout.split()
    assert int(count) > 3 and loaded == "False"
