"""Variance between units: first recordings of new units, and what recordings of a unit change."""

import pickle
import warnings

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.stats import multivariate_normal
from sklearn.covariance import shrunk_covariance
from sklearn.utils.estimator_checks import parametrize_with_checks

from emacm import CostSensitiveGaussianBayes, NewUnitClassifier
from emacm.decisions.new_units import (
    fit_unit_levels,
    population_eigenvalues,
    probability_threshold,
    unit_scatter,
)

STATES = np.array(["healthy", "backlash", "dry"])  # not in alphabetical order
CENTRES = np.array([[0.0, 1.0, 0.0], [4.0, 1.0, -2.0], [0.0, 5.0, 3.0]])
WITHIN = np.array([[0.8, 0.2, 0.0], [0.2, 1.1, -0.3], [0.0, -0.3, 0.6]])
BETWEEN = np.array([[6.0, 2.0, 1.0], [2.0, 3.0, 0.0], [1.0, 0.0, 9.0]])


def draw(codes, units, seed=0, between=BETWEEN):
    """Return recordings of units with their own offsets, and the offsets."""
    rng = np.random.default_rng(seed)
    offsets = rng.multivariate_normal(np.zeros(3), between, units.max() + 1)
    return CENTRES[codes] + offsets[units] + rng.multivariate_normal(
        np.zeros(3), WITHIN, len(units)
    ), offsets  # fmt: skip


def fleet(n_units=60, n_runs=5, seed=0, between=BETWEEN, crossed=False):
    """Return recordings, states and units; crossed: each unit was recorded in every state."""
    units = np.repeat(np.arange(n_units), n_runs)
    codes = np.tile(np.arange(n_runs) % 3, n_units) if crossed else units % 3
    return draw(codes, units, seed, between)[0], STATES[codes], units


@pytest.fixture(scope="module")
def model():
    return NewUnitClassifier(priors="uniform").fit(*fleet())


