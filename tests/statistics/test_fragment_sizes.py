"""The fractal dimension of fragments: exact samples, its error by drawn ones, and how often its interval holds."""

import math

import numpy as np
import pytest

from taichi_lsm.core.errors import InputError
from taichi_lsm.statistics import fragment_dimension, share_below
from workflows.plots.fragments import UNLIKELY

LEAST, LARGEST = 2e-5, 1.5e-4


def sizes(dimension, chance, largest=LARGEST):
    """Sizes below which these shares of a power law lie, the inverse of `share_below`."""
    length = math.log(largest / LEAST)
    if dimension == 0.0:
        return LEAST * np.exp(chance * length)
    return LEAST * (1.0 + chance * math.expm1(-dimension * length)) ** (-1.0 / dimension)


@pytest.mark.parametrize("dimension", [-1.0, 0.0, 1e-5, 0.8, 2.58, 6.0])
def test_evenly_spaced_shares_give_their_dimension_and_the_variance_of_its_mean(dimension):
    """No noise is left: the middle of 200 000 equal shares each. The error is that by quadrature of (ln d)^2."""
    chance = (np.arange(200_000) + 0.5) / 200_000
    drawn = sizes(dimension, chance)
    assert share_below(drawn, dimension, LEAST, LARGEST) == pytest.approx(chance, abs=1e-9)
    found = fragment_dimension(drawn, LEAST, LARGEST)
    assert found.dimension.mean == pytest.approx(dimension, abs=1e-5)
    assert found.dimension.standard_error == pytest.approx(1.0 / np.sqrt(200_000 * np.var(np.log(drawn))), rel=1e-4)
    assert found.fragments == 200_000 and found.distance < 1e-4


def test_fragments_outside_of_the_range_do_not_count():
    inside = sizes(1.5, np.random.default_rng(3).random(200))
    others = np.array([0.5 * LEAST, 0.99 * LEAST, 1.01 * LARGEST])
    assert fragment_dimension(np.concatenate([others, inside]), LEAST, LARGEST) == fragment_dimension(
        inside, LEAST, LARGEST
    )


def test_sizes_of_no_power_law_have_a_large_distance():
    lumps = np.repeat([1.2 * LEAST, 0.9 * LARGEST], 100)
    assert fragment_dimension(lumps, LEAST, LARGEST).distance > 1.1 / math.sqrt(200)


def test_the_limit_of_the_distance_is_that_of_a_fitted_law():
    """A steep law on a long range, of which it is exceeded most often: 1.36, for a known law, by 0.4 % of the sets."""
    rng, count = np.random.default_rng(4), 100
    distance = [
        fragment_dimension(sizes(6.0, rng.random(count), 10.0 * LEAST), LEAST, 10.0 * LEAST).distance
        for _ in range(600)
    ]
    assert 0.02 < np.mean(np.array(distance) > UNLIKELY / math.sqrt(count)) < 0.08


def test_few_fragments_have_no_error_and_none_no_dimension():
    few = fragment_dimension(sizes(1.5, np.linspace(0.1, 0.9, 19)), LEAST, LARGEST)
    assert math.isnan(few.dimension.standard_error) and "19 fragments between" in few.dimension.unknown
    for wrong, text in (
        (([3e-5], LEAST, LARGEST), "1 lie between"),
        (([LEAST, LEAST], LEAST, LARGEST), "not all at one end"),
        (([3e-5] * 3, LARGEST, LEAST), "must be below largest"),
        (([3e-5] * 3, 0.0, LARGEST), "least: 0.0, must be"),
    ):
        with pytest.raises(InputError, match=text):
            fragment_dimension(*wrong)


def covered(dimension, ratio, count, sets):
    """Share of the intervals of so many synthetic sets that hold the dimension."""
    rng, hits = np.random.default_rng(round(100 * dimension) + count), 0
    for _ in range(sets):
        drawn = sizes(dimension, rng.random(count), ratio * LEAST)
        found = fragment_dimension(drawn, LEAST, ratio * LEAST).dimension
        hits += abs(found.mean - dimension) <= found.half_width
    return hits / sets


@pytest.mark.validate
@pytest.mark.parametrize("ratio", [2.0, 10.0])
@pytest.mark.parametrize("count", [30, 300])
def test_intervals_hold_the_dimension_of_synthetic_fragments(ratio, count):
    """2000 sets each, of which the share that is covered is known to 0.5 %."""
    for dimension in (0.0, 1.6, 2.58):
        share = covered(dimension, ratio, count, 2000)
        print(f"D = {dimension}, d_max/d_min = {ratio:g}, {count} fragments: {100 * share:.1f} % of 2000 sets covered")
        assert share == pytest.approx(0.95, abs=0.03)
