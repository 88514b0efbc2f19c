"""Reports on the progress of a run: what `run` of an experiment is given to call."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

Progress = Callable[[dict[str, Any]], None]  # takes the reports of a run


def as_dict(report: Any) -> dict[str, Any]:
    """A report, a mapping or a dataclass, as a dict."""
    if isinstance(report, Mapping):
        return dict(report)
    return {f.name: getattr(report, f.name) for f in dataclasses.fields(report)}
