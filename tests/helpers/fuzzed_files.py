"""Small files of every kind that the package reads, changed at random, and read in a process of their own.

A reader may crash its process, for the libraries below it are written in C: a child of the test reads the files, and if
it dies that is the result of the file.
"""

import faulthandler
import functools
import itertools
import multiprocessing
import os
import resource
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import netCDF4
import numpy as np

import taichi_lsm as lsm
from tests.helpers import bodies, output_files, scenes
from tests.helpers.changed_files import changed
from tests.io.test_contacts_file import filled, moment
from tests.io.test_contacts_file import writer as contacts_writer
from workflows import shear_gouge
from workflows.cli import inspect_run
from workflows.common.metrics import Metric, write_summary
from workflows.common.parameter_files import experiment_of
from workflows.common.parameters import merge, to_toml
from workflows.protocol.finished_parts import FinishedParts
from workflows.report.page import write_report

MEMORY = 2**30  # bytes that a reader may take
HANGS = 60.0  # s on the clock after which a reader counts as hanging


class Result(NamedTuple):
    """What came of a file: "valid", "refused", "crash", with the message, and the processor time [s]."""

    outcome: str
    message: str
    seconds: float


def shapes_file(folder):
    """shapes.nc with a shape of every class."""
    path = folder / "shapes.nc"
    square = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    cube = lsm.shapes.regular_polyhedron(6, 0.1)
    lsm.shapes.save_shapes(
        path,
        [
            lsm.shapes.from_polygon(square, 0.1),
            cube,
            lsm.shapes.from_patches([[0, 0, 0]], [0.5], [[1, 0, 0]], [np.pi]),
            lsm.shapes.crossed_bars(2.0, 0.1),
        ],
    )
    return path


def of_run(name, folder):
    """A NetCDF file of a run, small."""
    output_files.write_every_kind(folder)
    return folder / name


def config_file(folder):
    """config.toml of a run."""
    path = folder / "config.toml"
    effects = [{"name": "gravity", "acceleration": [0.0, -9.81]}]
    path.write_text(to_toml(shear_gouge.Params(effects=effects), "shear-gouge"))
    return path


def run_with_config(folder):
    """run.nc with parameters that can be taken from it."""
    path = of_run("run.nc", folder)
    with netCDF4.Dataset(path, "a") as file:
        file.config_toml = config_file(folder).read_text()
    return path


def part_file(folder):
    """A finished part of an experiment."""
    parts = FinishedParts(folder, shear_gouge.Params(), resume=True)
    parts.put("part", {"rows": [{"drift": 1e-5, "scheme": "verlet"}], "energy": np.arange(20.0)})
    return folder / "parts" / "part.json"


def summary_file(folder):
    """summary.json of a run."""
    metrics = {"friction": Metric(0.4, "1", 1.0, True, (0.3, 0.5)), "stress": Metric(1e6, "Pa", 1e5, False, remedy="x")}
    write_summary(folder, "shear-gouge", "smoke", metrics, quiet=True)
    return folder / "summary.json"


def mesh_file(suffix, folder):
    """A box as a mesh, in text or bytes."""
    import trimesh

    path = folder / f"mesh.{suffix}"
    trimesh.creation.box((1.0, 2.0, 3.0)).export(path, file_type="stl_ascii" if "ascii" in folder.name else suffix)
    return path


def quads_file(suffix, folder):
    """A box as quads: OBJ with texture and normals, PLY with doubles."""
    path = folder / f"mesh.{suffix}"
    path.write_text(bodies.obj_of_quads(texture=True) if suffix == "obj" else bodies.ply_of_quads("double"))
    return path


def bodies_file(folder):
    """Two boxes whose boxes overlap and that do not, in one mesh."""
    import trimesh

    path = folder / "mesh.stl"
    bar = trimesh.creation.box((4.0, 0.2, 0.2))
    bar.apply_transform(trimesh.transformations.rotation_matrix(0.7, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)))
    other = bar.copy()
    other.apply_translation([0.0, 1.0, 0.0])
    trimesh.util.concatenate([bar, other]).export(path)
    return path


def read_shapes(path):
    """Load the shapes, and ask each for what a scene asks."""
    for shape in lsm.shapes.load_shapes(path):
        assert shape.patch_count > 0 and shape.half_width > 0.0
        shape.spanning_balls()
        shape.part_bounds()


def read_run(path):
    """Open a file of a run and its table of effects."""
    with lsm.open_run(path) as run:
        lsm.read_effects(run)


