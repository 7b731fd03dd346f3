"""The inner loops, in two implementations: numba's where it is installed, NumPy's otherwise.

`numpy` is the reference; `numba` gives the same results in fewer passes over memory. Both have
four modules: `motion`, `resampling` and `spectra`, and `control` of the simulated bench. The
environment variable ``EMACM_KERNELS`` ("numpy" or "numba") selects one of them.
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

_chosen: ModuleType | None = None


def kernels() -> ModuleType:
    """Return the package of the inner loops; numba is imported at the first call."""
    global _chosen
    if _chosen is None:
        name = os.environ.get("EMACM_KERNELS") or ("numba" if find_spec("numba") else "numpy")
        _chosen = _imported(check_choice(name, "the environment variable EMACM_KERNELS", NAMES))
    return _chosen


def needs_compiler() -> bool:
    """Tell whether loops are compiled at their first call, as none are on the disk yet."""
    compiled = getattr(kernels().decimate, "stats", None)
    folder = None if compiled is None else compiled.cache_path
    return folder is not None and not any(Path(folder).glob("resampling.*.nbi"))


@contextmanager
def using(name: str) -> Iterator[None]:
    """Use the named kernels inside a with statement, in all threads."""
    global _chosen
    before, _chosen = _chosen, _imported(check_choice(name, "kernels", NAMES))
    try:
        yield
    finally:
        _chosen = before


def batches(
    n_signals: int, n_segments: int, n_bytes: int, at_most: int
) -> Iterator[tuple[slice, int, int]]:
    """Yield rows and segments, first and last + 1, that are processed together.

    Parameters
    ----------
    n_signals, n_segments : int
    n_bytes : int
        Size of a segment.
    at_most : int
        Bytes processed together, or a single segment if that is larger.

    Examples
    --------
    >>> list(batches(3, 5, 100, 700))
    [(slice(0, 3, None), 0, 2), (slice(0, 3, None), 2, 4), (slice(0, 3, None), 4, 5)]
    >>> list(batches(3, 1, 100, 200))
    [(slice(0, 2, None), 0, 1), (slice(2, 4, None), 0, 1)]
    """
    n_rows = min(n_signals, max(1, at_most // n_bytes))
    at_once = max(1, at_most // n_bytes // n_rows)
    for row in range(0, n_signals, n_rows):
        for start in range(0, n_segments, at_once):
            yield slice(row, row + n_rows), start, min(start + at_once, n_segments)


def _imported(name: str) -> ModuleType:
    try:
        return importlib.import_module(f"emacm._kernels.{name}")
    except ImportError as error:
        raise ImportError("the numba kernels need numba; install emacm[fast].") from error
