"""Films of a run: one figure drawn at many moments, with one scale, a frame at a time in memory."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, cast

import numpy as np

import taichi_lsm as lsm
from workflows.common.reports import Progress
from workflows.plots.canvas import PRINT, STYLE
from workflows.plots.packing import Scale
from workflows.plots.run_figures import figure_module, figures_of_moments, is_of_moment
from workflows.plots.run_files import Moments, RunFiles

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL.Image import Image

KINDS = (".gif", ".mp4")
DPI = 200  # of a frame
COLOURS = 256  # of a GIF
WITHOUT_FFMPEG = (
    "needs ffmpeg, which is not installed (Debian, Ubuntu: apt install ffmpeg; conda install ffmpeg); or write a .gif"
)
EVEN = "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white"  # H.264 takes even numbers of pixels only
Add = Callable[[], None]  # adds what the figure shows now to a film
Draw = Callable[[int], None]  # draws the moment of this number


def draw_film(
    folder: Path,
    path: Path,
    name: str,
    times: str = "all",
    every: int = 1,
    fps: float = 10.0,
    progress: Progress | None = None,
) -> int:
    """Draw a film of a run, from its files alone; returns the number of its frames.

    Parameters
    ----------
    folder
        Of the run, which may go on or have been killed.
    path
        Of the film, which appears when it is whole; a .gif, or an .mp4 where ffmpeg is installed.
    name
        Of a figure that shows one moment.
    times, every
        Moments that are frames, see `selection.chosen`.
    fps
        Frames per second.
    progress
        Called with how many frames are read and drawn.

    Raises
    ------
    InputError
        If the figure shows no moment, its files are missing, there are fewer than two moments, or ffmpeg is missing.
    SimulationError
        If the film cannot be written.
    """
    module = figure_module(name)
    if not is_of_moment(module):
        raise lsm.InputError(f"--what {name}: shows a whole run; films are made of {', '.join(figures_of_moments())}")
    writer = {".gif": _gif, ".mp4": _mp4}.get(path.suffix)
    if writer is None:
        raise lsm.InputError(f"--out {path}: must end in {' or '.join(KINDS)}")
    if path.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise lsm.InputError(f"{path.name}: {WITHOUT_FFMPEG}")
    with RunFiles(folder) as run:
        moments = _moments(run, module, times, every)
        scale: Scale = {}
        for done, moment in enumerate(moments, 1):
            scale = united(scale, module.scale_of(moment))
            _report(progress, "reading", done, len(moments))
        with _empty_figure(module.SIZE) as figure, lsm.replacing(path) as new:

            def draw(number: int) -> None:
                figure.clear()
                module.draw_moment(figure, moments.at(number), scale)

            with writer(new, figure, fps, draw, len(moments)) as add:
                for number in range(len(moments)):
                    draw(number)
                    add()
                    _report(progress, "drawing frames", number + 1, len(moments))
    return len(moments)


def _moments(run: RunFiles, module: ModuleType, times: str, every: int) -> Moments:
    """The moments of a film; InputError if there are fewer than two."""
    for stem in module.NEEDS:
        run.path(stem)
    moments = Moments(run, module.NEEDS, times, every)
    if len(moments) < 2:
        raise lsm.InputError(
            f"{run.folder}: a film needs two moments, and there is {len(moments)}; a run with --snapshots every=0.01 "
            "writes one for each hundredth of strain"
        )
    return moments


def _report(progress: Progress | None, stage: str, done: int, total: int) -> None:
    if progress:
        progress({"stage": stage, "done": done, "total": total})


def united(first: Scale, second: Scale) -> Scale:
    """The least and the greatest of the ends of two scales, of which the first one may be empty."""
    if not first:
        return second
    return {n: (min(first[n][0], second[n][0]), max(first[n][1], second[n][1])) for n in second}


@contextmanager
def _empty_figure(size: tuple[float, float]) -> Iterator[Figure]:
    """A figure in the style of the others, with the resolution of a film."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    style: dict[Any, Any] = STYLE | PRINT | {"savefig.dpi": DPI}
    with matplotlib.rc_context(style):
        figure = Figure(figsize=size, dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure


def _picture(figure: Figure) -> Image:
    """What a figure shows, as a picture of Pillow."""
    from PIL import Image as Images

    figure.canvas.draw()
    return Images.fromarray(np.asarray(cast(Any, figure.canvas).buffer_rgba())).convert("RGB")


@contextmanager
def _gif(path: Path, figure: Figure, fps: float, draw: Draw, count: int) -> Iterator[Add]:
    """Write a GIF by Pillow, one frame behind the other: `Image.save` would keep all of them in memory.

    All frames have the colours of the first, the middle and the last one; the octree keeps rare colours, such as those
    of a bar, apart.
    """
    from PIL import GifImagePlugin
    from PIL import Image as Images

    some = []
    for number in dict.fromkeys((0, count // 2, count - 1)):
        draw(number)
        some.append(np.asarray(_picture(figure)))
    palette = Images.fromarray(np.concatenate(some)).quantize(COLOURS, Images.Quantize.FASTOCTREE)
    size, duration = some[0].shape[:2], round(1000.0 / fps)
    with open(path, "wb") as file:

        def add() -> None:
            frame = _picture(figure).quantize(palette=palette, dither=Images.Dither.NONE)
            _require_size(frame.size[::-1], size)
            if not file.tell():
                file.writelines(GifImagePlugin.getheader(frame, info={"loop": 0})[0])
            file.writelines(GifImagePlugin.getdata(frame, duration=duration))

        yield add
        file.write(b";")


@contextmanager
def _mp4(path: Path, figure: Figure, fps: float, draw: Draw, count: int) -> Iterator[Add]:
    """Write an MP4: each frame goes to ffmpeg through a pipe."""
    from matplotlib.animation import FFMpegWriter

    draw(0)  # which makes the figure as high as it stays
    size = _picture(figure).size
    # The format must be named: the file has another name until it is whole.
    options = ["-pix_fmt", "yuv420p", "-vf", EVEN, "-f", "mp4"]
    writer = FFMpegWriter(fps=cast(Any, fps), codec="libx264", extra_args=options)
    with writer.saving(figure, str(path), DPI):

        def add() -> None:
            _require_size(_picture(figure).size, size)
            writer.grab_frame()

        yield add


def _require_size(size: tuple[int, ...], first: tuple[int, ...]) -> None:
    """SimulationError if a frame has not the size of the first one."""
    if size != first:
        raise lsm.SimulationError(f"a frame of {size} pixels follows one of {first}")
