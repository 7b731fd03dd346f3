"""Facts about the classifier of least risk and its scorer."""

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import softmax
from scipy.stats import multivariate_normal
from sklearn.base import clone
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis, QuadraticDiscriminantAnalysis
from sklearn.metrics import make_scorer
from sklearn.naive_bayes import GaussianNB
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.metrics import expected_cost, neg_expected_cost

NAMES = np.array(["ball", "healthy", "screw"])
COST = np.array([[0.0, 8.0, 3.0], [20.0, 0.0, 40.0], [5.0, 6.0, 0.0]])
INSPECT = {("inspect", name): 0.2 for name in NAMES}
CHOICES = [("full", None), ("full", "oas"), ("tied", 0.2), ("tied", "oas"), ("diag", None)]


def draw(seed=0, n_recordings=90, n_features=3, spread=1.0):
    """Equally many recordings of three overlapping classes."""
    rng = np.random.default_rng(seed)
    codes = rng.permutation(np.arange(n_recordings) % 3)
    mixing = np.eye(n_features) + 0.3 * rng.normal(size=(n_features, n_features))
    shape = 1 + 0.5 * codes[:, None] * np.linspace(0, 1, n_features)
    X = rng.normal(size=(n_recordings, n_features)) * shape @ mixing
    return X + spread * np.array([[0.0], [1.0], [-1.0]])[codes], NAMES[codes]


def posterior_by_scipy(model, X, scale=1.0):
    """Posterior of the fitted means, priors and covariances, the latter times `scale`."""
    joint = np.empty((len(X), len(model.classes_)))
    for k, mean in enumerate(model.means_):
        tied = model.covariance == "tied"
        covariance = model.covariances_ if tied else model.covariances_[k]
        covariance = np.diag(covariance) if model.covariance == "diag" else covariance
        joint[:, k] = multivariate_normal(mean, covariance * scale).logpdf(X)
    return softmax(joint + np.log(model.priors_), axis=1)


