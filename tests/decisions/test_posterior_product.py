"""Facts about the product of posteriors: one classifier per channel, one diagnosis."""

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal
from sklearn.base import clone
from sklearn.calibration import CalibratedClassifierCV
from sklearn.compose import make_column_selector, make_column_transformer
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.linear_model import LogisticRegression, RidgeClassifier
from sklearn.model_selection import GridSearchCV
from sklearn.naive_bayes import GaussianNB
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    NewUnitClassifier,
    OrderPSD,
    OrderResampler,
    PosteriorProduct,
    Recording,
    explain_decision,
)

STATES = ["dry 1", "dry 2", "healthy", "spall"]
COLUMNS = ["current@0-1", "current@1-2", "position@0-1", "position@1-2"]


def table(seed, n_each=15):
    """Two channels of two bins, dependent within each state, and the states."""
    rng = np.random.default_rng(seed)
    y = np.repeat(STATES, n_each)
    centres = np.repeat(rng.normal(size=(len(STATES), 4)), n_each, axis=0)
    X = rng.normal(size=(len(y), 4)) @ rng.normal(size=(4, 4)) + 2 * centres
    return pd.DataFrame(X, columns=COLUMNS), y


def seeing(channel, classifier):
    columns = make_column_selector(f"^{channel}[+-]?@")
    return make_pipeline(make_column_transformer(("passthrough", columns)), clone(classifier))


def product(classifier=None, channels=("current", "position"), **options):
    classifier = CostSensitiveGaussianBayes() if classifier is None else classifier
    return PosteriorProduct([(name, seeing(name, classifier)) for name in channels], **options)


MEMBERS = [
    ("one", CostSensitiveGaussianBayes(covariance="tied", shrinkage=0.1)),
    ("other", LogisticRegression()),
]
CHECKS = parametrize_with_checks([PosteriorProduct(MEMBERS)])


@pytest.mark.slow
@pytest.mark.parametrize(CHECKS.args[0], list(CHECKS.args[1]), **CHECKS.kwargs)
def test_every_check_of_scikit_learn_passes(estimator, check):
    check(estimator)


# Known answers


def test_of_any_channels_it_is_bayes_rule_with_block_diagonal_covariances():
    X, y = table(2)
    fused = product(priors=[0.4, 0.1, 0.3, 0.2]).fit(X, y)
    joint = []
    for state, prior in zip(STATES, fused.priors_, strict=True):
        rows = X[y == state].to_numpy()
        blocks = block_diag(np.cov(rows[:, :2].T), np.cov(rows[:, 2:].T))
        joint.append(np.log(prior) + multivariate_normal(rows.mean(axis=0), blocks).logpdf(X))
    expected = np.exp(np.transpose(joint) - np.max(joint, axis=0)[:, np.newaxis])
    expected /= expected.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(fused.predict_proba(X), expected, atol=1e-10)


# Priors


@pytest.mark.parametrize(
    ("member", "prior"),
    [
        (CostSensitiveGaussianBayes(priors=[0.1, 0.2, 0.3, 0.4]), [0.1, 0.2, 0.3, 0.4]),
        (LinearDiscriminantAnalysis(priors=[0.1, 0.2, 0.3, 0.4]), [0.1, 0.2, 0.3, 0.4]),
        (GaussianNB(priors=[0.1, 0.2, 0.3, 0.4]), [0.1, 0.2, 0.3, 0.4]),
        (make_pipeline(StandardScaler(), GaussianNB(priors=[0.4, 0.3, 0.2, 0.1])), None),
        (GridSearchCV(GaussianNB(priors=[0.4, 0.3, 0.2, 0.1]), {}, cv=2), None),
        (PosteriorProduct([("a", GaussianNB())], priors=[0.4, 0.3, 0.2, 0.1]), None),
        (LogisticRegression(), [0.2, 0.2, 0.4, 0.2]),
        (KNeighborsClassifier(), [0.2, 0.2, 0.4, 0.2]),
        (CalibratedClassifierCV(GaussianNB(priors=[0.4, 0.3, 0.2, 0.1])), [0.2, 0.2, 0.4, 0.2]),
    ],
)
def test_the_prior_of_a_member_is_its_own_or_the_shares_in_training(member, prior):
    X, y = table(7)
    X, y = pd.concat([X, X[y == "healthy"]]), np.append(y, ["healthy"] * 15)
    fused = PosteriorProduct([("one", member)]).fit(X, y)
    np.testing.assert_allclose(fused.priors_, [0.4, 0.3, 0.2, 0.1] if prior is None else prior)


