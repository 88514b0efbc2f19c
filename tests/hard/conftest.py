"""What all hard cases run on."""

import pytest

from tests.helpers.scenes import PRECISION
from workflows.hard import Bench


@pytest.fixture(scope="module")
def bench(runtime):
    """One for the cases of a file: scenes of equal make-up share a simulation."""
    return Bench(PRECISION)
