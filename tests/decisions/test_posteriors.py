"""Facts about posteriors in blocks: they are those of the plain formulas, class by class."""

import numpy as np
import pytest
from scipy.special import log_softmax, softmax

from emacm.decisions.gaussians import FLOOR, class_moments, fit_gaussians
from emacm.decisions.posteriors import BayesRule
from emacm.decisions.risks import least_risk

KINDS = {
    "full": ({}, {}),
    "tied": ({"pooled": True}, {}),
    "diag": ({"variances_only": True}, {"diagonal": True}),
}
COST = np.array([[0.0, 8.0, 3.0], [20.0, 0.0, 40.0], [5.0, 6.0, 0.0], [4.0, 4.0, 4.0]])


def draw(n_features, *, condition=1.0, shift=0.0, apart=1.0, scales=False, n=600):
    """Recordings of three classes with covariances of a condition number.

    `shift` from the origin and `apart` from one another in standard deviations.
    """
    rng = np.random.default_rng(n_features)
    codes = np.arange(n) % 3
    X = rng.normal(size=(n, n_features))
    spread = np.logspace(0, np.log10(condition) / 2, n_features)
    for k in range(3):
        turn = np.linalg.qr(rng.normal(size=(n_features, n_features)))[0]
        X[codes == k] = X[codes == k] * spread @ turn
    deviation = X.std(axis=0).max()
    X += deviation * (shift + apart * rng.normal(size=(3, n_features))[codes])
    return (X * np.logspace(-8, 8, n_features) if scales else X), codes


def fitted(X, codes, kind, **options):
    moments, gaussians = KINDS[kind]
    n_classes = int(codes.max()) + 1
    return fit_gaussians(class_moments(X, codes, n_classes, **moments), **gaussians, **options)


def plain_joint(gaussians, log_priors, X):
    """Log of prior times density, one class at a time as Eq. (2.44) reads."""
    joint = np.empty((len(X), len(log_priors)))
    for k, mean in enumerate(gaussians.means):
        group = k % len(gaussians.factors)
        factor = gaussians.factors[group]
        white = (X - mean) * factor if factor.ndim == 1 else (X - mean) @ factor
        constant = X.shape[1] * np.log(2 * np.pi) + gaussians.log_determinants[group]
        joint[:, k] = log_priors[k] - 0.5 * (np.sum(white**2, axis=1) + constant)
    return joint


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n_features", [2, 8, 40])
@pytest.mark.parametrize("condition", [1.0, 1e8])
@pytest.mark.parametrize("shift", [0.0, 1e6])
@pytest.mark.parametrize("apart", [1.0, 1e6])
@pytest.mark.parametrize("scales", [False, True])
def test_everything_follows_from_the_plain_formulas(
    kind, n_features, condition, shift, apart, scales
):
    X, codes = draw(n_features, condition=condition, shift=shift, apart=apart, scales=scales)
    gaussians = fitted(X, codes, kind)
    rule = BayesRule(gaussians, np.log([0.2, 0.5, 0.3]))
    joint = plain_joint(gaussians, rule.log_priors, X)
    size = np.maximum(np.abs(joint), 1)
    assert (np.abs(rule.joint(X) - joint) <= 1e-9 * size).all()
    posterior = softmax(joint, axis=1)
    np.testing.assert_allclose(rule.posterior(X), posterior, atol=1e-9)
    found = rule.log_posterior(X)
    assert (np.abs(found - log_softmax(joint, axis=1)) <= 1e-9 * size.max(axis=1)[:, None]).all()
    risk = rule.risk(X, COST)
    np.testing.assert_allclose(risk, posterior @ COST.T, atol=1e-7)
    for cost in (COST, 1 - np.eye(3)):
        np.testing.assert_array_equal(rule.decide(X, cost), least_risk(posterior, cost))


