"""Facts about risks and the decision of least risk, beyond those of `test_costs`."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from emacm.decisions.risks import canonical_cost, decide, risks_of

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
    # Ties, near ties, and gaps where the posterior of all but one class is 0 or nearly so. Below
    # exp(-708) a number has few digits, and equal risks may differ by more than rounding.
    gaps = [0.0, -1e-15, -1e-10, -1e-6, -0.5, -1.0, -36.0, -40.0, -700.0, -1e5, -np.inf]
    row = st.lists(st.sampled_from(gaps), min_size=n_classes, max_size=n_classes)
    finite = row.filter(lambda values: max(values) > -np.inf)
    return st.lists(finite, min_size=1, max_size=8).map(normalised)


def normalised(scores):
    weights = np.exp(np.array(scores) - np.max(scores, axis=1, keepdims=True))
    return weights / weights.sum(axis=1, keepdims=True)


@given(posteriors(3), arrays(float, (4, 3), elements=st.integers(-3, 3).map(float)))
@settings(max_examples=40)
def test_decisions_are_those_of_the_plain_formula(posterior, cost):
    np.testing.assert_array_equal(decide(posterior, cost), plain_decision(posterior, cost))


@pytest.mark.parametrize("n_classes", [2, 3, 300])
def test_equal_probabilities_go_to_the_first_decision(n_classes):
    posterior = np.full((3, n_classes), 1.0)
    posterior[1, n_classes - 1] = 2.0
    posterior[2, 0] = 0.0
    decided = decide(posterior, 1 - np.eye(n_classes))
    np.testing.assert_array_equal(decided, [0, n_classes - 1, 1])


@given(arrays(float, (40, 7), elements=st.floats(0, 1)), st.permutations(range(12)))
def test_equal_decisions_have_equal_risks_to_the_last_bit(posterior, order):
    cost = np.random.default_rng(0).normal(size=(6, 7))
    risk = risks_of(posterior, np.vstack([cost, cost])[order])
    sorted_risk = risk[:, np.argsort(order)]
    np.testing.assert_array_equal(sorted_risk[:, :6], sorted_risk[:, 6:])
    np.testing.assert_allclose(sorted_risk[:, :6], posterior @ cost.T, atol=1e-13)


@pytest.mark.parametrize("gap", [0.5e-12, 2e-12])
def test_risks_tie_within_a_fraction_of_the_least(gap):
    for scale in (0.1, 1e-9):
        posterior = np.array([[0.5, scale * (1 + gap), scale]])
        cost = np.array([[0.0, 1, 0], [0, 0, 1], [1, 1, 1]])
        assert decide(posterior, cost) == [0 if gap < 1e-12 else 1]


def test_canonical_costs_are_from_0_to_1_in_any_unit_and_from_any_zero():
    for unit in (1e-300, 1e-9, 1.0, 1e300):
        found = canonical_cost(unit * np.array([[5.0, 20.0], [7.0, 15.0], [6.0, 16.0]]))
        np.testing.assert_allclose(found, [[0, 1], [0.4, 0], [0.2, 0.2]], rtol=1e-12)
    np.testing.assert_array_equal(canonical_cost([[3, 4], [3, 4]]), 0)
    np.testing.assert_array_equal(canonical_cost([[0, 0], [0, 0]]), 0)


whole_costs = arrays(float, (3, 3), elements=st.integers(-20, 20).map(float))
probabilities = arrays(float, (6, 3), elements=st.integers(0, 8).map(float)).map(
    lambda p: (p + 1e-3) / (p + 1e-3).sum(axis=1, keepdims=True)
)


@given(probabilities, whole_costs, st.sampled_from([1e-9, 1 / 3, 7e8]), st.integers(-7, 50))
@settings(max_examples=40)
def test_a_scale_and_a_constant_on_one_truth_change_no_decision(posterior, cost, scale, constant):
    decided = decide(posterior, cost)
    np.testing.assert_array_equal(decide(posterior, cost * scale), decided)
    np.testing.assert_array_equal(decide(posterior, cost + [0, constant, 0]), decided)
    chosen = np.take_along_axis(risks_of(posterior, cost), decided[:, None], axis=1)[:, 0]
    np.testing.assert_allclose(chosen, risks_of(posterior, cost).min(axis=1), atol=1e-10)


@pytest.mark.parametrize(
    ("posterior", "cost", "row"),
    [
        # Rows are the decision: R(0) = 0.7*0 + 0.3*1, R(1) = 0.7*10 + 0.3*0, and Eq. (2.48).
        ([0.7, 0.3], [[0, 1], [10, 0]], 0),
        ([0.7, 0.3], [[0, 10], [1, 0]], 1),
        ([0.5, 0.5], [[0.3 + 7, 0.1], [7, 0.1 + 0.3]], 0),
        ([0.2, 0.8], [[1, 1], [1, 1], [1, 1]], 0),
        ([1.0, 1e-30], [[5, 9], [5, 1]], 1),
    ],
)
def test_decisions_by_hand(posterior, cost, row):
    assert decide(np.array([posterior]), np.array(cost, float)) == [row]
