"""The nearest image, and boxes too small to have one."""

import numpy as np
import pytest

import taichi_lsm as lsm
from taichi_lsm.boundaries.periodic_cell import Domain, check_box
from taichi_lsm.core.runtime import ti

COUNT = 2000


@ti.data_oriented
class Images:
    """Displacements of COUNT pairs in one launch."""

    def __init__(self, domain):
        self.domain = domain
        self.x_k, self.x_l, self.d = (ti.Vector.field(domain.dim, ti.f64, COUNT) for _ in range(3))

    @ti.kernel
    def measure(self):
        for c in range(COUNT):
            self.d[c] = self.domain.displacement(self.x_k[c], self.x_l[c])


@pytest.mark.parametrize(
    ("lengths", "periodic"), [((3.0, np.inf), (True, False)), ((3.0, 5.0, 0.7), (True, True, False))]
)
def test_displacement_goes_to_the_nearest_image(runtime, lengths, periodic):
    rng = np.random.default_rng(0)
    images = Images(Domain(lengths, periodic))
    x_k, x_l = (rng.uniform(-40, 40, (COUNT, len(lengths))) for _ in range(2))
    images.x_k.from_numpy(x_k)
    images.x_l.from_numpy(x_l)
    images.measure()
    d, plain = images.d.to_numpy(), x_l - x_k
    for axis, (length, repeats) in enumerate(zip(lengths, periodic)):
        if repeats:
            lengths_away = (plain[:, axis] - d[:, axis]) / length
            assert lengths_away == pytest.approx(np.round(lengths_away), abs=1e-13)
            assert np.abs(lengths_away).max() > 5
            assert np.abs(d[:, axis]).max() <= 0.5 * length * (1 + 1e-12)
        else:
            assert np.array_equal(d[:, axis], plain[:, axis])


def test_displacement_is_odd_but_on_the_border(runtime):
    """k to l is minus l to k, so that pairs may be evaluated from either side."""
    rng = np.random.default_rng(1)
    images = Images(Domain((2.0, 2.0), (True, True)))
    x = rng.uniform(-9, 9, (2, COUNT, 2))
    found = []
    for first, second in ((0, 1), (1, 0)):
        images.x_k.from_numpy(x[first])
        images.x_l.from_numpy(x[second])
        images.measure()
        found.append(images.d.to_numpy())
    assert np.array_equal(found[0], -found[1])


def test_boxes_in_which_a_grain_could_meet_itself_are_refused():
    check_box((2.2, np.inf), (True, False), 1.0, 0.1)
    for length in (2.1999, np.inf, np.nan):
        with pytest.raises(lsm.InputError, match=r"box axis y: length .* must be >= 2.2 m"):
            check_box((9.0, length), (True, True), 1.0, 0.1)