def read_table(path):
    """Open a table of runs."""
    lsm.open_run(path).close()


def read_runs(path):
    """The file as one of two runs of an experiment."""
    folder = path.parent / "experiment"
    for name in ("a", "b"):
        (folder / "runs" / name).mkdir(parents=True, exist_ok=True)
        (folder / "runs" / name / "run.nc").write_bytes((GOOD["run"] if name == "a" else path).read_bytes())
    lsm.open_runs(folder).close()


def keep_run(path):
    """Go on with run.nc."""
    output_files.run_writer(path, effects=output_files.effects(), keep=2).close("complete")


def keep_grains(path):
    """Go on with grains.nc."""
    static, snapshot = output_files.grains(2)
    writer = output_files.grains_writer(path, static, 2, keep=1)
    writer.append(1.0, snapshot | {"stage": "shear"})
    writer.close("complete")


def contacts_file(folder):
    """contacts.nc with some moments."""
    filled(folder / "contacts.nc", 4).close("complete")
    return folder / "contacts.nc"


def keep_contacts(path):
    """Go on with contacts.nc."""
    file = contacts_writer(path, keep=2)
    file.append(*moment(2))
    file.close("complete")


def read_config(path):
    """Parameters of shear-gouge from the file."""
    shear_gouge.check(merge(shear_gouge.Params, None, path, None, "shear-gouge", {"toy": {"speed"}}))


def read_experiment(path):
    """The name of the experiment of a folder."""
    experiment_of(path.parent)
    read_config(path)


@functools.cache
def parameters_of_parts():
    """Content of the file without which no part counts."""
    with tempfile.TemporaryDirectory() as folder:
        return (part_file(Path(folder)).parent / "parameters.json").read_bytes()


def read_part(path):
    """A part that is damaged is as one that is not there."""
    (path.parent / "parameters.json").write_bytes(parameters_of_parts())
    found = FinishedParts(path.parent.parent, shear_gouge.Params(), resume=True).get("part")
    if found is None:
        raise lsm.InputError(f"{path}: no such part")
    assert found["energy"].tolist() == list(range(20)) and found["rows"] == [{"drift": 1e-5, "scheme": "verlet"}]


def read_info(path):
    """What `lsm info` prints of a folder with the file."""
    inspect_run.print_info(path.parent)


def write_page(path):
    """The page of a folder with the file."""
    write_report(path.parent, *inspect_run.require_run(path.parent), path.parent / "report.html")


def read_mesh(path):
    """A grain from the mesh."""
    lsm.shapes.from_mesh(path, faces=6, hull=True)


def read_bodies(path):
    """All bodies of the mesh."""
    assert lsm.shapes.bodies_of_mesh(path)


# Kind of file: how one is made, and how it is read.
READERS = {
    "shapes": (shapes_file, read_shapes),
    "run": (functools.partial(of_run, "run.nc"), read_run),
    "grains": (functools.partial(of_run, "grains2.nc"), read_run),
    "contacts": (contacts_file, read_table),
    "table": (functools.partial(of_run, "compare.nc"), read_table),
    "runs": (functools.partial(of_run, "run.nc"), read_runs),
    "kept run": (functools.partial(of_run, "run.nc"), keep_run),
    "kept grains": (functools.partial(of_run, "grains2.nc"), keep_grains),
    "kept contacts": (contacts_file, keep_contacts),
    "run as config": (run_with_config, read_config),
    "config": (config_file, read_experiment),
    "part": (part_file, read_part),
    "summary": (summary_file, read_info),
    "info": (functools.partial(of_run, "run.nc"), read_info),
    "page": (functools.partial(of_run, "run.nc"), write_page),
    "page of a summary": (summary_file, write_page),
    "stl": (functools.partial(mesh_file, "stl"), read_mesh),
    "stl ascii": (functools.partial(mesh_file, "stl"), read_mesh),
    "ply": (functools.partial(mesh_file, "ply"), read_mesh),
    "obj": (functools.partial(mesh_file, "obj"), read_mesh),
    "obj of quads": (functools.partial(quads_file, "obj"), read_mesh),
    "ply of quads": (functools.partial(quads_file, "ply"), read_mesh),
    "bodies": (bodies_file, read_bodies),
}
NETCDF = (
    *("checkpoint", "shapes", "run", "grains", "contacts", "table", "runs"),
    *("kept run", "kept grains", "kept contacts", "run as config", "info", "page"),
)
GOOD = {}  # kind: path of a good file
SIMULATION = []  # of a child that reads checkpoints


