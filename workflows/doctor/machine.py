"""Processor, memory, kernel cache, disk, terminal and programs of this machine."""

from __future__ import annotations

import locale
import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import taichi_lsm as lsm
from workflows.common.run_cost import PROCESS_BYTES
from workflows.doctor.finding import Finding

CACHE = "TI_OFFLINE_CACHE_FILE_PATH"
LEAST_DISK = 1e9  # bytes
LETTERS = "µ±─"  # that tables and progress lines have


def machine() -> Iterator[Finding]:
    """What can be known without a process."""
    yield cores()
    yield memory()
    yield kernel_cache()
    yield disk(Path.cwd())
    yield terminal()
    yield ffmpeg()


def cores() -> Finding:
    """Processor cores, and how many of them this process may use."""
    count = os.cpu_count() or 1
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else count
    of = "" if usable == count else f" of {count}"
    more = f"; --threads up to {usable}" if usable > 1 else ""
    return Finding("cores", "ok", f"{usable}{of}{more}")


def memory() -> Finding:
    """Memory of the machine, and what of it is free as far as the system tells."""
    whole, free = lsm.machine_memory(), free_memory()
    text = f"{whole / 1e9:.1f} GB" + ("" if free is None else f", {free / 1e9:.1f} GB free")
    if free is not None and free < PROCESS_BYTES:
        least = f"a run needs {PROCESS_BYTES / 1e9:.1f} GB and more: end other programs"
        return Finding("memory", "problem", f"{text}; {least}", needed=True)
    return Finding("memory", "ok", text, needed=True)


def free_memory(told_by: Path = Path("/proc/meminfo")) -> float | None:
    """Memory that a new process can have [bytes]; None where the system does not say."""
    try:
        lines = told_by.read_text(encoding="utf-8").splitlines()
    except OSError:
        return None
    found = [line.split()[1] for line in lines if line.startswith("MemAvailable:")]
    return 1024.0 * float(found[0]) if found else None


def cache_folder() -> Path:
    """Where Taichi keeps compiled kernels."""
    if given := os.environ.get(CACHE):
        return Path(given)
    if os.name == "nt":
        return Path("C:/taichi_cache/ticache")
    above = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(above) / "taichi" / "ticache"


def kernel_cache() -> Finding:
    """Whether compiled kernels are kept, where, and how many there are."""
    if os.environ.get("TI_OFFLINE_CACHE") == "0":
        return Finding(
            "kernel cache", "problem", "switched off by TI_OFFLINE_CACHE=0: every run compiles anew; unset it"
        )
    folder = cache_folder()
    # Of a folder in one that may not be searched Path.exists raises PermissionError, os.path.exists says no.
    sizes = [path.stat().st_size for path in folder.glob("*.tic")] if os.path.isdir(folder) else []
    above = next(path for path in (folder, *folder.absolute().parents) if os.path.exists(path))
    if not (above.is_dir() and os.access(above, os.W_OK | os.X_OK)):
        text = f"{folder}: cannot be written, every run compiles anew; name another folder in {CACHE}"
        return Finding("kernel cache", "problem", text)
    if not sizes:
        return Finding("kernel cache", "ok", f"{folder}: empty, the first run of each kind compiles for some time")
    return Finding(
        "kernel cache", "ok", f"{folder}: {len(sizes)} kernel{'s' * (len(sizes) > 1)}, {sum(sizes) / 1e6:.0f} MB"
    )


def disk(folder: Path) -> Finding:
    """Room for files of runs, which lie in the folder `out` of the present one if nothing else is said."""
    if not os.access(folder, os.W_OK | os.X_OK):
        return Finding("disk", "problem", f"{folder} cannot be written: go to another folder, or give runs --out DIR")
    free = shutil.disk_usage(folder).free
    text = f"{free / 1e9:.1f} GB free in {folder}"
    if free < LEAST_DISK:
        return Finding("disk", "problem", f"{text}: make room, or give runs --out DIR on another disk")
    return Finding("disk", "ok", text)


def terminal() -> Finding:
    """Whether the output can have all letters, and what it is."""
    encoding = getattr(sys.stdout, "encoding", None) or "ascii"
    try:
        LETTERS.encode(encoding)
    except (UnicodeEncodeError, LookupError):
        text = f"its encoding is {encoding}, which has not all letters: set LANG=C.UTF-8 or PYTHONUTF8=1"
        return Finding("terminal", "problem", text)
    try:
        locale.setlocale(locale.LC_CTYPE, "")
    except locale.Error:
        names = ", ".join(f"{n}={os.environ[n]}" for n in ("LC_ALL", "LC_CTYPE", "LANG") if os.environ.get(n))
        return Finding("terminal", "problem", f"the locale {names} is not installed: set LANG=C.UTF-8")
    if not sys.stdout.isatty():
        return Finding("terminal", "ok", f"{encoding}; the output goes elsewhere, as plain lines")
    width = shutil.get_terminal_size().columns
    return Finding("terminal", "ok", f"{encoding}, {width} columns, {os.environ.get('TERM', 'of unknown kind')}")


def ffmpeg() -> Finding:
    """The program that makes films."""
    path = shutil.which("ffmpeg")
    if path is None:
        return Finding("ffmpeg", "missing", "for MP4 films of lsm animate (GIF needs none): apt install ffmpeg")
    return Finding("ffmpeg", "ok", path)
