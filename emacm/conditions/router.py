"""One estimator for each condition, and every recording to the one of its condition."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn import get_config
from sklearn.base import BaseEstimator, MetaEstimatorMixin, clone, is_classifier, is_regressor
from sklearn.exceptions import NotFittedError
from sklearn.metrics import accuracy_score, r2_score
from sklearn.utils import get_tags
from sklearn.utils.metadata_routing import MetadataRouter, MethodMapping, process_routing
from sklearn.utils.metaestimators import available_if
from sklearn.utils.parallel import Parallel, delayed
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_choice, located
from emacm.conditions.rows import aligned_columns, joined_rows, joined_tables
from emacm.decisions.costs import cost_table, narrow_costs
from emacm.decisions.labels import check_classes
from emacm.decisions.metrics import fraction_correct
from emacm.decisions.pipelines import before_the_last_step, final_estimator
from emacm.recordings.inputs import described
from emacm.recordings.meta import chosen_rows, condition_name, read_meta, sorted_conditions

_UNSEEN = ("error", "nearest", "pooled")


def _has(method: str) -> Callable[[Any], bool]:
    """Tell, for `available_if`, whether the estimator has a method."""

    def check(router: ConditionRouter) -> bool:
        getattr(router.estimator, method)  # its error says why it has none
        return True

    return check


def _has_risk(router: ConditionRouter) -> bool:
    return hasattr(final_estimator(router.estimator), "risk")


def _scores(router: ConditionRouter) -> bool:
    return is_classifier(router.estimator) or is_regressor(router.estimator)


class ConditionRouter(MetaEstimatorMixin, BaseEstimator):
    """Fit one clone of an estimator for each condition, and ask the one that fits a recording.

    Under another load or speed the healthy signals themselves are others. Where the condition
    of each recording is known, a model for each need not tell a fault from a change of load.

    Parameters
    ----------
    estimator : estimator
        What is fitted for each condition, such as a whole pipeline.
    condition : hashable, tuple or callable, default="load"
        Key of the recordings' `meta`; several keys as a tuple; or a function of the recording
        that returns something hashable. Of a DataFrame, names of columns, which no
        estimator gets to see, the pooled one neither.
    unseen : {"error", "nearest", "pooled"}, default="error"
        What a recording of a condition without an estimator gets: an error, the
        estimator of the nearest condition (of two equally near, the lower one; for numbers only),
        or one more estimator, fitted on all recordings.
    n_jobs : int, optional
        Estimators fitted at the same time, under joblib's active backend
        (by default, threads).

    Attributes
    ----------
    conditions_ : tuple
        The conditions, sorted where they have an order.
    estimators_ : dict
        The fitted estimator of each condition.
    pooled_ : estimator
        The one fitted on all recordings, with ``unseen="pooled"``.
    classes_ : ndarray of shape (n_classes,)
        Classes of all conditions, where the estimator is a classifier.
    decisions_, cost_ : ndarray of shape (n_decisions,) and (n_decisions, n_classes)
        What can be decided, and its cost, where the estimator ends in a
        `CostSensitiveGaussianBayes` or `PosteriorProduct`; `neg_expected_cost` reads them.

    Notes
    -----
    A class that does not occur in a condition has probability 0 there, and minus infinity in
    log probabilities and decision functions; a decision that is unknown there has infinite risk.
    What the estimator's parameters called `cost` say of such a class is left out there, which
    changes no decision, as its posterior is 0.

    Arguments of `fit` that have an entry for each recording (`sample_weight`, or a step's) are
    cut by condition. To explain decisions, explain the pipeline of one condition:
    ``explain_decision(router.estimators_[load], recording)``.

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
        unseen: str = "error",
        n_jobs: int | None = None,
    ) -> None:
        self.estimator = estimator
        self.condition = condition
        self.unseen = unseen
        self.n_jobs = n_jobs

    def fit(self, X: Any, y: Any = None, **fit_params: Any) -> ConditionRouter:
        """Fit a clone of the estimator on the recordings of each condition.

        Parameters
        ----------
        X : list of Recording, or DataFrame
            Recordings, or rows of a table with the condition in a column.
        y : array-like of n_recordings, optional
            Truths.
        **fit_params : any
            Passed to `fit` of the estimators; what has an entry for each recording is cut.

        Returns
        -------
        ConditionRouter
            Itself.

        Raises
        ------
        TypeError, ValueError
            If a condition is missing or no key; if a recording has no class, or a classifier
            finds a single class in a condition; or as the estimator has it (the message names
            the condition).
        """
        check_choice(self.unseen, "unseen", _UNSEEN)
        if isinstance(self.estimator, type) or not hasattr(self.estimator, "fit"):
            raise TypeError(f"estimator must be one, such as a Pipeline; got {self.estimator!r}.")
        if get_config()["enable_metadata_routing"]:
            fit_params = process_routing(self, "fit", **fit_params).estimator.fit
        found = read_meta(X, self.condition)
        _check_length(y, len(found))
        conditions = sorted_conditions(found)
        if self.unseen == "nearest":
            self._check_numbers(conditions)
        groups = [self._rows_of(found, value) for value in conditions]
        if is_classifier(self.estimator):
            self._check_classes(y, conditions, groups)
        names = [f"of {condition_name(self.condition, value)}" for value in conditions]
        if self.unseen == "pooled":
            groups, names = [*groups, np.arange(len(found))], [*names, "of all conditions"]
        inner = self._inner(X)
        fitted = Parallel(n_jobs=self.n_jobs, prefer="threads")(
            delayed(_fitted)(self._clone_for(y, rows), inner, y, rows, fit_params, len(found), name)
            for rows, name in zip(groups, names, strict=True)
        )
        self.__dict__.pop("pooled_", None)  # of an earlier fit
        if self.unseen == "pooled":
            self.pooled_ = fitted[-1]
        self.conditions_ = conditions
        self.estimators_ = dict(zip(conditions, fitted, strict=False))
        self._agree_on_classes()
        return self

    @available_if(_has("predict"))
    def predict(self, X: Any) -> NDArray[Any]:
        """Return what the estimator of each recording's condition predicts, or decides.

        Parameters
        ----------
        X : list of Recording, or DataFrame
            Recordings.

        Returns
        -------
        ndarray of shape (n_recordings,) or (n_recordings, n_outputs)
            In the order of X.

        Raises
        ------
        TypeError, ValueError
            If a recording lacks the condition, or it has no estimator and `unseen` is "error".
        """
        parts, places, _ = self._asked(X, lambda model, rows: model.predict(rows))
        return joined_rows(parts, places)

    @available_if(_has("predict_proba"))
    def predict_proba(self, X: Any) -> NDArray[np.floating]:
        """Return probabilities, shape (n_recordings, n_classes), in the order of `classes_`.

        Parameters
        ----------
        X : list of Recording, or DataFrame
            Recordings.

        Returns
        -------
        ndarray of shape (n_recordings, n_classes)
            0 for a class that the recording's condition does not have.
        """
        return self._by_class(X, lambda model, rows: model.predict_proba(rows), absent=0.0)

    @available_if(_has("predict_log_proba"))
    def predict_log_proba(self, X: Any) -> NDArray[np.floating]:
        """Return logarithms of probabilities, in the order of `classes_`.

        Parameters
        ----------
        X : list of Recording, or DataFrame
            Recordings.

        Returns
        -------
        ndarray of shape (n_recordings, n_classes)
            Minus infinity for a class that the recording's condition does not have.
        """
        return self._by_class(X, lambda model, rows: model.predict_log_proba(rows), absent=-np.inf)

    @available_if(_has("decision_function"))
    def decision_function(self, X: Any) -> NDArray[np.floating]:
        """Return the estimators' decision functions, as they are if their classes are the same.

        Parameters
        ----------
        X : list of Recording, or DataFrame
            Recordings.

        Returns
        -------
        ndarray of shape (n_recordings,) or (n_recordings, n_classes)
            Where conditions differ in their classes: a column for each of `classes_`.
        """
        return self._by_class(X, lambda model, rows: model.decision_function(rows), absent=-np.inf)

    @available_if(_has_risk)
    def risk(self, X: Any) -> NDArray[np.floating]:
        """Return the expected cost of each decision, Eq. (2.39) of Chirico.

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
        parts, places, models = self._asked(X, _risk)
        known = [final_estimator(model).decisions_ for model in models]
        return joined_rows(aligned_columns(parts, known, self.decisions_, absent=np.inf), places)

    @available_if(_has("transform"))
    def transform(self, X: Any) -> Any:
        """Transform each recording by the transformer of its condition.

        Parameters
        ----------
        X : list of Recording, or DataFrame
            Recordings.

        Returns
        -------
        list, array, OrderTable or DataFrame
            What the transformers return, in the order of X.

        Raises
        ------
        ValueError
            If transformers of two conditions return different columns.
        """
        parts, places, models = self._asked(X, lambda model, rows: model.transform(rows))
        return joined_tables(parts, places, known=[_names_out(model) for model in models])

    @available_if(_has("transform"))
    def fit_transform(self, X: Any, y: Any = None, **fit_params: Any) -> Any:
        """Fit, then transform the same recordings.

        Parameters
        ----------
        X : list of Recording, or DataFrame
            Recordings.
        y : array-like of n_recordings, optional
            Truths.
        **fit_params : any
            As for `fit`.

        Returns
        -------
        list, array, OrderTable or DataFrame
            As `transform` returns.
        """
        return self.fit(X, y, **fit_params).transform(X)

    @available_if(_scores)
    def score(self, X: Any, y: ArrayLike, sample_weight: ArrayLike | None = None) -> float:
        """Return the share of recordings decided rightly, or the R² of a regressor.

        Right is what `CostSensitiveGaussianBayes.score` calls so: also a decision for the family
        of a true state. Of other classifiers it is the accuracy.

        Parameters
        ----------
        X : list of Recording, or DataFrame
            Recordings.
        y : array-like of n_recordings
            Truths.
        sample_weight : array-like of shape (n_recordings,), optional
            How often each counts.

        Returns
        -------
        float
        """
        answers = self.predict(X)
        if hasattr(self, "cost_"):
            table = self.decisions_, self.classes_, self.cost_
            return fraction_correct(y, answers, table, sample_weight)
        metric = accuracy_score if is_classifier(self.estimator) else r2_score
        return float(metric(y, answers, sample_weight=sample_weight))

    @available_if(_has("get_feature_names_out"))
    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """Return the names of the transformers' columns.

        Parameters
        ----------
        input_features : array-like of str, optional
            As the transformers take it.

        Returns
        -------
        ndarray of str
        """
        check_is_fitted(self)
        return self.estimators_[self.conditions_[0]].get_feature_names_out(input_features)

    @available_if(_has("set_output"))
    def set_output(self, *, transform: str | None = None) -> ConditionRouter:
        """Tell the transformers what to return.

        Parameters
        ----------
        transform : {"default", "pandas", "polars", None}
            As for any transformer.

        Returns
        -------
        ConditionRouter
            Itself.
        """
        for model in (self.estimator, *self._models()):
            model.set_output(transform=transform)
        return self

    def get_metadata_routing(self) -> MetadataRouter:
        """Tell scikit-learn whom arguments are for: those of `fit` for the estimator.

        Returns
        -------
        MetadataRouter
        """
        mapping = MethodMapping().add(caller="fit", callee="fit")
        router = MetadataRouter(owner=type(self).__name__).add_self_request(self)
        return router.add(estimator=self.estimator, method_mapping=mapping)

    def __sklearn_tags__(self) -> Any:
        """Be to scikit-learn what the estimator is, except that X is no 2-D table."""
        tags, inner = super().__sklearn_tags__(), get_tags(self.estimator)
        for name in ("estimator_type", "classifier_tags", "regressor_tags", "transformer_tags"):
            setattr(tags, name, getattr(inner, name))
        tags.target_tags = inner.target_tags
        tags.input_tags.two_d_array = False
        return tags

    def _models(self) -> list[Any]:
        pooled = [self.pooled_] if hasattr(self, "pooled_") else []
        return [*getattr(self, "estimators_", {}).values(), *pooled]

    def _rows_of(self, found: list[Any], value: Any) -> NDArray[np.intp]:
        return np.array([row for row, other in enumerate(found) if other == value], dtype=np.intp)

    def _inner(self, X: Any) -> Any:
        """Return X as the estimators see it: a table without the columns of the condition."""
        if not isinstance(X, pd.DataFrame) or callable(self.condition):
            return X
        keys = self.condition if isinstance(self.condition, tuple) else (self.condition,)
        inner = X.drop(columns=list(keys))
        if not inner.shape[1]:
            raise ValueError(f"X has no columns besides the condition, {list(keys)}; add features.")
        return inner

    def _clone_for(self, y: Any, rows: NDArray[np.intp]) -> Any:
        """Return a clone of the estimator, with costs of the classes that occur in some rows."""
        model = clone(self.estimator)
        if not is_classifier(model):
            return model
        known, everything = (np.unique(np.asarray(part)) for part in (chosen_rows(y, rows), y))
        return narrow_costs(model, known.tolist(), everything.tolist())

    def _check_classes(
        self, y: Any, conditions: Sequence[Any], groups: list[NDArray[np.intp]]
    ) -> None:
        if y is None:
            raise ValueError("a classifier needs y, the class of each recording; call fit(X, y).")
        check_classes(y)
        for value, rows in zip(conditions, groups, strict=True):
            classes = np.unique(np.asarray(chosen_rows(y, rows))).tolist()
            if len(classes) < 2:
                raise ValueError(
                    f"all {len(rows)} recordings of {condition_name(self.condition, value)} are of "
                    f"class {classes[0]!r}; a classifier needs two classes in each condition. "
                    f"Add recordings of another class there, or leave this condition out."
                )

    def _check_numbers(self, values: Sequence[Any]) -> None:
        for value in values:
            if isinstance(value, bool) or not isinstance(value, Real):
                raise ValueError(
                    f"unseen='nearest' needs conditions that are numbers, but there is "
                    f"{condition_name(self.condition, value)}. Use 'error' or 'pooled'."
                )

    def _agree_on_classes(self) -> None:
        """Set what classifiers of all conditions have in common."""
        for name in ("classes_", "decisions_", "cost_"):
            self.__dict__.pop(name, None)  # of an earlier fit
        models = self._models()
        if not is_classifier(self.estimator):
            return
        self.classes_ = np.unique(np.concatenate([model.classes_ for model in models]))
        whole = [model for model in models if len(model.classes_) == len(self.classes_)]
        if hasattr(final_estimator(models[0]), "cost_"):
            # A condition that lacks a class was given a part of the cost; what was stated has all.
            stated = final_estimator(whole[0] if whole else self.estimator).cost
            self.decisions_, self.cost_ = cost_table(stated, self.classes_)

    def _asked(self, X: Any, ask: Callable[[Any, Any], Any]) -> tuple[list[Any], list[Any], list]:
        """Ask each estimator about its recordings: answers, their rows in X, and estimators."""
        check_is_fitted(self)
        keys = self._routes(X)
        inner = self._inner(X)
        parts, places, models = [], [], []
        for key in dict.fromkeys(keys):
            rows = np.array([row for row, other in enumerate(keys) if other == key])
            pooled, value = key
            model = self.pooled_ if pooled else self.estimators_[value]
            name = "of conditions not seen" if pooled else condition_name(self.condition, value)
            with located(f"among the recordings for the estimator of {name}"):
                parts.append(ask(model, chosen_rows(inner, rows)))
            places.append(rows)
            models.append(model)
        return parts, places, models

    def _routes(self, X: Any) -> list[tuple[bool, Any]]:
        """Return for each recording whether it goes to the pooled estimator, or to which."""
        routes: list[tuple[bool, Any]] = []
        for index, value in enumerate(read_meta(X, self.condition)):
            if value in self.estimators_:
                routes.append((False, value))
            elif self.unseen == "pooled" and hasattr(self, "pooled_"):
                routes.append((True, None))
            elif self.unseen == "nearest":
                self._check_numbers([value, *self.conditions_])
                nearest = min(self.conditions_, key=lambda known: (abs(known - value), known))
                routes.append((False, nearest))
            else:
                entry = (
                    f"row {index}" if isinstance(X, pd.DataFrame) else described(X[index], index)
                )
                raise ValueError(
                    f"{entry} has {condition_name(self.condition, value)}, for which no estimator "
                    f"was fitted; known are {list(self.conditions_)}. Fit with recordings of it, "
                    f"or with unseen='nearest' or 'pooled'."
                )
        return routes

    def _by_class(
        self, X: Any, ask: Callable[[Any, Any], Any], *, absent: float
    ) -> NDArray[np.floating]:
        parts, places, models = self._asked(X, ask)
        if hasattr(self, "classes_"):
            known = [model.classes_ for model in models]
            parts = aligned_columns(parts, known, self.classes_, absent=absent)
        return joined_rows(parts, places)


def _fitted(
    model: Any,
    X: Any,
    y: Any,
    rows: NDArray[np.intp],
    fit_params: Mapping[str, Any],
    n_recordings: int,
    name: str,
) -> Any:
    """Fit on some recordings, with their share of all other arguments."""
    cut = {
        key: chosen_rows(value, rows) if _per_recording(value, n_recordings) else value
        for key, value in fit_params.items()
    }
    with located(f"among the recordings {name}"):
        if y is None:
            return model.fit(chosen_rows(X, rows), **cut)
        return model.fit(chosen_rows(X, rows), chosen_rows(y, rows), **cut)


def _per_recording(value: Any, n_recordings: int) -> bool:
    if isinstance(value, str | Mapping) or not hasattr(value, "__len__"):
        return False
    shape = getattr(value, "shape", None)
    return (len(value) if shape is None else shape[0] if shape else -1) == n_recordings


def _check_length(y: Any, n_recordings: int) -> None:
    if y is None:
        return
    if isinstance(y, str | Mapping) or getattr(y, "ndim", 1) == 0 or not hasattr(y, "__len__"):
        raise TypeError(
            f"y must be a list or an array with an entry for each of {n_recordings} recordings, "
            f"got {type(y).__name__}."
        )
    if len(y) != n_recordings:
        raise ValueError(f"y has {len(y)} entries for {n_recordings} recordings.")


def _names_out(model: Any) -> Any:
    """Return the names of a transformer's columns; None if it has none."""
    try:
        return tuple(model.get_feature_names_out())
    except (AttributeError, NotFittedError, ValueError):
        return None


def _risk(estimator: Any, X: Any) -> NDArray[np.floating]:
    """Return the risk that the last step computes; pipelines have no such method."""
    final, table = before_the_last_step(estimator, X)
    return final.risk(table)