@pytest.mark.parametrize("diagonal", [False, True])
def test_covariances_raised_to_the_floor_are_no_exception(diagonal):
    X, codes = draw(30)
    X[codes == 1, 2] = X[codes == 1, 3]
    X[codes == 2, 5] = 0.5
    gaussians = fit_gaussians(class_moments(X, codes, 3), diagonal=diagonal, floor=FLOOR)
    assert gaussians.singular[2]
    rule = BayesRule(gaussians, np.log(np.ones(3) / 3))
    joint = plain_joint(gaussians, rule.log_priors, X)
    np.testing.assert_allclose(rule.joint(X), joint, rtol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_pieces_of_any_size_give_what_all_recordings_give(kind):
    X, codes = draw(20, n=9_001)
    rule = BayesRule(fitted(X, codes, kind), np.log([0.2, 0.5, 0.3]))
    pieces = np.split(X, [1, 2, 500, 8_000])
    for function in (rule.joint, rule.posterior, rule.log_posterior):
        expected = np.concatenate([function(piece) for piece in pieces])
        np.testing.assert_allclose(function(X), expected, rtol=1e-10, atol=1e-200)
    decided = np.concatenate([rule.decide(piece, COST) for piece in pieces])
    np.testing.assert_array_equal(rule.decide(X, COST), decided)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("idle", [0, 1, 2])
def test_a_class_that_never_occurs_changes_nothing_for_the_other_two(kind, idle):
    X, codes = draw(4)
    others = [k for k in range(3) if k != idle]
    log_priors = np.log(np.where(np.arange(3) == idle, 1e-300, [0.2, 0.3, 0.5]))
    log_priors[idle] = -np.inf
    gaussians = fitted(X, codes, kind)
    three = BayesRule(gaussians, log_priors)
    groups = others if len(gaussians.factors) == 3 else [0]
    two = BayesRule(
        type(gaussians)(
            gaussians.means[others],
            gaussians.covariances[groups],
            gaussians.factors[groups],
            gaussians.log_determinants[groups],
            gaussians.singular[groups],
        ),
        log_priors[others],
    )
    np.testing.assert_array_equal(three.posterior(X)[:, idle], 0)
    np.testing.assert_allclose(three.posterior(X)[:, others], two.posterior(X), rtol=1e-9)
    np.testing.assert_allclose(three.log_posterior(X)[:, others], two.log_posterior(X), atol=1e-9)
    cost = 1 - np.eye(3)
    pairs = np.array(others)[two.decide(X, cost[:2, :2])]
    np.testing.assert_array_equal(three.decide(X, cost), pairs)


def test_two_classes_far_away_keep_their_small_posteriors():
    gaussians = fitted(np.array([[-1.0], [1.0], [29.0], [31.0]]), np.array([0, 0, 1, 1]), "tied")
    rule = BayesRule(gaussians, np.log([0.5, 0.5]))
    # Variance 2: the log odds are 15 (15 - x).
    points = np.array([[0.0], [30.0], [15.0], [14.0]])
    odds = np.exp(15 * (15 - points[:, 0]))
    posterior = rule.posterior(points)
    np.testing.assert_allclose(posterior[:, 0], odds / (1 + odds), rtol=1e-10)
    np.testing.assert_allclose(posterior[:, 1], 1 / (1 + odds), rtol=1e-10)


@pytest.mark.parametrize("kind", KINDS)
def test_far_outliers_have_posteriors_whatever_they_are_next_to(kind):
    X, codes = draw(3)
    rule = BayesRule(fitted(X, codes, kind), np.log([0.2, 0.5, 0.3]))
    far = np.vstack([X[:5], np.array([[1.0], [-1.0]]) * [[1e155, 1e200, -1.7e308]]])
    posterior = rule.posterior(far)
    np.testing.assert_allclose(posterior.sum(axis=1), 1, rtol=1e-12)
    np.testing.assert_allclose(posterior[:5], rule.posterior(X[:5]), rtol=1e-9)
    np.testing.assert_allclose(posterior[5:], 1 / 3)  # at the end of numbers none is nearer
    assert np.isfinite(rule.joint(far)).all()
