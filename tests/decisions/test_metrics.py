"""Facts about which decisions are correct."""

import numpy as np
import pytest

from emacm.decisions.metrics import are_correct, correct_decisions, fraction_correct

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
    message = "y contains 'dry 3' at recording 0, which is none of the classes .* leave such"
    with pytest.raises(ValueError, match=f"(?i){message}"):
        correctness(["dry 1", "dry 3"], ["dry", "dry"], FAMILIES, STATES, COST)


def test_a_classifier_of_classes_is_wrong_about_an_unknown_class():
    right = correctness(["worn", "new"], ["worn", "worn"], ["worn"], ["worn"], [[0]])
    np.testing.assert_array_equal(right, [True, False])


def test_numbers_and_names_of_numpy_and_python_are_the_same_labels():
    truths = np.array([0, 1, 1])
    decided = np.array([0, 1, "inspect"], dtype=object)
    cost = [[0, 1], [1, 0], [0.2, 0.2]]
    right = correctness(truths, decided, [0, 1, "inspect"], np.array([0, 1]), cost)
    np.testing.assert_array_equal(right, [True, True, False])


def test_unequal_lengths_are_refused():
    with pytest.raises(ValueError, match="equally long, got 2 and 1"):
        fraction_correct([0, 1], [0], ([0, 1], [0, 1], np.eye(2)))


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


def test_costs_that_differ_by_rounding_are_equally_cheap():
    cost = [[0.1 + 0.2, 7.0], [0.3, 1.0]]
    assert correct_decisions(["fly", "ground"], [4, 2], cost)[4] == ("fly", "ground")


def test_where_all_decisions_are_free_each_of_them_is_correct():
    correct = correct_decisions(["fly", "ground"], [4, 2], [[0.0, 7.0], [0.0, 1.0]])
    assert correct[4] == ("fly", "ground")
    assert correct[2] == ("ground",)


def test_a_class_decided_for_another_of_its_family_is_correct():
    correct = correct_decisions(FAMILIES, STATES, COST)
    found = are_correct(["dry 1", "dry 1", "spall"], ["dry 2", "spall", "spalled"], correct)
    assert found.tolist() == [True, False, True]
