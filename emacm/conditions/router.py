"""One classifier for each condition, which decides on the recordings of that condition."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import ClassifierMixin, MetaEstimatorMixin, clone, is_classifier
from sklearn.metrics import accuracy_score
from sklearn.utils import get_tags
from sklearn.utils.metaestimators import available_if
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_choice, located
from emacm._saved import SavedEstimator
from emacm.conditions.present_costs import narrowed, present_cost_table, with_present_costs
from emacm.decisions.metrics import fraction_correct
from emacm.decisions.pipelines import before_the_last_step, final_estimator, parameters_of_rows
from emacm.decisions.truths import check_classes, label_array, truth_labels
from emacm.recordings.inputs import entry_name, run
from emacm.recordings.meta import chosen_rows, condition_name, read_meta, sorted_conditions

Rows = NDArray[np.intp]


def check_labels(y: Any, n_recordings: int) -> None:
    """Raise if y does not hold one valid class for each recording."""
    if y is None:
        raise ValueError("a classifier needs y, the class of each recording; call fit(X, y).")
    if isinstance(y, str | Mapping) or not np.shape(y):
        raise TypeError(
            f"y must be a list or an array with one class for each recording, got "
            f"{type(y).__name__}."
        )
    if len(y) != n_recordings:
        raise ValueError(f"y has {len(y)} entries for {n_recordings} recordings.")
    check_classes(y)


def _has(method: str) -> Callable[[Any], bool]:
    """Return whether the last step has a method, for `available_if`."""
    return lambda router: hasattr(final_estimator(router.estimator), method)


class ConditionRouter(ClassifierMixin, MetaEstimatorMixin, SavedEstimator):
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
    pooled_ : estimator
        The classifier fitted on all recordings, with ``unseen="pooled"``.
    classes_ : ndarray of shape (n_classes,)
        Classes of all conditions.
    truths_ : ndarray of shape (n_truths,)
        `classes_`, followed by the unknown state if the last step has one.
    decisions_, cost_ : ndarray of shape (n_decisions,) and (n_decisions, n_truths)
        Possible decisions and their costs, if the last step is a classifier with costs
        (`CostSensitiveGaussianBayes`, `LeastRiskClassifier`, `PosteriorProduct`).

    See Also
    --------
    emacm.FeatureBaseline : One model, with features relative to their condition.

    Notes
    -----
    `cost` and `priors` of such a last step take effect when a decision is made:
    ``router.set_params(estimator__...__cost=...)`` applies to the next `predict`, as if the
    router had been fitted again (except where a search has selected them).

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
        is_class = isinstance(self.estimator, type)
        is_estimator = hasattr(self.estimator, "get_params") and not is_class
        if not is_estimator or not is_classifier(self.estimator):
            raise TypeError(
                f"estimator must be a classifier or a pipeline that ends in one; got "
                f"{self.estimator!r}."
            )
        found = read_meta(X, self.condition)
        check_labels(y, len(found))
        conditions = sorted_conditions(found)
        groups = [np.flatnonzero([value == other for other in found]) for value in conditions]
        names = [f"of {condition_name(self.condition, value)}" for value in conditions]
        if self.unseen == "pooled":
            groups, names = [*groups, np.arange(len(found))], [*names, "of all conditions"]
        fit_one = partial(self._fitted, self.inner(X), y, fit_params)
        fitted = run(fit_one, groups, names, n_jobs=self.n_jobs)
        self.__dict__.pop("pooled_", None)  # of an earlier fit
        if self.unseen == "pooled":
            self.pooled_ = fitted[-1]
        self.conditions_ = conditions
        self.estimators_ = dict(zip(conditions, fitted, strict=False))
        self.classes_ = np.unique(np.concatenate([model.classes_ for model in fitted]))
        return self

    def _fitted(self, X: Any, y: Any, fit_params: Mapping[str, Any], rows: Rows, name: str) -> Any:
        """Fit a clone on some recordings, with the costs and priors of their classes."""
        labels, some = chosen_rows(y, rows), parameters_of_rows(fit_params, rows, len(y))
        classes = np.unique(labels)
        model = narrowed(clone(self.estimator), classes, np.unique(y))
        with located(f"among the recordings {name}"):
            if len(classes) < 2:
                raise ValueError(
                    f"all {len(rows)} are of class {classes.tolist()[0]!r}. Add recordings of "
                    f"another class there, or leave this condition out."
                )
            return model.fit(chosen_rows(X, rows), labels, **some)

    @property
    def decisions_(self) -> NDArray[Any]:
        """Possible results of `predict`, shape (n_decisions,), for the present cost."""
        return self._cost_table()[0]

    @property
    def cost_(self) -> NDArray[np.float64]:
        """Cost of each of `decisions_` under each of `truths_`, for the present cost."""
        return self._cost_table()[1]

    @property
    def truths_(self) -> NDArray[Any]:
        """The possible true states: `classes_`, and the unknown state if there is one."""
        return truth_labels(
            self.classes_, getattr(final_estimator(self.estimator), "unknown", None)
        )

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
        return label_array(self._by_recording(X, "predict").tolist(), self.classes_)

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
        return self._table(X, "predict_proba", "classes_", absent=0.0)

    @available_if(_has("predict_log_proba"))
    def predict_log_proba(self, X: Any) -> NDArray[np.floating]:
        """Return the logarithm of `predict_proba`; -inf for a class absent from the condition."""
        return self._table(X, "predict_log_proba", "classes_", absent=-np.inf)

    @available_if(_has("typicality"))
    def typicality(self, X: Any) -> NDArray[np.floating]:
        """Return the fraction of left-out training recordings that are at least as far away.

        As `CostSensitiveGaussianBayes.typicality`, by the classifier of each recording's condition.
        """
        return self._by_recording(X, "typicality").to_numpy()

    @available_if(_has("unknown_proba"))
    def unknown_proba(self, X: Any) -> NDArray[np.floating]:
        """Return the probability that the true state is unknown, shape (n_recordings,)."""
        return self._by_recording(X, "unknown_proba").to_numpy()

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
        return self._table(X, "risk", "decisions_", absent=np.inf)

    def score(self, X: Any, y: ArrayLike, sample_weight: ArrayLike | None = None) -> float:
        """Return the fraction of correct decisions.

        For a classifier with costs as in `CostSensitiveGaussianBayes.score`, where a decision for
        the family of the true state is correct too; for other classifiers the accuracy.

        Parameters
        ----------
        X : list of Recording, or DataFrame
            Recordings.
        y : array-like of n_recordings
            True classes.
        sample_weight : array-like of shape (n_recordings,), optional
            How often each recording counts.

        Returns
        -------
        float
        """
        decided = self.predict(X)
        if hasattr(self, "cost_"):
            table = self.decisions_, self.truths_, self.cost_
            return fraction_correct(y, decided, table, sample_weight)
        return float(accuracy_score(y, decided, sample_weight=sample_weight))

    def models_of(self, X: Any) -> list[Any]:
        """Return the fitted classifier of the condition of each recording, as for `predict`."""
        check_is_fitted(self)
        routes = self._routes(X)
        return [self.pooled_ if route is None else self.estimators_[route] for route in routes]

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

    def _routes(self, X: Any) -> list[Any]:
        """Return the condition of the classifier of each recording; None for the pooled one."""
        routes: list[Any] = []
        for index, value in enumerate(read_meta(X, self.condition)):
            if value in self.estimators_:
                routes.append(value)
            elif self.unseen == "pooled" and hasattr(self, "pooled_"):
                routes.append(None)  # there is no condition None
            else:
                raise ValueError(
                    f"{entry_name(X, index)} has {condition_name(self.condition, value)}, but "
                    f"training has {list(self.conditions_)}. Train with it, or use unseen='pooled'."
                )
        return routes

    def _results(self, X: Any, method: str) -> Iterator[tuple[Rows, Any, Any]]:
        """Yield numbers of recordings, the last step of their condition, and its result."""
        routes, inner = self._routes(X), self.inner(X)
        for route in dict.fromkeys(routes):
            rows = np.flatnonzero([other == route for other in routes])
            model = self.pooled_ if route is None else self.estimators_[route]
            of = "all conditions" if route is None else condition_name(self.condition, route)
            with located(f"among the recordings for the classifier of {of}"):
                final, table = before_the_last_step(model, chosen_rows(inner, rows))
                final = with_present_costs(final, model, self.estimator, self.classes_)
                yield rows, final, getattr(final, method)(table)

    def _by_recording(self, X: Any, method: str) -> pd.Series:
        check_is_fitted(self)
        parts = [pd.Series(result, rows) for rows, _, result in self._results(X, method)]
        return pd.concat(parts).sort_index()

    def _table(self, X: Any, method: str, labels: str, *, absent: float) -> NDArray[np.floating]:
        """Return one row per recording, one column per label of all conditions."""
        check_is_fitted(self)
        known = getattr(self, labels).tolist()
        parts = [
            pd.DataFrame(result, rows, getattr(final, labels).tolist()).reindex(
                columns=known, fill_value=absent
            )
            for rows, final, result in self._results(X, method)
        ]
        return pd.concat(parts).sort_index().to_numpy()

    def _cost_table(self) -> tuple[NDArray[Any], NDArray[np.float64]]:
        check_is_fitted(self)
        return present_cost_table([*self.estimators_.values()], self.estimator, self.classes_)
