"""The table of an experiment that consists of many runs, one row each."""

import taichi_lsm as lsm
from workflows.common.parameters import to_toml


def attributes_of(params, dt, title, summary):
    """Global attributes of a file of the experiment with these parameters; dt [s]: its smallest time step."""
    return lsm.file_attributes(title, summary, to_toml(params), params.seed, dt, params.arch, params.precision)


def write_runs(path, rows, variables, params, dt, title, summary, **options):
    """Write `rows`, a list of dicts with equal keys, to the NetCDF file `path`; returns it opened.

    variables: schema rows of the numbers. params: of the experiment. dt [s]: its smallest time step. options: see
    `lsm.write_table`, which also says what raises ValueError.
    """
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    lsm.write_table(path, columns, variables, attributes_of(params, dt, title, summary), **options)
    return lsm.open_run(path)
