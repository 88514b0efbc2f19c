"""What all hard cases run on."""

import pytest

from tests.helpers import scenes
from workflows.hard import Bench


@pytest.fixture(scope="module")
def bench(runtime):
    """One for the cases of a file: scenes of equal KernelSpec share a simulation."""
    return Bench(scenes.PRECISION)
