"""Calibration on left-out groups: typicality, and the temperature of posteriors."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.special import softmax
from sklearn.exceptions import NotFittedError
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_choice, check_number, group_codes
from emacm._statements import warn
from emacm.calibration.left_out import (
    Array,
    Indices,
    check_judged,
    fit_temperature,
    left_out,
    single_recordings,
)
from emacm.decisions.risks import LeastRiskMixin
from emacm.decisions.typicality import Typicality, fit_typicality


def check_temperature(temperature: Any) -> None:
    """Raise if a temperature is neither None, "groups" nor a positive number."""
    if isinstance(temperature, str):
        check_choice(temperature, "temperature as a word", ("groups",))
    elif temperature is not None:
        check_number(temperature, 'temperature, if not None or "groups",', above=0)


class LeftOut(NamedTuple):
    """Training recordings, judged by classifiers that were fitted without their groups.

    Only those of classes of which others remained.

    Attributes
    ----------
    typicality : ndarray of shape (n_recordings,)
        Of each recording.
    log_densities : ndarray of shape (n_recordings, n_classes)
        -inf for classes of which no other recordings remain.
    codes, units : ndarray of int, shape (n_recordings,)
        Number of the true class, and of the group.
    """

    typicality: Array
    log_densities: Array
    codes: Indices
    units: Indices


class LeftOutMixin(LeastRiskMixin):
    """Typicality, unknown state and temperature, found by leaving out each group in turn.

    The results are None before anything was left out, and what is not needed.
    """

    class_count_: Array
    unknown_rate: Any
    temperature: Any
    _typicality: Typicality | None = None
    _temperature: float | None = None
    _left_out: LeftOut | None = None
    _checked_features: Any
    # (X, codes, units, weight, X_left): log densities of left-out recordings under classes fitted
    # to the others, shape (n_left, n_classes); -inf for classes of which too few others remain.
    _densities_without: Any

    @property
    def temperature_(self) -> float:
        """Temperature of the densities in effect."""
        check_temperature(self.temperature)  # it may have been set after `fit`
        if isinstance(self.temperature, str):
            return self._calibrated("temperature")
        return 1.0 if self.temperature is None else float(self.temperature)

    @property
    def unknown_limit_(self):
        """Typicality up to which the unknown state is the most probable one; None without a rate.

        Below `unknown_rate` by one standard error of the mean over the groups that were left out:
        the shares of untypical recordings in single groups scatter about as much as their mean
        (0.8 times, at 5 % on the runs 1 to 4 of the Cranfield actuator).
        """
        if self.unknown_rate is None:
            return None
        n_groups = len(np.unique(self._calibrated("left_out").units)) or 1
        return self.unknown_rate / (1 + n_groups**-0.5)

    @property
    def distances_(self) -> Any:
        """The `ClassDistances` that `typicality` is based on."""
        return self._calibrated("typicality").distances

    @property
    def feature_range_(self) -> Array:
        """Smallest and largest training value of each feature, shape (2, n_features)."""
        return self._calibrated("typicality").feature_range

    def _leave_out(self, X: Array, codes: Indices, groups: Any, weight: Array) -> None:
        """Set what is found by leaving each group out; without groups, single recordings."""
        rows = np.flatnonzero(weight > 0)
        if groups is None:
            warn(
                "groups",
                f"fit was called without groups, so single recordings are left out. Those that "
                f"were measured together (one unit, one run) make the model over-confident: give "
                f"their labels, in a pipeline as {type(self).__name__.lower()}__groups=units.",
                stacklevel=3,
            )
            units = single_recordings(codes[rows], X[rows])
        else:
            units = group_codes(groups, len(codes))[rows]
        X, codes, weight = X[rows], codes[rows], weight[rows]
        self._typicality = fit_typicality(X, codes, units, weight)
        logs = np.full((len(rows), len(self.classes_)), -np.inf)
        for others, left in left_out(codes, units):
            logs[left] = self._densities_without(
                X[others], codes[others], units[others], weight[others], X[left]
            )
        judged = np.isfinite(logs[np.arange(len(codes)), codes])
        columns = self._typicality.left_out, logs, codes, units
        self._left_out = LeftOut(*(column[judged] for column in columns))
        if isinstance(self.temperature, str):
            check_judged(judged)
            some = logs[judged], codes[judged], weight[judged]
            self._temperature = fit_temperature(*some, self.class_count_ / self.class_count_.sum())

    def typicality(self, X):
        """Return the fraction of left-out training recordings that are at least as far away.

        Every training recording is judged by a model without its group. Distances to the nearest
        class are measured inside and outside the discriminant space (where large deviations of few
        features count less) and for the largest deviation of a single feature, with one covariance
        for all classes; beyond the farthest left-out recordings their distribution has a modelled
        tail, which is wider the fewer they are.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features.

        Returns
        -------
        typicality : ndarray of shape (n_recordings,)
            In (0, 1]. 0.01 or less: at most one in a hundred known recordings is so far away.

        Raises
        ------
        ValueError
            If an input is invalid, or `fit` had neither `groups` nor an unknown state.
        """
        return self._calibrated("typicality")(self._checked_features(X))

    def second_states(self, X, decisions):
        """Return the class whose lines each recording has beyond those of the decided one.

        Two damaged parts raise the features of both; a classifier of single faults decides one of
        them. The deviation from the decided class is projected on what each other class raises;
        about 2 % of left-out training recordings deviate as far.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features.
        decisions : sequence of n_recordings labels
            Decisions of `predict`; in place of one that is no class, the most probable class.

        Returns
        -------
        list of label or None
            None if there is no such class, the decision is the unknown state, or `fit` had neither
            `groups` nor an unknown state.
        """
        check_is_fitted(self)
        if self._typicality is None:
            return [None] * len(decisions)
        classes = self.classes_.tolist()
        probable = zip(decisions, self.predict_proba(X).argmax(axis=1), strict=True)
        codes = [classes.index(label) if label in classes else k for label, k in probable]
        others = self._typicality.second_classes(self._checked_features(X), np.array(codes))
        return [
            None if code < 0 or decision == self.unknown else classes[code]
            for code, decision in zip(others, decisions, strict=True)
        ]

    def left_out_decisions(self):
        """Return the present decision on each training recording, judged without its group.

        Returns
        -------
        DataFrame
            "truth", "decision", "typicality" and "group" (a number) of the recordings of classes
            that other groups have as well.

        Raises
        ------
        ValueError
            If `fit` had neither `groups` nor an unknown state.
        """
        left = self._calibrated("left_out")
        log_priors = np.log(np.maximum(self.priors_, np.finfo(np.float64).tiny))
        joint = left.log_densities / self.temperature_ + log_priors
        truths = self.truth_proba(None, softmax(joint, axis=1), left.typicality)
        return pd.DataFrame(
            {
                "truth": self.classes_[left.codes],
                "decision": self.decided(truths),
                "typicality": left.typicality,
                "group": left.units,
            }
        )

    @property
    def _frequencies(self):
        return self.class_count_

    def _calibrated(self, name: str) -> Any:
        """Return what was found by leaving groups out."""
        check_is_fitted(self)
        found = getattr(self, f"_{name}")
        if found is None:
            raise NotFittedError(  # a ValueError, and an AttributeError where it is a property
                f"{name} is found by leaving groups out, which the last fit did not do. "
                f"Call fit with groups=, the labels of recordings that were measured together."
            )
        return found
