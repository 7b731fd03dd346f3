"""Digests of arrays, files and models."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Mapping
from functools import lru_cache
from hashlib import file_digest, sha256
from numbers import Number
from typing import Any

import numpy as np
from numpy.typing import NDArray


def content_digest(facts: str, arrays: Iterable[NDArray[Any]]) -> str:
    """Return the SHA-256 of arrays and of further facts.

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
    block = 1 << 20  # samples that are read at once, so that a long file takes no memory
    total = sha256(facts.encode("utf-8", "surrogatepass"))
    for array in arrays:
        digest = sha256(f"{array.dtype.str}{array.shape}".encode())
        for start in range(0, len(array), block):
            digest.update(np.ascontiguousarray(array[start : start + block]).data)
        total.update(digest.digest())
    return total.hexdigest()


def digest_of_file(path: str | os.PathLike[str]) -> str:
    """Return the SHA-256 of a file; it is read again if its size or time of writing changes.

    Raises
    ------
    OSError
        If the file cannot be read, or is none: a device or a pipe may have no end.
    """
    status = os.stat(path)
    if not stat.S_ISREG(status.st_mode):
        raise OSError(f"{os.fspath(path)!r} is not a file, but a folder or a device. Name a file.")
    return _digest_of_file(os.fspath(path), status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=100_000)
def _digest_of_file(path: str, size: int, written: int) -> str:
    with open(path, "rb") as file:
        return file_digest(file, "sha256").hexdigest()


_NO_RESULT = ("n_jobs", "memory", "verbose")  # parameters that change no result


def model_digest(model: Any) -> str:
    """Return the digest of the parameters and the fitted values of a model, or of several steps.

    Examples
    --------
    >>> from sklearn.naive_bayes import GaussianNB
    >>> X, y = [[0.0], [1.0], [5.0], [7.0]], [0, 0, 1, 1]
    >>> model_digest(GaussianNB().fit(X, y)) == model_digest(GaussianNB().fit(X, y))
    True
    >>> model_digest(GaussianNB().fit(X, y)) == model_digest(GaussianNB().fit(X, [0, 0, 0, 1]))
    False
    """
    return content_digest(repr(_facts(model)), [])


def _facts(value: Any) -> Any:
    """Return what a value consists of, equal for equal values; digests for arrays."""
    if isinstance(value, bool | str | None):
        return value
    if isinstance(value, Number):
        return complex(value)  # type: ignore[call-overload]
    if isinstance(value, Mapping):
        return sorted((repr(_facts(k)), _facts(v)) for k, v in value.items())
    if isinstance(value, list | tuple) or getattr(value, "dtype", None) == np.dtype(object):
        return [_facts(item) for item in value]
    if isinstance(value, np.ndarray):
        return content_digest("", [np.atleast_1d(value)])
    if hasattr(value, "__dict__") and not isinstance(value, type) and not callable(value):
        public = {n: v for n, v in vars(value).items() if n[0] != "_" and n not in _NO_RESULT}
        return type(value).__name__, _facts(public)
    return getattr(value, "__qualname__", type(value).__name__)
