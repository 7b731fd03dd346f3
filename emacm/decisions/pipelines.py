"""What pipelines and searches contain: the last step, a classifier, and all parts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn import get_config
from sklearn.base import BaseEstimator
from sklearn.compose import ColumnTransformer
from sklearn.frozen import FrozenEstimator
from sklearn.pipeline import Pipeline
from sklearn.utils import metadata_routing
from sklearn.utils.validation import has_fit_parameter

from emacm.decisions.costs import plain_labels
from emacm.recordings.meta import chosen_rows
from emacm.resampling.order_resampler import OrderResampler


class RoutingMixin:
    """Arguments of `fit` for a classifier that fits another one, its `estimator`.

    With scikit-learn's metadata routing, arguments go to those who request them, as `groups` to
    `BinTransformer` and `CostSensitiveGaussianBayes`; otherwise all go to `estimator`.
    """

    estimator: Any

    def get_metadata_routing(self):
        """Return which arguments of `fit` are passed on, as for any meta-estimator."""
        router = metadata_routing.MetadataRouter(owner=type(self).__name__).add_self_request(self)
        fit = metadata_routing.MethodMapping().add(caller="fit", callee="fit")
        return router.add(estimator=self.estimator, method_mapping=fit)

    def _routed(self, fit_params: dict[str, Any]) -> dict[str, Any]:
        """Return the arguments of `fit` of `estimator`."""
        if not get_config()["enable_metadata_routing"]:
            return fit_params
        return metadata_routing.process_routing(self, "fit", **fit_params)["estimator"]["fit"]


def parameters_of_rows(
    parameters: Mapping[str, Any], rows: NDArray[np.intp], n_recordings: int
) -> dict[str, Any]:
    """Take rows of those arguments of `fit` that have one entry for each recording.

    Examples
    --------
    >>> parameters_of_rows({"sample_weight": [1, 2, 3], "classes": ["a", "b"]}, np.array([2]), 3)
    {'sample_weight': [3], 'classes': ['a', 'b']}
    """
    per_recording = {
        name: chosen_rows(value, rows)
        for name, value in parameters.items()
        if hasattr(value, "__len__") and type(value) is not str and len(value) == n_recordings
    }
    return {**parameters, **per_recording}


def final_estimator(estimator: Any) -> Any:
    """Return the last step of nested pipelines and searches, fitted or not.

    Of a fitted search, this is the last step of the best estimator; of one that is not fitted, of
    the estimator that it would fit.

    Examples
    --------
    >>> from sklearn.naive_bayes import GaussianNB
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.preprocessing import StandardScaler
    >>> final_estimator(make_pipeline(StandardScaler(), make_pipeline(GaussianNB())))
    GaussianNB()
    """
    inner = search_estimator(estimator)
    return final_estimator(inner.steps[-1][1]) if hasattr(inner, "steps") else inner


def before_the_last_step(estimator: Any, X: Any) -> tuple[Any, Any]:
    """Transform X by all steps of a fitted pipeline but the last.

    Returns
    -------
    final : estimator
        As of `final_estimator`.
    X : any
        The input of `final`.

    Examples
    --------
    >>> from sklearn.naive_bayes import GaussianNB
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.preprocessing import StandardScaler
    >>> model = make_pipeline(StandardScaler(), GaussianNB()).fit([[0.0], [2.0]], [0, 1])
    >>> before_the_last_step(model, [[3.0]])
    (GaussianNB(), array([[2.]]))
    """
    inner = search_estimator(estimator)
    if not hasattr(inner, "steps"):
        return inner, X
    return before_the_last_step(inner[-1], inner[:-1].transform(X) if len(inner) > 1 else X)


def groups_options(estimator: Any, groups: Any) -> dict[str, Any]:
    """Return the arguments of `fit` that pass groups to all that learn from left-out groups.

    With scikit-learn's metadata routing this is `groups`, wherever they are needed.

    Parameters
    ----------
    estimator : estimator
        Classifier or pipeline.
    groups : array-like of shape (n_recordings,) or None
        Labels of recordings that were measured together.

    Returns
    -------
    dict
        The groups, by the name of the argument; empty without groups, or if nothing uses them.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from emacm import BinTransformer, CostSensitiveGaussianBayes
    >>> model = make_pipeline(BinTransformer(), CostSensitiveGaussianBayes(unknown="unknown"))
    >>> sorted(groups_options(model, ["unit 1", "unit 2"]))
    ['bintransformer__groups', 'costsensitivegaussianbayes__groups']
    """
    if groups is None:
        return {}
    if get_config()["enable_metadata_routing"]:
        names = metadata_routing.get_routing_for_object(estimator).consumes("fit", ["groups"])
    else:
        names = groups_parameters(estimator)
    return dict.fromkeys(names, groups)


def groups_parameters(estimator: Any) -> list[str]:
    """Return the names of the arguments of `fit` that are groups from which anything is learned.

    Without scikit-learn's metadata routing.
    """
    if isinstance(estimator, Pipeline):
        return [
            f"{step}__{name}" for step, part in estimator.steps for name in groups_parameters(part)
        ]
    if has_fit_parameter(estimator, "groups"):
        unknown, temperature = (getattr(estimator, n, None) for n in ("unknown", "temperature"))
        needed = getattr(estimator, "needs_groups", False)
        return ["groups"] if needed or unknown is not None or temperature == "groups" else []
    # Searches and routers pass what `fit` gets on to the estimator inside.
    inner = getattr(estimator, "estimator", None)
    return [] if inner is None else groups_parameters(inner)


def groups_are_units(estimator: Any) -> bool:
    """Return whether the groups that a classifier learns from must be units, not runs of them.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.preprocessing import StandardScaler
    >>> from emacm import CostSensitiveGaussianBayes, NewUnitClassifier
    >>> classifiers = CostSensitiveGaussianBayes(), NewUnitClassifier()
    >>> [groups_are_units(make_pipeline(StandardScaler(), each)) for each in classifiers]
    [False, True]
    """
    last = final_estimator(estimator)
    inner = getattr(last, "estimator", None)
    return getattr(last, "groups_are_units", False) if inner is None else groups_are_units(inner)


def search_estimator(estimator: Any) -> Any:
    """Return the best estimator of a search, before the fit its template, or a frozen one.

    Others are unchanged.

    Examples
    --------
    >>> from sklearn.model_selection import GridSearchCV
    >>> from sklearn.naive_bayes import GaussianNB
    >>> search_estimator(GridSearchCV(GaussianNB(), {}))
    GaussianNB()
    """
    if hasattr(estimator, "best_estimator_"):
        return search_estimator(estimator.best_estimator_)
    if isinstance(estimator, FrozenEstimator):
        return search_estimator(estimator.estimator)
    if hasattr(estimator, "param_grid") or hasattr(estimator, "param_distributions"):
        return estimator.estimator
    return estimator


def parts_of(model: Any) -> Iterator[Any]:
    """Yield a fitted model and all estimators that it contains, each once, outer ones first."""
    seen: set[int] = set()

    def walk(value: Any) -> Iterator[Any]:
        if id(value) in seen or not isinstance(value, BaseEstimator | Mapping | list | tuple):
            return
        seen.add(id(value))
        if isinstance(value, BaseEstimator):
            yield value
            value = vars(value)
        for inner in value.values() if isinstance(value, Mapping) else value:
            yield from walk(inner)

    yield from walk(model)


def check_unknown_states(model: Any) -> None:
    """Raise a ValueError if an estimator hides the unknown state of a classifier inside.

    Pipelines, searches and the estimators of emacm carry an unknown state; estimators of
    scikit-learn that combine or calibrate classifiers use their probabilities of classes only.

    Examples
    --------
    >>> from sklearn.calibration import CalibratedClassifierCV
    >>> from emacm import CostSensitiveGaussianBayes
    >>> check_unknown_states(CalibratedClassifierCV(CostSensitiveGaussianBayes(unknown="new")))
    Traceback (most recent call last):
    ...
    ValueError: CalibratedClassifierCV loses the unknown state 'new' of ...
    """
    final = final_estimator(model)
    if hasattr(final, "unknown_proba"):
        return
    for part in parts_of(final):
        if getattr(part, "unknown", None) is not None:
            raise ValueError(
                f"{type(final).__name__} loses the unknown state {part.unknown!r} of "
                f"{type(part).__name__}. Set unknown=None, or give that classifier itself "
                f'(temperature="groups" calibrates it).'
            )


def fitted_resamplers(model: Any) -> list[OrderResampler]:
    """Return the fitted resamplers of a model."""
    parts = parts_of(model)
    return [p for p in parts if isinstance(p, OrderResampler) and hasattr(p, "channels_")]


def parts_with_input(model: Any, X: Any, kinds: Any) -> Iterator[tuple[Any, Any]]:
    """Yield the fitted parts of a model that are of some kinds, with their input.

    Parameters
    ----------
    model : estimator
        Fitted.
    X : list of Recording
        Of one condition, if the model has several.
    kinds : type or tuple of types
        A pipeline is followed up to the first step that contains one of them.
    """
    model = search_estimator(model)
    if isinstance(model, kinds):
        yield model, X
    elif hasattr(model, "models_of"):  # a router
        yield from parts_with_input(model.models_of(X)[0], model.inner(X), kinds)
    elif not isinstance(model, Pipeline):
        for part, own in _members(model, X):
            yield from parts_with_input(part, own, kinds)
    elif any(isinstance(part, kinds) for part in parts_of(model)):
        for _, step in model.steps:
            found = list(parts_with_input(step, X, kinds))
            yield from found
            if found:
                return
            X = step.transform(X) if hasattr(step, "transform") else X


def _members(model: Any, X: Any) -> Iterator[tuple[Any, Any]]:
    """Yield the fitted estimators that a model is made of, with their input."""
    if isinstance(model, ColumnTransformer):
        for _, part, columns in model.transformers_:
            if hasattr(part, "fit"):
                names = getattr(part, "feature_names_in_", columns)
                yield part, X[names] if isinstance(X, pd.DataFrame) else X[:, columns]
        return
    parts = [step for _, step in getattr(model, "transformer_list", ())]
    inner = ("estimator_", "transformer_", "resampler_")
    parts += [*getattr(model, "estimators_", ()), *(getattr(model, name, None) for name in inner)]
    parts += [part.estimator for part in getattr(model, "calibrated_classifiers_", ())]
    yield from ((part, X) for part in parts if hasattr(part, "fit"))


def stated_costs(estimator: Any) -> dict[str, Any]:
    """Return the cost by which an estimator decides, its unknown state and its priors.

    They are those of the last step of pipelines and searches. Costs and priors of an estimator
    inside of that step (a member of a `PosteriorProduct`, for example) do not count; its unknown
    state does.

    Returns
    -------
    dict
        "cost", "unknown" and "priors"; None if they are not stated.

    Raises
    ------
    ValueError
        If the last step has no costs, but a classifier inside of it has, which decides nothing.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from emacm import CostSensitiveGaussianBayes
    >>> model = CostSensitiveGaussianBayes(unknown="unknown", priors="uniform")
    >>> stated_costs(make_pipeline(model))
    {'cost': None, 'unknown': 'unknown', 'priors': 'uniform'}
    """
    final = final_estimator(estimator)
    for inner in parts_of(final):
        if not hasattr(final, "cost") and getattr(inner, "cost", None) is not None:
            raise ValueError(
                f"the cost of {type(inner).__name__} has no effect on decisions of "
                f"{type(final).__name__}. Use LeastRiskClassifier({type(final).__name__}(...), "
                f"cost=...)."
            )
    return {name: getattr(final, name, None) for name in ("cost", "unknown", "priors")}


def narrowed(model: Any, known: Iterable[Any], classes: Iterable[Any]) -> Any:
    """Remove classes that do not occur from all costs and priors of an estimator, nested ones too.

    The posterior probability of a class that is absent from training is 0, and so is its
    contribution to every expected cost, Eq. (2.39) of [1]_: removing its column changes no
    decision among those that remain. Priors of the other classes are normalised; that of the
    unknown state stays.

    Parameters
    ----------
    model : estimator
        It is changed; pass a clone. Of a cost, a DataFrame keeps every decision, a mapping loses
        the pairs that name an absent class, an array its rows and columns. What does not fit the
        classes stays as it is.
    known, classes : iterable of labels
        Classes that occur, and all classes, sorted.

    Returns
    -------
    estimator
        The same object.

    Examples
    --------
    >>> from emacm import CostSensitiveGaussianBayes
    >>> model = CostSensitiveGaussianBayes({("ok", "worn"): 10, ("ok", "dry"): 5})
    >>> narrowed(model, ["dry", "ok"], ["dry", "ok", "worn"])
    CostSensitiveGaussianBayes(cost={('ok', 'dry'): 5})
    """
    every, occurring = plain_labels(classes), plain_labels(known)
    absent = {place: label for place, label in enumerate(every) if label not in occurring}
    of_some = {"cost": _cost_of_some, "priors": _priors_of_some}
    for name, value in model.get_params().items() if absent else ():
        parameter = name.rpartition("__")[2]
        if parameter in of_some:
            model.set_params(**{name: of_some[parameter](value, absent, every)})
    return model


def _cost_of_some(cost: Any, absent: Mapping[int, Any], every: Sequence[Any]) -> Any:
    """Remove absent classes, given by their place."""
    n_classes = len(every)
    if isinstance(cost, pd.DataFrame):
        return cost.drop(columns=[*absent.values()], errors="ignore")
    if isinstance(cost, Mapping):
        named = set(absent.values())
        return {pair: value for pair, value in cost.items() if not named & set(pair)}
    if np.shape(cost) not in {(n_classes,) * 2, (n_classes + 1,) * 2}:  # such as None
        return cost
    return np.delete(np.delete(cost, [*absent], axis=0), [*absent], axis=1)


def _priors_of_some(priors: Any, absent: Mapping[int, Any], every: Sequence[Any]) -> Any:
    """Remove absent classes, given by their place; the unknown state keeps its probability."""
    is_named = isinstance(priors, Mapping | pd.Series)
    if not is_named and np.shape(priors) not in {(len(every),), (len(every) + 1,)}:
        return priors  # such as "uniform"
    labels = None if is_named else [*every, "the unknown state"][: len(priors)]
    kept = pd.Series(dict(priors) if is_named else priors, labels)
    kept = kept.drop([*absent.values()], errors="ignore")
    is_class = kept.index.isin(every)
    kept[is_class] *= (1 - kept[~is_class].sum()) / kept[is_class].sum()
    return kept.to_dict() if is_named else kept.to_numpy()
