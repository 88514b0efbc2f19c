"""Python, the package and the libraries that it asks for, those of its extras too."""

from __future__ import annotations

import platform
import sys
from collections.abc import Iterator, Sequence
from importlib import metadata
from pathlib import Path

import workflows
from workflows.doctor.finding import Finding

PACKAGE = "taichi-lsm"
EXTRAS = {  # and what needs them; one for developers is not asked for
    "cluster": "lsm sweep",
    "calibration": "lsm calibrate, lsm sensitivity",
    "decompose": "lsm.shapes.non_convex_mesh without given parts",
    "export": "lsm export --format vtk or gsd, pictures of spheres and polyhedra",
}


def packages() -> Iterator[Finding]:
    """Python, the package, and its libraries by extra."""
    from packaging.specifiers import SpecifierSet  # comes with xarray and matplotlib

    python, where = platform.python_version(), Path(workflows.__file__).parents[1]
    try:
        about = metadata.metadata(PACKAGE)
    except metadata.PackageNotFoundError:
        yield Finding("Python", "ok", f"{python}, {sys.executable}")
        text = f"in {where}, but not installed, so its libraries are not known: pip install -e {where}"
        yield Finding(PACKAGE, "problem", text)
        return
    suits = about["Requires-Python"] or ""
    if SpecifierSet(suits).contains(python, prereleases=True):
        yield Finding("Python", "ok", f"{python}, {sys.executable}", needed=True)
    else:
        text = f"{python}, must be {suits}: install another one, and the package in an environment of it"
        yield Finding("Python", "problem", text, needed=True)
    yield Finding(PACKAGE, "ok", f"{about['Version']}, in {where}", needed=True)
    yield from libraries(metadata.requires(PACKAGE) or [])


def libraries(requirements: Sequence[str]) -> Iterator[Finding]:
    """Whether what the package requires is there, in the versions that it allows.

    Parameters
    ----------
    requirements
        As in the metadata of a package: 'gsd>=3; extra == "export"'.
    """
    lacking = unmet(requirements, "")
    what = ", ".join(lacking) or ", ".join(_versions(requirements))
    remedy = f"; pip install {PACKAGE}" if lacking else ""
    yield Finding("libraries", "problem" if lacking else "ok", what + remedy, needed=True)
    for extra, needs in EXTRAS.items():
        if lacking := unmet(requirements, extra):
            text = f"{', '.join(lacking)}; for {needs}: pip install '{PACKAGE}[{extra}]'"
            yield Finding(f"extra {extra}", "missing", text)
        else:
            yield Finding(f"extra {extra}", "ok", f"for {needs}")


def unmet(requirements: Sequence[str], extra: str) -> list[str]:
    """What an extra requires, or "" the package itself, and is not there, such as "numpy 1.0: must be >=2"."""
    from packaging.requirements import Requirement

    lacking = []
    for line in requirements:
        need = Requirement(line)
        of_extra = need.marker is not None and not need.marker.evaluate({"extra": ""})
        wanted = (need.marker is None or need.marker.evaluate({"extra": extra})) and of_extra == bool(extra)
        if not wanted:
            continue
        if need.name.lower() == PACKAGE:  # of an extra with others in it
            lacking += [text for other in sorted(need.extras) for text in unmet(requirements, other)]
            continue
        try:
            version = metadata.version(need.name)
        except metadata.PackageNotFoundError:
            lacking.append(f"{need.name}: not installed")
            continue
        if not need.specifier.contains(version, prereleases=True):
            lacking.append(f"{need.name} {version}: must be {need.specifier}")
    return list(dict.fromkeys(lacking))


def _versions(requirements: Sequence[str]) -> Iterator[str]:
    """Versions of the libraries on which results depend."""
    from packaging.requirements import Requirement

    for line in requirements:
        if (name := Requirement(line).name) in ("taichi", "numpy", "scipy", "xarray", "netCDF4"):
            yield f"{name} {metadata.version(name)}"
