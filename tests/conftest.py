"""Tests run in forks of the test process; costly experiments are made once per session.

Taichi 1.7 numbers all nodes of a process in a table of 1024 and writes past its end without a word; a simulation takes
100 to 250 of them, and Taichi cannot be started afresh in one process while sparse fields exist. So the test process
itself never starts Taichi: its tests run in a child, a fork of it. A module begins with an
empty table, because Taichi finds a kernel in its cache only if the nodes have the same numbers as before; when the
table fills up, the module goes on in the next child, with module fixtures of its own. A child that dies is one failed
test, and the rest goes on.
"""

import os

# Tests compile longer than they run. Without the costliest passes of Taichi kernels compile sooner, to the same bits
# (`TI_ADVANCED_OPTIMIZATION=0 python -m benchmarks.digest`); `make validate` runs with all passes.
os.environ.setdefault("TI_ADVANCED_OPTIMIZATION", "0")
# The threads of the linear algebra wait in a loop for more work, which costs the other test process its core.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import fcntl
import gc
import importlib
import multiprocessing.util
import sys
import warnings
from collections import Counter
from pathlib import Path

import hypothesis
import pytest
from _pytest.runner import runtestprotocol

import taichi_lsm as lsm
from tests.helpers import scenes

hypothesis.settings.register_profile("untimed", deadline=None)  # a busy machine fails no test
hypothesis.settings.load_profile("untimed")

MOST_NODES = 1024
FULL = 800  # nodes in use after which a child begins no further test
NO_ROOM = "Taichi nodes of"  # in the message of a test that finds no room for its simulation: it has another child
TESTS = Path(__file__).parent
SMALL_LAYER = {"layer_thickness": 8, "length": 10, "inertial_number": 5e-3, "strain": 0.5, "steady_from": 0.2}
LONGEST = (  # modules that take most time, in this order; then those of few tests, which take long as a rule
    "hard/test_every_case.py",
    "experiments/test_shear_gouge.py",
    "experiments/test_compare_shapes.py",
    "physics/test_impacts.py",
    "physics/test_rubble.py",
    "experiments/test_energy_conservation.py",
    "contact/test_ball_polyhedra.py",
    "io/test_checkpoint.py",
    "hard/test_controls.py",
    "boundaries/test_plane_walls.py",
    "bonds/test_bond_network.py",
    "bonds/test_freed_contacts.py",
    "effects/test_every_effect.py",
)

_child = []  # the present one


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items):
    """The longest modules first: at the end one process would wait for the other. In a module, f32 comes last."""
    order = {TESTS / name: i for i, name in enumerate(LONGEST)}
    count = Counter(item.path for item in items)
    items.sort(
        key=lambda i: (order.get(i.path, len(order)), count[i.path], i.path, precision_of(i) != scenes.PRECISION)
    )


def precision_of(item):
    """Precision in which a test runs."""
    return item.callspec.params.get("runtime", scenes.PRECISION) if hasattr(item, "callspec") else scenes.PRECISION


def pytest_collection_finish():
    """Import once, before the forks, what most children need."""
    for name in (
        *("matplotlib.backends.backend_agg", "matplotlib.figure", "netCDF4", "shapely", "xarray"),
        *("scipy.optimize", "scipy.spatial", "scipy.stats", "taichi_lsm.simulation"),
    ):
        importlib.import_module(name)
    gc.freeze()  # what is there now is never garbage, and children need not look at it again and again


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item, nextitem):
    """Run a test in the present child, or in a new one."""
    if not hasattr(os, "fork") or item.config.getoption("usepdb"):
        return None
    if _child and not _child[0].takes(item):
        _child.pop().retire()
    if not _child:
        _child.append(Child(item))
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    used, reports = _child[0].nodes, _child[0].run(item, nextitem)
    if used and any(NO_ROOM in str(report.longrepr) for report in reports):
        _child.pop().retire()
        _child.append(Child(item))
        reports = _child[0].run(item, nextitem)
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    if nextitem is None or not _child[0].alive:
        _child.pop().retire()
    return True


