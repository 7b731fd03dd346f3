"""What tells one content from another, whether it lies in memory or in a file.

SHA-256 stands for the content: with the instructions that processors have for
it, it runs within a few percent of SHA-1 and twice as fast as BLAKE2, and nobody
knows two contents that it takes for one.
"""

from __future__ import annotations

import mmap
import os
import time
from collections.abc import Iterable
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray

Stamps = tuple[tuple[str, int, int, int], ...]

_BLOCK = 1 << 20  # samples, so that the digest of a long file takes no memory
_SETTLED = 2.0  # s; what is written later has another time stamp on any file system


def content_digest(facts: str, arrays: Iterable[NDArray[Any]]) -> str:
    """Return the digest of arrays and of what else is to be told apart.

    Parameters
    ----------
    facts : str
        Names, rates and the like.
    arrays : iterable of ndarray
        Their dtypes, shapes and values count; how they lie in memory does not.

    Returns
    -------
    str
        64 hexadecimal digits.

    Examples
    --------
    >>> import numpy as np
    >>> square = np.arange(4.0).reshape(2, 2)
    >>> content_digest("", [square]) == content_digest("", [np.asfortranarray(square)])
    True
    >>> content_digest("", [square]) == content_digest("", [square.astype(np.float32)])
    False
    """
    total = sha256(facts.encode("utf-8", "surrogatepass"))
    for array in arrays:
        part = sha256(f"{array.dtype.str}{array.shape}".encode())
        for start in range(0, len(array), _BLOCK):
            part.update(np.ascontiguousarray(array[start : start + _BLOCK]).data)
        total.update(part.digest())
    return total.hexdigest()


def file_stamps(arrays: Iterable[NDArray[Any]]) -> Stamps | None:
    """Tell where in which files arrays lie, and when these files were last written.

    As long as the answer stays the same, so does the content.

    Parameters
    ----------
    arrays : iterable of ndarray
        Arrays, some of them perhaps memory maps or views of such.

    Returns
    -------
    tuple of (name, offset [bytes], mtime [ns], size [bytes]), or None
        Empty if all arrays lie in memory. None if nothing can be told: a file
        was written so lately that its time stamp may not change once more, is
        gone, or is not known.
    """
    stamps = []
    for array in arrays:
        owner = _mapped_owner(array)
        if owner is None:
            continue
        name = getattr(owner, "filename", None)
        try:
            status = os.stat(name) if name else None
        except OSError:
            status = None
        if status is None or time.time() - status.st_mtime < _SETTLED:
            return None
        offset = owner.offset + _address(array) - _address(owner)
        stamps.append((str(name), offset, status.st_mtime_ns, status.st_size))
    return tuple(stamps)


def _mapped_owner(array: Any) -> Any:
    """Return the memory map that an array is a view of, or None if it lies in memory."""
    owner = None
    while isinstance(array, np.ndarray):
        owner, array = array, array.base
    return owner if isinstance(array, mmap.mmap | memoryview) and _maps(array) else None


def _address(array: NDArray[Any]) -> int:
    return int(array.__array_interface__["data"][0])


def _maps(buffer: Any) -> bool:
    """Tell whether a buffer is a mapped file."""
    return isinstance(getattr(buffer, "obj", buffer), mmap.mmap)
