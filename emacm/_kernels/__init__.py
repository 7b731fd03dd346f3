"""The inner loops, in two implementations: numba's where it is installed, NumPy's otherwise.

`numpy` is the reference; `numba` gives the same results in fewer passes over memory. Both have
four modules: `motion`, `resampling` and `spectra`, and `control` of the simulated bench. The
environment variable ``EMACM_KERNELS`` ("numpy" or "numba") selects one of them, which is `loops`.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from emacm._checks import check_choice

NAMES = ("numpy", "numba")

loops: ModuleType  # to be read as an attribute of this package, as `using` sets it


def __getattr__(name: str) -> ModuleType:
    """Choose `loops` when they are first read, as numba takes a second to import."""
    if name != "loops":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    chosen = os.environ.get("EMACM_KERNELS") or ("numba" if find_spec("numba") else "numpy")
    _use(_imported(check_choice(chosen, "the environment variable EMACM_KERNELS", NAMES)))
    return loops


def _use(package: ModuleType) -> None:
    global loops
    loops = package


def needs_compiler() -> bool:
    """Tell whether loops are compiled at their first call, as none are on the disk yet."""
    package = globals().get("loops") or __getattr__("loops")
    compiled = getattr(package.decimate, "stats", None)
    folder = None if compiled is None else compiled.cache_path
    return folder is not None and not any(Path(folder).glob("resampling.*.nbi"))


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
