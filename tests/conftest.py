"""Where the real recordings are, how examples are drawn, and figures without a screen."""

import os
import sys
from pathlib import Path

import matplotlib
import pytest
from hypothesis import settings

matplotlib.use("Agg")

# By default every run draws the same examples, on machines of any speed. With
# HYPOTHESIS_PROFILE=explore each run draws its own; what fails there becomes an @example.
settings.register_profile("repeatable", deadline=None, derandomize=True, database=None)
settings.register_profile("explore", deadline=None, derandomize=False, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

ROOT = Path(__file__).parents[1]


@pytest.fixture(autouse=True)
def closed_figures():
    """Close the figures of a test; pyplot warns of more than 20."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture(scope="session")
def cranfield_file():
    folder = Path(os.environ.get("EMACM_DATA", ROOT.parent / "shared" / "data"))
    files = sorted(folder.glob("cranfield_ema/*.npz"))
    if not files:
        pytest.skip("no recordings of the Cranfield actuator; set EMACM_DATA to their folder")
    return files[0]
