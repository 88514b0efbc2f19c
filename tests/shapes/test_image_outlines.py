"""Grains in images: masks, grey values and labels, bright or dark; steps of pixels are no concavities."""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import from_outline, outline_of_image

FEW_RADII = (4, 8, 10, 20)
RADII = (5, 6, 7, 9, 12, 15, 30, 50)


def disc(r):
    return lambda x, y: np.hypot(x, y) - r


def ellipse(r, angle):
    c, s = np.cos(angle), np.sin(angle)
    return lambda x, y: 0.6 * (np.hypot(c * x + s * y, (c * y - s * x) / 0.6) - r)


def square(r, angle):
    c, s = np.cos(angle), np.sin(angle)
    return lambda x, y: np.maximum(abs(c * x + s * y), abs(c * y - s * x)) - 0.7 * r


def blob(r, seed):
    """A convex outline with harmonics, as of a worn grain."""
    rng = np.random.default_rng(seed)
    size, phase = rng.uniform(0.3, 1.0, 3) * [0.04, 0.015, 0.008], rng.uniform(0.0, 2.0 * np.pi, 3)

    def height(x, y):
        t = np.arctan2(y, x)
        return np.hypot(x, y) - r * (1.0 + sum(size[k] * np.cos((k + 2) * t + phase[k]) for k in range(3)))

    return height


GRAINS = {
    "disc": disc,
    "ellipse": lambda r: ellipse(r, 0.4),
    "square": lambda r: square(r, 0.0),
    "turned square": lambda r: square(r, 0.3),
    "diamond": lambda r: square(r, np.pi / 4),
    "blob": lambda r: blob(r, 1),
    "other blob": lambda r: blob(r, 2),
}


def grid(r):
    y, x = np.mgrid[-r - 4 : r + 5, -r - 4 : r + 5].astype(float)
    return x, y


def covered(height, r):
    """Share of every pixel that a grain covers."""
    x, y = grid(r)
    step = (np.arange(5) + 0.5) / 5 - 0.5
    return np.mean([height(x + dx, y + dy) <= 0.0 for dx in step for dy in step], axis=0)


def images(height, r):
    """(image, its grain in pixels) of every kind."""
    mask, share = height(*grid(r)) <= 0.0, covered(height, r)
    yield from ((image, mask) for image in (mask, ~mask, 255 * mask.astype(np.uint8), 0.1 + 0.7 * mask, 1 - mask))
    yield from ((image, share) for image in (share, 1.0 - share, (255 * share).astype(np.uint8)))


@pytest.mark.parametrize("radii", [FEW_RADII, pytest.param(RADII, marks=pytest.mark.validate)], ids=["few", "many"])
@pytest.mark.parametrize("name", GRAINS)
def test_convex_grains_of_any_size_and_kind_of_image_are_accepted(name, radii):
    for r in radii[::3] if name != "disc" else radii:
        for image, grain in images(GRAINS[name](r), r):
            outline = outline_of_image(image)
            shape, misfit, placement = from_outline(outline)
            assert np.pi / 4 * placement.diameter**2 == pytest.approx(grain.sum(), rel=0.03)
            y, x = np.indices(grain.shape)
            centroid = np.array([np.sum(x * grain), np.sum(y * grain)]) / grain.sum()
            assert placement.centre == pytest.approx(centroid, abs=0.25)  # pixel
            inked = np.argwhere(grain > 0.5)[:, ::-1]
            ends = np.abs(
                [outline.min(axis=0) - inked.min(axis=0) + 0.5, outline.max(axis=0) - inked.max(axis=0) - 0.5]
            )
            assert ends.max() < 1.1  # pixel
            if name == "disc":
                assert shape.bounding_radius == pytest.approx(0.5, rel=0.04)


def test_a_level_is_followed_between_pixels():
    x, y = grid(20)
    for level in (8.0, 9.5, 12.25):
        outline = outline_of_image(np.hypot(x, y), level)
        assert np.linalg.norm(outline - 24.0, axis=1) == pytest.approx(level, abs=0.02)


