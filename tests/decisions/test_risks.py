"""Facts about risks and the decision of least risk, beyond those of `test_costs`."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from emacm.decisions.risks import (
    LeastRisk,
    canonical_cost,
    conditional_risk,
    distinct_rows,
    least_risk,
)

TIE = 1e-12


def plain_decision(scores, cost):
    """Decision of least risk, one recording and one decision at a time."""
    chosen = []
    for column in np.asarray(scores, float).T:
        weights = np.exp(column - column.max())
        posterior = weights / weights.sum()
        risks = [
            sum(p * c for p, c in zip(posterior, row, strict=True)) for row in canonical_cost(cost)
        ]
        chosen.append(next(i for i, risk in enumerate(risks) if risk <= min(risks) * (1 + TIE)))
    return chosen


def score_tables(n_classes):
    # Ties, near ties, and gaps where the posterior of all but one class is 0 or nearly so.
    gaps = [0.0, -1e-15, -1e-10, -1e-6, -0.5, -1.0, -36.0, -40.0, -700.0, -740.0, -1e5, -np.inf]
    column = st.lists(st.sampled_from(gaps), min_size=n_classes, max_size=n_classes)
    finite = column.filter(lambda values: max(values) > -np.inf)
    return st.lists(finite, min_size=1, max_size=8).map(lambda rows: np.array(rows).T)


@given(st.integers(1, 5).flatmap(score_tables), st.sampled_from([0.0, 3.0, -1e3]))
def test_zero_one_decisions_need_no_exponentials_to_be_the_same(scores, common):
    cost = 1 - np.eye(len(scores))
    expected = plain_decision(scores, cost)
    np.testing.assert_array_equal(LeastRisk(cost).decide_by_scores(scores + common), expected)


@given(
    score_tables(3),
    arrays(float, (4, 3), elements=st.integers(-3, 3).map(float)),
)
def test_decisions_by_scores_are_those_of_the_posteriors(scores, cost):
    expected = plain_decision(scores, cost)
    np.testing.assert_array_equal(LeastRisk(cost).decide_by_scores(scores.copy()), expected)
    weights = np.exp(scores - scores.max(axis=0))
    np.testing.assert_array_equal(least_risk((weights / weights.sum(axis=0)).T, cost), expected)


@pytest.mark.parametrize("n_classes", [2, 3, 300])
def test_equal_probabilities_go_to_the_first_decision(n_classes):
    rule = LeastRisk(1 - np.eye(n_classes))
    scores = np.full((n_classes, 3), -5.0)
    scores[n_classes - 1, 1] = -4.0
    scores[0, 2] = -np.inf
    np.testing.assert_array_equal(rule.decide_by_scores(scores), [0, n_classes - 1, 1])


def test_among_saturated_posteriors_the_sure_class_wins():
    scores = np.array([[-1e8, 0.0, -1e300], [0.0, -1e8, -1e299]])
    np.testing.assert_array_equal(LeastRisk(1 - np.eye(2)).decide_by_scores(scores), [1, 0, 1])


def test_a_scale_of_zero_one_costs_is_still_zero_one():
    scores = np.log([[0.2, 0.6], [0.8, 0.4]])
    for cost in ([[0, 1], [1, 0]], [[0, 7], [7, 0]], [[3, 4], [4, 3]]):
        np.testing.assert_array_equal(LeastRisk(cost).decide_by_scores(scores.copy()), [1, 0])


@given(arrays(float, (40, 7), elements=st.floats(0, 1)), st.permutations(range(12)))
def test_equal_decisions_have_equal_risks_to_the_last_bit(posterior, order):
    cost = np.random.default_rng(0).normal(size=(6, 7))
    risk = conditional_risk(posterior, np.vstack([cost, cost])[order])
    sorted_risk = risk[:, np.argsort(order)]
    np.testing.assert_array_equal(sorted_risk[:, :6], sorted_risk[:, 6:])
    np.testing.assert_allclose(sorted_risk[:, :6], posterior @ cost.T, atol=1e-13)


def test_each_row_is_found_among_those_that_differ():
    cost = np.array([[1.0, 0.0], [2.0, 0.0], [1.0, 0.0], [0.0, 1.0], [2.0, 0.0]])
    first, place = distinct_rows(cost)
    assert first.tolist() == [0, 1, 3]
    np.testing.assert_array_equal(cost[first][place], cost)
