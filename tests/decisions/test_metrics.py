"""Facts about which decisions are correct."""

import numpy as np
import pandas as pd
import pytest

from emacm import expected_cost, neg_expected_cost
from emacm.decisions.metrics import are_correct, correct_decisions, fraction_correct, label_of

STATES = ["healthy", "dry 1", "dry 2", "spall"]
FAMILIES = ["healthy", "dry", "spalled"]
COST = [[0, 9, 9, 9], [1, 0, 0, 1], [1, 1, 1, 0]]


def correctness(truths, decided, decisions, classes, cost):
    """Whether each decision is correct; the fraction of them must be their mean."""
    table = decisions, classes, cost
    correct = [fraction_correct([k], [d], table) == 1 for k, d in zip(truths, decided, strict=True)]
    assert fraction_correct(truths, decided, table) == pytest.approx(np.mean(correct))
    return correct


def test_the_family_of_a_state_is_its_correct_decision():
    decided = ["healthy", "dry", "healthy", "spalled"]
    right = correctness(STATES, decided, FAMILIES, STATES, COST)
    np.testing.assert_array_equal(right, [True, True, False, True])


def test_where_decisions_are_classes_only_the_true_class_is_correct_for_any_cost():
    # Deciding "worn" costs nothing, but is not true of the healthy.
    cost = [[0, 1], [0, 0]]
    classes = ["healthy", "worn"]
    truths, decided = ["healthy", "healthy"], ["healthy", "worn"]
    right = correctness(truths, decided, classes, classes, cost)
    np.testing.assert_array_equal(right, [True, False])


def test_several_decisions_with_the_least_cost_are_all_correct():
    cost = [[5, 2], [5, 2], [7, 3]]
    right = correctness([0, 0, 1], ["a", "b", "c"], ["a", "b", "c"], [0, 1], cost)
    np.testing.assert_array_equal(right, [True, True, False])


def test_a_family_given_as_the_truth_is_compared_by_name():
    right = correctness(["dry", "dry"], ["dry", "spalled"], FAMILIES, STATES, COST)
    np.testing.assert_array_equal(right, [True, False])


def test_a_truth_that_is_neither_a_class_nor_a_decision_is_refused():
    with pytest.raises(ValueError, match="y contains 'dry 3' at position 0"):
        correctness(["dry 1", "dry 3"], ["dry", "dry"], FAMILIES, STATES, COST)


def test_a_classifier_of_classes_is_wrong_about_an_unknown_class():
    right = correctness(["worn", "new"], ["worn", "worn"], ["worn"], ["worn"], [[0]])
    np.testing.assert_array_equal(right, [True, False])


def test_weights_count_recordings():
    table = [0, 1], [0, 1], np.eye(2)
    assert fraction_correct([0, 1, 1], [0, 0, 1], table, [5, 2, 1]) == 0.75
    with pytest.raises(ValueError, match="zero for every recording"):
        fraction_correct([0, 1], [0, 1], table, [0, 0])


@pytest.mark.parametrize("constant", [-3.0, 0.0, 0.7])
def test_neither_negative_nor_positive_costs_change_which_decision_is_correct(constant):
    cost = np.array([[-1.0, 0.2, 5.0], [0.0, -0.3, 0.1]]) + constant
    correct = correct_decisions(["fly", "ground"], ["new", "worn", "broken"], cost)
    assert [correct[k] for k in ("new", "worn", "broken")] == [("fly",), ("ground",), ("ground",)]


def test_a_class_decided_for_another_of_its_family_is_correct():
    correct = correct_decisions(FAMILIES, STATES, COST)
    found = are_correct(["dry 1", "dry 1", "spall"], ["dry 2", "spall", "spalled"], correct)
    assert found.tolist() == [True, False, True]


def test_a_label_that_is_no_class_is_correct_for_itself_only():
    correct = correct_decisions(FAMILIES, STATES, COST)
    names = {"dry 1": "dry", "dry": "dry", "odd": "odd"}
    assert {name: label_of(name, correct) for name in names} == names
    found = are_correct(["odd", "odd", "dry", "dry 1"], ["odd", "dry", "dry 2", "odd"], correct)
    assert found.tolist() == [True, False, True, False]
    assert are_correct([], [], correct).dtype == bool


class Fixed:
    """Decides as stated, under a cost with an unknown state."""

    decisions_, classes_ = np.array(["new", "worn", "stop"]), np.array(["new", "worn"])
    cost_ = np.array([[0.0, 9, 5], [1, 0, 3], [0.2, 0.3, 0.1]])

    def predict(self, X):
        return self.decisions_[X]


def test_the_negative_mean_cost_is_that_of_the_truths_of_the_classifier():
    model, truths = Fixed(), ["new", "worn", "worn", "new"]
    known = Fixed()
    known.cost_ = known.cost_[:, :2]
    assert neg_expected_cost(known, [0, 0, 2, 1], truths) == -(0 + 9 + 0.3 + 1) / 4
    with pytest.raises(ValueError, match="y_true contains 'odd' at position 1"):
        neg_expected_cost(known, [0, 0], ["new", "odd"])
    model.truths_ = np.array(["new", "worn", "odd"])
    assert neg_expected_cost(model, [0, 0, 2], ["new", "odd", "odd"]) == -(0 + 5 + 0.1) / 3


def test_classes_of_a_metric_follow_from_the_cost_and_the_labels():
    pairs = {("stop", "a"): 3, ("stop", "b"): 2, ("stop", "c"): 4}
    assert expected_cost(["b", "a"], ["stop", "a"], cost=pairs) == 1.0
    assert expected_cost(["b", "a"], ["d", "a"], cost=pairs | {("stop", "d"): 1}) == 0.5
    frame = pd.DataFrame([[0, 3], [7, 0]], ["b", "a"], ["b", "a"])
    assert expected_cost(["a", "a"], ["b", "a"], cost=frame) == 1.5
    assert expected_cost([2, 10], [10, 10], cost=[[0, 4], [6, 0]]) == 3.0  # sorted as numbers
    assert expected_cost([2, 10], [10, 10], cost=[[0, 4], [6, 0]], labels=[10, 2]) == 2.0