def assert_same_model(first, second, X):
    for name in ("class_count_", "means_", "covariances_", "priors_", "cost_"):
        expected = getattr(second, name)
        np.testing.assert_allclose(getattr(first, name), expected, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(first.predict_proba(X), second.predict_proba(X), atol=1e-9)
    np.testing.assert_array_equal(first.predict(X), second.predict(X))


# Scikit-learn's own conventions


@pytest.mark.filterwarnings("ignore:The covariance of .* is singular:UserWarning")
@parametrize_with_checks([CostSensitiveGaussianBayes()])
def test_every_check_of_scikit_learn_passes(estimator, check):
    check(estimator)


# Agreement with independent implementations


@pytest.mark.parametrize("solver", ["lsqr", "eigen"])
@pytest.mark.parametrize("shrinkage", [None, 0.0, 0.3, 1.0])
def test_tied_covariances_agree_with_linear_discriminant_analysis(solver, shrinkage):
    X, y = draw(2)
    linear = LinearDiscriminantAnalysis(
        solver=solver, shrinkage=shrinkage, priors=[1 / 3] * 3, store_covariance=True
    ).fit(X, y)
    model = CostSensitiveGaussianBayes(priors="uniform", covariance="tied", shrinkage=shrinkage)
    model.fit(X, y)
    divisors = (90 - 3) / 90  # LDA divides by N
    np.testing.assert_allclose(model.covariances_ * divisors, linear.covariance_, rtol=1e-10)
    rescaled = posterior_by_scipy(model, X, divisors)
    np.testing.assert_allclose(rescaled, linear.predict_proba(X), rtol=1e-6)


@pytest.mark.parametrize("priors", [None, [0.5, 0.2, 0.3]])
def test_full_covariances_agree_with_quadratic_discriminant_analysis(priors):
    X, y = draw(4)
    quadratic = QuadraticDiscriminantAnalysis(priors=priors, store_covariance=True).fit(X, y)
    model = CostSensitiveGaussianBayes(priors=priors).fit(X, y)
    by_n = np.cov(X[y == "ball"].T, bias=True)  # QDA divides by N since 1.8, by N - 1 before
    divisors = (30 - 1) / 30 if np.allclose(quadratic.covariance_[0], by_n) else 1.0
    expected = np.array(quadratic.covariance_)
    np.testing.assert_allclose(model.covariances_ * divisors, expected, rtol=1e-10)
    rescaled = posterior_by_scipy(model, X, divisors)
    np.testing.assert_allclose(rescaled, quadratic.predict_proba(X), rtol=1e-6)


def test_diagonal_covariances_agree_with_naive_bayes():
    X, y = draw(6)
    naive = GaussianNB(var_smoothing=0).fit(X, y)
    model = CostSensitiveGaussianBayes(covariance="diag").fit(X, y)
    divisors = (30 - 1) / 30  # GaussianNB divides by N
    np.testing.assert_allclose(model.covariances_ * divisors, naive.var_, rtol=1e-10)
    rescaled = posterior_by_scipy(model, X, divisors)
    np.testing.assert_allclose(rescaled, naive.predict_proba(X), rtol=1e-6)


# Decisions


def test_inspection_is_chosen_exactly_where_its_risk_is_least():
    X, y = draw(11)
    model = CostSensitiveGaussianBayes(INSPECT).fit(X, y)
    assert model.decisions_.tolist() == [*NAMES, "inspect"]
    inspected = model.predict(X) == "inspect"
    # 0-1 cost: the risk of a class is what its posterior lacks to 1.
    np.testing.assert_array_equal(inspected, model.predict_proba(X).max(axis=1) < 0.8)
    assert 0 < inspected.sum() < len(X)


@pytest.mark.parametrize("covariance", ["full", "tied", "diag"])
def test_far_outliers_and_saturated_posteriors_give_no_nan(covariance):
    X, y = draw(13)
    model = CostSensitiveGaussianBayes(INSPECT, covariance=covariance).fit(X, y)
    far = np.array([[1.0, -1.0, 1.0]]) * np.array([[5e4], [-5e4], [1e100], [-1e149]])
    assert model.predict_joint_log_proba(far[:1]).max() < -1e8
    for values in (model.predict_proba(far), model.risk(far), model.predict_joint_log_proba(far)):
        assert np.isfinite(values).all()
    assert not np.isnan(model.predict_log_proba(far)).any()
    np.testing.assert_allclose(model.predict_proba(far).sum(axis=1), 1, rtol=1e-12)
    assert set(model.predict(far)) <= set(model.decisions_)


def test_features_whose_distances_to_every_class_overflow_are_refused():
    X, y = draw(13)
    model = CostSensitiveGaussianBayes().fit(X * 1e-100, y)
    with pytest.raises(ValueError, match="features of recording 1 are so far from every class"):
        model.predict_proba([[0.0, 0.0, 0.0], [0.0, 0.0, 1e140]])


# Pieces and weights


@pytest.mark.slow
@pytest.mark.parametrize(("covariance", "shrinkage"), CHOICES)
@given(cuts=st.lists(st.integers(1, 89), unique=True, max_size=5), seed=st.integers(0, 99))
@settings(max_examples=10)
def test_any_division_into_parts_gives_the_result_of_one_fit(covariance, shrinkage, cuts, seed):
    X, y = draw(seed)
    model = CostSensitiveGaussianBayes(COST, covariance=covariance, shrinkage=shrinkage)
    pieces = clone(model)
    for start, stop in pairwise([0, *sorted(cuts), 90]):
        pieces.partial_fit(X[start:stop], y[start:stop], classes=NAMES)
    assert_same_model(pieces, model.fit(X, y), X)


def test_partial_fit_goes_on_from_fit_and_fit_starts_afresh():
    X, y = draw(16)
    whole = CostSensitiveGaussianBayes().fit(X, y)
    longer = CostSensitiveGaussianBayes().fit(X[:40], y[:40]).partial_fit(X[40:], y[40:])
    assert_same_model(longer, whole, X)
    assert_same_model(longer.partial_fit(X[:3], y[:3], sample_weight=np.zeros(3)), whole, X)
    again = CostSensitiveGaussianBayes().partial_fit(X[:40], y[:40], classes=NAMES).fit(X, y)
    assert_same_model(again, whole, X)


@pytest.mark.parametrize(("covariance", "shrinkage"), CHOICES)
def test_a_weight_of_k_is_k_recordings_and_zero_leaves_out(covariance, shrinkage):
    X, y = draw(17)
    weight = np.random.default_rng(17).integers(0, 4, 90)
    model = CostSensitiveGaussianBayes(COST, covariance=covariance, shrinkage=shrinkage)
    repeated = clone(model).fit(np.repeat(X, weight, axis=0), np.repeat(y, weight))
    assert_same_model(clone(model).fit(X, y, sample_weight=weight), repeated, X)
    pieces = clone(model).partial_fit(X[:50], y[:50], NAMES, weight[:50])
    assert_same_model(pieces.partial_fit(X[50:], y[50:], sample_weight=weight[50:]), repeated, X)


def test_a_class_not_seen_yet_is_never_decided():
    X, y = draw(18)
    seen = y != "screw"
    model = CostSensitiveGaussianBayes().partial_fit(X[seen], y[seen], classes=NAMES)
    assert model.priors_[2] == 0
    assert set(model.predict(X)) == {"ball", "healthy"}
    np.testing.assert_array_equal(model.predict_proba(X)[:, 2], 0)
    whole = CostSensitiveGaussianBayes().fit(X, y)
    assert_same_model(model.partial_fit(X[~seen], y[~seen]), whole, X)


@pytest.mark.parametrize("priors", ["uniform", [0.2, 0.3, 0.5]])
def test_a_class_with_a_prior_and_no_recordings_is_an_error_when_deciding(priors):
    X, y = draw(18)
    seen = y != "screw"
    model = CostSensitiveGaussianBayes(priors=priors)
    model.partial_fit(X[seen], y[seen], classes=NAMES)
    with pytest.raises(ValueError, match=r"class \['screw'\] has had no recordings yet"):
        model.predict(X)
    assert len(model.partial_fit(X[~seen], y[~seen]).predict(X)) == 90


def test_partial_fit_refuses_what_it_cannot_merge():
    X, y = draw()
    model = CostSensitiveGaussianBayes()
    with pytest.raises(ValueError, match="given in the first call: got None"):
        model.partial_fit(X, y)
    with pytest.raises(ValueError, match="zero for every recording"):
        model.partial_fit(X, y, NAMES, np.zeros(90))
    with pytest.raises(ValueError, match="y contains 'screw' at position"):
        model.partial_fit(X, y, NAMES[:2])
    model.partial_fit(X, y, NAMES)
    with pytest.raises(ValueError, match=r"classes must be the same.*'ball' 'healthy'"):
        model.partial_fit(X, y, NAMES[:2])
    with pytest.raises(ValueError, match="'nut' at position 0, which is not a known class"):
        model.partial_fit(X[:1], ["nut"])
    with pytest.raises(ValueError, match=r"covariance or shrinkage has changed since.*Call fit"):
        model.set_params(covariance="tied").partial_fit(X, y)


def test_recordings_that_were_refused_are_not_counted():
    X, y = draw()
    model = CostSensitiveGaussianBayes(cost=np.ones((2, 2)))
    with pytest.raises(ValueError, match="square array"):
        model.partial_fit(X, y, NAMES)
    model.set_params(cost=None).partial_fit(X, y, NAMES)
    assert model.class_count_.tolist() == [30, 30, 30]


def test_automatic_shrinkage_refuses_partial_fit_and_weights_with_the_reason():
    X, y = draw()
    model = CostSensitiveGaussianBayes(shrinkage="auto")
    assert not hasattr(model, "partial_fit")
    with pytest.raises(AttributeError, match="has no attribute 'partial_fit'") as caught:
        model.partial_fit(X, y, NAMES)
    assert 'Use "oas" or a number' in str(caught.value.__cause__)
    assert hasattr(clone(model).set_params(shrinkage="oas"), "partial_fit")
    with pytest.raises(ValueError, match=r'other than 1, .* fourth moments.*"oas"'):
        model.fit(X, y, sample_weight=np.full(90, 2.0))
    np.testing.assert_array_equal(
        model.fit(X, y, np.ones(90)).covariances_, clone(model).fit(X, y).covariances_
    )


def test_a_class_without_weight_is_refused():
    X, y = draw()
    with pytest.raises(ValueError, match=r"all recordings of class \['screw'\]"):
        CostSensitiveGaussianBayes().fit(X, y, np.where(y == "screw", 0.0, 1.0))


@pytest.mark.parametrize("shrinkage", [None, 0.2, "oas", "auto"])
def test_weights_whose_sum_is_one_are_relative(shrinkage):
    X, y = draw()
    model = CostSensitiveGaussianBayes(shrinkage=shrinkage).fit(X, y, np.full(90, 1 / 90))
    assert_same_model(model, clone(model).fit(X, y), X)


# Singular covariances


def singular(covariance):
    """Recordings of which the class "screw" (all, if tied) has one feature constant."""
    X, y = draw(19)
    X[(y == "screw") | (covariance == "tied"), 1] = 3.0
    return X, y


@pytest.mark.parametrize(
    ("covariance", "named"),
    [("full", "class 'screw'"), ("tied", "all classes"), ("diag", "class 'screw'")],
)
def test_a_singular_covariance_is_raised_to_the_floor_with_a_warning(covariance, named):
    X, y = singular(covariance)
    model = CostSensitiveGaussianBayes(covariance=covariance)
    with pytest.warns(UserWarning, match=f"{named} is singular.*raised to 1e-9"):
        model.fit(X, y)
    lifted = model.covariances_ if covariance == "tied" else model.covariances_[2]
    least = lifted.min() if covariance == "diag" else np.linalg.eigvalsh(lifted)[0]
    assert least == pytest.approx(1e-9 * X.var(axis=0).max(), rel=1e-4)
    assert np.isfinite(model.predict_proba(X)).all()  # and no second warning


@pytest.mark.parametrize(
    ("covariance", "named"),
    [("full", "class 'screw'"), ("tied", "all classes"), ("diag", "class 'screw'")],
)
def test_with_shrinkage_zero_a_singular_covariance_is_an_error(covariance, named):
    X, y = singular(covariance)
    model = CostSensitiveGaussianBayes(covariance=covariance, shrinkage=0)
    for _ in range(2):
        with pytest.raises(ValueError, match=f"{named} is singular with shrinkage=0.*by PCA"):
            model.fit(X, y)
    with pytest.raises(ValueError, match="is singular"):
        model.predict(X)
    assert len(model.set_params(shrinkage=0.1).fit(X, y).predict(X)) == 90


def test_more_features_than_recordings_need_shrinkage():
    X, y = draw(21, n_recordings=30, n_features=40)
    with pytest.raises(ValueError, match="class 'ball', 'healthy', 'screw' is singular"):
        CostSensitiveGaussianBayes(shrinkage=0).fit(X, y)
    for covariance in ("full", "tied", "diag"):
        for shrinkage in (0.1, "oas", "auto"):
            model = CostSensitiveGaussianBayes(covariance=covariance, shrinkage=shrinkage)
            assert np.isfinite(model.fit(X, y).predict_log_proba(X)).all()


@pytest.mark.parametrize("shrinkage", [None, 0.1, "oas", "auto"])
def test_features_that_never_vary_are_an_error(shrinkage):
    _, y = draw()
    with pytest.raises(ValueError, match="largest variance of the features is 0"):
        CostSensitiveGaussianBayes(shrinkage=shrinkage).fit(np.full((90, 2), 0.1), y)


# Parameters and the scorer


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        (
            {"covariance": "spherical"},
            ValueError,
            "covariance must be one of 'full', 'tied', 'diag'",
        ),
        (
            {"shrinkage": "lw"},
            ValueError,
            "shrinkage as a word must be one of 'oas', 'auto'; got 'lw'",
        ),
        ({"shrinkage": 1.1}, ValueError, "shrinkage.*at least 0 and at most 1, got 1.1"),
        ({"shrinkage": -0.1}, ValueError, "shrinkage.*got -0.1"),
        ({"shrinkage": True}, TypeError, "shrinkage.*got True"),
        ({"shrinkage": [0.1]}, TypeError, "shrinkage.*got "),
    ],
)
def test_parameters_out_of_range_are_refused(options, error, message):
    with pytest.raises(error, match=message):
        CostSensitiveGaussianBayes(**options).fit(*draw())
    with pytest.raises(error, match=message):
        CostSensitiveGaussianBayes(**options).partial_fit(*draw(), NAMES)


def test_for_a_classifier_without_a_cost_the_message_names_make_scorer():
    X, y = draw()
    remedy = (
        r"GaussianNB\(\) has no cost_.*make_scorer\(expected_cost, greater_is_better=False, cost="
    )
    with pytest.raises(TypeError, match=remedy):
        neg_expected_cost(make_pipeline(StandardScaler(), GaussianNB()).fit(X, y), X, y)
    cost = pd.DataFrame(COST, index=NAMES, columns=NAMES)
    scorer = make_scorer(expected_cost, greater_is_better=False, cost=cost)
    assert scorer(GaussianNB().fit(X, y), X, y) < 0
