"""Variance between units: first recordings of new units, and what recordings of a unit change."""

import pickle
import warnings

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.special import softmax
from scipy.stats import multivariate_normal
from sklearn.covariance import shrunk_covariance
from sklearn.utils.estimator_checks import parametrize_with_checks

from emacm import CostSensitiveGaussianBayes, NewUnitClassifier
from emacm.decisions.new_units import probability_threshold
from emacm.decisions.shrinkage import population_eigenvalues
from emacm.decisions.unit_effects import fit_unit_levels, unit_scatter

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
    known = new.for_unit(later[:7], "healthy")
    for one in (new, known):
        np.testing.assert_array_equal(one.predict_proba(later), plain.predict_proba(later))
        np.testing.assert_array_equal(one.typicality(later), plain.typicality(later))
    assert not new.between_covariance_.any()
    np.testing.assert_allclose(new.within_covariance_, plain.covariances_, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("crossed", [False, True])
def test_the_covariances_are_found(crossed):
    fitted = NewUnitClassifier(shrinkage=None).fit(*fleet(1000, 6, crossed=crossed))
    np.testing.assert_allclose(fitted.within_covariance_, WITHIN, atol=0.08)
    np.testing.assert_allclose(fitted.between_covariance_, BETWEEN, atol=1.0)
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


def projector(columns):
    return columns @ np.linalg.pinv(columns)


@pytest.mark.parametrize("crossed", [False, True])
def test_mean_squares_are_those_of_projections(crossed):
    X, codes, units, C, Z = dense(crossed=crossed)
    of_classes, of_both = projector(C), projector(np.hstack([C, Z]))
    rank = round(np.trace(of_both))
    parts = unit_scatter(X, codes, units)
    np.testing.assert_allclose(parts.within, X.T @ (np.eye(18) - of_both) @ X / (18 - rank))
    np.testing.assert_allclose(parts.between, X.T @ (of_both - of_classes) @ X / (rank - 3))
    # The trace is that of Z'(I - P)Z: the expected mean square between units is W + n B.
    multiplicity = np.trace(Z.T @ (np.eye(18) - of_classes) @ Z) / (rank - 3)
    assert (parts.between_divisor, parts.multiplicity) == (rank - 3, pytest.approx(multiplicity))


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
    np.testing.assert_allclose(levels.within, W if ratios.any() else plain)
    D, contrasts = levels.directions, np.array([[1, -1, 0], [1, 1, -2]]).T / np.sqrt([2, 6])
    np.testing.assert_allclose(levels.between, D @ np.diag(ratios) @ D.T, atol=1e-12)
    np.testing.assert_allclose(levels.offset, 0)
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
        np.testing.assert_allclose(levels.means[j], [*means, 0], rtol=1e-6, atol=1e-9)
        excess_variance = np.linalg.inv(matrix + prior) - np.linalg.inv(C.T @ C + prior)
        expected = np.pad(excess_variance, (0, 1)) + ratios[j]
        np.testing.assert_allclose(levels.covariances[j], expected, rtol=1e-5, atol=1e-8)


def test_densities_of_a_unit_are_those_of_scipy():
    X, codes, units, *_ = dense(n_features=3)
    levels = fit_unit_levels(X, codes, units, np.eye(3), 0.3)
    for known in (levels, levels.given(X[:4], codes[:4])):
        gaussians, D = known.gaussians(), known.directions
        for k in range(3):
            covariance = D @ np.diag(1 + known.covariances[:, k, k]) @ D.T
            expected = multivariate_normal(D @ known.means[:, k], covariance).logpdf(X)
            np.testing.assert_allclose(gaussians.log_densities(X)[:, k], expected, rtol=1e-8)
            np.testing.assert_allclose(gaussians.covariances[k], covariance)
    assert (levels.n_recordings, known.n_recordings) == (0, 4)
    assert gaussians.singular.tolist() == [False] * 3
    again = known.given(X[4:6], codes[4:6])
    together = levels.given(X[:6], codes[:6])
    np.testing.assert_allclose(again.covariances, together.covariances, atol=1e-12)
    np.testing.assert_allclose(again.means, together.means, atol=1e-12)


@pytest.mark.parametrize("n_features", [1, 3])
def test_units_without_a_difference_have_the_covariance_within_classes(n_features):
    rng = np.random.default_rng(4)
    units, codes = np.repeat(np.arange(6), 4), np.repeat([0, 1, 0, 1, 0, 1], 4)
    X = rng.normal(size=(24, n_features))
    X -= np.array([X[units == unit].mean(axis=0) for unit in range(6)])[units]
    X += 5 * codes[:, np.newaxis]
    plain = np.cov(rng.normal(size=(9, n_features)).T).reshape(n_features, n_features)
    levels = fit_unit_levels(X, codes, units, plain, 0.0)
    assert not levels.covariances.any()
    assert not levels.between.any()
    np.testing.assert_allclose(levels.within, plain)
    # Differences between classes are shrunk, the level of all of them is not.
    levels_of_classes = levels.directions @ levels.means[:, :2]
    np.testing.assert_allclose(levels_of_classes.mean(axis=1), 2.5)
    fitted = NewUnitClassifier().fit(X, codes, groups=units)
    tied = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto").fit(X, codes)
    np.testing.assert_array_equal(fitted.covariances_, tied.covariances_)
    np.testing.assert_array_equal(fitted.predict_proba(X), tied.predict_proba(X))


def test_conditioning_is_that_of_the_joint_gaussian():
    X, _, units = fleet(40, 6, crossed=True)
    codes = np.tile(np.arange(6) % 3, 40)
    fitted = NewUnitClassifier().fit(X, STATES[codes], groups=units)
    later, _ = draw(np.array([0, 0, 1, 2]), np.zeros(4, int), 3)
    known = fitted.for_unit(later[:3], STATES[[0, 0, 1]])
    # All recordings of the unit have one offset, and class means one uncertainty, in common.
    levels = fitted._levels
    D, prior = levels.directions, levels.covariances
    places = [list(fitted.classes_).index(STATES[k]) for k in (0, 0, 1, 2)]
    joint = np.zeros((12, 12))
    for i, j in np.ndindex(4, 4):
        shared = (D * prior[:, places[i], places[j]]) @ D.T
        joint[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] = shared + (i == j) * D @ D.T
    mean = np.concatenate([fitted.means_[place] for place in places])
    whole = multivariate_normal(mean, joint).logpdf(later.ravel())
    part = multivariate_normal(mean[:9], joint[:9, :9]).logpdf(later[:3].ravel())
    density = known._gaussians.log_densities(later[3:])[0, places[3]]
    assert density == pytest.approx(whole - part, rel=1e-9)
    with_offset = np.hstack([(D * prior[:, -1, place]) @ D.T for place in places[:3]])
    gain = with_offset @ np.linalg.inv(joint[:9, :9])
    np.testing.assert_allclose(known.unit_offset_, gain @ (later[:3].ravel() - mean[:9]))
    remaining = fitted.between_covariance_ - gain @ with_offset.T
    np.testing.assert_allclose(known.between_covariance_, remaining, rtol=1e-7)


def test_recordings_of_a_unit_may_come_one_at_a_time(model):
    X = fleet(seed=4)[0]
    at_once = model.for_unit(X[:5], STATES[[0, 0, 2, 0, 1]])
    stepwise = model
    for row, code in enumerate([0, 0, 2, 0, 1]):
        stepwise = stepwise.for_unit(X[[row]], STATES[code])
    np.testing.assert_allclose(stepwise.predict_proba(X), at_once.predict_proba(X), rtol=1e-9)
    np.testing.assert_allclose(stepwise.unit_offset_, at_once.unit_offset_)
    assert stepwise.n_unit_recordings_ == at_once.n_unit_recordings_ == 5
    assert model.n_unit_recordings_ == 0


def test_densities_narrow_with_every_recording(model):
    X = draw(np.zeros(10, int), np.zeros(10, int), 1)[0]
    spreads = [np.linalg.det(model.between_covariance_)]
    for count in (1, 2, 5, 10):
        known = model.for_unit(X[:count], "healthy")
        spreads.append(np.linalg.det(known.between_covariance_))
        healthy = known.covariances_[2]
        assert (np.linalg.eigvalsh(healthy - known.within_covariance_) > -1e-12).all()
        assert (np.linalg.eigvalsh(model.covariances_[2] - healthy) > 0).all()
    assert (np.diff(spreads) < 0).all()


@pytest.mark.slow
def test_known_recordings_of_a_unit_improve_its_posteriors():
    fitted = NewUnitClassifier(priors="uniform").fit(*fleet(30, 6))
    codes, losses = np.arange(200) % 3, []
    later, offsets = draw(codes, np.arange(200), 5)
    healthy = CENTRES[0] + offsets[:, np.newaxis] + np.random.default_rng(0).multivariate_normal(
        np.zeros(3), WITHIN, (200, 10))  # fmt: skip
    places = np.searchsorted(fitted.classes_, STATES[codes])
    for count in (0, 1, 3, 10):
        models = [fitted.for_unit(h[:count], "healthy") if count else fitted for h in healthy]
        rows = zip(models, later, places, strict=True)
        losses.append(np.mean([-model.predict_log_proba([z])[0, k] for model, z, k in rows]))
    assert (np.diff(losses) < 0).all()
    assert losses[3] < losses[0] / 4


@pytest.mark.slow
@pytest.mark.parametrize("crossed", [False, True])
def test_sets_of_50_units_cover_90_percent_and_have_one_class_after_three_recordings(crossed):
    between, first, after = 3 * WITHIN + BETWEEN, [], []
    for seed in range(60):
        X, y, units = fleet(50, 6, seed, between, crossed)
        fitted = NewUnitClassifier(priors="uniform").fit(X, y, groups=units)
        codes = np.arange(240) % 3
        later, offsets = draw(codes, np.arange(240), 1000 + seed, between)
        places = np.searchsorted(fitted.classes_, STATES[codes])
        sets = fitted.prediction_sets(later)
        first.append((sets[np.arange(240), places].mean(), sets.sum(axis=1).mean()))
        rng = np.random.default_rng(seed)
        for unit in range(0, 240, 4):
            healthy = CENTRES[0] + offsets[unit] + rng.multivariate_normal(np.zeros(3), WITHIN, 3)
            known = fitted.for_unit(healthy, "healthy").prediction_sets(later[[unit]])[0]
            after.append((known[places[unit]], known.sum()))
    coverage, size = np.mean(first, axis=0)
    assert 0.88 <= coverage <= 0.92
    assert size > 1.2
    coverage, size = np.mean(after, axis=0)
    assert coverage >= 0.9
    assert size <= 1.1


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


def test_the_threshold_weights_classes_by_priors_and_cools_densities():
    rng = np.random.default_rng(8)
    logs, codes = 3 * rng.normal(size=(40, 3)), np.tile([0, 1, 1, 2], 10)
    logs[codes != 2, 2] = -np.inf
    units = 3 * rng.permutation(np.arange(40) // 2)
    priors = np.array([0.7, 0.1, 0.2])
    posterior = softmax(logs / 2.5 + np.log(priors), axis=1)
    own = posterior[np.arange(40), codes]
    own[codes == posterior.argmax(axis=1)] = 1.0
    weight = 1 / np.array([np.sum(units == unit) for unit in units])
    weight *= (priors / [weight[codes == k].sum() for k in range(3)])[codes]
    assert weight.sum() == pytest.approx(1)
    left_out = logs, codes, units
    for coverage in (0.6, 0.8, 0.95):
        enough = [p for p in own if weight[own >= p].sum() >= coverage]
        assert probability_threshold(*left_out, priors, 2.5, coverage) == max(enough)
    with pytest.raises(ValueError, match=r"20 units cannot support .* at least 24; .* most 0\.952"):
        probability_threshold(*left_out, priors, 2.5, 0.96)


@pytest.mark.slow
def test_unknown_states_and_temperature():
    X, y, units = fleet()
    fitted = NewUnitClassifier(unknown="new", temperature="groups").fit(X, y, groups=units)
    far = CENTRES[:1] + [0.0, 40.0, -40.0]
    assert fitted.predict(far).tolist() == ["new"]
    assert fitted.truths_[-1] == "new"
    assert 0.5 < fitted.temperature_ < 2
    assert fitted.for_unit(X[:3], y[0]).predict(far).tolist() == ["new"]
    frame = pd.DataFrame(X, columns=["level", "ratio", "phase"])
    named = NewUnitClassifier(unknown="new").fit(frame, y, groups=units)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        known = named.for_unit(frame[:4], "healthy")
        assert known.unknown_proba(frame[4:6]).shape == (2,)
        assert known.prediction_sets(frame[4:6]).shape == (2, 3)


def test_the_offset_of_a_unit_is_no_unknown_state():
    fitted = NewUnitClassifier(unknown="new").fit(*fleet(crossed=True))
    offset = np.array([9.0, 5.0, 9.0])  # a unit unlike the others
    X = CENTRES[0] + offset + np.random.default_rng(0).normal(scale=0.5, size=(8, 3))
    known = fitted.for_unit(X[:5], "healthy")
    assert (known.typicality(X[5:]) > 10 * fitted.typicality(X[5:])).all()


@pytest.mark.parametrize(
    ("units", "states", "message"),
    [
        ([4] * 6, "hhhddd", "no class has recordings in two groups"),
        ([1, 1, 1, 2, 2, 2], "hhhddd", "no class has recordings in two groups"),
        ([1, 2, 3, 4, 5, 6], "hhhddd", "no unit has recordings beyond one"),
        ([1, 1, 2], "hhhddd", "groups must have one label for each of the 6 recordings, got 3"),
    ],
)
def test_fleets_that_reveal_no_variance_between_units(units, states, message):
    X = np.random.default_rng(0).normal(size=(6, 2))
    with pytest.raises(ValueError, match=message):
        NewUnitClassifier().fit(X, list(states), groups=units)


def test_invalid_input(model):
    X, y, _ = fleet()
    with pytest.raises(ValueError, match="'worn' at position 0, which is not a known class"):
        model.for_unit(X[:2], "worn")
    with pytest.raises(ValueError, match="y must have one class for each of 2 recordings"):
        model.for_unit(X[:2], ["healthy"] * 3)
    with pytest.raises(ValueError, match="X has 2 features, but NewUnitClassifier is expecting 3"):
        model.for_unit(X[:2, :2], "healthy")
    with pytest.raises(ValueError, match=r"coverage must be .* below 1"):
        model.prediction_sets(X, 1.0)
    with pytest.raises(ValueError, match=r"9 units cannot support a coverage of 0.95, .* least 19"):
        NewUnitClassifier().fit(*fleet(9)).prediction_sets(X, 0.95)
    many = np.random.default_rng(0).normal(size=(16, 9))
    with pytest.raises(ValueError, match=r"covariance within units is singular, for 9 features"):
        NewUnitClassifier(shrinkage=0).fit(many, [0, 1] * 8, groups=np.arange(16) // 2)
    with pytest.raises(AttributeError, match="no partial_fit: all units are needed at once"):
        model.partial_fit(X, y)


def test_without_groups_there_are_no_units():
    X, y, _ = fleet()
    with pytest.warns(UserWarning, match="NewUnitClassifier was fitted without groups"):
        fitted = NewUnitClassifier().fit(X, y)
    plain = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto").fit(X, y)
    np.testing.assert_array_equal(fitted.predict_proba(X), plain.predict_proba(X))
    for call in (
        lambda: fitted.for_unit(X, "healthy"),
        lambda: fitted.prediction_sets(X),
        lambda: fitted.between_covariance_,
    ):
        with pytest.raises(
            ValueError, match=r"it was fitted without groups. Call fit with groups="
        ):
            call()
    for name in ("unit_offset_", "n_unit_recordings_", "between_covariance_", "within_covariance_"):
        assert not hasattr(NewUnitClassifier(), name)


@pytest.mark.filterwarnings("ignore:NewUnitClassifier was fitted without groups:UserWarning")
@parametrize_with_checks([NewUnitClassifier()])
def test_scikit_learn_checks(estimator, check):
    check(estimator)
