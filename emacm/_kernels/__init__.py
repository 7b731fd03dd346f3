"""The inner loops, in two implementations: numba's where it is installed, NumPy's otherwise.

`numpy` is the reference; `numba` gives the same results in fewer passes over memory. The
environment variable ``EMACM_KERNELS`` ("numpy" or "numba") selects one of them, which is `loops`.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from types import ModuleType

from emacm._checks import check_choice

NAMES = ("numpy", "numba")

loops: ModuleType  # to be read as an attribute of this package, as `using` sets it


@dataclass(frozen=True)
class BlockSizes:
    """How much is processed at a time; chosen by ``python benchmarks/pipeline.py``.

    The defaults are those of the compiled loops, which hold little besides their input.

    Attributes
    ----------
    spread, interpolated : int
        Time samples that are spread or interpolated; with fewer, threads wait for one another.
    weights : int
        Samples whose weights are held, which should stay in the first cache.
    segment_bytes : int
        Bytes of the segments that are transformed, which should stay in the second cache.
    """

    spread: int = 1 << 18
    interpolated: int = 1 << 17
    weights: int = 2048
    segment_bytes: int = 1 << 20


def __getattr__(name: str) -> ModuleType:
    """Choose `loops` when they are first read, as numba takes a second to import."""
    if name != "loops":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    chosen = os.environ.get("EMACM_KERNELS") or ("numba" if find_spec("numba") else "numpy")
    _use(_imported(check_choice(chosen, "the environment variable EMACM_KERNELS", NAMES)))
    return loops


def _use(module: ModuleType) -> None:
    global loops
    loops = module


@contextmanager
def using(name: str) -> Iterator[None]:
    """Use the named kernels inside a with statement, in all threads."""
    before = globals().get("loops")
    _use(_imported(check_choice(name, "kernels", NAMES)))
    try:
        yield
    finally:
        if before is None:  # to be chosen when they are read
            del globals()["loops"]
        else:
            _use(before)


def _imported(name: str) -> ModuleType:
    try:
        return importlib.import_module(f"emacm._kernels.{name}")
    except ImportError as error:
        raise ImportError("the numba kernels need numba; install emacm[fast].") from error
