"""One diagnosis from several: the posteriors of one classifier per channel, multiplied."""

from __future__ import annotations

from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from sklearn import get_config
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils import Bunch, assert_all_finite, check_consistent_length, get_tags
from sklearn.utils.metadata_routing import MetadataRouter, MethodMapping, process_routing
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, column_or_1d

from emacm._checks import check_number
from emacm.decisions.costs import cost_table
from emacm.decisions.labels import check_classes
from emacm.decisions.members import (
    checked_members,
    fitted_member,
    log_posterior,
    member_prior,
    named_pairs,
    weight_parameter,
)
from emacm.decisions.metrics import check_weights, fraction_correct
from emacm.decisions.opinion_pools import pooled_log_posterior
from emacm.decisions.priors import class_priors
from emacm.decisions.risks import LeastRisk, conditional_risk

Array = NDArray[np.float64]


class PosteriorProduct(ClassifierMixin, BaseEstimator):
    """Combine classifiers by the product of their posteriors, and decide by least risk.

    Each member is fitted on the same recordings, and looks at one channel, or at whatever
    it chooses of them. The fusion of separate assessments is a next step named in [1]_, chapter 5;
    the product rule is that of [2]_::

        log p(k | x_1..x_m) = log P(k) + sum_j (log p_j(k | x_j) - log P_j(k)) + constant

    Each member's own prior P_j is divided out, and the shared prior P enters once.

    Parameters
    ----------
    estimators : list of (str, estimator)
        Names and members: classifiers or pipelines with `predict_proba`. Costs
        of a member play no part, only its posteriors do.
    priors : None, "uniform", array-like or mapping, default=None
        Probability of each class in service, as for `CostSensitiveGaussianBayes`. None: the
        prior of the members, who must then have the same.
    cost : None, array-like, DataFrame or mapping, default=None
        Cost of each decision under each truth; rows are the decision. None: 0-1. See
        `emacm.decisions.costs.cost_table`.
    weights : None or array-like of shape (n_members,), default=None
        How much of each member's evidence counts; see Notes. None: all of it, 1 each.
    n_jobs : int, optional
        Members fitted at the same time, under joblib's active backend (by default,
        threads).

    Attributes
    ----------
    classes_ : ndarray of shape (n_classes,)
        The possible truths, sorted.
    decisions_ : ndarray of shape (n_decisions,)
        What `predict` can answer; ties go to the first.
    cost_ : ndarray of shape (n_decisions, n_classes)
        Cost of each of `decisions_` under each of `classes_`.
    priors_ : ndarray of shape (n_classes,)
        The shared prior.
    member_priors_ : ndarray of shape (n_members, n_classes)
        The prior within each member's posterior.
    weights_ : ndarray of shape (n_members,)
        Exponents of the members' likelihoods.
    estimators_ : list of estimators
        The fitted members; `named_estimators_` has them by name.
    n_features_in_ : int
        Number of features, if members count them.
    feature_names_in_ : ndarray of shape (n_features,)
        Names of the features, if members know any.

    Notes
    -----
    The product is exact where channels are independent within each class. Where
    they are not, what they share counts as often as it is seen, and the posterior is too sure
    of itself: one channel given twice squares its odds. The most probable class may stay the
    same; a decision by cost need not. Remedies: all channels into one classifier,
    whose covariance knows how they depend; or `weights` below 1 (exponents of the
    likelihoods, a logarithmic opinion pool [3]_), chosen by a search with a score that punishes
    overconfidence, ``scoring="neg_log_loss"`` or `neg_expected_cost`. ``1 / m`` for each of
    m copies of a channel is exactly that channel.

    The prior of a member is its `priors_` or `class_prior_`, that of the last step of a
    pipeline and of the best estimator of a search; for a member without, the shares of
    the classes in training, weighted as the recordings are. So members may have been
    trained with different priors, if `priors` says which holds. A member that
    balances its classes by other means (``class_weight="balanced"``) hides its prior: the result
    is then off by a constant factor for each class.

    A product of one member gives it costs, and priors of service: so a `StackingClassifier`
    or a `CalibratedClassifierCV` (which number their classes, and cannot decide for what is
    no class) decides by least risk.

    Log odds add up over the members, so each can be explained by itself:
    ``explain_decision(product.named_estimators_[name], x)`` (but for its prior and weight).

    `sample_weight` reaches every member; in a `Pipeline`, the last step. Anything else goes by
    scikit-learn's metadata routing, if that is enabled.

    References
    ----------
    .. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
       Condition Monitoring.
    .. [2] Kittler, Hatef, Duin and Matas, On combining classifiers, IEEE Transactions on
       Pattern Analysis and Machine Intelligence 20 (3), 1998.
    .. [3] Genest and Zidek, Combining probability distributions, Statistical Science 1 (1),
       1986.

    Examples
    --------
    A member chooses its channel by the names of the columns of one table:

    >>> import pandas as pd
    >>> from sklearn.compose import make_column_selector, make_column_transformer
    >>> from sklearn.pipeline import make_pipeline
    >>> from emacm import CostSensitiveGaussianBayes, PosteriorProduct
    >>> X = pd.DataFrame({"current@0-1": [0.0, 1, 2, 3, 4, 5], "gear@0-1": [1.0, 0, 2, 4, 3, 5]})
    >>> y = ["healthy"] * 3 + ["worn"] * 3
    >>> def of(channel):
    ...     columns = make_column_selector(f"^{channel}[+-]?@")
    ...     return make_pipeline(
    ...         make_column_transformer(("passthrough", columns)), CostSensitiveGaussianBayes()
    ...     )
    >>> members = [(channel, of(channel)) for channel in ("current", "gear")]
    >>> product = PosteriorProduct(members, cost={("healthy", "worn"): 10}).fit(X, y)
    >>> product.predict(X.iloc[[2, 3]])
    array(['healthy', 'worn'], dtype='<U7')
    >>> product.set_params(cost={("healthy", "worn"): 100}).fit(X, y).predict(X.iloc[[2, 3]])
    array(['worn', 'worn'], dtype='<U7')
    """

    def __init__(
        self,
        estimators: Any,
        *,
        priors: Any = None,
        cost: Any = None,
        weights: Any = None,
        n_jobs: int | None = None,
    ):
        self.estimators = estimators
        self.priors = priors
        self.cost = cost
        self.weights = weights
        self.n_jobs = n_jobs

    def fit(self, X, y, sample_weight=None, **fit_params):
        """Fit every member.

        Parameters
        ----------
        X : list of Recording, or table
            What the members take; it is passed on untouched.
        y : array-like of shape (n_recordings,)
            True class of each recording.
        sample_weight : array-like of shape (n_recordings,), default=None
            How often each recording counts, in the members and in their shares.
        **fit_params : dict
            What members request by metadata routing, such as `groups`.

        Returns
        -------
        self : PosteriorProduct
            The fitted classifier.

        Raises
        ------
        ValueError
            If a parameter or an input is invalid, members do not know the same classes, or
            they have different priors and `priors` is None. Errors of a member name it.
        TypeError
            If a member has no `predict_proba`, or cannot take what it is given.
        """
        if y is None:
            raise ValueError("PosteriorProduct requires y to be passed, but the target y is None.")
        members = checked_members(self.estimators, self._own_parameters())
        exponents = _exponents(self.weights, [*members])
        assert_all_finite(y, input_name="y")
        if isinstance(y, list | tuple):
            check_classes(y)
        check_classification_targets(y)
        y = column_or_1d(y, warn=True)
        check_consistent_length(X, y)
        classes, codes = np.unique(y, return_inverse=True)
        counts = np.bincount(codes, check_weights(sample_weight, len(y))).astype(np.float64)
        handed = self._handed(members, sample_weight, fit_params)
        decisions, cost = cost_table(self.cost, classes)
        stated = None if self.priors is None else class_priors(self.priors, classes, counts)
        fitted = Parallel(n_jobs=self.n_jobs, prefer="threads")(
            delayed(fitted_member)(name, member, X, y, handed[name])
            for name, member in members.items()
        )
        plain = np.bincount(codes).astype(np.float64)
        own = [
            member_prior(name, member, classes, counts if _weighted(handed[name]) else plain)
            for name, member in zip(members, fitted, strict=True)
        ]
        self.priors_ = _shared_prior(stated, np.array(own), [*members], classes.tolist())
        self.member_priors_, self.weights_ = np.array(own), exponents
        self.classes_, self.decisions_, self.cost_ = classes, decisions, cost
        self.estimators_ = fitted
        self.named_estimators_ = Bunch(**dict(zip(members, fitted, strict=True)))
        return self

    def predict_log_proba(self, X):
        """Return the logarithm of the combined posterior.

        Parameters
        ----------
        X : list of Recording, or table
            What the members take.

        Returns
        -------
        log_posterior : ndarray of shape (n_recordings, n_classes)
            -inf where the prior is 0.
        """
        check_is_fitted(self)
        logs = [log_posterior(name, member, X) for name, member in self.named_estimators_.items()]
        return pooled_log_posterior(logs, self.member_priors_, self.priors_, self.weights_)

    def predict_proba(self, X):
        """Return the combined posterior, shape (n_recordings, n_classes)."""
        return np.exp(self.predict_log_proba(X))

    def risk(self, X):
        """Conditional risk of each decision, Eq. (2.39), in the unit of the cost.

        Parameters
        ----------
        X : list of Recording, or table
            What the members take.

        Returns
        -------
        risk : ndarray of shape (n_recordings, n_decisions)
            Posterior times `cost_`, columns in the order of `decisions_`.
        """
        return conditional_risk(self.predict_proba(X), self.cost_)

    def predict(self, X):
        """Take the decision of least risk, Eq. (2.43); one of `decisions_` for each recording."""
        scores = np.ascontiguousarray(self.predict_log_proba(X).T)
        return self.decisions_.take(LeastRisk(self.cost_).decide_by_scores(scores))

    def score(self, X, y, sample_weight=None):
        """Share of recordings decided rightly, as for `CostSensitiveGaussianBayes`.

        Parameters
        ----------
        X : list of Recording, or table
            What the members take.
        y : array-like of shape (n_recordings,)
            True classes.
        sample_weight : array-like of shape (n_recordings,), default=None
            How often each recording counts.

        Returns
        -------
        share : float
            Accuracy, 0..1.

        Raises
        ------
        ValueError
            If an input is invalid, or what is right is not known: some decisions are no
            classes, and `y` holds a label that is neither.
        """
        table = self.decisions_, self.classes_, self.cost_
        return fraction_correct(column_or_1d(y), self.predict(X), table, sample_weight)

    def get_params(self, deep=True):
        """Return parameters; with `deep`, also members, and theirs as ``name__parameter``."""
        parameters = super().get_params(deep=False)
        members = named_pairs(self.estimators) if deep else {}
        for name, member in members.items():
            parameters[name] = member
            if hasattr(member, "get_params"):
                inner = member.get_params(deep=True)
                parameters |= {f"{name}__{key}": value for key, value in inner.items()}
        return parameters

    def set_params(self, **params):
        """Set parameters, members by name, and parameters of members as ``name__parameter``."""
        if "estimators" in params:
            self.estimators = params.pop("estimators")
        replaced = {
            name: params.pop(name) for name in named_pairs(self.estimators) if name in params
        }
        if replaced:
            self.estimators = [(name, replaced.get(name, old)) for name, old in self.estimators]
        return super().set_params(**params)

    def get_metadata_routing(self):
        """Return who asks for what: the product for weights, and every member."""
        router = MetadataRouter(owner=type(self).__name__).add_self_request(self)
        mapping = MethodMapping().add(caller="fit", callee="fit")
        return router.add(method_mapping=mapping, **named_pairs(self.estimators))

    @property
    def n_features_in_(self):
        """Number of features, as the first member counts them."""
        return self._of_the_first("n_features_in_")

    @property
    def feature_names_in_(self):
        """Names of the features, as the first member knows them."""
        return self._of_the_first("feature_names_in_")

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        inputs = [get_tags(member).input_tags for member in named_pairs(self.estimators).values()]
        tags.input_tags.sparse = bool(inputs) and all(tag.sparse for tag in inputs)
        tags.input_tags.allow_nan = bool(inputs) and all(tag.allow_nan for tag in inputs)
        return tags

    def _of_the_first(self, name: str) -> Any:
        members = getattr(self, "estimators_", None)
        if members is None:
            raise AttributeError(f"{type(self).__name__} has no {name} before it is fitted.")
        return getattr(members[0], name)

    def _own_parameters(self) -> set[str]:
        return set(super().get_params(deep=False))

    def _handed(
        self, members: dict[str, Any], sample_weight: Any, fit_params: dict[str, Any]
    ) -> dict[str, dict[str, Any]]:
        """Return what is handed to the `fit` of each member."""
        if get_config()["enable_metadata_routing"]:
            if sample_weight is not None:
                fit_params = {**fit_params, "sample_weight": sample_weight}
            routed = process_routing(self, "fit", **fit_params)
            return {name: dict(routed[name].fit) for name in members}
        if fit_params:
            raise TypeError(
                f"fit got {sorted(fit_params)}, which reach the members by metadata routing only: "
                f"call sklearn.set_config(enable_metadata_routing=True), and let members "
                f"request them (set_fit_request)."
            )
        if sample_weight is None:
            return {name: {} for name in members}
        return {
            name: {weight_parameter(name, member): sample_weight}
            for name, member in members.items()
        }


