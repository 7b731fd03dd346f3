"""One classifier for each condition, which decides on the recordings of that condition."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import ClassifierMixin, MetaEstimatorMixin, clone, is_classifier
from sklearn.utils import get_tags
from sklearn.utils.metaestimators import available_if
from sklearn.utils.validation import check_is_fitted, column_or_1d

from emacm._checks import check_choice, located
from emacm._saved import SavedEstimator
from emacm.decisions.costs import check_classes, label_array
from emacm.decisions.pipelines import (
    RoutingMixin,
    before_the_last_step,
    check_unknown_states,
    final_estimator,
    narrowed,
    parameters_of_rows,
    stated_costs,
)
from emacm.decisions.risks import LeastRiskMixin
from emacm.recordings.inputs import entry_name, run
from emacm.recordings.meta import chosen_rows, condition_name, read_meta, sorted_conditions

Rows = NDArray[np.intp]


def check_labels(y: Any, n_recordings: int) -> None:
    """Raise if y does not hold one valid class for each recording."""
    check_classes(y)
    if len(column_or_1d(y)) != n_recordings:
        raise ValueError(f"y has {len(y)} entries for {n_recordings} recordings.")


def _has(method: str) -> Callable[[Any], bool]:
    """Return whether the last step has a method, for `available_if`."""
    return lambda router: hasattr(final_estimator(router.estimator), method)


class ConditionRouter(
    LeastRiskMixin, RoutingMixin, ClassifierMixin, MetaEstimatorMixin, SavedEstimator
):
    """Fit one clone of a classifier for each condition, and apply it to the recordings there.

    Healthy signals differ between loads and speeds. If the condition of each recording is known,
    a separate classifier for each condition does not have to separate faults from load changes.

    Parameters
    ----------
    estimator : estimator
        Classifier, usually a whole pipeline, of which a clone is fitted for each condition.
    condition : hashable, tuple or callable, default="load"
        Key of the recordings' `meta`, a tuple of keys, or a function of the recording that returns
        something hashable. In a DataFrame, names of columns, which the classifiers do not
        see.
    unseen : {"raise", "pooled"}, default="raise"
        For a recording of a condition without a classifier: raise an error, or use an additional
        classifier that is fitted on all recordings.
    n_jobs : int, optional
        Number of classifiers fitted in parallel, by joblib's active backend (default: threads).

    Attributes
    ----------
    conditions_ : tuple
        The conditions, sorted if they have an order.
    estimators_ : dict
        The fitted classifier of each condition.
    pooled_ : estimator or None
        The classifier fitted on all recordings, with ``unseen="pooled"``.
    classes_ : ndarray of shape (n_classes,)
        Classes of all conditions.
    truths_ : ndarray of shape (n_truths,)
        `classes_`, followed by the unknown state if the last step has one.
    decisions_, cost_ : ndarray of shape (n_decisions,) and (n_decisions, n_truths)
        Possible decisions and their costs; 0-1 if the last step is no classifier with costs
        (`CostSensitiveGaussianBayes`, `LeastRiskClassifier`, `PosteriorProduct`).

    See Also
    --------
    emacm.FeatureBaseline : One model, with features relative to their condition.

    Notes
    -----
    `cost` and `priors` of such a last step take effect when a decision is made:
    ``router.set_params(estimator__...__cost=...)`` applies to the next `predict`, as if the
    router had been fitted again. They are those of `estimator`, also if that is a search: one over
    costs or priors has no effect.

    A class that is absent from a condition has the probability 0 there, and a decision that
    is unknown there has infinite risk. Its costs are left out, which changes no decision, and
    the priors of the other classes are normalised.

    Arguments of `fit` with one entry for each recording (`sample_weight`, or those of a step) are
    split by condition.

    Examples
    --------
    >>> import pandas as pd
    >>> from emacm import ConditionRouter, CostSensitiveGaussianBayes
    >>> X = pd.DataFrame({"load": [20] * 4 + [40] * 4, "level": [1.0, 2, 5, 6, 5, 6, 9, 10]})
    >>> y = ["healthy", "healthy", "worn", "worn"] * 2
    >>> router = ConditionRouter(CostSensitiveGaussianBayes(covariance="tied"), "load").fit(X, y)
    >>> same_level = pd.DataFrame({"load": [20, 40], "level": [5.5, 5.5]})
    >>> router.predict(same_level).tolist()
    ['worn', 'healthy']
    """

    unknown_prior_ = None  # type: ignore[assignment]  # the classifier of each condition has one

    def __init__(
        self,
        estimator: Any,
        condition: Any = "load",
        *,
        unseen: str = "raise",
        n_jobs: int | None = None,
    ) -> None:
        self.estimator = estimator
        self.condition = condition
        self.unseen = unseen
        self.n_jobs = n_jobs

    def fit(self, X: Any, y: ArrayLike, **fit_params: Any) -> ConditionRouter:
        """Fit a clone of the classifier on the recordings of each condition.

        Parameters
        ----------
        X : list of Recording, or DataFrame
            Recordings, or rows of a table with the condition in a column.
        y : array-like of n_recordings
            True classes.
        **fit_params : any
            Passed to `fit` of the classifiers; values with one entry for each recording are split.
            With scikit-learn's metadata routing, ``groups`` reach all that need them.

        Returns
        -------
        ConditionRouter
            Itself.

        Raises
        ------
        TypeError, ValueError
            If a parameter, a condition or a class is invalid or missing, a condition has
            a single class, or a classifier raises an error (the message gives the condition).
        """
        check_choice(self.unseen, "unseen", ("raise", "pooled"))
        if not is_classifier(clone(self.estimator)):
            raise TypeError(
                f"estimator must be a classifier or a pipeline that ends in one; got "
                f"{self.estimator!r}."
            )
        check_unknown_states(self.estimator)
        found = read_meta(X, self.condition)
        check_labels(y, len(found))
        rows = {
            condition_name(self.condition, value): np.flatnonzero([v == value for v in found])
            for value in sorted_conditions(found)
        }
        if self.unseen == "pooled":
            rows["all conditions"] = np.arange(len(found))
        fit_one = partial(self._fitted, self.inner(X), y, self._routed(fit_params))
        fitted = run(fit_one, [*rows], [*rows.values()], n_jobs=self.n_jobs)
        self.conditions_ = sorted_conditions(found)
        self.estimators_ = dict(zip(self.conditions_, fitted, strict=False))
        self.pooled_ = fitted[-1] if self.unseen == "pooled" else None
        self.classes_ = np.unique(y)
        return self

    def _fitted(self, X: Any, y: Any, fit_params: Mapping[str, Any], name: str, rows: Rows) -> Any:
        """Fit a clone on some recordings, with the costs and priors of their classes."""
        labels = chosen_rows(y, rows)
        classes = np.unique(labels)
        model = narrowed(clone(self.estimator), classes, np.unique(y))
        with located(f"among the recordings of {name}"):
            if len(classes) < 2:
                raise ValueError(
                    f"all {len(rows)} are of class {classes.tolist()[0]!r}. Add recordings of "
                    f"another class there, or leave this condition out."
                )
            options = parameters_of_rows(fit_params, rows, len(y))
            return model.fit(chosen_rows(X, rows), labels, **options)

    @property
    def cost(self) -> Any:
        """The present cost of the last step; None if it has none."""
        return stated_costs(self.estimator)["cost"]

    @property
    def priors(self) -> Any:
        """The present priors of the last step; None if it has none."""
        return stated_costs(self.estimator)["priors"]

    @property
    def unknown(self) -> Any:
        """Label of the unknown state of the last step; None if it has none."""
        return stated_costs(self.estimator)["unknown"]

    def with_present_costs(self, classifier: Any) -> Any:
        """Return the last step for a condition with the cost and priors that are stated now.

        Parameters
        ----------
        classifier : estimator
            Fitted; it is not changed.

        Returns
        -------
        estimator
            A shallow copy, which shares the fitted attributes.
        """
        present = copy.copy(classifier)
        for name in {"cost", "priors"} & set(classifier.get_params(deep=False)):
            setattr(present, name, getattr(self, name))
        if isinstance(classifier, ConditionRouter):  # it has those of its own estimator
            present.estimator = clone(final_estimator(self.estimator).estimator)
        return narrowed(present, classifier.classes_, self.classes_)

    def predict(self, X: Any) -> NDArray[Any]:
        """Return the decision of the classifier of each recording's condition.

        Parameters
        ----------
        X : list of Recording, or DataFrame
            Recordings.

        Returns
        -------
        ndarray of shape (n_recordings,)
            In the order of X.

        Raises
        ------
        TypeError, ValueError
            If a recording has no condition, or no classifier and ``unseen="raise"``; or if the
            present cost or priors are invalid.
        """
        return label_array(self._results(X, "predict").ravel().tolist(), self.classes_)

    @available_if(_has("predict_proba"))
    def predict_proba(self, X: Any) -> NDArray[np.floating]:
        """Return the probability of each class.

        Parameters
        ----------
        X : list of Recording, or DataFrame
            Recordings.

        Returns
        -------
        ndarray of shape (n_recordings, n_classes)
            In the order of `classes_`; 0 for a class that is absent from the recording's condition.
        """
        return self._results(X, "predict_proba", "classes_")

    @available_if(_has("predict_log_proba"))
    def predict_log_proba(self, X: Any) -> NDArray[np.floating]:
        """Return the logarithm of `predict_proba`; -inf for a class absent from the condition."""
        return self._results(X, "predict_log_proba", "classes_", absent=-np.inf)

    @available_if(_has("typicality"))
    def typicality(self, X: Any) -> NDArray[np.floating]:
        """Return the fraction of left-out training recordings that are at least as far away.

        As `CostSensitiveGaussianBayes.typicality`, by the classifier of each recording's condition.
        """
        return self._results(X, "typicality").ravel()

    @available_if(_has("unknown_proba"))
    def unknown_proba(self, X: Any, typicality: Any = None) -> NDArray[np.floating]:
        """Return the probability that the true state is unknown, shape (n_recordings,).

        `typicality` is computed again, with the unknown state of each recording's condition.
        """
        return self._results(X, "unknown_proba").ravel()

    @available_if(_has("risk"))
    def risk(self, X: Any) -> NDArray[np.floating]:
        """Return the expected cost of each decision (conditional risk), Eq. (2.39) of Chirico.

        Parameters
        ----------
        X : list of Recording, or DataFrame
            Recordings.

        Returns
        -------
        ndarray of shape (n_recordings, n_decisions)
            In the order of `decisions_`; infinite for a decision that is unknown in the
            recording's condition.
        """
        return self._results(X, "risk", "decisions_", absent=np.inf)

    def models_of(self, X: Any) -> list[Any]:
        """Return the fitted classifier of the condition of each recording, as for `predict`."""
        check_is_fitted(self)
        found = read_meta(X, self.condition)
        models = [self.estimators_.get(value, self.pooled_) for value in found]
        if None in models:
            index = models.index(None)
            raise ValueError(
                f"{entry_name(X, index)} has {condition_name(self.condition, found[index])}, but "
                f"training has {list(self.conditions_)}. Train with it, or use unseen='pooled'."
            )
        return models

    def __sklearn_tags__(self) -> Any:
        """Declare that X is not a 2-D table; the classes are those of the classifier."""
        tags, inner = super().__sklearn_tags__(), get_tags(self.estimator)
        tags.classifier_tags = inner.classifier_tags or tags.classifier_tags
        tags.input_tags.two_d_array = False
        return tags

    def inner(self, X: Any) -> Any:
        """Return X as the classifiers see it: a table without the columns of the condition."""
        if not isinstance(X, pd.DataFrame) or callable(self.condition):
            return X
        keys = self.condition if isinstance(self.condition, tuple) else (self.condition,)
        inner = X.drop(columns=list(keys))
        if not inner.shape[1]:
            raise ValueError(f"X has no columns besides the condition, {list(keys)}; add features.")
        return inner

    def _results(
        self, X: Any, method: str, labels: str | None = None, absent: float = 0.0
    ) -> NDArray[Any]:
        """Return results of the last steps, one row per recording, one column per label."""
        models, inner, parts = self.models_of(X), self.inner(X), []
        for model in dict.fromkeys(models):
            rows = np.flatnonzero([other is model for other in models])
            with located(f"in the condition of {entry_name(X, int(rows[0]))}"):
                final, table = before_the_last_step(model, chosen_rows(inner, rows))
                final = self.with_present_costs(final)
                part = pd.DataFrame(getattr(final, method)(table), rows)
                if labels is not None:  # those of all conditions
                    part.columns = getattr(final, labels).tolist()
                    part = part.reindex(columns=getattr(self, labels).tolist(), fill_value=absent)
            parts.append(part)
        return pd.concat(parts).sort_index().to_numpy()