@pytest.mark.slow
def test_without_variance_between_units_all_results_are_those_of_the_tied_classifier():
    X, y, units = fleet()
    for unit in np.unique(units):
        rows = units == unit
        X[rows] += CENTRES[y[rows][0] == STATES] - X[rows].mean(axis=0)
    new = NewUnitClassifier(unknown="new").fit(X, y, groups=units)
    plain = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto", unknown="new")
    plain.fit(X, y, groups=units)
    later = fleet(seed=1)[0]
    np.testing.assert_array_equal(new.predict_proba(later), plain.predict_proba(later))
    np.testing.assert_array_equal(new.typicality(later), plain.typicality(later))
    np.testing.assert_allclose(new.covariances_, plain.covariances_, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("crossed", [False, True])
def test_the_covariances_are_found(crossed):
    fitted = NewUnitClassifier(shrinkage=None).fit(*fleet(1000, 6, crossed=crossed))
    for covariance in fitted.covariances_:
        np.testing.assert_allclose(covariance, WITHIN + BETWEEN, atol=1.0)
    np.testing.assert_allclose(fitted.means_[[2, 0, 1]], CENTRES, atol=0.4)
    assert fitted.classes_.tolist() == ["backlash", "dry", "healthy"]


def dense(n_features=2, crossed=True, seed=3, spread=2.0, apart=3.0):
    """Return recordings of seven units in an unbalanced design, and its indicator matrices."""
    rng = np.random.default_rng(seed)
    units = np.repeat(np.arange(7), [1, 5, 2, 2, 3, 1, 4])
    codes = rng.integers(0, 3, len(units)) if crossed else units % 3
    X = rng.normal(size=(18, n_features)) + spread * rng.normal(size=(7, n_features))[units]
    X = (X + apart * codes[:, np.newaxis]) @ rng.normal(size=(n_features, n_features))
    return X, codes, units, np.eye(3)[codes], np.eye(7)[units]


def test_eigenvalues_are_corrected_by_the_inverse_of_their_bias():
    rng = np.random.default_rng(0)
    order = rng.permutation(30)
    values = np.linspace(0.5, 1.5, 30)
    values[:2] = 40.0, 9.0
    found = population_eigenvalues(values, 60)
    assert found.sum() == pytest.approx(values.sum())
    np.testing.assert_allclose(population_eigenvalues(values[order], 60), found[order])
    np.testing.assert_allclose(population_eigenvalues(7 * values, 60), 7 * found)
    assert np.ptp(found[2:]) == 0  # as far apart as noise makes equal ones
    np.testing.assert_allclose(population_eigenvalues(values, 10**9), values, rtol=1e-3)
    # Variance 0.15^2 of ten values of which sampling explains 10 / 1000.
    apart = 1 + 0.15 * np.array([-1, 1] * 5)
    kept = 1 + (apart - 1) * (1 - 0.01 / 0.15**2)
    np.testing.assert_allclose(population_eigenvalues(3 * apart, 1000), 3 * kept)
    assert population_eigenvalues([2, 4], 1).tolist() == [3.0, 3.0]


@pytest.mark.parametrize("crossed", [False, True])
@pytest.mark.parametrize(("spread", "apart"), [(0.0, 3.0), (2.0, 3.0), (20.0, 3.0), (2.0, 0.0)])
def test_levels_are_those_of_generalised_least_squares_with_dense_matrices(crossed, spread, apart):
    # Classes that are not apart: one difference is hardly proven, the other is not (crossed).
    X, codes, units, C, Z = dense(crossed=crossed, spread=spread, apart=apart)
    parts = unit_scatter(X, codes, units)
    coefficient, plain = 0.1, np.diag([2.0, 3.0])
    levels = fit_unit_levels(X, codes, units, plain, coefficient)
    W, between = (shrunk_covariance(part, coefficient) for part in parts[:2])
    mean_squares = eigh(between, W, eigvals_only=True)
    corrected = population_eigenvalues(mean_squares, parts.between_divisor)
    ratios = np.maximum(corrected - 1, 0) / parts.multiplicity
    D, contrasts = levels.directions, np.array([[1, -1, 0], [1, 1, -2]]).T / np.sqrt([2, 6])
    np.testing.assert_allclose(D @ D.T, W if ratios.any() else plain)
    weights = [np.linalg.inv(np.eye(18) + r * Z @ Z.T) for r in ratios]
    information = [C.T @ V @ C for V in weights]
    sums = [C.T @ V @ y for V, y in zip(weights, np.linalg.solve(D, X.T), strict=True)]

    def excess(variance):
        total = -4.0
        for matrix, right in zip(information, sums, strict=True):
            difference = contrasts.T @ np.linalg.solve(matrix, right)
            spread = contrasts.T @ np.linalg.inv(matrix) @ contrasts
            total += difference @ np.linalg.solve(spread + variance * np.eye(2), difference)
        return total

    variance = brentq(excess, 1e-6, 1e6) if excess(1e-6) > 0 else 1e-6
    prior = contrasts @ contrasts.T / variance
    for j, matrix in enumerate(information):
        means = np.linalg.solve(matrix + prior, sums[j])
        np.testing.assert_allclose(levels.means[j], means, rtol=1e-6, atol=1e-9)
        excess_variance = np.linalg.inv(matrix + prior) - np.linalg.inv(C.T @ C + prior)
        expected = np.diagonal(excess_variance) + ratios[j]
        np.testing.assert_allclose(levels.variances[j], expected, rtol=1e-5, atol=1e-8)


def test_densities_of_a_unit_are_those_of_scipy():
    X, codes, units, *_ = dense(n_features=3)
    levels = fit_unit_levels(X, codes, units, np.eye(3), 0.3)
    gaussians, D = levels.gaussians(), levels.directions
    for k in range(3):
        covariance = D @ np.diag(1 + levels.variances[:, k]) @ D.T
        expected = multivariate_normal(D @ levels.means[:, k], covariance).logpdf(X)
        np.testing.assert_allclose(gaussians.log_densities(X)[:, k], expected, rtol=1e-8)
        np.testing.assert_allclose(gaussians.covariances[k], covariance)
    assert gaussians.singular.tolist() == [False] * 3


@pytest.mark.slow
@pytest.mark.parametrize("crossed", [False, True])
def test_sets_of_50_units_cover_90_percent(crossed):
    between, found = 3 * WITHIN + BETWEEN, []
    for seed in range(15):
        X, y, units = fleet(50, 6, seed, between, crossed)
        fitted = NewUnitClassifier(priors="uniform").fit(X, y, groups=units)
        codes = np.arange(240) % 3
        later, _ = draw(codes, np.arange(240), 1000 + seed, between)
        places = np.searchsorted(fitted.classes_, STATES[codes])
        sets = fitted.prediction_sets(later)
        found.append((sets[np.arange(240), places].mean(), sets.sum(axis=1).mean()))
    coverage, size = np.mean(found, axis=0)
    assert 0.88 <= coverage <= 0.92
    assert size > 1.2


def test_sets_follow_priors_and_coverage(model):
    later = fleet(seed=9)[0]
    sizes = [model.prediction_sets(later, coverage).sum() for coverage in (0.5, 0.8, 0.95)]
    assert len(later) <= sizes[0] < sizes[1] < sizes[2]
    rare = pickle.loads(pickle.dumps(model))
    rare.set_params(priors={"healthy": 0.98, "dry": 0.01, "backlash": 0.01})
    assert rare.prediction_sets(later)[:, 2].mean() > model.prediction_sets(later)[:, 2].mean()


def test_the_threshold_is_the_quantile_of_units_with_equal_weights():
    # Unit 0 has three recordings, of probability 0.2; units 1 to 9 one each, of 0.45 down to 0.05.
    own = np.array([0.2] * 3 + [0.45, 0.4, 0.35, 0.3, 0.25, 0.15, 0.12, 0.1, 0.05])
    logs = np.log(np.column_stack([own, 1 - own]))
    units = np.array([0, 0, 0, *range(1, 10)])
    left_out = logs, np.zeros(12, int), units
    even = np.array([0.5, 0.5])
    assert probability_threshold(*left_out, even, 1.0, 0.5) == pytest.approx(0.25)
    assert probability_threshold(*left_out, even, 1.0, 0.6) == pytest.approx(0.2)
    assert probability_threshold(*left_out, even, 1.0, 0.9) == pytest.approx(0.1)
    nine = [part[units > 0] for part in left_out]
    assert probability_threshold(*nine, even, 1.0, 0.9) == pytest.approx(0.05)
    with pytest.raises(ValueError, match=r"10 units cannot .* at least 19; .* at most 0.909"):
        probability_threshold(*left_out, even, 1.0, 0.95)


@pytest.mark.slow
def test_unknown_states_and_temperature():
    X, y, units = fleet()
    fitted = NewUnitClassifier(unknown="new", temperature="groups").fit(X, y, groups=units)
    far = CENTRES[:1] + [0.0, 40.0, -40.0]
    assert fitted.predict(far).tolist() == ["new"]
    assert fitted.truths_[-1] == "new"
    assert 0.5 < fitted.temperature_ < 2
    frame = pd.DataFrame(X, columns=["level", "ratio", "phase"])
    named = NewUnitClassifier(unknown="new").fit(frame, y, groups=units)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert named.unknown_proba(frame[4:6]).shape == (2,)
        assert named.prediction_sets(frame[4:6]).shape == (2, 3)


@pytest.mark.parametrize(
    ("units", "states", "message"),
    [
        ([4] * 6, "hhhddd", "no class has recordings in two groups"),
        ([1, 1, 1, 2, 2, 2], "hhhddd", "no class has recordings in two groups"),
        ([1, 2, 3, 4, 5, 6], "hhhddd", "and units several times"),
        ([1, 1, 2], "hhhddd", "groups must have a label for each of 6 recordings, got 3"),
    ],
)
def test_fleets_that_reveal_no_variance_between_units(units, states, message):
    X = np.random.default_rng(0).normal(size=(6, 2))
    with pytest.raises(ValueError, match=message):
        NewUnitClassifier().fit(X, list(states), groups=units)


def test_invalid_input(model):
    X, y, _ = fleet()
    with pytest.raises(ValueError, match=r"coverage must be .* below 1"):
        model.prediction_sets(X, 1.0)
    with pytest.raises(ValueError, match=r"9 units cannot support a coverage of 0.95, .* least 19"):
        NewUnitClassifier().fit(*fleet(9)).prediction_sets(X, 0.95)
    many = np.random.default_rng(0).normal(size=(16, 9))
    with pytest.raises(ValueError, match=r"covariance within units is singular, for 9 features"):
        NewUnitClassifier(shrinkage=0).fit(many, [0, 1] * 8, groups=np.arange(16) // 2)
    with pytest.raises(AttributeError, match="partial_fit"):
        model.partial_fit(X, y)


def test_without_groups_there_are_no_units():
    X, y, _ = fleet()
    with pytest.warns(UserWarning, match="NewUnitClassifier was fitted without groups"):
        fitted = NewUnitClassifier().fit(X, y)
    plain = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto").fit(X, y)
    np.testing.assert_array_equal(fitted.predict_proba(X), plain.predict_proba(X))
    with pytest.raises(ValueError, match=r"it was fitted without groups. Call fit with groups="):
        fitted.prediction_sets(X)


@pytest.mark.filterwarnings("ignore:NewUnitClassifier was fitted without groups:UserWarning")
@parametrize_with_checks([NewUnitClassifier()])
def test_scikit_learn_checks(estimator, check):
    check(estimator)


@pytest.mark.parametrize(("shift", "warned"), [(0.0, False), (1.0, True)])
def test_units_of_another_kind_are_stated_with_their_sets(model, shift, warned):
    codes, units = np.arange(60) % 3, np.arange(60) // 6
    later = draw(codes, units, 77)[0] + shift * np.sqrt(np.diag(BETWEEN + WITHIN))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        model.prediction_sets(later, groups=units)
    assert [str(x.message)[:8] for x in caught] == ["10 units"] * warned
