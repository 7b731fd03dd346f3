"""Where the real recordings are, how examples are drawn, and figures without a screen."""

import gc
import os
import shutil
import sys
from pathlib import Path

# Before NumPy is imported: several workers of several threads each would wait for one another,
# and take more than twice the processor time.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

os.environ.setdefault("MPLBACKEND", "Agg")

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

# By default every run draws the same examples, on machines of any speed. With
# HYPOTHESIS_PROFILE=explore each run draws its own, and twice as many; what fails there becomes
# an @example.
settings.register_profile(
    "repeatable", deadline=None, derandomize=True, database=None, max_examples=25
)
settings.register_profile(
    "explore", deadline=None, derandomize=False, print_blob=True, max_examples=50
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

ROOT = Path(__file__).parents[1]
collect_ignore = ["typed_example.py"]  # a program: it would run when examples are looked for


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collect tests, all of which stay, without the garbage collector."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def pytest_collection_modifyitems(items):
    """Begin with the longest tests, so that no worker waits for them at the end.

    Those of the thesis first: later, another worker would take some, and compute it again.
    """
    longest = ["thesis", "test_site.py", "test_notebooks.py"]
    rank = {name: number for number, name in enumerate(longest)}
    items.sort(key=lambda i: min(rank.get(name, 3) for name in (i.path.name, i.path.parent.name)))


@pytest.fixture(autouse=True)
def closed_figures():
    """Close the figures of a test; pyplot warns of more than 20."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture
def here(bench, tmp_path, monkeypatch):
    """Stand in a copy of the folder that the fixture `bench` of a module has written."""
    monkeypatch.chdir(shutil.copytree(bench, tmp_path / "here"))
    return tmp_path / "here"


@pytest.fixture(scope="session")
def cranfield_file():
    folder = Path(os.environ.get("EMACM_DATA", ROOT.parent / "shared" / "data"))
    files = sorted(folder.glob("cranfield_ema/*.npz"))
    if not files:
        pytest.skip("no recordings of the Cranfield actuator; set EMACM_DATA to their folder")
    return files[0]
