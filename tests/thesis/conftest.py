"""Modules of the reproduction are found by their folder: they are no part of the package."""

import sys
from functools import lru_cache
from importlib import import_module
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks" / "thesis"))


@pytest.fixture(scope="session")
def quick_chapter():
    """Return a function that reproduces a chapter once: the chapter, and its lines of progress."""

    @lru_cache
    def reproduced(number):
        function, said = getattr(import_module(name := f"chapter{number}"), f"reproduce_{name}"), []
        return function(quick=True, report=said.append), said

    return reproduced
