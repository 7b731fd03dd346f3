"""Modules of the reproduction are found by their folder: they are no part of the package."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks" / "thesis"))