def prepare_checkpoints():
    """Two discs that touch, one of a platen, compiled; for a child alone, as Taichi does not survive a fork."""
    platens = [lsm.Platen("top", [lsm.ConstantVelocity(0.1), lsm.Fixed()])]
    scene = scenes.scene(
        [[1.0, 1.0], [1.99, 1.0], [1.0, 3.0]], scenes.frictional(), platen_index=[-1, -1, 0], platens=platens
    )
    SIMULATION.append(lsm.Simulation(scene))
    SIMULATION[0].run(10)
    READERS["checkpoint"] = (None, read_checkpoint)


def make_checkpoint(path):
    """A checkpoint of it; in a process of its own."""
    prepare_checkpoints()
    lsm.save_checkpoint(SIMULATION[0], path, {"rows": 3})


def read_checkpoint(path):
    """Restore the simulation, and run it on."""
    sim = SIMULATION[0]
    assert lsm.restore_checkpoint(sim, path) == {"rows": 3}
    with suppress(lsm.SimulationError):  # a state may be changed together with its digest, but not into any state
        sim.run(2)


def make_good_files(folder):
    """One good file of every kind, each in a folder of its own."""
    for kind, (make, _) in READERS.items():
        (folder / kind).mkdir()
        GOOD[kind] = make(folder / kind)


def attempt(kind, path):
    """Read a file of this kind; any error that is not of the user's input is a crash."""
    began = time.process_time()
    try:
        READERS[kind][1](path)
        outcome, message = "valid", ""
    except lsm.InputError as error:
        outcome, message = "refused", str(error)
    except BaseException as error:
        outcome = "crash"
        message = (
            f"{type(error).__name__}: {str(error)[:300]}\n{''.join(traceback.format_tb(error.__traceback__)[-4:])}"
        )
    return Result(outcome, message, time.process_time() - began)


def serve(pipe, mothers, folder, prepare):
    """The child: do what it is asked for until the pipe closes."""
    mothers.close()
    faulthandler.disable()
    if prepare:
        prepare()
    sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: SIM115  as long as the process lives
    warnings.simplefilter("ignore")
    with open("/proc/self/statm") as file:
        mine = int(file.read().split()[0]) * resource.getpagesize()
    for limit, value in ((resource.RLIMIT_AS, mine + MEMORY), (resource.RLIMIT_CORE, 0)):
        resource.setrlimit(limit, (value, resource.getrlimit(limit)[1]))
    with suppress(EOFError):
        for number in itertools.count():
            kind, steps, data = pipe.recv()
            if data is None:
                pipe.send(changed(GOOD[kind], steps))
                continue
            good, home = GOOD[kind], folder / str(number)
            path = home / kind / good.relative_to(good.parents[1] if good.parent.name == "parts" else good.parent)
            path.parent.mkdir(parents=True)
            path.write_bytes(data)
            pipe.send(attempt(kind, path))
            shutil.rmtree(home)


class Child:
    """A process that makes or reads files one by one; another one takes its place if it dies."""

    def __init__(self, folder, prepare=None):
        self.folder, self.process, self.count, self.prepare = folder, None, 0, prepare

    def ask(self, *request):
        """What it answers; a text that says how it ended if it does not."""
        if self.process is None:
            self.pipe, theirs = multiprocessing.Pipe()
            self.count += 1
            arguments = (theirs, self.pipe, self.folder / str(self.count), self.prepare)
            self.process = multiprocessing.get_context("fork").Process(target=serve, args=arguments, daemon=True)
            self.process.start()
            theirs.close()
        self.pipe.send(request)
        with suppress(EOFError, ConnectionResetError):
            if self.pipe.poll(HANGS):
                return self.pipe.recv()
            self.process.kill()
        self.process.join()
        status, self.process = self.process.exitcode, None
        return f"the process died with {status}"

    def made(self, kind, steps):
        """Bytes of a file of this kind after these changes; None if the libraries cannot make it."""
        data = self.ask(kind, steps, None)
        return data if isinstance(data, bytes) else None

    def read(self, kind, data):
        """Result of a file of this kind with these bytes."""
        result = self.ask(kind, (), data)
        return result if isinstance(result, Result) else Result("crash", result, 0.0)

    def close(self):
        """End the process."""
        if self.process:
            self.process.kill()
            self.process.join()
