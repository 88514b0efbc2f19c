"""Opens the files of a run."""


def open_run(path):
    """A file of this package as an xarray.Dataset in memory: a run that goes on may rewrite it meanwhile."""
    import xarray

    return xarray.load_dataset(path)
