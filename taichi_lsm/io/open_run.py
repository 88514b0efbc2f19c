"""Opens the files of a run, or those of many runs together."""

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from ..core.errors import InputError, reason, shown
from ..core.netcdf_input import opened_netcdf
from ..core.record_netcdf import is_record_file, read_layout

if TYPE_CHECKING:
    from xarray import Dataset

EXPECTED = "must be a NetCDF file that this package wrote, such as run.nc, grains.nc or compare.nc"


def open_run(path: str | PathLike[str]) -> "Dataset":
    """A file of this package as an xarray.Dataset in memory: a run that goes on may rewrite it meanwhile.

    Parameters
    ----------
    path
        A file of a run, such as run.nc or grains.nc, or a table such as compare.nc; or the folder of a run, for run.nc.

    Returns
    -------
    xarray.Dataset
        All variables, with units and long_name; `run_status` among the attributes tells how the run ended. Rows can be
        chosen by their stage: `dataset.sel(stage="shear")`.

    Raises
    ------
    InputError
        If the file is missing, truncated or damaged, no NetCDF file, or not written by this package.
    """
    with opened_run(path) as lazy, _readable(_file_of(path)):
        return lazy.load()


@contextmanager
def opened_run(path: str | PathLike[str]) -> "Iterator[Dataset]":
    """As `open_run`, but values are read when they are used, within the block: for files larger than the memory.

    Parameters
    ----------
    path
        As of `open_run`. What is there now counts: a snapshot that a run appends meanwhile is not seen.

    Yields
    ------
    xarray.Dataset
        Of which `dataset.isel(time=3).load()` reads one snapshot.

    Raises
    ------
    InputError
        As `open_run`.
    """
    import xarray  # takes long to load
    from xarray.backends import NetCDF4DataStore

    path = _file_of(path)
    if not path.is_file():
        raise InputError(f"{path}: {'is a folder' if path.is_dir() else 'no such file'}, {EXPECTED}")
    with ExitStack() as stack:
        with _readable(path):
            if is_record_file(path):
                _require_whole(path)
            file = stack.enter_context(opened_netcdf(path))
            dataset = xarray.open_dataset(NetCDF4DataStore(file))
            dataset.set_close(None)  # the file is closed here
            dataset.encoding["source"] = str(path.absolute())
            if "stage" in dataset.coords and dataset.stage.dims == ("time",):
                dataset = dataset.set_xindex("stage")
        if "run_status" not in dataset.attrs:
            raise InputError(f"{path}: has no attribute run_status, {EXPECTED}")
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
    except Exception as error:  # attributes of other types are errors of any kind in xarray
        raise InputError(
            f"{path}: cannot be read ({reason(error)}), {EXPECTED}; it may be truncated or damaged"
        ) from None


def _require_whole(path: Path) -> None:
    """ValueError if a file of records was cut off: the library would give zeros for what is missing."""
    layout = read_layout(path)
    if layout.whole < layout.count:
        raise ValueError(f"it counts {layout.count} snapshots and holds {layout.whole}")


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
    run = open_run(path)
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
        The run.nc of one run, as `open_run` or xarray opens it; arrays of Dask stay unread, but for texts.

    Returns
    -------
    xarray.Dataset
        The same variables along `row` in place of `time`.

    Raises
    ------
    ValueError or KeyError
        If it lacks rows or effects.
    """
    rows = run.drop_indexes(["time", "stage"], errors="ignore").reset_coords("time").rename_dims(time="row")
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
