"""Where the real recordings are, and how pictures are drawn without a screen."""

import os
from pathlib import Path

import matplotlib
import pytest

matplotlib.use("Agg")

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="session")
def cranfield_file():
    folder = Path(os.environ.get("EMACM_DATA", ROOT.parent / "shared" / "data"))
    files = sorted(folder.glob("cranfield_ema/*.npz"))
    if not files:
        pytest.skip("no recordings of the Cranfield actuator; set EMACM_DATA to their folder")
    return files[0]
