"""Runs that begin in the last state of another one: copies of its folder, which go on through more stages."""

from __future__ import annotations

import shutil
from pathlib import Path

import netCDF4

import taichi_lsm as lsm
from workflows.common.parameter_files import CONFIG
from workflows.common.run_folder import is_begun

FILES = ("run.nc", "grains.nc")
COPIED = (CONFIG, *FILES, "checkpoint.nc")
CONTACTS = "contacts.nc"  # if the run has it
UNDONE = ".begun"  # of the name of a folder whose copy is not complete


def fork(trunk: Path, branch: Path) -> None:
    """Make the folder `branch` of a run whose state is that at the end of the complete run in `trunk`, bit for bit.

    The run in `trunk` must have kept its checkpoint. A branch that is there stays as it is.

    Raises
    ------
    InputError
        If `trunk` has no checkpoint.
    """
    if is_begun(branch):
        return
    missing = [name for name in COPIED if not (trunk / name).is_file()]
    if missing:
        raise lsm.InputError(f"{trunk}: has no {', '.join(missing)}, must be a complete run with --keep-checkpoint")
    undone = branch.with_name(branch.name + UNDONE)
    shutil.rmtree(undone, ignore_errors=True)
    shutil.rmtree(branch, ignore_errors=True)
    undone.mkdir(parents=True)
    contacts = [CONTACTS] * (trunk / CONTACTS).is_file()
    for name in (*COPIED, *contacts):
        shutil.copy2(trunk / name, undone / name)
    for name in (*FILES, *contacts):
        with netCDF4.Dataset(undone / name, "a") as file:
            file.run_status = "interrupted"  # the stages of the branch are still to come
    undone.rename(branch)  # at once: a copy that is cut off is no run
