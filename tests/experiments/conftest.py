"""Layers of few shapes, for tests of what is computed before a run."""

import functools
import json

import pytest

import taichi_lsm as lsm
from workflows.gouge import initial_grains


@pytest.fixture(scope="module")
def few_shapes():
    """Layers of a few shapes, each made once: how many there are changes nothing in what is refused."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(initial_grains, "SHAPES", {2: 2, 3: 1})
        patch.setattr(initial_grains, "AGGREGATES", 1)
        makers = ("random_angular_shapes", "random_angular_polyhedra", "angular_aggregate", "polyhedral_aggregate")
        for name in makers:
            patch.setattr(lsm.shapes, name, remembered(getattr(lsm.shapes, name)))
        yield


def remembered(make):
    """As `make`, which is called once for equal arguments."""

    @functools.cache
    def cached(text):
        arguments, options = json.loads(text)
        return make(*arguments, **options)

    return lambda *arguments, made=None, **options: cached(json.dumps([arguments, options]))
