"""The digest of a fitted model."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Number
from typing import Any

import numpy as np

from emacm.recordings.digests import content_digest

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