def test_different_priors_of_members_are_refused_unless_one_is_stated():
    X, y = table(8)
    fused = product().set_params(position__costsensitivegaussianbayes__priors=[0.4, 0.2, 0.2, 0.2])
    message = r"'current': \[0.25, .*'position': \[0.4, .* Give priors=\.\.\."
    with pytest.raises(ValueError, match=message):
        fused.fit(X, y)
    fused.set_params(priors="uniform").fit(X, y)
    with pytest.raises(ValueError, match=message):
        fused.set_params(priors=None).predict(X)


def test_a_member_that_cannot_know_a_class_is_refused():
    X, y = table(8)
    fused = product(CostSensitiveGaussianBayes(priors=[0, 0.3, 0.3, 0.4]), priors="uniform")
    with pytest.raises(ValueError, match=r"'current' has the prior 0 of class 'dry 1'.*0.25"):
        fused.fit(X, y)


# Composition


def test_members_and_their_parameters_are_set_by_name():
    fused = product()
    fused.set_params(current=GaussianNB(), position__costsensitivegaussianbayes__shrinkage=0.5)
    assert isinstance(fused.estimators[0][1], GaussianNB)
    assert fused.estimators[1][1][-1].shrinkage == 0.5
    with pytest.raises(ValueError, match="Invalid parameter 'vibration'"):
        fused.set_params(vibration=GaussianNB())


# Recordings


def run(state, seed, fs=500, seconds=4):
    """A drive that goes forth and back; current and position show wear at different orders."""
    rng = np.random.default_rng(seed)
    times = np.arange(int(fs * seconds)) / fs
    velocity = 2 * np.pi * (8 + rng.uniform()) * np.sin(2 * np.pi * 0.2 * times + 0.1)
    angle = np.cumsum(velocity) / fs
    worn = 0.3 * (state == "worn")
    channels = {
        "current": worn * np.sin(3 * angle) + 0.3 * rng.standard_normal(len(times)),
        "position": worn * np.sin(5 * angle) + 0.3 * rng.standard_normal(len(times)),
    }
    return Recording(channels, fs, velocity=velocity)


@pytest.fixture(scope="module")
def fleet():
    y = np.array(["healthy", "worn"] * 10)
    return [run(state, seed) for seed, state in enumerate(y)], y


def features(**options):
    return make_pipeline(
        OrderResampler(2 * np.pi / 32, **options),
        OrderPSD(4),
        BinTransformer(2, max_order=12),
        FunctionTransformer(lambda X: np.log(X + 1e-20), feature_names_out="one-to-one"),
    )


GAUSSIAN = CostSensitiveGaussianBayes(covariance="tied", shrinkage=0.1)


def test_what_members_explain_adds_up_to_the_log_odds_of_the_product(fleet):
    X, y = fleet
    members = [
        (name, make_pipeline(features(channels=[name]), GAUSSIAN))
        for name in ("current", "position")
    ]
    fused = PosteriorProduct(members).fit(X, y)  # as many of each state: the prior odds are 1
    logs = fused.predict_log_proba(X[:1])[0]
    labels = {"decision": "healthy", "against": "worn"}
    explained = [explain_decision(one, X[0], **labels) for one in fused.estimators_]
    assert sum(table.attrs["value"] for table in explained) == pytest.approx(logs[0] - logs[1])


# The unknown state of members


def two_channels(seed, n_units=12):
    """Two features of healthy and worn units, one for each channel, 8 standard deviations apart."""
    y = np.tile(np.repeat(["healthy", "worn"], 5), n_units)
    X = np.random.default_rng(seed).normal(size=(len(y), 2))
    return X + 8.0 * (y == "worn")[:, np.newaxis], y, np.repeat(np.arange(n_units), 10)


def of_two_channels(*options, **shared):
    members = []
    for column, own in enumerate(options):
        select = make_column_transformer(("passthrough", [column]))
        classifier = CostSensitiveGaussianBayes(covariance="tied", **own)
        members.append((f"channel {column}", make_pipeline(select, classifier)))
    return PosteriorProduct(members, **shared)


UNKNOWN = {"unknown": "unknown", "unknown_rate": 0.02}


def test_a_member_far_from_its_training_makes_the_state_unknown():
    X, y, units = two_channels(0)
    fused = of_two_channels(UNKNOWN, UNKNOWN).fit(X, y, groups=units)
    decided = fused.predict([[-60, 0], [0, 80], [0, 0], [8, 8]]).tolist()
    assert decided == ["unknown", "unknown", "healthy", "worn"]
    assert fused.truths_.tolist() == fused.decisions_.tolist() == ["healthy", "worn", "unknown"]
    new = two_channels(1, n_units=400)[0]
    for level in (0.02, 0.1, 0.5):  # typicality is uniform for known recordings
        assert np.mean(fused.typicality(new) <= level) == pytest.approx(level, rel=0.3)
    assert np.mean(fused.predict(new) == "unknown") == pytest.approx(0.016, abs=0.006)
    priors = {"healthy": 0.4, "worn": 0.4, "unknown": 0.2}
    assert fused.set_params(priors=priors).unknown_prior_ == pytest.approx(0.2)


