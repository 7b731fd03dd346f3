"""The fleet of two loads, without which there is no condition to learn."""

import pytest
from strokes_under_load import made_fleet


@pytest.fixture(scope="session")
def loaded_fleet():
    return made_fleet()
