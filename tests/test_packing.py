"""Start states: no overlap, no bias, and platens through which nothing falls."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from taichi_lsm.core.errors import InputError
from taichi_lsm.packing import grain_diameters, loose_packing, random_rotations, rough_platen


def closest(positions, radii, lengths):
    """Least surface distance of any two grains, over the periodic images in x (and z)."""
    apart = positions[:, None] - positions[None]
    for axis, length in zip((0, 2), lengths):
        apart[..., axis] -= length * np.round(apart[..., axis] / length)
    gap = np.linalg.norm(apart, axis=2) - radii[:, None] - radii
    return gap[~np.eye(len(radii), dtype=bool)].min()


def test_diameters():
    sizes = grain_diameters(np.random.default_rng(0), 20_000, 0.8, 1.2)
    assert sizes.shape == (20_000,)
    assert 0.8 <= sizes.min() < 0.801 and 1.199 < sizes.max() <= 1.2
    assert sizes.mean() == pytest.approx(1.0, abs=4 * 0.4 / np.sqrt(12 * 20_000))
    assert np.all(grain_diameters(np.random.default_rng(0), 5, 0.7, 0.7) == 0.7)
    for count, smallest, largest in ((-1, 1, 2), (3, 0, 1), (3, 2, 1), (3, 1, np.inf), (3, np.nan, 1)):
        with pytest.raises(InputError, match="must be"):
            grain_diameters(np.random.default_rng(0), count, smallest, largest)


@given(
    seed=st.integers(0, 10**6),
    count=st.integers(2, 80),
    dim=st.sampled_from([2, 3]),
    ratio=st.floats(1.0, 5.0),
    length=st.floats(2.0, 12.0),
    width=st.floats(2.0, 4.0),
)
@settings(max_examples=100, derandomize=True)
def test_loose_packing_has_no_overlap(seed, count, dim, ratio, length, width):
    rng = np.random.default_rng(seed)
    radii = rng.uniform(1.0, ratio, count)
    lengths = tuple(2 * radii.max() * share for share in (length, width)[: dim - 1])
    positions = loose_packing(rng, radii, lengths, dim)
    assert positions.shape == (count, dim)
    assert closest(positions, radii, lengths) > 0
    assert np.all(positions[:, 1] > radii)
    for axis, side in zip((0, 2), lengths):
        assert np.all((positions[:, axis] >= 0) & (positions[:, axis] < side))


@pytest.mark.parametrize(("dim", "lengths"), [(2, (20.0,)), (3, (12.0, 8.0))])
def test_loose_packing_is_filled_from_below_whatever_the_size(dim, lengths):
    rng = np.random.default_rng(1)
    radii = np.sort(rng.uniform(0.3, 0.5, 2000))
    positions = loose_packing(rng, radii, lengths, dim)
    assert abs(np.corrcoef(radii, positions[:, 1])[0, 1]) < 4 / np.sqrt(2000)
    assert abs(np.corrcoef(radii, positions[:, 0])[0, 1]) < 4 / np.sqrt(2000)
    per_row = np.prod([int(length / 1.1) for length in lengths])
    assert positions[:, 1].max() < 1.1 * (2000 / per_row + 2)  # no row is left out
    first = np.sum(positions[:, 1] < 1.1)
    assert first == per_row


def test_loose_packing_is_jittered_and_may_be_empty():
    rng = np.random.default_rng(2)
    positions = loose_packing(rng, np.full(300, 0.5), (11.0,), 2)
    assert len(np.unique(np.round(positions[:, 0], 12))) == 300
    assert np.std(positions[:, 0] % 1.1) > 0.02
    assert loose_packing(rng, [], (1.0,), 2).shape == (0, 2)


def test_loose_packing_refuses_what_does_not_fit():
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="at least twice the largest diameter, 4"):
        loose_packing(rng, [0.5, 1.0], (3.99,), 2)
    with pytest.raises(InputError, match="at least twice"):
        loose_packing(rng, [1.0], (10.0, 3.0), 3)
    with pytest.raises(InputError, match=r"\(Lx, Lz\) in 3D"):
        loose_packing(rng, [1.0], (10.0,), 3)
    with pytest.raises(InputError, match=r"\(Lx,\) in 2D"):
        loose_packing(rng, [1.0], (np.nan,), 2)
    with pytest.raises(InputError, match="dim = 4"):
        loose_packing(rng, [1.0], (10.0,), 4)
    with pytest.raises(InputError, match="bounding_radii"):
        loose_packing(rng, [1.0, -1.0], (10.0,), 2)


@pytest.mark.parametrize(("smallest", "largest"), [(1.0, 1.0), (0.8, 1.2), (0.3, 3.0)])
def test_platen_row_fills_the_length_and_lets_nothing_through(smallest, largest):
    mean = 0.5 * (smallest + largest)
    for seed in range(50):
        length = 17.3 * largest
        positions, sizes = rough_platen(np.random.default_rng(seed), smallest, largest, (length,), 2)
        assert sizes.sum() == pytest.approx(length, rel=1e-14)
        stretch = 1 + 0.5 * largest / (length - 0.5 * largest)
        assert smallest / stretch < sizes.min() and sizes.max() < largest * stretch
        step = np.diff(positions, axis=0, append=positions[:1] + np.array([length, 0.0]))
        assert step[:, 0] == pytest.approx(0.5 * (sizes + np.roll(sizes, -1)), rel=1e-10)
        gap = np.linalg.norm(step, axis=1) - 0.5 * (sizes + np.roll(sizes, -1))
        assert gap.max() < smallest
        assert 0.1 * mean < np.abs(positions[:, 1]).max() <= 0.25 * mean


def leaks(positions, sizes, lengths, grain):
    """Whether a sphere of diameter `grain` gets from above to below: a flood on a grid over 2 x 2 periods."""
    step = 0.06 * grain
    top = np.abs(positions[:, 1]).max() + sizes.max() + grain
    x, y, z = (np.arange(a, b, step) for a, b in ((0, 2 * lengths[0]), (-top, top), (0, 2 * lengths[1])))
    free = np.ones((x.size, y.size, z.size), dtype=bool)
    for position, size in zip(positions, sizes):
        reach = 0.5 * (size + grain)
        near = np.abs(y - position[1]) < reach
        dx, dz = (
            (axis - c + 0.5 * length) % length - 0.5 * length
            for axis, c, length in ((x, position[0], lengths[0]), (z, position[2], lengths[1]))
        )
        square = dx[:, None, None] ** 2 + (y[near] - position[1])[None, :, None] ** 2 + dz[None, None, :] ** 2
        free[:, near] &= square >= reach**2
    region, _ = ndimage.label(free)
    return np.intersect1d(region[:, 0], region[:, -1]).max(initial=0) > 0


@pytest.mark.parametrize(("smallest", "largest"), [(1.0, 1.0), (0.8, 1.2), (0.5, 1.5)])
def test_platen_of_spheres_lets_nothing_through(smallest, largest):
    lengths = (max(2.0 * largest, 2.6 * smallest), max(2.0 * largest, 3.4 * smallest))
    for seed in range(3):
        positions, sizes = rough_platen(np.random.default_rng(seed), smallest, largest, lengths, 3)
        assert not leaks(positions, sizes, lengths, smallest)
    apart = (positions - positions[0])[:, [0, 2]]
    apart -= lengths * np.round(apart / lengths)
    wide = np.linalg.norm(apart, axis=1) > 0.6 * (smallest + sizes)  # a hole that the flood has to find
    assert leaks(positions[wide], sizes[wide], lengths, smallest)


def test_platen_of_spheres_is_a_rough_near_square_lattice():
    lengths = (20.0, 11.0)
    positions, sizes = rough_platen(np.random.default_rng(3), 0.8, 1.2, lengths, 3)
    assert np.all((sizes >= 0.8) & (sizes <= 1.2)) and np.ptp(sizes) > 0.3
    for axis, length in zip((0, 2), lengths):
        columns = np.unique(np.round(positions[:, axis], 9))
        assert np.diff(columns, append=columns[0] + length) == pytest.approx(length / columns.size)
        assert 0.8 < length / columns.size <= 0.9
    assert np.abs(positions[:, 1]).max() <= 0.25 and positions[:, 1].std() == pytest.approx(0.5 / np.sqrt(12), rel=0.1)


def test_platens_refuse_what_does_not_fit():
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match=r"at least twice the largest diameter, 2.4"):
        rough_platen(rng, 0.8, 1.2, (2.3,), 2)
    with pytest.raises(InputError, match="smallest = 2"):
        rough_platen(rng, 2.0, 1.0, (20.0,), 2)
    with pytest.raises(InputError, match=r"\(Lx, Lz\)"):
        rough_platen(rng, 0.8, 1.2, (20.0,), 3)


def test_rotations_are_uniform():
    count = 40_000
    angle = random_rotations(np.random.default_rng(0), count, 2)
    assert angle.shape == (count,) and angle.min() >= 0 and angle.max() < 2 * np.pi
    assert np.abs(np.exp(1j * angle).mean()) < 4 / np.sqrt(count)
    assert np.abs(np.exp(2j * angle).mean()) < 4 / np.sqrt(count)
    q = random_rotations(np.random.default_rng(0), count, 3)
    assert q.shape == (count, 4)
    assert np.linalg.norm(q, axis=1) == pytest.approx(1.0, abs=1e-15)
    # w^2 of a uniform rotation has mean 1/4 and w^4 mean 1/8; uniform Euler angles fail the second
    assert q.T @ q / count == pytest.approx(np.eye(4) / 4, abs=5 * 0.25 / np.sqrt(count))
    assert np.mean(q**4, axis=0) == pytest.approx(np.full(4, 1 / 8), abs=5 * 0.15 / np.sqrt(count))
    with pytest.raises(InputError, match="dim = 1"):
        random_rotations(np.random.default_rng(0), 3, 1)
    with pytest.raises(InputError, match="count = -1"):
        random_rotations(np.random.default_rng(0), -1, 3)


def test_the_generator_decides():
    for make in (
        lambda rng: loose_packing(rng, np.ones(9), (9.0,), 2),
        lambda rng: rough_platen(rng, 1.0, 2.0, (9.0,), 2)[0],
        lambda rng: random_rotations(rng, 9, 3),
    ):
        a, b, c = (make(np.random.default_rng(seed)) for seed in (4, 4, 5))
        assert np.array_equal(a, b) and (a.shape != c.shape or not np.array_equal(a, c))
