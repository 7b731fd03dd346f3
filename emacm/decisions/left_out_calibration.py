"""Calibration on left-out groups: typicality, and the temperature of posteriors."""

from __future__ import annotations

from bisect import bisect_right
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats
from scipy.special import softmax
from sklearn.exceptions import NotFittedError
from sklearn.utils.metaestimators import available_if
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
from emacm.decisions.risks import LeastRiskMixin, decide
from emacm.decisions.truths import states_unknown, truth_priors
from emacm.decisions.typicality import (
    Typicality,
    evidence_for_unknown,
    fit_typicality,
    unknown_probability,
)


def has_unknown(classifier: Any) -> bool:
    """Return True if there is an unknown state; otherwise an AttributeError states the remedy."""
    if classifier.unknown is None:
        raise AttributeError(
            'unknown_proba needs the label of an unknown state, such as unknown="unknown".'
        )
    return True


def check_temperature(temperature: Any) -> None:
    """Raise if a temperature is neither None, "groups" nor a positive number."""
    if isinstance(temperature, str):
        check_choice(temperature, "temperature as a word", ("groups",))
    elif temperature is not None:
        check_number(temperature, 'temperature, if not None or "groups",', above=0)


class LeftOut(NamedTuple):
    """Training recordings, judged by classifiers that were fitted without their groups.

    Attributes
    ----------
    typicality : ndarray of shape (n_recordings,)
        NaN if no other recordings of the class remained.
    log_densities : ndarray of shape (n_recordings, n_classes)
        -inf for classes of which no other recordings remain.
    codes, units : ndarray of int, shape (n_recordings,)
        Number of the true class, and of the group.
    weight : ndarray of shape (n_recordings,)
        Number of times each recording is counted.
    """

    typicality: Array
    log_densities: Array
    codes: Indices
    units: Indices
    weight: Array

    @property
    def judged(self) -> NDArray[np.bool_]:
        """Whether other recordings of the true class remained, shape (n_recordings,)."""
        return np.isfinite(self.log_densities[np.arange(len(self.codes)), self.codes])

    def fit_temperature(self) -> float:
        """Return the temperature of least log loss, with the frequencies of the classes."""
        judged = self.judged
        check_judged(judged)
        counts = np.bincount(self.codes, self.weight, self.log_densities.shape[1])
        some = self.log_densities[judged], self.codes[judged], self.weight[judged]
        return fit_temperature(*some, counts / counts.sum())


