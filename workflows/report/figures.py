"""The figures of a folder, as data: URIs with what they show."""

from __future__ import annotations

import base64
import html
import re
import warnings
from collections.abc import Iterator
from pathlib import Path

from taichi_lsm.core.errors import reason
from workflows.common.run_folder import PLOTS
from workflows.report.parts import Figure, Section

KINDS = (".png", ".svg")
MOST_FIGURES = 60
MOST_BYTES = 2e7  # of a figure
MOST_IN_ALL = 1e8  # bytes
INCH, LARGER = 96.0, 1.35  # CSS pixels; how much larger than in print a figure is shown
DOTS = 130.0  # per inch, of a file that does not say
HEAD = 2**16  # bytes of an SVG file in which its description stands
DESCRIPTION = re.compile(r"<dc:description[^>]*>(.*?)</dc:description>", re.DOTALL)
MATHS = re.compile(r"\$([^$]*)\$")  # a formula in a text of matplotlib
PNG, SVG = b"\x89PNG\r\n\x1a\n", re.compile(rb"\s*(<\?xml|<!DOCTYPE svg|<svg)")


def pictures_in(folder: Path) -> list[Path]:
    """The pictures of a run: those of its experiment, then those that were drawn of it."""
    kinds = (*KINDS, ".pdf")
    return [
        path
        for place in (folder, folder / PLOTS)
        for path in sorted(place.glob("*"))
        if path.suffix in kinds and path.is_file()
    ]


def figures(folder: Path, title: str) -> Section:
    """All PNG and SVG figures of a run that can be read; what is left out is told."""
    section, left, used = Section("figures", "Figures"), [], 0.0
    for path in pictures_in(folder):
        name = path.relative_to(folder).as_posix()
        if path.suffix == ".pdf":
            if not any(path.with_suffix(kind).is_file() for kind in KINDS):
                left.append(f"{name} (PDF, which a page does not show)")
            continue
        size = path.stat().st_size
        if size > MOST_BYTES or used + size > MOST_IN_ALL or len(section.figures) >= MOST_FIGURES:
            left.append(f"{name} (too large, or one of too many)")
            continue
        try:
            section.figures.append(_figure(path, name, title))
        except (OSError, ValueError) as error:
            left.append(f"{name} (cannot be read: {error})")
            continue
        used += size
    section.texts.extend(_left_out(left, section.figures, folder))
    return section


def _left_out(left: list[str], shown: list[Figure], folder: Path) -> Iterator[str]:
    """What is not shown, and how there will be figures."""
    if left:
        yield f"Not shown: {'; '.join(left)}."
    if not shown:
        yield f"There are no figures to show here. To draw some: lsm plot {folder}"


def _figure(path: Path, name: str, title: str) -> Figure:
    """One figure; OSError or ValueError if it is not what its name says."""
    data = path.read_bytes()
    size, words = _of_png(path, data) if path.suffix == ".png" else (None, _of_svg(data))
    kind = "png" if path.suffix == ".png" else "svg+xml"
    source = f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"
    words = MATHS.sub(r"\1", words) or f"Figure {path.stem.replace('_', ' ')} of: {title}"
    return Figure(name, source, words[:1].upper() + words[1:], size)


def _of_png(path: Path, data: bytes) -> tuple[tuple[int, int], str]:
    """Size at which a whole PNG file is shown [CSS pixels], and its description."""
    from PIL import Image  # comes with matplotlib

    if not data.startswith(PNG):
        raise ValueError("it is no PNG file")
    try:
        with warnings.catch_warnings(), Image.open(path) as image:
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            dots = max(1.0, float(image.info.get("dpi", (DOTS, DOTS))[0]))
            width, height = (round(LARGER * INCH * pixels / dots) for pixels in image.size)
            words = str(image.info.get("Description", ""))
            image.verify()
    except Exception as error:  # a damaged file raises errors of any kind
        raise ValueError(reason(error)) from None
    return (width, height), words


def _of_svg(data: bytes) -> str:
    """Description of an SVG file. It is shown as an image, in which no script runs and nothing else is loaded."""
    if not SVG.match(data.removeprefix(b"\xef\xbb\xbf")):
        raise ValueError("it is no SVG file")
    found = DESCRIPTION.search(data[:HEAD].decode("utf-8", "replace"))
    return html.unescape(" ".join(found[1].split())) if found else ""