class Child:
    """A fork of the test process that runs tests one by one."""

    def __init__(self, item):
        self.config, self.scope = item.config, scope_of(item)
        self.nodes, self.alive = 0, True
        self.config._tmp_path_factory.getbasetemp()  # made here, for all children
        self.pipe, theirs = multiprocessing.Pipe()
        sys.stdout.flush()
        sys.stderr.flush()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # threads of numerical libraries sleep through a fork
            self.pid = os.fork()
        if self.pid == 0:
            self.pipe.close()
            serve(theirs, item.session)
        theirs.close()

    def takes(self, item):
        """May the next test run here? Not in another precision, after another module's nodes, or in a full table."""
        (module, precision), (mine, own) = scope_of(item), self.scope
        return precision == own and (self.nodes == 0 or (module == mine and self.nodes < FULL))

    def run(self, item, nextitem):
        """The reports of a test; one that says so if the child dies."""
        self.scope = scope_of(item)
        items = item.session.items
        self.pipe.send((items.index(item), None if nextitem is None else items.index(nextitem)))
        dead = status = 0
        while not (dead or self.pipe.poll(0.2)):  # a process that the child has left may keep the pipe open
            dead, status = os.waitpid(self.pid, os.WNOHANG)
        try:
            if dead:
                raise EOFError
            data, self.nodes = self.pipe.recv()
        except EOFError:
            return self.died(item, status if dead else os.waitpid(self.pid, 0)[1])
        reports = [self.config.hook.pytest_report_from_serializable(config=self.config, data=d) for d in data]
        full = f"{self.nodes} {NO_ROOM} {MOST_NODES}"  # and Taichi has written past the end of its table
        return reports if self.nodes < MOST_NODES else [*reports, failed(item, full)]

    def died(self, item, status):
        """The report of a test that has ended its process."""
        self.alive = False
        return [failed(item, f"the process of {item.nodeid} died with status {status}")]

    def retire(self):
        """Let the child end; what it has compiled is then in the cache."""
        self.pipe.close()
        if self.alive:
            os.waitpid(self.pid, 0)


def failed(item, text):
    """Report of a test that could not tell by itself."""
    return pytest.TestReport(item.nodeid, item.location, {}, "failed", text, "call")


def scope_of(item):
    """(module, precision): tests of one scope may share a child."""
    return item.path, precision_of(item)


def serve(pipe, session):
    """The child: run the tests that are asked for until the pipe closes."""
    items, config = session.items, session.config
    while True:
        try:
            at, following = pipe.recv()
        except EOFError:
            break
        nextitem = None if following is None else items[following]
        done = runtestprotocol(items[at], log=False, nextitem=nextitem)
        data = [config.hook.pytest_report_to_serializable(config=config, report=report) for report in done]
        pipe.send((data, nodes_in_use()))
    session._setupstate.teardown_exact(None)
    sys.stdout.flush()
    sys.stderr.flush()
    if "taichi_lsm.core.runtime" in sys.modules:
        sys.modules["taichi_lsm.core.runtime"].ti.reset()  # writes the compiled kernels to the cache
    multiprocessing.util._run_finalizers()  # which `os._exit` leaves out: semaphores that tests still hold
    os._exit(0)


def nodes_in_use():
    """Highest number of a Taichi node in this process."""
    if "taichi_lsm.core.runtime" not in sys.modules:
        return 0
    program = sys.modules["taichi_lsm.core.runtime"].ti.lang.impl.get_runtime().prog
    trees = program.get_snode_tree_size() if program else 0

    def highest(node):
        return max([node.id, *(highest(node.get_ch(i)) for i in range(node.get_num_ch()))])

    return highest(program.get_snode_root(trees - 1)) if trees else 0


@pytest.fixture(scope="session", params=[scenes.PRECISION], ids=[pytest.HIDDEN_PARAM])
def runtime(request):
    """Taichi on one CPU thread, in the precision of the test."""
    from taichi_lsm.core.runtime import start

    scenes.PRECISION = request.param
    return start("cpu", scenes.PRECISION, 1)


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
def sheared(runtime, once_per_session):
    """sheared(shape): (folder, parameters, run.nc as a Dataset) of a small 2D layer, sheared once per session."""
    from workflows import shear_gouge

    def get(shape):
        params = shear_gouge.Params(shape=shape, precision=runtime.precision, **SMALL_LAYER)
        out = once_per_session(f"sheared-{shape}", lambda folder: shear_gouge.run(params, folder).close())
        return out, params, lsm.open_run(out / "run.nc")

    return get


@pytest.fixture(scope="session")
def once_per_session(tmp_path_factory):
    """once_per_session(name, make): a folder that `make(folder)` has filled, for all processes of this session."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    def get(name, make):
        out = shared / f"{name}-{scenes.PRECISION}"
        with open(f"{out}.lock", "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # given up also by a process that dies
            if not out.exists():
                make(shared / "unfinished" / out.name)
                (shared / "unfinished" / out.name).rename(out)
        return out

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
