"""Opens the folder of a run as a tree, one of its files as a dataset, or the files of many runs together."""

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from ..core.errors import InputError, reason, shown
from ..core.netcdf_input import opened_netcdf, require_memory
from ..core.record_netcdf import is_record_file
from ..statistics.contact_moments import whole_moments
from ..statistics.run_parts import part_of
from .checkpoint_names import LAST, NEW, PREVIOUS

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

EXPECTED = "must be a NetCDF file that this package wrote, such as run.nc, grains.nc or compare.nc"
NO_TABLES = ("stopped.nc", LAST, PREVIOUS, NEW)  # states to go on from
LARGE = ("grains.nc", "contacts.nc")
Opened: TypeAlias = Any  # a DataTree of a folder, a Dataset of a file: no type checker sees which the path is


def open_run(path: str | PathLike[str]) -> Opened:
    """The folder of a run, or of an experiment of many runs, as an xarray.DataTree; one file as an xarray.Dataset.

    Parameters
    ----------
    path
        Folder of a run, which may go on or have been killed; of an experiment with runs in `runs/`; or a file of this
        package, such as run.nc, grains.nc or compare.nc.

    Returns
    -------
    xarray.DataTree
        Of a folder: a child for each file, by its name: `run`, `grains`, `contacts` and every further table that is
        there. `tree.run.friction` is a series, `tree.grains.position` are the positions. Grains and contacts may be
        large: their values are read whenever they are used, those of the snapshots that were there when the tree was
        made, so that a run may go on meanwhile. Everything else is in memory. Runs below `runs/` are children of
        `tree.runs`, each a tree of this kind: `tree["runs/angular-1"].run`.
    xarray.Dataset
        Of a file: all variables, in memory, with units and long_name. `run_status` among the attributes tells how the
        run ended. Rows can be chosen by their stage: `dataset.sel(stage="shear")`.

    Raises
    ------
    InputError
        If there is nothing, a folder holds no file of a run, or a file is truncated or damaged, no NetCDF file, or not
        written by this package; with the name of the file.

    See Also
    --------
    open_runs : the series of many runs side by side, as one dataset.
    """
    path = Path(path)
    if not path.is_dir():
        return open_file(path)
    tree = _tree_of(path)
    if tree is None:
        raise InputError(
            f"{path}: holds no file of a run yet, must be the folder of a run or of an experiment, or a file of one"
        )
    return tree


def _tree_of(folder: Path) -> "DataTree | None":
    """The files of a folder, and the runs within it, as a tree; None if there are none."""
    import xarray

    children = {}
    for path in sorted(folder.glob("*.nc")):
        if path.name not in NO_TABLES and not path.name.startswith("."):
            with _opened(path) as dataset, _readable(path):
                if "run_status" in dataset.attrs:  # others are files of the user
                    children[path.stem] = xarray.DataTree(dataset if _is_lazy(path) else _loaded(dataset))
    within = {path.name: _tree_of(path) for path in sorted(folder.glob("runs/*")) if path.is_dir()}
    if runs := {name: tree for name, tree in within.items() if tree is not None}:  # others have only begun
        children["runs"] = xarray.DataTree(children=runs)
    if not children:
        return None
    tree = xarray.DataTree(children=children)
    tree.encoding["source"] = str(folder.absolute())
    return tree


def _is_lazy(path: Path) -> bool:
    """Whether values of the file are read when they are used: of large ones that can be read so."""
    return path.name in LARGE and is_record_file(path)


def _loaded(dataset: "Dataset") -> "Dataset":
    """The dataset with all values in memory; ValueError if it has not enough of it."""
    require_memory(dataset.nbytes)
    return dataset.load()


def open_file(path: str | PathLike[str]) -> "Dataset":
    """One file, as `open_run` gives it."""
    with opened_run(path) as dataset, _readable(Path(path)):
        return _loaded(dataset)


@contextmanager
def opened_run(path: str | PathLike[str]) -> "Iterator[Dataset]":
    """One file of a run, whose values are read when they are used, within the block: for files larger than the memory.

    Parameters
    ----------
    path
        A file of this package, or the folder of a run, for its run.nc. What is there now counts: a snapshot that a run
        appends meanwhile is not seen.

    Yields
    ------
    xarray.Dataset
        Of which `dataset.isel(time=3).load()` reads one snapshot.

    Raises
    ------
    InputError
        As `open_run`.
    """
    path = _file_of(path)
    with _opened(path) as dataset:
        if "run_status" not in dataset.attrs:
            raise InputError(f"{path}: has no attribute run_status, {EXPECTED}")
        yield dataset


@contextmanager
def _opened(path: Path) -> "Iterator[Dataset]":
    """A file of whatever program, whose values are read when they are used."""
    import xarray  # takes long to load
    from xarray.backends import NetCDF4DataStore

    if not path.is_file():
        raise InputError(f"{path}: {'is a folder' if path.is_dir() else 'no such file'}, {EXPECTED}")
    with ExitStack() as stack:
        with _readable(path):
            if is_record_file(path):
                from .record_arrays import record_dataset

                dataset = record_dataset(path)
            else:
                file = stack.enter_context(opened_netcdf(path))
                dataset = xarray.open_dataset(NetCDF4DataStore(file))
                dataset.set_close(None)  # the file is closed here
            dataset.encoding["source"] = str(path.absolute())
            if "stage" in dataset.coords and dataset.stage.dims == ("time",):
                dataset = dataset.set_xindex("stage")
            if "row_size" in dataset:
                dataset = whole_moments(dataset)
        yield dataset


