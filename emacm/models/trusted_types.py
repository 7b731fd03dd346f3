"""Types that a model file may contain: those that hold numbers and settings, and no functions."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import is_dataclass
from typing import Any

from sklearn.base import BaseEstimator

_SUBPACKAGES = {
    "conditions",
    "decisions",
    "machine",
    "monitoring",
    "orders",
    "recordings",
    "resampling",
    "stroke_features",
}
_OTHERS = {
    "emacm.machine.lines.LineLevels",
    "scipy.sparse._csr.csr_array",
    "scipy.sparse._csr.csr_matrix",
    "sklearn.metrics._scorer._PassthroughScorer",
    "sklearn.model_selection._split.GroupKFold",
    "sklearn.model_selection._split.KFold",
    "sklearn.model_selection._split.LeaveOneGroupOut",
    "sklearn.model_selection._split.StratifiedKFold",
    "sklearn.utils._bunch.Bunch",
    "sklearn.utils._metadata_requests.MetadataRequest",
    "sklearn.utils._metadata_requests.MethodMetadataRequest",
}


def check_types(names: Sequence[str]) -> None:
    """Raise a TypeError if a model file must not contain one of the types.

    Parameters
    ----------
    names : sequence of str
        Full names of types that skops does not trust by itself.

    Raises
    ------
    TypeError
        The message names the types.
    """
    foreign = [name for name in names if name not in _OTHERS and not _is_ours(name)]
    if foreign:
        raise TypeError(
            f"the model contains types that a model file must not hold: {', '.join(foreign)}. Use "
            f"steps of emacm and scikit-learn, and functions of NumPy or SciPy, only; or "
            f"joblib.dump, whose files execute code."
        )


def _is_ours(name: str) -> bool:
    """Tell whether this is an estimator of emacm, or one of its classes that only hold values."""
    module, _, short = name.rpartition(".")
    parts = module.split(".")
    if len(parts) != 3 or parts[0] != "emacm" or parts[1] not in _SUBPACKAGES:
        return False
    if parts[2].startswith("__") or short.startswith("__"):
        return False
    try:
        found: Any = getattr(importlib.import_module(module), short, None)
    except ImportError:
        return False
    if not isinstance(found, type) or found.__module__ != module:
        return False
    holds_values = is_dataclass(found) or (issubclass(found, tuple) and hasattr(found, "_fields"))
    return issubclass(found, BaseEstimator) or holds_values
