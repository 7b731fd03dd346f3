"""Modules of the reproduction are found by their folder: they are no part of the package."""

import re
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


@pytest.fixture(scope="session")
def figures_of():
    """Return a function: the numbers of the figures that a chapter draws, or names as not drawn."""

    def numbers(text):
        found = set()
        for first, last in re.findall(r"\d\.(\d+)(?:(?: to |-)\d\.(\d+))?", text):
            found |= set(range(int(first), int(last or first) + 1))
        return found

    def named(chapter):
        omitted = [text for text in chapter.remarks if text.startswith("Not drawn: ")]
        return numbers(" ".join(chapter.figures)), numbers(" ".join(omitted))

    return named