def test_concave_grains_are_not_convex():
    x, y = grid(20)
    bean = (np.hypot(x, y) < 15.0) & (np.hypot(x - 14.0, y) > 7.0)
    with pytest.raises(InputError, match="not convex"):
        from_outline(outline_of_image(bean))
    _, _, placement = from_outline(outline_of_image(bean), hull=True)
    assert np.pi / 4 * placement.diameter**2 == pytest.approx(bean.sum(), rel=0.02)


def two_labels(apart):
    x, y = grid(20)
    labels = np.zeros(x.shape, int)
    labels[np.hypot(x + 8, y) < 8.0] = 3
    labels[np.hypot(x - 8 - apart, y) < 7.0] = 7
    return labels


@pytest.mark.parametrize("apart", [-2, 4])
def test_labels_are_refused_unless_one_is_chosen(apart):
    labels = two_labels(apart)
    with pytest.raises(InputError, match=r"2 values fill areas of their own \(3, 7\).*label=3 takes one"):
        outline_of_image(labels, 0.5)
    for label in (3, 7):
        placement = from_outline(outline_of_image(labels, label=label)).placement
        assert np.pi / 4 * placement.diameter**2 == pytest.approx((labels == label).sum(), rel=0.03)
    with pytest.raises(InputError, match="label = 5: no pixel has this value; values range from 0"):
        outline_of_image(labels, label=5)
    with pytest.raises(InputError, match="2 grains of .* pixels, must be one" if apart > 0 else "not convex"):
        from_outline(outline_of_image(labels > 0))


def test_the_largest_grain_is_taken_among_specks_and_never_replaces_another():
    x, y = grid(20)
    mask = np.hypot(x, y) < 9.0
    mask[0, :3] = mask[22:24, 40] = True  # specks
    mask[24, 24] = False  # a hole
    outline = outline_of_image(mask)
    assert outline.mean(axis=0) == pytest.approx([24.0, 24.0], abs=0.1)
    cut = (np.hypot(x - 20.0, y) < 9.0) | (np.hypot(x + 14.0, y) < 3.0)
    for image in (cut, 1.0 - np.clip(np.hypot(x - 20.0, y) - 8.5, 0.0, 1.0)):
        with pytest.raises(InputError, match="the grain touches the border"):
            outline_of_image(image if image.dtype != bool else np.hypot(x - 20.0, y) < 9.0)
        closed = outline_of_image(np.hypot(x - 20.0, y) < 9.0 if image.dtype == bool else image, border="close")
        assert closed[:, 0].max() == pytest.approx(48.5, abs=0.3)  # the edge of the last pixels
    with pytest.raises(InputError, match="2 grains of"):
        outline_of_image(cut)


def test_wrong_images_are_refused():
    for image in (np.zeros((2, 9)), np.zeros((9, 9, 3)), np.full((9, 9), np.nan)):
        with pytest.raises(InputError, match="image has shape"):
            outline_of_image(image)
    with pytest.raises(InputError, match=r"level = 5.0: no closed contour; values range from 0.0 to 0.0"):
        outline_of_image(np.zeros((9, 9)), 5.0)
    with pytest.raises(InputError, match="border = 'open'"):
        outline_of_image(np.eye(9), border="open")
    dot = np.zeros((9, 9))
    dot[4, 4] = 1.0
    with pytest.raises(InputError, match="too small"):
        outline_of_image(dot)


@settings(max_examples=60, deadline=None, derandomize=True, database=None)
@given(arrays.arrays(st.sampled_from([np.uint8, np.float64, bool]), st.tuples(*[st.integers(1, 9)] * 2)), st.booleans())
def test_any_image_gives_an_outline_or_a_reason(image, close):
    with suppress(InputError):
        outline = outline_of_image(image, border="close" if close else "refuse")
        assert outline.ndim == 2 and len(outline) >= 3 and np.all(np.isfinite(outline))
