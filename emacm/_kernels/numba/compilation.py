"""How the loops are compiled."""

from __future__ import annotations

from typing import Any

from numba import njit

_ANY_ORDER = {"reassoc", "contract", "nsz", "arcp"}  # of sums, which changes results by 1e-15


def compiled(function: Any) -> Any:
    """Compile at the first call, without Python's lock; sums may be reordered."""
    return _compile(function, fastmath=_ANY_ORDER)


def compiled_exactly(function: Any) -> Any:
    """Compile at the first call, without Python's lock; every sum keeps its order."""
    return _compile(function)


def _compile(function: Any, **options: Any) -> Any:
    """Cache the compiled code on disk where that is possible."""
    try:
        return njit(cache=True, nogil=True, **options)(function)
    except RuntimeError:  # neither the folder of the package nor that of the user can be written to
        return njit(nogil=True, **options)(function)
