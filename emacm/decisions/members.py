"""The members of a classifier that combines others: their names, weights, priors, posteriors."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import has_fit_parameter

from emacm._checks import located
from emacm.decisions.pipelines import final_estimator

Array = NDArray[np.float64]


def named_pairs(estimators: Any) -> dict[str, Any]:
    """Return members by name; none of them if they are not pairs (name, estimator).

    Parameters are set and read before anything is checked.

    Examples
    --------
    >>> named_pairs([("current", 1), ("vibration", 2)]), named_pairs("current")
    ({'current': 1, 'vibration': 2}, {})
    """
    if not isinstance(estimators, list | tuple) or not all(map(_is_pair, estimators)):
        return {}
    return {name: member for name, member in estimators}


def checked_members(estimators: Any, taken: set[str]) -> dict[str, Any]:
    """Return members by name, or say what is wrong with them.

    Parameters
    ----------
    estimators : list of (str, estimator)
        Members.
    taken : set of str
        Names of parameters, which no member may have.

    Returns
    -------
    members : dict of str to estimator
        In the same order.

    Raises
    ------
    ValueError
        If there is none, one is no pair, or a name occurs twice, is taken or holds "__".
    TypeError
        If one is no estimator.
    """
    if not isinstance(estimators, list | tuple) or not len(estimators):
        raise ValueError(
            f"estimators must be a list of at least one pair (name, classifier), "
            f"got {estimators!r}."
        )
    for place, pair in enumerate(estimators):
        if not _is_pair(pair):
            raise ValueError(
                f"estimators must hold pairs (name, classifier), got {pair!r} at place {place}."
            )
    names = [name for name, _ in estimators]
    for name, member in estimators:
        if names.count(name) > 1 or name in taken or "__" in name:
            raise ValueError(
                f"names in estimators must differ, hold no '__' and be none of the parameters "
                f"{sorted(taken)}; got {names}."
            )
        if not hasattr(member, "fit"):
            raise TypeError(f"member {name!r} must be a classifier, got {member!r}.")
    return named_pairs(estimators)


def fitted_member(name: str, member: Any, X: Any, y: Any, handed: dict[str, Any]) -> Any:
    """Fit a clone of a member; an error says whose it is."""
    with located(f"member {name!r}"):
        return clone(member).fit(X, y, **handed)


def weight_parameter(name: str, member: Any) -> str:
    """Name by which the `fit` of a member takes weights: in a pipeline, those of the last step.

    Raises
    ------
    TypeError
        If it takes none.

    Examples
    --------
    >>> from sklearn.naive_bayes import GaussianNB
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.preprocessing import StandardScaler
    >>> weight_parameter("current", make_pipeline(StandardScaler(), GaussianNB()))
    'gaussiannb__sample_weight'
    """
    prefix, last = "", member
    while isinstance(last, Pipeline):
        step, last = last.steps[-1]
        prefix += f"{step}__"
    if not has_fit_parameter(last, "sample_weight"):
        raise TypeError(
            f"member {name!r} ({type(last).__name__}) takes no sample_weight. Leave the weights "
            f"out, or enable scikit-learn's metadata routing, by which members request them."
        )
    return f"{prefix}sample_weight"


def member_prior(name: str, member: Any, classes: NDArray[Any], counts: Array) -> Array:
    """Return the prior within the posterior of a fitted member.

    Parameters
    ----------
    name : str
        Its name.
    member : classifier
        Fitted.
    classes : ndarray of shape (n_classes,)
        The classes it must know.
    counts : ndarray of shape (n_classes,)
        Recordings of each class in training, as weighted. Their shares are the prior of a
        member that states none (assumed: what learns posteriors directly learns those of
        its training set).

    Returns
    -------
    prior : ndarray of shape (n_classes,)
        `priors_` or `class_prior_` of the last step of a pipeline, or of the best estimator
        of a search; else the shares.

    Raises
    ------
    TypeError
        If it has no posteriors.
    ValueError
        If it knows other classes.
    """
    if not hasattr(member, "predict_proba"):
        raise TypeError(
            f"member {name!r} ({type(member).__name__}) has no predict_proba, so there is no "
            f"posterior to multiply. Put it into a CalibratedClassifierCV, or leave it out."
        )
    known = np.asarray(member.classes_)
    if not np.array_equal(known, classes):
        raise ValueError(
            f"member {name!r} knows the classes {known.tolist()}, the recordings have "
            f"{classes.tolist()}: posteriors can be multiplied for the same classes only. "
            f"Fit it on all of them."
        )
    final = final_estimator(member)
    for attribute in ("priors_", "class_prior_"):
        if hasattr(final, attribute):
            return np.asarray(getattr(final, attribute), dtype=np.float64)
    return counts / counts.sum()


def log_posterior(name: str, member: Any, X: Any) -> Array:
    """Return the logarithm of a member's posterior, shape (n_recordings, n_classes).

    Raises
    ------
    ValueError
        If the member refuses X, or answers NaN; the message names it.
    """
    with located(f"member {name!r}"), np.errstate(divide="ignore"):
        if hasattr(member, "predict_log_proba"):
            logs = np.asarray(member.predict_log_proba(X), dtype=np.float64)
        else:
            logs = np.log(np.asarray(member.predict_proba(X), dtype=np.float64))
        unknown = np.isnan(logs).any(axis=1)
        if unknown.any():
            raise ValueError(
                f"its posterior of recording {int(np.argmax(unknown))} is NaN, which no product "
                f"survives. Look at its features of that recording."
            )
    return logs


def _is_pair(pair: Any) -> bool:
    return isinstance(pair, tuple | list) and len(pair) == 2 and isinstance(pair[0], str)
