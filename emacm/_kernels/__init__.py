"""The inner loops, in two implementations: numba's where it is installed, NumPy's otherwise.

`numpy` is the reference; `numba` gives the same results in fewer passes over memory. The
environment variable ``EMACM_KERNELS`` ("numpy" or "numba") selects one of them, which is `loops`.
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

loops: ModuleType  # to be read as an attribute of this package, as `using` sets it


def __getattr__(name: str) -> ModuleType:
    """Choose `loops` when they are first read, as numba takes a second to import."""
    global loops
    if name != "loops":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    chosen = os.environ.get("EMACM_KERNELS") or ("numba" if find_spec("numba") else "numpy")
    loops = _imported(chosen, "the environment variable EMACM_KERNELS")
    return loops


@contextmanager
def using(name: str) -> Iterator[None]:
    """Use the named kernels inside a with statement, in all threads."""
    global loops
    before = globals().get("loops") or __getattr__("loops")
    loops = _imported(name, "kernels")
    try:
        yield
    finally:
        loops = before


def _imported(name: str, role: str) -> ModuleType:
    try:
        return importlib.import_module(f"emacm._kernels.{check_choice(name, role, NAMES)}")
    except ImportError as error:
        raise ImportError("the numba kernels need numba; install emacm[fast].") from error