def _file_of(path: str | PathLike[str]) -> Path:
    """The file that is meant: run.nc where a folder is given."""
    path = Path(path)
    return path / "run.nc" if path.is_dir() and (path / "run.nc").is_file() else path


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Turn what reading a damaged file raises into an InputError with its name."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:  # attributes of other types are errors of any kind in xarray
        raise InputError(
            f"{path}: cannot be read ({reason(error)}), {EXPECTED}; it may be truncated or damaged"
        ) from None


def open_runs(folder: str | PathLike[str] | Iterable[str | PathLike[str]]) -> "Dataset":
    """The files run.nc of all runs of an experiment, or of those that are listed, as one xarray.Dataset in memory.

    Parameters
    ----------
    folder
        Folder of the experiment, whose runs are `folder`/runs/*/run.nc; or a list of folders of runs, or of files.

    Returns
    -------
    xarray.Dataset
        Dimensions run, labelled with the names of the runs, and row, counted from 0 in each run, since runs have their
        own times; shorter runs are filled up with nan. Parameters that differ are coordinates along run, and
        `parameter_value` (run, effect_parameter) holds those of the effects, nan where a run has no such effect. Rows
        of a stage: `runs.where(runs.stage == "shear")`.

    Raises
    ------
    InputError
        If there is no such run, a file cannot be read, or a folder of the list holds no run; the message names it.
    """
    import xarray

    paths = _paths_of(folder)
    runs = [_rows_of(path) for path in paths]
    try:
        return xarray.concat(
            runs,
            dim="run",
            data_vars="all",
            coords="different",
            compat="equals",
            join="outer",
            combine_attrs="drop_conflicts",
        )
    except Exception as error:  # of whatever differs in runs that do not belong together
        names = ", ".join(map(str, paths[:3])) + (", ..." if len(paths) > 3 else "")
        raise InputError(f"{names}: cannot be put together ({reason(error)})") from None


def _paths_of(folder: "str | PathLike[str] | Iterable[str | PathLike[str]]") -> list[Path]:
    """The files of the runs that `open_runs` is asked for; InputError if there are none."""
    if isinstance(folder, str | PathLike):
        paths = sorted(Path(folder).glob("runs/*/run.nc"))
        if not paths:
            raise InputError(
                f"{folder}: holds no runs/*/run.nc, must be the folder of an experiment of many runs, or a list of "
                "folders of runs"
            )
        return paths
    paths = []
    for given in folder if isinstance(folder, Iterable) else (folder,):
        if not isinstance(given, str | PathLike):
            raise InputError(f"open_runs: {shown(given)}, must be a folder of a run or its run.nc")
        path = Path(given)
        if path.is_dir() and not (path / "run.nc").is_file():
            raise InputError(f"{path}: holds no run.nc, must be the folder of a run or its run.nc")
        paths.append(path)
    if not paths:
        raise InputError("open_runs: the list is empty, must name folders of runs")
    return paths


def _rows_of(path: Path) -> "Dataset":
    """The run in a file, see `by_row`; InputError if it lacks rows or effects."""
    run = open_file(path)
    try:
        return by_row(run)
    except Exception as error:  # of whatever is declared otherwise
        raise InputError(f"{path}: is not the run.nc of a layer ({reason(error)}), {EXPECTED}") from None


def by_row(run: "Dataset") -> "Dataset":
    """A run whose rows, effects and parameters of effects are labelled alike in all runs.

    Runs have their own times, so that only their rows, counted from 0, can stand side by side: `open_runs` and the
    `preprocess` of `xarray.open_mfdataset` put runs together after this.

    Parameters
    ----------
    run
        The run.nc of one run, as `open_run` or xarray opens it, or the tree of the run; arrays of Dask stay unread, but
        for texts.

    Returns
    -------
    xarray.Dataset
        The same variables along `row` in place of `time`.

    Raises
    ------
    ValueError or KeyError
        If it lacks rows or effects.
    """
    rows = (
        part_of(run, "run")
        .drop_indexes(["time", "stage"], errors="ignore")
        .reset_coords("time")
        .rename_dims(time="row")
    )
    labels = {"row": range(rows.sizes["row"]), "effect": rows.effect_name.values}
    if "parameter_value" in rows:
        names = [f"{e}.{n}" for e, n in zip(rows.parameter_effect.values, rows.parameter_name.values, strict=True)]
        labels["effect_parameter"] = names
    texts = [name for name in rows.coords if rows[name].dims in (("effect",), ("effect_parameter",))]
    rows = rows.drop_vars(texts).assign_coords(labels)
    for variable in rows.variables.values():
        if variable.dtype == object:  # texts, which Dask cannot pad where runs have different numbers of rows
            variable.load()
    return rows