class LeftOutMixin(LeastRiskMixin):
    """Typicality, unknown state and temperature, found by leaving out each group in turn.

    The results are None before anything was left out, and what is not needed.
    """

    class_count_: Array
    priors: Any
    unknown_rate: Any
    temperature: Any
    _typicality: Typicality | None = None
    _temperature: float | None = None
    _left_out: LeftOut | None = None

    @property
    def priors_(self) -> Array:
        """Prior probabilities in effect, shape (n_classes,), for the present `priors`.

        With an unknown state, those given that the true state is one of the classes.
        """
        return self._truth_priors()[0]

    @property
    def unknown_prior_(self) -> float:
        """Prior probability in effect of the unknown state; 0 if there is none.

        That of `priors`, or else the largest with which the decisions on at most `unknown_rate` of
        the known recordings, each judged without its group, change because of the unknown state
        (to the unknown state itself, or to an inspection): the upper limit of the mean over the
        groups with a one-sided confidence of 84 % (one standard error, with Student's t), because
        few groups leave the rate uncertain.
        """
        found, left = self._truth_priors()[1], self._left_out
        stated = states_unknown(self.priors, self.classes_, self.unknown)
        if left is None or self.unknown_rate is None or stated:
            return found
        judged = np.isfinite(left.typicality)
        posterior, weight = self._left_out_posterior(judged), left.weight[judged]
        units = np.unique(left.units[judged], return_inverse=True)[1]
        n_units = int(units.max()) + 1
        cost = self.cost_
        # Without the unknown state a recording has the decision of least risk. Another one is
        # cheaper where the odds of the unknown state exceed what it costs more if the state is
        # known, over what it costs less if it is not.
        risks = posterior @ cost[:, :-1].T
        best = risks.argmin(axis=1)
        more = risks - risks.min(axis=1, keepdims=True)
        less = cost[best, -1][:, np.newaxis] - cost[:, -1]
        odds = np.divide(more, less, out=np.full_like(more, np.inf), where=less > 0).min(axis=1)
        odds /= evidence_for_unknown(left.typicality[judged])
        order, total = np.argsort(odds), np.bincount(units, weight)
        # As many standard errors as Student's t has where the normal distribution has one.
        errors = stats.t.isf(stats.norm.sf(1.0), max(n_units - 1, 1))

        def rate(n_changed: int) -> float:
            """Return the share of changed decisions, and its standard error, added."""
            first = order[:n_changed]
            shares = np.bincount(units[first], weight[first], n_units) / total
            error = shares.std(ddof=1) / np.sqrt(n_units) if n_units > 1 else 0.0
            return float(shares.mean() + errors * error)

        n_changed = bisect_right(range(1, len(order) + 1), self.unknown_rate, key=rate)
        limit = odds[order[n_changed]] * (1 - 1e-9) if n_changed < len(order) else np.inf
        limit = np.clip(limit, np.exp(-40), np.exp(40))
        return float(limit / (1 + limit))

    @property
    def temperature_(self) -> float:
        """Temperature of the densities in effect."""
        check_temperature(self.temperature)  # it may have been set after `fit`
        if isinstance(self.temperature, str):
            return self._calibrated("temperature")
        return 1.0 if self.temperature is None else float(self.temperature)

    @property
    def distances_(self) -> Any:
        """The `ClassDistances` that `typicality` is based on."""
        return self._calibrated("typicality").distances

    @property
    def feature_range_(self) -> Array:
        """Smallest and largest training value of each feature, shape (2, n_features)."""
        return self._calibrated("typicality").feature_range

    @property
    def _needs_densities(self) -> bool:
        """Whether a temperature or a rate is to be found by leaving groups out."""
        return isinstance(self.temperature, str) or self.unknown_rate is not None

    def _judge(
        self, X: Array, codes: Indices, units: Indices, weight: Array, X_left: Array
    ) -> Array:
        """Return log densities of left-out recordings under classes fitted to the others.

        Shape (n_left, n_classes); -inf for classes of which too few others remain.
        """
        raise NotImplementedError

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
        if not self._needs_densities:
            return
        logs = np.full((len(rows), len(self.classes_)), -np.inf)
        for others, left in left_out(codes, units):
            logs[left] = self._judge(
                X[others], codes[others], units[others], weight[others], X[left]
            )
        self._left_out = LeftOut(self._typicality.left_out, logs, codes, units, weight)
        if isinstance(self.temperature, str):
            self._temperature = self._left_out.fit_temperature()

    def _left_out_posterior(self, rows: NDArray[np.bool_]) -> Array:
        """Return posterior probabilities of left-out recordings, for the present priors."""
        log_priors = np.log(np.maximum(self.priors_, np.finfo(np.float64).tiny))
        joint = self._calibrated("left_out").log_densities[rows] / self.temperature_ + log_priors
        return softmax(joint, axis=1)

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
        is_class = np.array([decision in classes for decision in decisions])
        codes = np.array([classes.index(d) if d in classes else 0 for d in decisions], np.intp)
        if not is_class.all():
            codes = np.where(is_class, codes, self.predict_proba(X).argmax(axis=1))
        others = self._typicality.second_classes(self._checked_features(X), codes)
        return [
            None if code < 0 or decision == self.unknown else classes[code]
            for code, decision in zip(others, decisions, strict=True)
        ]

    @available_if(has_unknown)
    def unknown_proba(self, X, typicality=None):
        """Return the probability that the true state is unknown.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_features)
            Features.
        typicality : ndarray of shape (n_recordings,), default=None
            Result of `typicality`, if it is known; `X` is then not used.

        Returns
        -------
        probability : ndarray of shape (n_recordings,)
            From the typicality and `unknown_prior_`, by Bayes' rule.
        """
        if typicality is None:
            typicality = self.typicality(X)
        return unknown_probability(typicality, self.unknown_prior_)

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
            If `fit` had neither ``unknown_rate`` nor a temperature to find.
        """
        left = self._calibrated("left_out")
        rows = left.judged
        posterior = self._left_out_posterior(rows)
        truths = self.truth_proba(None, posterior, left.typicality[rows])
        return pd.DataFrame(
            {
                "truth": self.classes_[left.codes[rows]],
                "decision": self.decisions_[decide(truths, self.cost_)],
                "typicality": left.typicality[rows],
                "group": left.units[rows],
            }
        )

    def _checked_features(self, X: Any) -> Array:
        raise NotImplementedError

    def _truth_priors(self) -> tuple[Array, float]:
        return truth_priors(self.priors, self.classes_, self.class_count_, self.unknown)

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
