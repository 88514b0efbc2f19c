"""The experiment `noisy-run` as a plugin."""

import shutil
from pathlib import Path

import pytest


@pytest.fixture
def noisy(plugins):
    """The folder of the plugins with noisy_run.py in it."""
    shutil.copy(Path(__file__).with_name("noisy_run.py"), plugins)
    return plugins
