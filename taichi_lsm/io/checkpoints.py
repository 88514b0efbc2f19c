"""The last two checkpoints of a run, in its folder: while one is written, or if it is damaged, there is the other."""

from collections.abc import Callable, Mapping
from os import PathLike, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..core.errors import InputError
from ..core.whole_files import require_folder_still
from .checkpoint_file import DamagedCheckpointError, restore_checkpoint, save_checkpoint
from .checkpoint_names import LAST, NEW, PREVIOUS

if TYPE_CHECKING:
    from ..simulation import Simulation


class Restored(NamedTuple):
    """What `restore_last` found: the `run_state` of the file, its path, and what was wrong with a later one, or ""."""

    run_state: dict[str, Any]
    path: Path
    damage: str


def keep_checkpoint(sim: "Simulation", folder: str | PathLike[str], run_state: Mapping[str, Any] | None = None) -> Path:
    """Save `sim` and `run_state` as the last checkpoint in `folder`; returns its path. The one before is kept beside.

    Raises
    ------
    SimulationError
        If the disk is full or cannot be written to, then the checkpoint before is as it was; or the folder is gone.
    """
    last, previous, new = (Path(folder) / name for name in (LAST, PREVIOUS, NEW))
    require_folder_still(last)
    save_checkpoint(sim, new, run_state)  # first: a disk that is full takes none of those that are there
    if last.exists():
        replace(last, previous)
    replace(new, last)
    return last


def restore_last(
    sim: "Simulation", folder: str | PathLike[str], accept: Callable[[dict[str, Any], Path], None] | None = None
) -> Restored:
    """Put `sim` into the state of the last checkpoint in `folder` that is whole.

    One that is damaged is removed once the one before it has been restored, so that it cannot take its place. accept:
    is called with `run_state` and path before, and raises what it has against them.

    Raises
    ------
    InputError
        If there is none, or it belongs to a simulation of another scene. The simulation is then as it was.
    """
    damages = []
    for path in (Path(folder) / LAST, Path(folder) / PREVIOUS):
        try:
            run_state = restore_checkpoint(sim, path)
        except DamagedCheckpointError as error:
            damages.append(str(error))
            continue
        if accept:
            accept(run_state, path)
        if damages:
            replace(path, Path(folder) / LAST)
        return Restored(run_state, Path(folder) / LAST, "; ".join(damages))
    raise InputError(f"{'; '.join(damages)}; none is whole: begin the run anew")


def has_checkpoint(folder: str | PathLike[str]) -> bool:
    """Whether there is a checkpoint in `folder`, whole or not."""
    return any((Path(folder) / name).exists() for name in (LAST, PREVIOUS))


def remove_checkpoints(folder: str | PathLike[str]) -> None:
    """Remove the checkpoints in `folder`: the run is complete."""
    for name in (LAST, PREVIOUS, NEW):
        (Path(folder) / name).unlink(missing_ok=True)
