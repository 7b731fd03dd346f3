"""Facts about risks and the decision of least risk, beyond those of `test_costs`."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from emacm.decisions.risks import canonical_cost, conditional_risk, least_risk

TIE = 1e-12


def plain_decision(posterior, cost):
    """Decision of least risk, one recording and one decision at a time."""
    chosen = []
    for row in posterior:
        risks = [
            sum(p * c for p, c in zip(row, costs, strict=True)) for costs in canonical_cost(cost)
        ]
        chosen.append(next(i for i, risk in enumerate(risks) if risk <= min(risks) * (1 + TIE)))
    return chosen


def posteriors(n_classes):
    # Ties, near ties, and gaps where the posterior of all but one class is 0 or nearly so.
    gaps = [0.0, -1e-15, -1e-10, -1e-6, -0.5, -1.0, -36.0, -40.0, -700.0, -740.0, -1e5, -np.inf]
    row = st.lists(st.sampled_from(gaps), min_size=n_classes, max_size=n_classes)
    finite = row.filter(lambda values: max(values) > -np.inf)
    return st.lists(finite, min_size=1, max_size=8).map(normalised)


def normalised(scores):
    weights = np.exp(np.array(scores) - np.max(scores, axis=1, keepdims=True))
    return weights / weights.sum(axis=1, keepdims=True)


@given(st.integers(1, 5).flatmap(posteriors))
@settings(max_examples=40)
def test_zero_one_decisions_are_those_of_the_plain_formula(posterior):
    cost = 1 - np.eye(posterior.shape[1])
    np.testing.assert_array_equal(least_risk(posterior, cost), plain_decision(posterior, cost))


@given(posteriors(3), arrays(float, (4, 3), elements=st.integers(-3, 3).map(float)))
@settings(max_examples=40)
def test_decisions_are_those_of_the_plain_formula(posterior, cost):
    np.testing.assert_array_equal(least_risk(posterior, cost), plain_decision(posterior, cost))


@pytest.mark.parametrize("n_classes", [2, 3, 300])
def test_equal_probabilities_go_to_the_first_decision(n_classes):
    posterior = np.full((3, n_classes), 1.0)
    posterior[1, n_classes - 1] = 2.0
    posterior[2, 0] = 0.0
    decided = least_risk(posterior, 1 - np.eye(n_classes))
    np.testing.assert_array_equal(decided, [0, n_classes - 1, 1])


@given(arrays(float, (40, 7), elements=st.floats(0, 1)), st.permutations(range(12)))
def test_equal_decisions_have_equal_risks_to_the_last_bit(posterior, order):
    cost = np.random.default_rng(0).normal(size=(6, 7))
    risk = conditional_risk(posterior, np.vstack([cost, cost])[order])
    sorted_risk = risk[:, np.argsort(order)]
    np.testing.assert_array_equal(sorted_risk[:, :6], sorted_risk[:, 6:])
    np.testing.assert_allclose(sorted_risk[:, :6], posterior @ cost.T, atol=1e-13)


@pytest.mark.parametrize("function", [conditional_risk, least_risk])
@pytest.mark.parametrize(
    ("posterior", "cost", "message"),
    [
        ([[0.2, 0.8], [np.nan, 1.0]], np.eye(2), "posterior.* got nan for recording 1, class nu"),
        ([[0.2, 0.8], [1.5, -0.5]], np.eye(2), r"at least 0, got -0.5 for recording 1, .*r 1\."),
        ([[0.2, 0.8]], [[0, 1], [np.inf, 0]], "cost must be finite, got inf for decision 1, .*r 0"),
        ([[0.2, 0.8]], np.eye(3), r"same number of columns.*\(1, 2\) and \(3, 3\)"),
        ([0.2, 0.8], np.eye(2), r"posterior must have one row per recording.*shape \(2,\)"),
        ([[0.2, 0.8]], np.empty((0, 2)), r"at least one row.*\(0, 2\)"),
    ],
)
def test_invalid_probabilities_and_costs_are_refused(function, posterior, cost, message):
    with pytest.raises(ValueError, match=message):
        function(posterior, cost)


def test_a_recording_without_any_probability_is_not_decided():
    with pytest.raises(ValueError, match="recording 1 are 0"):
        least_risk([[0.2, 0.8], [0.0, 0.0]], 1 - np.eye(2))


def test_text_is_no_probability():
    with pytest.raises(TypeError, match="posterior must be numeric"):
        least_risk([["a", "b"]], np.eye(2))


@pytest.mark.parametrize("dtype", [np.float32, np.int64])
def test_risks_and_costs_are_computed_in_double_precision(dtype):
    posterior, cost = np.array([[0.1, 0.9]], np.float32), np.array([[0, 3], [7, 1]], dtype)
    exact = posterior.astype(float), cost.astype(float)
    for function in (conditional_risk, lambda _, cost: canonical_cost(cost)):
        found = function(posterior, cost)
        assert found.dtype == np.float64
        np.testing.assert_array_equal(found, function(*exact))
    assert canonical_cost(cost).tolist() == [[0, 2 / 7], [1, 0]]


@pytest.mark.parametrize("gap", [0.5e-12, 2e-12])
def test_risks_tie_within_a_fraction_of_the_least(gap):
    for scale in (0.1, 1e-9):
        posterior = [[0.5, scale * (1 + gap), scale]]
        cost = [[0.0, 1, 0], [0, 0, 1], [1, 1, 1]]
        assert least_risk(posterior, cost) == [0 if gap < 1e-12 else 1]


def test_canonical_costs_are_from_0_to_1_in_any_unit_and_from_any_zero():
    for unit in (1e-300, 1e-9, 1.0, 1e300):
        found = canonical_cost(unit * np.array([[5.0, 20.0], [7.0, 15.0], [6.0, 16.0]]))
        np.testing.assert_allclose(found, [[0, 1], [0.4, 0], [0.2, 0.2]], rtol=1e-12)
    np.testing.assert_array_equal(canonical_cost([[3, 4], [3, 4]]), 0)
    np.testing.assert_array_equal(canonical_cost([[0, 0], [0, 0]]), 0)


def test_the_first_invalid_probability_or_cost_is_named():
    posterior = np.full((3, 2), 0.5)
    posterior[1:, 1] = np.nan
    with pytest.raises(ValueError, match="got nan for recording 1, class number 1"):
        conditional_risk(posterior, np.eye(2))
    with pytest.raises(ValueError, match="got inf for decision 0, class number 1"):
        conditional_risk(posterior[:1], [[0, np.inf], [np.inf, 0]])
