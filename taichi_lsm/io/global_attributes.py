"""Global attributes of the files of a run: what it is, what made it and how it ended (CF-1.11, ACDD-1.3)."""

import subprocess
import uuid
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib import metadata
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.errors import InputError

if TYPE_CHECKING:
    import netCDF4

RUN_STATUS = ("running", "complete", "failed", "interrupted")
REFERENCES = (
    "Abe and Mora (2003), Efficient implementation of complex particle shapes in the lattice solid model; "
    "Mair, Frye and Marone (2002), doi:10.1029/2001JB000516"
)


def utc_now() -> str:
    """Present time as ISO 8601 text in UTC, to the second."""
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def package_version(name: str) -> str:
    """Version of an installed distribution, or "unknown"."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "unknown"


def git_commit(folder: str | PathLike[str] | None = None) -> str:
    """Commit of the repository that the package's folder lies in, or "unknown".

    A repository without taichi_lsm at its root belongs to another project that holds a virtual environment.
    """
    folder = Path(__file__).parent if folder is None else Path(folder)
    command = ["git", "rev-parse", "--show-toplevel", "HEAD"]
    try:
        answer = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    root, commit = answer.stdout.split("\n")[:2]
    return commit if (Path(root) / "taichi_lsm" / "scene.py").exists() else "unknown"


def file_attributes(
    title: str,
    summary: str,
    config_toml: str,
    seed: int | None,
    dt: float | None,
    arch: str,
    precision: str,
    references: str = REFERENCES,
) -> dict[str, Any]:
    """Global attributes of a file, as a dict; the writers add run_status and date_modified.

    Parameters
    ----------
    title, summary
        What the file holds, in one line and in a few sentences.
    config_toml
        The merged parameters as TOML text.
    seed
        Random seed; None in a table of runs with several.
    dt
        Time step [s]; None in a table of runs, and of what has none.
    arch, precision
        Those of the runtime.
    references
        Papers that the data rest on.
    """
    version, created = package_version("taichi-lsm"), utc_now()
    of_one_run = {"seed": seed, "dt": dt}
    return {
        "Conventions": "CF-1.11, ACDD-1.3",
        "title": title,
        "summary": summary,
        "source": f"taichi_lsm {version}, Taichi {package_version('taichi')}, {arch}, {precision}",
        "history": f"{created} created by taichi_lsm {version}",
        "references": references,
        "date_created": created,
        "id": str(uuid.uuid4()),
        "config_toml": config_toml,
        **{name: value for name, value in of_one_run.items() if value is not None},
        "git_commit": git_commit(),
    }


def set_global_attributes(dataset: "netCDF4.Dataset", attributes: Mapping[str, Any], run_status: str) -> None:
    """Write the global attributes with this run_status and the present date_modified."""
    dataset.setncatts({**attributes, "run_status": run_status, "date_modified": utc_now()})


def require_status(run_status: str, allowed: Sequence[str] = RUN_STATUS) -> None:
    """Raise InputError unless run_status is one of `allowed`."""
    if run_status not in allowed:
        raise InputError(f"run_status {run_status!r}, allowed are {', '.join(allowed)}")
