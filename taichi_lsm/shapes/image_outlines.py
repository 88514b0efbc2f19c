"""Outlines of grains in images: masks, grey values and labels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError
from .input_checks import number_array

if TYPE_CHECKING:
    import shapely

MOST_PIXELS = 100_000_000
SPECK = 0.05  # of the largest grain: smaller ones are left out
STEP = 1.0  # depth of a concavity [pixel] that pixels may make of a convex outline
BLUR = 1.25  # standard deviation [pixel] of the Gaussian that makes grey values of a mask
MARGIN = 6  # pixels about the grain, which the Gaussian reaches
EVEN = 0.02  # of the range of grey values: less is no difference
EIGHT = np.ones((3, 3), bool)  # a pixel and its neighbours


def outline_of_image(
    image: ArrayLike, level: float | None = None, *, label: float | None = None, border: str = "refuse"
) -> NDArray:
    """The outline of the grain in an image.

    Parameters
    ----------
    image : array_like, (rows, columns)
        Values of the pixels, at least 3 x 3: a mask, grey values or labels. What most of the border shows is taken as
        the background, bright or dark.
    level : float, optional
        Value between grain and background; by default the middle of the range.
    label : float, optional
        Value of the pixels of the grain in an image of labels.
    border : {"refuse", "close"}
        What to do with a grain that touches the border: refuse it, or close it along the border.

    Returns
    -------
    ndarray, (k, 2)
        Points x (column), y (row) [pixel] of the outline of the largest grain, the first not repeated.

    Raises
    ------
    InputError
        If the image is no such array, or holds no grain, several ones or several labels, or one that touches the
        border.

    Notes
    -----
    Grey values are followed at the level between pixels; where they are even but for the edge of the grain, its outline
    has the area that they cover. Two values, a mask or a label, are blurred by a pixel first, and the outline has the
    area of the pixels. Where an outline is convex but for steps of up to a pixel, it is the hull drawn in to its area.
    """
    values = _checked(image, border)
    if label is None:
        at = 0.5 * values.min() + 0.5 * values.max() if level is None else level
        inside, sign = _of_level(values, at)
        _require_one_value(values, inside)
        two_valued = values.min() == values[values <= at].max() and values.max() == values[values > at].min()
    else:
        at, inside, sign, two_valued = label, values == label, 1.0, True
        if not inside.any():
            raise InputError(f"label = {label}: no pixel has this value; values range from {_range(values)}")
    grain = _largest(inside)
    if border == "refuse":
        _require_inside(grain, "grain" if label is None else f"grain of label {label}")
    rows, columns = np.nonzero(grain)
    first = np.maximum([rows.min() - 2, columns.min() - 2], 0)
    box = slice(first[0], rows.max() + 3), slice(first[1], columns.max() + 3)
    if two_valued:
        above, area = _blurred(grain[box]), float(grain.sum())
    else:
        height = sign * (values[box] - at)
        above, area = _above(height, grain[box]), _covered(height, grain[box])
    return _convex_outline(_contour(above), area) + first[::-1] - MARGIN


def _checked(image: ArrayLike, border: str) -> NDArray:
    """The values of the pixels (rows, columns); InputError if they are none, or `border` is no choice."""
    values = number_array("image", image)
    if values.ndim != 2 or min(values.shape) < 3 or values.size > MOST_PIXELS or not np.all(np.isfinite(values)):
        raise InputError(
            f"image has shape {values.shape}: must be 2D, at least 3 x 3, at most {MOST_PIXELS} pixels, all finite; "
            "of colours take one or their mean"
        )
    if border not in ("refuse", "close"):
        raise InputError(f"border = {border!r}: must be 'refuse' or 'close'")
    return values


def _require_inside(grain: NDArray, name: str) -> None:
    """Refuse a grain (rows, columns) that touches the border."""
    if grain[0].any() or grain[-1].any() or grain[:, 0].any() or grain[:, -1].any():
        raise InputError(
            f"image: the {name} touches the border, beyond which it is not known; take a larger section, or "
            "border='close' closes it along the border"
        )


def _of_level(values: NDArray, level: float) -> tuple[NDArray, float]:
    """Pixels beyond the level that the background is not, and 1 if these are the brighter ones, else -1."""
    bright = values > level
    if not bright.any() or bright.all():
        raise InputError(f"level = {level}: no closed contour; values range from {_range(values)}")
    frame = np.concatenate([bright[0], bright[-1], bright[1:-1, 0], bright[1:-1, -1]])
    return (~bright, -1.0) if frame.mean() > 0.5 else (bright, 1.0)


def _range(values: NDArray) -> str:
    """Least and greatest value."""
    return f"{values.min()} to {values.max()}"


def _require_one_value(values: NDArray, inside: NDArray) -> None:
    """Refuse an image whose grains have several values, each over a whole neighbourhood: those are labels."""
    even = (scipy.ndimage.maximum_filter(values, 3) == values) & (scipy.ndimage.minimum_filter(values, 3) == values)
    found = np.unique(values[inside & even])
    if len(found) > 1:
        raise InputError(
            f"image: {len(found)} values fill areas of their own ({', '.join(f'{v:g}' for v in found[:5])}"
            f"{', ...' if len(found) > 5 else ''}): are these labels? label={found[0]:g} takes one of them; "
            f"of grey values take the mask, image > level"
        )


def _largest(inside: NDArray) -> NDArray:
    """The largest connected grain, without holes; InputError if another one is nearly as large."""
    number, count = scipy.ndimage.label(inside, EIGHT)
    size = np.bincount(number.ravel())[1:]
    best = int(size.argmax())
    others = np.flatnonzero(size > SPECK * size[best])
    if len(others) > 1:
        sizes = ", ".join(str(s) for s in np.sort(size[others])[::-1][:5])
        raise InputError(
            f"image: {len(others)} grains of {sizes}{', ...' if len(others) > 5 else ''} pixels, must be one; number "
            "them, with scipy.ndimage.label, and take one by label="
        )
    return scipy.ndimage.binary_fill_holes(number == best + 1)


def _blurred(grain: NDArray) -> NDArray:
    """Heights of a mask over its edge, with a margin: half way between two pixels they are 0."""
    return scipy.ndimage.gaussian_filter(np.pad(grain, MARGIN).astype(np.float64), BLUR) - 0.5


def _above(height: NDArray, grain: NDArray) -> NDArray:
    """Heights of grey values over the level, with a margin, and far below it away from the grain.

    The first pixel beyond the border is as far below the level as the last one is above it: there the grain ends.
    """
    reach = scipy.ndimage.binary_dilation(grain, EIGHT)
    height = np.where(reach, height, -np.abs(height).max())
    mirrored = -np.abs(np.pad(height, 1, mode="edge"))
    mirrored[1:-1, 1:-1] = height
    return np.pad(mirrored, MARGIN - 1, constant_values=-np.abs(height).max())


def _covered(height: NDArray, grain: NDArray) -> float | None:
    """Area [pixel^2] of a grain whose edge pixels are as grey as they are covered; None where grey means more.

    Inside and outside are even then, and the level lies half way between them.
    """
    reach = scipy.ndimage.binary_dilation(grain, EIGHT)
    inside = height[scipy.ndimage.binary_erosion(grain, EIGHT)]
    outside = height[~reach]
    if not len(inside) or not len(outside):
        return None
    low, high = outside.max(), inside.min()
    even = EVEN * (height.max() - height.min())
    if max(np.ptp(inside), np.ptp(outside), abs(high + low)) > even:
        return None
    return float(np.clip((height[reach] - low) / (high - low), 0.0, 1.0).sum())


def _contour(above: NDArray) -> shapely.Polygon:
    """What the longest closed contour of height 0 encloses."""
    import shapely
    from contourpy import contour_generator

    lines = [np.asarray(line) for line in contour_generator(z=above).lines(0.0)]
    closed = [shapely.Polygon(line) for line in lines if len(line) > 3 and np.array_equal(line[0], line[-1])]
    parts = shapely.get_parts(shapely.buffer(closed, 0.0))
    if not len(parts) or not shapely.area(parts).max() > 0.0:
        raise InputError("image: the grain is too small for a closed contour; take a finer image")
    return shapely.Polygon(max(parts, key=shapely.area).exterior)


def _convex_outline(body: shapely.Polygon, area: float | None) -> NDArray:
    """Points (k, 2) of a contour brought to an area [pixel^2], if one is given, without the steps of pixels."""
    import shapely

    from .outline_repair import grown_to, without_steps

    body = body if area is None else grown_to(body, area)
    return shapely.get_coordinates(without_steps(body, STEP).exterior)[:-1]
