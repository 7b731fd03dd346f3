"""Facts about posteriors brought to one."""

import numpy as np
from scipy.special import logsumexp

from emacm.decisions.least_risk import pooled_log_posterior

HALF = [0.5, 0.5]


def test_members_with_different_priors_agree_once_their_priors_are_divided_out():
    rng = np.random.default_rng(0)
    likelihoods = rng.normal(size=(3, 20, 4))
    priors = rng.dirichlet(np.ones(4), size=3)
    shared = np.array([0.7, 0.1, 0.1, 0.1])

    def members(own):
        joint = likelihoods + np.log(own)[:, np.newaxis]
        return joint - logsumexp(joint, axis=2, keepdims=True)

    np.testing.assert_allclose(
        pooled_log_posterior(members(priors), priors, shared),
        pooled_log_posterior(members(np.full((3, 4), 0.25)), np.full((3, 4), 0.25), shared),
        rtol=1e-12,
    )


def test_certain_contradictions_cancel_and_leave_the_prior():
    certain = np.array([[0.0, -np.inf]])
    pooled = pooled_log_posterior([certain, certain[:, ::-1]], [HALF, HALF], [0.3, 0.7])
    np.testing.assert_allclose(np.exp(pooled), [[0.3, 0.7]], rtol=1e-12)


def test_a_posterior_of_zero_is_at_most_the_smallest_of_its_row():
    logs = np.array([[0.0, -1e5, -np.inf]])
    pooled = pooled_log_posterior([logs], [[1 / 3] * 3], [1 / 3] * 3)
    assert pooled[0, 2] <= pooled[0, 1] == -1e5


def test_a_class_of_prior_zero_stays_impossible_even_if_members_gave_it_one():
    certain = np.array([[-np.inf, 0.0]])
    pooled = pooled_log_posterior([np.log([[0.9, 0.1]])], [HALF], [0, 1])
    np.testing.assert_array_equal(pooled, certain)
    np.testing.assert_array_equal(pooled_log_posterior([certain], [[0, 1]], [0, 1]), certain)
