"""Calibration of any classifier on left-out groups, by fitting it again without each of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.utils.validation import has_fit_parameter

from emacm._checks import located
from emacm.decisions.left_out_calibration import LeftOutCalibration
from emacm.decisions.tails import StudentTail, student_tail
from emacm.decisions.temperature import fit_temperature
from emacm.decisions.typicality import LEAST
from emacm.recordings.meta import chosen_rows

Array = NDArray[np.float64]

_MAX_PARTS = 10  # parts that are left out in turn, if no groups are given
_LEAST_LOG = np.log(1e-15)  # of a posterior probability, as some classifiers return 0


@dataclass(frozen=True)
class DetectorTypicality:
    """Typicality from the scores of an outlier detector.

    Attributes
    ----------
    detector : estimator
        Fitted, with `score_samples`: the larger, the more like the training.
    tail : StudentTail
        Distribution of the negative scores of left-out recordings.
    """

    detector: Any
    tail: StudentTail

    def __call__(self, X: Any) -> Array:
        """Return the typicality of recordings, in (0, 1], shape (n_recordings,)."""
        scores = -np.asarray(self.detector.score_samples(X), dtype=np.float64)
        return np.maximum(self.tail.survival(scores), LEAST)


@dataclass(frozen=True)
class Refits:
    """Recordings, and how to fit without some of them.

    Attributes
    ----------
    X : list of Recording, or table
        Recordings.
    codes, groups : ndarray of int, shape (n_recordings,)
        Number of the class, and of the group, of each recording.
    weight : ndarray of shape (n_recordings,)
        Number of times each recording is counted.
    log_likelihoods : callable
        ``log_likelihoods(others, rows)`` fits the classifier to some recordings and returns the
        logarithms of posterior over prior of others, shape (n_rows, n_classes of the others).
    """

    X: Any
    codes: NDArray[np.intp]
    groups: NDArray[np.intp]
    weight: Array
    log_likelihoods: Callable[[NDArray[np.intp], NDArray[np.intp]], Array]

    def calibrate(self, detector: Any, *, temperature: bool) -> LeftOutCalibration:
        """Leave out each group in turn.

        Parameters
        ----------
        detector : estimator or None
            Outlier detector that is not fitted yet.
        temperature : bool
            Whether to determine the temperature.

        Returns
        -------
        LeftOutCalibration

        Raises
        ------
        ValueError
            If no class has recordings in two groups.
        """
        n_classes = int(self.codes.max()) + 1
        logs = np.full((len(self.codes), n_classes), -np.inf)
        scores, judged = np.empty(len(self.codes)), np.zeros(len(self.codes), dtype=bool)
        counted = self.weight > 0
        for group in np.unique(self.groups):
            rows = np.flatnonzero((self.groups == group) & counted)
            others = np.flatnonzero((self.groups != group) & counted)
            seen = np.bincount(self.codes[others], minlength=n_classes) > 0
            if not len(rows) or np.count_nonzero(seen) < min(2, n_classes):
                continue
            judged[rows] = seen[self.codes[rows]]
            if temperature:
                logs[np.ix_(rows, seen)] = self.log_likelihoods(others, rows)
            if detector is not None:
                fitted = self._detector(detector, others)
                scores[rows] = -fitted.score_samples(chosen_rows(self.X, rows))
        if not judged.any():
            raise ValueError(
                "no class has recordings in two groups, so that no recording can be judged by "
                "others of its class. Give groups= with at least two groups in one class."
            )
        weight, typicality, best = self.weight[judged], None, None
        if detector is not None:
            tail = student_tail(scores[judged], weight)
            typicality = DetectorTypicality(self._detector(detector, np.flatnonzero(counted)), tail)
        if temperature:
            counts = np.bincount(self.codes, self.weight, n_classes)
            best = fit_temperature(logs[judged], self.codes[judged], weight, counts / counts.sum())
        return LeftOutCalibration(typicality, best)

    def _detector(self, detector: Any, rows: NDArray[np.intp]) -> Any:
        """Fit the detector to some recordings, with their weights if it accepts weights."""
        weighted = has_fit_parameter(detector, "sample_weight") and (self.weight != 1).any()
        options = {"sample_weight": self.weight[rows]} if weighted else {}
        with located("detector (its input is that of the estimator: recordings need a pipeline)"):
            return clone(detector).fit(chosen_rows(self.X, rows), **options)


def parts_of(codes: NDArray[np.intp]) -> NDArray[np.intp]:
    """Divide the recordings of each class among ten parts, in their order.

    Examples
    --------
    >>> parts_of(np.array([0, 1, 0, 0]))
    array([0, 3, 1, 2])
    """
    parts = np.empty(len(codes), dtype=np.intp)
    parts[np.argsort(codes, kind="stable")] = np.arange(len(codes)) % _MAX_PARTS
    return parts


def log_likelihoods(log_posterior: Array, priors: Array) -> Array:
    """Divide posteriors by the priors within them, but for a constant of each recording.

    Parameters
    ----------
    log_posterior : ndarray of shape (n_recordings, n_classes)
        Values below the logarithm of 1e-15 are raised to it.
    priors : ndarray of shape (n_classes,)
        Prior within the posterior; the result for a class of prior 0 is -inf.

    Returns
    -------
    ndarray of shape (n_recordings, n_classes)
    """
    with np.errstate(divide="ignore"):
        logs = np.maximum(log_posterior, _LEAST_LOG) - np.log(priors)
    return np.where(priors > 0, logs, -np.inf)


def parameters_of_rows(
    parameters: Mapping[str, Any], rows: NDArray[np.intp], n_recordings: int
) -> dict[str, Any]:
    """Take rows of those arguments of `fit` that have one entry for each recording.

    Examples
    --------
    >>> parameters_of_rows({"sample_weight": [1, 2, 3], "classes": ["a", "b"]}, np.array([2]), 3)
    {'sample_weight': [3], 'classes': ['a', 'b']}
    """
    some = {}
    for name, given in parameters.items():
        value = as_rows(given)
        per_recording = not isinstance(value, str) and hasattr(value, "__len__")
        if per_recording and len(value) == n_recordings:
            value = chosen_rows(value, rows)
        some[name] = value
    return some


def as_rows(values: Any) -> Any:
    """Convert objects that are only convertible to arrays; return all others unchanged.

    Examples
    --------
    >>> as_rows("any"), as_rows([1, 2])
    ('any', [1, 2])
    """
    only = hasattr(values, "__array__") and not hasattr(values, "iloc")
    return np.asarray(values) if only else values
