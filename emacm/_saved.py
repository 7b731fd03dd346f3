"""Saved estimators contain the version of the package; loading another version warns."""

from __future__ import annotations

import warnings
from typing import Any

from sklearn.base import BaseEstimator

from emacm._version import __version__

_KEY = "_emacm_version"


class SavedEstimator(BaseEstimator):
    """Base class of the estimators: pickles contain the version of emacm.

    Loading under another version gives a UserWarning, as scikit-learn's
    `InconsistentVersionWarning` does for its own estimators: results may differ.
    """

    def __getstate__(self) -> dict[str, Any]:
        return {**super().__getstate__(), _KEY: __version__}

    def __setstate__(self, state: dict[str, Any]) -> None:
        state = dict(state)
        saved = state.pop(_KEY, "an unknown version")
        if saved != __version__:
            warnings.warn(
                f"{type(self).__name__} was saved by emacm {saved} and is loaded by emacm "
                f"{__version__}: its results may differ. Fit it again, or install the version "
                f"that saved it.",
                UserWarning,
                stacklevel=2,
            )
        super().__setstate__(state)