def _weighted(handed: dict[str, Any]) -> bool:
    return any(name.endswith("sample_weight") for name in handed)


def _exponents(weights: Any, names: list[str]) -> Array:
    if weights is None:
        return np.ones(len(names))
    given = weights if isinstance(weights, list | tuple) else np.ravel(weights).tolist()
    if len(given) != len(names):
        raise ValueError(
            f"weights must hold one number for each of the members {names}, got {len(given)}."
        )
    pairs = zip(names, given, strict=True)
    checked = [check_number(value, f"the weight of {name!r}", at_least=0) for name, value in pairs]
    return np.array(checked)


def _shared_prior(
    stated: Array | None, member_priors: Array, names: list[str], classes: list[Any]
) -> Array:
    """Return the prior in service: the stated one, or that on which all members agree."""
    prior = member_priors[0] if stated is None else stated
    apart = np.abs(member_priors - prior).max(axis=1) > 1e-6
    if stated is None and apart.any():
        other = int(np.argmax(apart))
        raise ValueError(
            f"members have different priors of {classes}: {names[0]!r} has "
            f"{prior.round(6).tolist()}, {names[other]!r} has "
            f"{member_priors[other].round(6).tolist()}. State priors=..., those in service."
        )
    mute = np.argwhere((prior > 0) & ~(member_priors > 0))
    if len(mute):
        member, code = mute[0].tolist()
        raise ValueError(
            f"member {names[member]!r} has the prior 0 of class {classes[code]!r}, so it says "
            f"nothing of it, but priors give it {prior[code]:g}. Give the member another prior."
        )
    return prior
