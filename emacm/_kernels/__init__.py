"""Which inner loops are used: numba's where it is installed, NumPy's otherwise.

`numpy` is the reference; `numba` does the same in fewer passes over memory.
The environment variable ``EMACM_KERNELS`` ("numpy" or "numba") settles it beforehand.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from types import ModuleType

from emacm._checks import check_choice

NAMES = ("numpy", "numba")

_chosen: ModuleType | None = None


def kernels() -> ModuleType:
    """Return the module of the inner loops; numba is imported at the first call."""
    global _chosen
    if _chosen is None:
        name = os.environ.get("EMACM_KERNELS") or ("numba" if find_spec("numba") else "numpy")
        _chosen = _module(check_choice(name, "the environment variable EMACM_KERNELS", NAMES))
    return _chosen


@contextmanager
def using(name: str) -> Iterator[None]:
    """Use the named kernels inside a with statement, in all threads."""
    global _chosen
    before, _chosen = _chosen, _module(check_choice(name, "kernels", NAMES))
    try:
        yield
    finally:
        _chosen = before


def _module(name: str) -> ModuleType:
    try:
        return importlib.import_module(f"emacm._kernels.{name}")
    except ImportError as error:
        raise ImportError("the numba kernels need numba; install emacm[fast].") from error
