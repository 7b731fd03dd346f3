"""One decision from several classifiers: the product of their posterior probabilities."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from sklearn.base import ClassifierMixin
from sklearn.utils import Bunch
from sklearn.utils.validation import check_is_fitted

from emacm._checks import located
from emacm._saved import SavedEstimator
from emacm.calibration.left_out import Array
from emacm.decisions.costs import check_possible
from emacm.decisions.least_risk import (
    CombinedRiskMixin,
    LeastRiskClassifier,
    pooled_log_posterior,
)
from emacm.decisions.pipelines import groups_are_units, groups_options, groups_parameters


class PosteriorProduct(CombinedRiskMixin, ClassifierMixin, SavedEstimator):
    """Combine classifiers by the product of their posteriors, and decide by least risk.

    Each member is fitted to the same recordings and uses one channel, or any other part of
    them. Separate assessments are combined (future work in the thesis) by the product rule [1]_::

        log p(k | x_1..x_m) = log P(k) + sum_j (log p_j(k | x_j) - log P_j(k)) + constant

    The posterior of each member is divided by its own prior P_j; the shared prior P applies once.

    Parameters
    ----------
    estimators : list of (str, estimator)
        Names and members: classifiers or pipelines with `predict_proba`. Their costs have no
        effect. If they have an unknown state, all must have the same one, with the same rate.
    cost : None, array-like, DataFrame or mapping, default=None
        Cost of each decision under each true class, as for `LeastRiskClassifier`.
    priors : None, "uniform", array-like or mapping, default=None
        Probability of each class in service. None: the prior of the members, which must then be
        the same for all. That of the unknown state, if not stated: the largest of the members.

    Attributes
    ----------
    classes_, truths_, decisions_, cost_, priors_, unknown_prior_
        As for `LeastRiskClassifier`; `cost` and `priors` take effect when a decision is made.
    member_priors_ : ndarray of shape (n_members, n_classes)
        The prior within the posterior of each member, see `LeastRiskClassifier`.
    estimators_ : list of estimators
        The fitted members; `named_estimators_` contains them by name.
    n_features_in_, feature_names_in_ : int and ndarray of shape (n_features,)
        Number and names of the features, if the members have them.

    See Also
    --------
    emacm.CostSensitiveGaussianBayes : One classifier for all features.

    Notes
    -----
    The product is exact if the channels are independent within each class. Otherwise the posterior
    is over-confident: one channel given twice squares its odds. Of two channels with a correlation
    of 0, 0.5 and 0.9, and a missed detection that costs 20, it predicts a mean cost of 0.39, 0.36
    and 0.35; paid are 0.39, 0.52 and 0.66. One classifier of both, whose covariance describes their
    dependence, predicts and pays 0.39, 0.45 and 0.47 (``benchmarks/classifier.py``): use that.

    A member whose features are far outside of its training, as of a dead channel, does not decide:
    the product is as typical as its least typical member (`typicality`), and unknown beyond
    `unknown_limit_`, if its members have an unknown state.

    References
    ----------
    .. [1] Kittler, Hatef, Duin and Matas, On combining classifiers, IEEE Transactions on
       Pattern Analysis and Machine Intelligence 20 (3), 1998.

    Examples
    --------
    >>> from sklearn.compose import make_column_transformer
    >>> from sklearn.pipeline import make_pipeline
    >>> from emacm import CostSensitiveGaussianBayes, PosteriorProduct
    >>> X = np.array([[0.0, 1], [1, 0], [2, 2], [3, 4], [4, 3], [5, 5]])
    >>> y = ["healthy"] * 3 + ["worn"] * 3
    >>> def classifier_of(column):
    ...     select = make_column_transformer(("passthrough", [column]))
    ...     return make_pipeline(select, CostSensitiveGaussianBayes())
    >>> members = [("current", classifier_of(0)), ("gear", classifier_of(1))]
    >>> product = PosteriorProduct(members, cost={("healthy", "worn"): 10}).fit(X, y)
    >>> product.predict(X[[2, 3]])
    array(['healthy', 'worn'], dtype='<U7')
    >>> product.set_params(cost={("healthy", "worn"): 100}).predict(X[[2, 3]])
    array(['worn', 'worn'], dtype='<U7')
    """

    __metadata_request__fit: ClassVar = {"groups": True}  # where metadata routing is enabled

    def __init__(self, estimators: Any, cost: Any = None, *, priors: Any = None):
        self.estimators = estimators
        self.cost = cost
        self.priors = priors

    @property
    def needs_groups(self) -> bool:
        """Whether a member learns from groups."""
        return any(groups_parameters(member) for member in self._named_pairs().values())

    @property
    def groups_are_units(self) -> bool:
        """Whether a member learns how units differ."""
        return any(groups_are_units(member) for member in self._named_pairs().values())

    def fit(self, X, y, groups=None):
        """Fit a clone of every member.

        Parameters
        ----------
        X : list of Recording, or table
            Input of the members; it is passed on unchanged.
        y : array-like of shape (n_recordings,)
            True class of each recording.
        groups : array-like of shape (n_recordings,), default=None
            Labels of recordings that were measured together, for those members that learn from
            groups, such as `CostSensitiveGaussianBayes` with a temperature.

        Raises
        ------
        TypeError, ValueError
            If a parameter, an input or a member (which is named) is invalid, members have
            different priors and `priors` is None, or different unknown states.
        """
        fitted = {}
        for name, member in self._checked_members().items():
            with located(f"member {name!r}"):
                options = groups_options(member, groups)
                fitted[name] = LeastRiskClassifier(member).fit(X, y, **options)
        self._members = fitted
        self.classes_ = next(iter(fitted.values())).classes_
        self.named_estimators_ = Bunch(**{name: m.estimator_ for name, m in fitted.items()})
        self.estimators_ = list(self.named_estimators_.values())
        self._cost_table()
        self._agreed("unknown_rate")
        self._check_priors()
        return self

    @property
    def member_priors_(self) -> Array:
        """The prior within the posterior of each member, shape (n_members, n_classes)."""
        return np.array([member.priors_ for member in self._members.values()])

    @property
    def _frequencies(self):
        return self.member_priors_[0]

    @property
    def _inside(self):
        return getattr(self, "named_estimators_", None) or self._named_pairs()

    def predict_log_proba(self, X):
        """Return the logarithm of the combined posterior, shape (n_recordings, n_classes)."""
        check_is_fitted(self)
        self._check_priors()
        logs = []
        for name, member in self._members.items():
            with located(f"member {name!r}"):
                logs.append(member.predict_log_proba(X))
        return pooled_log_posterior(logs, self.member_priors_, self.priors_)

    def get_params(self, deep=True):
        """Return parameters; with `deep`, also members, and theirs as ``name__parameter``."""
        parameters = super().get_params()
        for name, member in self._named_pairs().items() if deep else ():
            inner = member.get_params() if hasattr(member, "get_params") else {}
            parameters |= {name: member} | {f"{name}__{key}": inner[key] for key in inner}
        return parameters

    def set_params(self, **params):
        """Set parameters, members by name, and parameters of members as ``name__parameter``."""
        self.estimators = params.pop("estimators", self.estimators)
        replaced = {name: params.pop(name) for name in self._named_pairs() if name in params}
        if replaced:
            self.estimators = [(name, replaced.get(name, old)) for name, old in self.estimators]
        return super().set_params(**params)

    def _named_pairs(self) -> dict[str, Any]:
        """Return members by name; none if `estimators` are not pairs (name, estimator)."""
        pairs: Any = self.estimators if isinstance(self.estimators, list | tuple) else [None]
        valid = (isinstance(p, tuple | list) and len(p) == 2 for p in pairs)
        return dict(pairs) if all(valid) and all(isinstance(p[0], str) for p in pairs) else {}

    def _checked_members(self) -> dict[str, Any]:
        members, taken = self._named_pairs(), set(super().get_params())
        if not members:
            raise ValueError(
                f"estimators must be a list of pairs (name, classifier), got {self.estimators!r}."
            )
        names = [name for name, _ in self.estimators]
        if len(members) < len(names) or taken & set(names) or any("__" in name for name in names):
            raise ValueError(
                f"names in estimators must differ, contain no '__' and be none of the parameters "
                f"{sorted(taken)}; got {names}."
            )
        return members

    def _check_priors(self) -> None:
        own = {name: member.priors_ for name, member in self._members.items()}
        if self.priors is None and np.ptp(self.member_priors_, axis=0).max() > 1e-6:
            listed = {name: prior.round(6).tolist() for name, prior in own.items()}
            raise ValueError(
                f"members have different priors: {listed}. Give priors=..., those in service."
            )
        for name, prior in own.items():
            check_possible(self.priors_, prior, self.classes_, f"member {name!r}")
