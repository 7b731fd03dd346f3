"""One decision from several classifiers: the product of their posterior probabilities."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import ClassifierMixin
from sklearn.utils import Bunch, get_tags
from sklearn.utils.validation import check_is_fitted

from emacm._checks import located
from emacm._saved import SavedEstimator
from emacm.decisions.least_risk import LeastRiskClassifier, check_possible
from emacm.decisions.least_risk_mixin import LeastRiskMixin
from emacm.decisions.opinion_pools import pooled_log_posterior
from emacm.decisions.priors import class_priors

Array = NDArray[np.float64]


class PosteriorProduct(LeastRiskMixin, ClassifierMixin, SavedEstimator):
    """Combine classifiers by the product of their posteriors, and decide by least risk.

    Each member is fitted to the same recordings and uses one channel, or any other part of
    them. Combining separate assessments is future work in [1]_, chapter 5; the product rule [2]_::

        log p(k | x_1..x_m) = log P(k) + sum_j (log p_j(k | x_j) - log P_j(k)) + constant

    divides the posterior of each member by its own prior P_j, and applies the shared prior P once.

    Parameters
    ----------
    estimators : list of (str, estimator)
        Names and members: classifiers or pipelines with `predict_proba`. Costs of members have
        no effect.
    cost : None, array-like, DataFrame or mapping, default=None
        Cost of each decision under each true class; rows are decisions. None: 0-1. See
        `emacm.decisions.costs.cost_table`.
    priors : None, "uniform", array-like or mapping, default=None
        Probability of each class in service, as for `CostSensitiveGaussianBayes`. None: the
        prior of the members, which must then be the same for all.

    Attributes
    ----------
    classes_, decisions_, cost_, priors_ : ndarray
        As for `LeastRiskClassifier`; `cost` and `priors` take effect when a decision is made.
    member_priors_ : ndarray of shape (n_members, n_classes)
        The prior within the posterior of each member, see `LeastRiskClassifier`.
    estimators_ : list of estimators
        The fitted members; `named_estimators_` contains them by name.
    n_features_in_, feature_names_in_ : int and ndarray of shape (n_features,)
        Number and names of the features, if the members have them.

    Notes
    -----
    The product is exact if the channels are independent within each class. Otherwise information
    that they share counts several times, and the posterior is over-confident: one channel given
    twice squares its odds. Then use one classifier for all channels, whose covariance describes
    their dependence.

    References
    ----------
    .. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
       Condition Monitoring.
    .. [2] Kittler, Hatef, Duin and Matas, On combining classifiers, IEEE Transactions on
       Pattern Analysis and Machine Intelligence 20 (3), 1998.

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn.compose import make_column_selector, make_column_transformer
    >>> from sklearn.pipeline import make_pipeline
    >>> from emacm import CostSensitiveGaussianBayes, PosteriorProduct
    >>> X = pd.DataFrame({"current@0-1": [0.0, 1, 2, 3, 4, 5], "gear@0-1": [1.0, 0, 2, 4, 3, 5]})
    >>> y = ["healthy"] * 3 + ["worn"] * 3
    >>> def select_channel(channel):
    ...     columns = make_column_selector(f"^{channel}[+-]?@")
    ...     return make_column_transformer(("passthrough", columns))
    >>> members = [
    ...     (channel, make_pipeline(select_channel(channel), CostSensitiveGaussianBayes()))
    ...     for channel in ("current", "gear")
    ... ]
    >>> product = PosteriorProduct(members, cost={("healthy", "worn"): 10}).fit(X, y)
    >>> product.predict(X.iloc[[2, 3]])
    array(['healthy', 'worn'], dtype='<U7')
    >>> product.set_params(cost={("healthy", "worn"): 100}).predict(X.iloc[[2, 3]])
    array(['worn', 'worn'], dtype='<U7')
    """

    def __init__(self, estimators: Any, cost: Any = None, *, priors: Any = None):
        self.estimators = estimators
        self.cost = cost
        self.priors = priors

    def fit(self, X, y, sample_weight=None):
        """Fit a clone of every member.

        Parameters
        ----------
        X : list of Recording, or table
            Input of the members; it is passed on unchanged.
        y : array-like of shape (n_recordings,)
            True class of each recording.
        sample_weight : array-like of shape (n_recordings,), default=None
            How often each recording counts, for every member; in a pipeline, the last step.

        Returns
        -------
        self : PosteriorProduct
            The fitted classifier.

        Raises
        ------
        TypeError, ValueError
            If a parameter or an input is invalid, or members have different priors and `priors`
            is None. Errors of a member contain its name.
        """
        fitted = {}
        for name, member in self._checked_members().items():
            with located(f"member {name!r}"):
                fitted[name] = LeastRiskClassifier(member).fit(X, y, sample_weight)
        self._members = fitted
        self.classes_ = next(iter(fitted.values())).classes_
        self.estimators_ = [member.estimator_ for member in fitted.values()]
        self.named_estimators_ = Bunch(**dict(zip(fitted, self.estimators_, strict=True)))
        self._cost_table()
        self._check_priors()
        return self

    @property
    def member_priors_(self) -> Array:
        """The prior within the posterior of each member, shape (n_members, n_classes)."""
        return np.array([member.priors_ for member in self._members.values()])

    @property
    def priors_(self) -> Array:
        """Prior probabilities in effect, shape (n_classes,)."""
        own = self.member_priors_[0]
        return own if self.priors is None else class_priors(self.priors, self.classes_, own)

    def predict_log_proba(self, X):
        """Return the logarithm of the combined posterior, shape (n_recordings, n_classes).

        Parameters
        ----------
        X : list of Recording, or table
            Input of the members.

        Returns
        -------
        log_posterior : ndarray of shape (n_recordings, n_classes)
            -inf where the prior is 0.
        """
        check_is_fitted(self)
        self._check_priors()
        logs = []
        for name, member in self._members.items():
            with located(f"member {name!r}"):
                logs.append(member.predict_log_proba(X))
        return pooled_log_posterior(logs, self.member_priors_, self.priors_)

    def get_params(self, deep=True):
        """Return parameters; with `deep`, also members, and theirs as ``name__parameter``."""
        parameters = super().get_params(deep=False)
        for name, member in self._named_pairs().items() if deep else ():
            parameters[name] = member
            if hasattr(member, "get_params"):
                inner = member.get_params(deep=True)
                parameters |= {f"{name}__{key}": value for key, value in inner.items()}
        return parameters

    def set_params(self, **params):
        """Set parameters, members by name, and parameters of members as ``name__parameter``."""
        self.estimators = params.pop("estimators", self.estimators)
        replaced = {name: params.pop(name) for name in self._named_pairs() if name in params}
        if replaced:
            self.estimators = [(name, replaced.get(name, old)) for name, old in self.estimators]
        return super().set_params(**params)

    @property
    def n_features_in_(self):
        """Number of features of the first member."""
        return self._first_member().n_features_in_

    @property
    def feature_names_in_(self):
        """Names of the features of the first member."""
        return self._first_member().feature_names_in_

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        inputs = [get_tags(member).input_tags for member in self._named_pairs().values()]
        tags.input_tags.sparse = bool(inputs) and all(tag.sparse for tag in inputs)
        tags.input_tags.allow_nan = bool(inputs) and all(tag.allow_nan for tag in inputs)
        return tags

    def _first_member(self) -> Any:
        if "_members" not in vars(self):
            raise AttributeError(f"{type(self).__name__} is not fitted.")
        return next(iter(self._members.values()))

    def _named_pairs(self) -> dict[str, Any]:
        """Return members by name; none if `estimators`, not checked yet, are no pairs."""
        pairs: Any = self.estimators if isinstance(self.estimators, list | tuple) else [None]
        return dict(pairs) if all(map(_is_pair, pairs)) else {}

    def _checked_members(self) -> dict[str, Any]:
        members, taken = self._named_pairs(), set(super().get_params(deep=False))
        if not members:
            raise ValueError(
                f"estimators must be a list of at least one pair (name, classifier), got "
                f"{self.estimators!r}."
            )
        names = [name for name, _ in self.estimators]
        if len(members) < len(names) or taken & set(names) or any("__" in name for name in names):
            raise ValueError(
                f"names in estimators must differ, contain no '__' and be none of the parameters "
                f"{sorted(taken)}; got {names}."
            )
        return members

    def _check_priors(self) -> None:
        """Raise if the members have no common prior, or exclude a class that occurs."""
        prior, own, names = self.priors_, self.member_priors_, list(self._members)
        different = np.abs(own - prior).max(axis=1) > 1e-6
        if self.priors is None and different.any():
            other = int(np.argmax(different))
            raise ValueError(
                f"members have different priors of {self.classes_.tolist()}: {names[0]!r} has "
                f"{prior.round(6).tolist()}, {names[other]!r} has "
                f"{own[other].round(6).tolist()}. Give priors=..., those in service."
            )
        for name, member_prior in zip(names, own, strict=True):
            check_possible(prior, member_prior, self.classes_, f"member {name!r}")


def _is_pair(pair: Any) -> bool:
    return isinstance(pair, tuple | list) and len(pair) == 2 and isinstance(pair[0], str)
