"""Every test module runs in a process of its own, with one Taichi; costly simulations are shared inside a module.

Taichi 1.7 numbers all nodes of a process in a table of 1024 and writes past its end without a word; a simulation
takes 100 to 250 of them. Taichi cannot be started afresh in one process while sparse fields exist. So a module is
a fork of the test process, which never loads Taichi itself. A module that crashes is one failed test.
"""

import json
import os
import sys
import warnings
from collections import Counter

import pytest
from _pytest.runner import runtestprotocol

from tests.helpers import scenes

MOST_NODES = 1024
SMALL_LAYER = {"layer_thickness": 8, "length": 10, "inertial_number": 5e-3, "strain": 0.5, "steady_from": 0.2}

_reports = {}  # of the present module, by test


def pytest_collection_modifyitems(items):
    """Modules of few tests first: those take long, and at the end one process would wait for the other."""
    count = Counter(item.path for item in items)
    items.sort(key=lambda item: (count[item.path], item.path))


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item, nextitem):
    """Report a test; the first one of a module runs the module first."""
    if not hasattr(os, "fork") or item.config.getoption("usepdb"):
        return None
    if item.nodeid not in _reports:
        same = [other for other in item.session.items if other.path == item.path]
        _reports.update(run_in_fork(item.config, same[same.index(item) :]))
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for report in _reports.pop(item.nodeid):
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def run_in_fork(config, items):
    """{test: reports} of these tests; if the process dies, the test it died in has failed and the rest are missing."""
    folder = config._tmp_path_factory.getbasetemp()  # made here, for all modules
    os.environ["LSM_TEST_FOLDER"] = str(folder)
    file = folder / "reports.jsonl"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # threads of numerical libraries sleep through a fork
        child = os.fork()
    if child == 0:
        run_and_exit(config, items, file)
    _, status = os.waitpid(child, 0)
    found = {}
    for line in file.read_text(encoding="utf-8").splitlines(keepends=True):
        if line.endswith("\n"):  # else the process died while it wrote this line
            nodeid, data = json.loads(line)
            found[nodeid] = [config.hook.pytest_report_from_serializable(config=config, data=d) for d in data]
    missing = next((item for item in items if item.nodeid not in found), None)
    if missing:
        text = f"the process of {missing.path.name} died with status {status}"
        found[missing.nodeid] = [pytest.TestReport(missing.nodeid, missing.location, {}, "failed", text, "call")]
    return found


def run_and_exit(config, items, file):
    """The child: every test's reports go to the file as soon as it is over."""
    with open(file, "w", encoding="utf-8") as reports:
        for item, following in zip(items, [*items[1:], None]):
            done = runtestprotocol(item, log=False, nextitem=following)
            data = [config.hook.pytest_report_to_serializable(config=config, report=report) for report in done]
            reports.write(json.dumps([item.nodeid, data], default=str) + "\n")
            reports.flush()
    sys.stdout.flush()
    sys.stderr.flush()
    if "taichi_lsm.core.runtime" in sys.modules:
        sys.modules["taichi_lsm.core.runtime"].ti.reset()  # writes the compiled kernels to the cache
    os._exit(0)


@pytest.fixture(scope="session")
def runtime():
    """Taichi on one CPU thread, f64 unless LSM_TEST_PRECISION=f32."""
    from taichi_lsm.core.runtime import start, ti

    yield start("cpu", scenes.PRECISION, 1)
    nodes = ti.field(ti.i32, ()).snode.ptr.id
    assert nodes < MOST_NODES, f"this module makes {nodes} nodes in simulations and fields: split it"


@pytest.fixture(scope="module")
def reference_packing(runtime):
    """reference_packing(name): a simulation of 48 packed grains, which `scenes.reload` resets."""
    made = {}

    def get(name):
        if name not in made:
            made[name] = scenes.simulate(scenes.reference_packing_scene(name))
        return made[name]

    return get


@pytest.fixture(scope="session")
def sheared(runtime, tmp_path_factory):
    """sheared(shape): (folder, parameters, run.nc as a Dataset) of a small 2D layer, sheared once per session."""
    from workflows import shear_gouge

    made = {}

    def get(shape):
        if shape not in made:
            out = tmp_path_factory.mktemp(shape)
            params = shear_gouge.Params(shape=shape, precision=runtime.precision, **SMALL_LAYER)
            made[shape] = out, params, shear_gouge.run(params, out)
        return made[shape]

    return get


@pytest.fixture
def pictures(monkeypatch):
    """Figures of matplotlib that are saved during a test, in their order."""
    from matplotlib.figure import Figure

    saved, save = [], Figure.savefig

    def keep(figure, *arguments, **options):
        saved.append(figure)
        return save(figure, *arguments, **options)

    monkeypatch.setattr(Figure, "savefig", keep)
    return saved