@pytest.mark.parametrize(
    "other", [{}, UNKNOWN | {"unknown": "new"}, UNKNOWN | {"unknown_rate": 0.1}]
)
def test_members_with_different_unknown_states_are_refused(other):
    X, y, units = two_channels(0)
    with pytest.raises(ValueError, match=r"different unknown.*'channel 1': "):
        of_two_channels(UNKNOWN, other).fit(X, y, groups=units)


@pytest.mark.parametrize("dead", ["current", "position"])
def test_a_dead_channel_does_not_decide(fleet, dead):
    X, y = fleet
    classifier = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto", **UNKNOWN)
    names = ("current", "position")
    members = [(name, make_pipeline(features(channels=[name]), classifier)) for name in names]
    fused = PosteriorProduct(members, {("healthy", "worn"): 10})
    fused.fit(X, y, groups=np.arange(20) // 2)
    worn, zeros = [run("worn", 100 + seed) for seed in range(12)], {dead: np.zeros(2000)}
    silent = [Recording({**x.signals, **zeros}, x.fs, velocity=x.velocity) for x in worn]
    assert fused.predict(worn).tolist() == ["worn"] * 12
    assert fused.predict(silent).tolist() == ["unknown"] * 12


# Refusals


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"estimators": []}, ValueError, r"pairs \(name, classifier\), got \[\]"),
        ({"estimators": GaussianNB()}, ValueError, "list of pairs"),
        ({"estimators": [("a", GaussianNB()), (1, None)]}, ValueError, "list of pairs"),
        ({"estimators": [("a", GaussianNB())] * 2}, ValueError, r"must differ.*got \['a', 'a'\]"),
        ({"estimators": [("a__b", GaussianNB())]}, ValueError, "no '__'.*'a__b'"),
        ({"estimators": [("cost", GaussianNB())]}, ValueError, r"none of the parameters .*'cost'"),
        ({"estimators": [("a", "drop")]}, TypeError, "member 'a': Cannot clone .*'drop'"),
        ({"estimators": [("a", RidgeClassifier())]}, TypeError, "'a': Ridge.*no predict_proba"),
        ({"priors": [1.0]}, ValueError, "each of the 4 classes"),
        ({"cost": np.eye(2)}, ValueError, r"square array of shape \(4, 4\)"),
    ],
)
def test_invalid_parameters_are_refused(options, error, message):
    X, y = table(20)
    with pytest.raises(error, match=message):
        product().set_params(**options).fit(X, y)


def test_what_is_no_member_has_no_parameters():
    names = PosteriorProduct([("a", "drop"), ("b", GaussianNB())]).get_params()
    assert {"a", "b__priors"} < {*names}


def test_errors_of_a_member_contain_its_name():
    X, y = table(20)
    with pytest.raises(ValueError, match="member 'position': shrinkage"):
        product().set_params(position__costsensitivegaussianbayes__shrinkage=2).fit(X, y)
    fused = product().fit(X, y)
    with pytest.raises(ValueError, match=r"member 'position': .*NaN"):
        fused.predict(X.assign(**{"position@0-1": np.nan}))
    with pytest.raises(ValueError, match="inconsistent numbers of samples"):
        fused.fit(X, y[:-1])


def test_members_that_learn_from_groups_get_them():
    X, y = table(3, n_each=12)
    units = np.arange(len(y)) % 12 // 2
    columns = {"current": [0, 1], "position": [2, 3]}

    def member(channel, **options):
        select = make_column_transformer(("passthrough", columns[channel]))
        return make_pipeline(select, CostSensitiveGaussianBayes(covariance="tied", **options))

    of_groups = member("current", temperature="groups")
    product = PosteriorProduct([("current", of_groups), ("position", member("position"))])
    product.fit(X, y, groups=units)
    alone = clone(of_groups).fit(X, y, costsensitivegaussianbayes__groups=units)
    assert product.needs_groups
    assert not product.groups_are_units
    new_units = ("new", NewUnitClassifier())
    assert PosteriorProduct([*product.estimators, new_units]).groups_are_units
    assert product.named_estimators_.current[-1].temperature_ == alone[-1].temperature_
    assert product.named_estimators_["position"][-1].temperature_ == 1
