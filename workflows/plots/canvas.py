"""The style of all figures, and how one is saved: as PNG, PDF or SVG by the name of its file.

matplotlib is imported when something is drawn. The colours, of Okabe and Ito, stay apart for colour-blind eyes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLUE, ORANGE, GREEN, PURPLE, YELLOW = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00"
DESCRIPTION = {".png": "Description", ".svg": "Description", ".pdf": "Subject"}  # where a file says what it shows
STYLE: dict[Any, Any] = {
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 8.8,
    "figure.titlesize": 10.5,
    "savefig.dpi": 130,
    "pdf.fonttype": 42,  # letters stay letters, which journals ask for and editors can change
    "svg.fonttype": "none",
}


PRINT: dict[Any, Any] = {  # beside STYLE, of a figure as wide as one or two columns of a journal
    **dict.fromkeys(("font.size", "axes.titlesize", "axes.labelsize", "figure.titlesize"), 8),
    **dict.fromkeys(("xtick.labelsize", "ytick.labelsize", "legend.fontsize"), 7.5),
    "axes.linewidth": 0.7,
    "savefig.dpi": 300,
}


@contextmanager
def figure_at(path: Path, size: tuple[float, float], style: Mapping[Any, Any] | None = None) -> Iterator[Figure]:
    """A figure of `size` [inches] that is saved at the end, its label as the description in the file.

    style: settings of matplotlib beside those of STYLE.

    It needs no display and leaves the settings of matplotlib unchanged.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE | dict(style or {})):
        figure = Figure(figsize=size, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        figure.savefig(path, metadata={DESCRIPTION[path.suffix]: str(figure.get_label())})
