"""Facts about which decisions are right."""

import numpy as np
import pytest

from emacm.decisions.right_decisions import right_decisions

STATES = ["healthy", "dry 1", "dry 2", "spall"]
FAMILIES = ["healthy", "dry", "spalled"]
COST = [[0, 9, 9, 9], [1, 0, 0, 1], [1, 1, 1, 0]]


def test_a_state_is_decided_rightly_by_its_family():
    decided = ["healthy", "dry", "healthy", "spalled"]
    right = right_decisions(STATES, decided, FAMILIES, STATES, COST)
    np.testing.assert_array_equal(right, [True, True, False, True])


def test_where_decisions_are_classes_only_the_true_class_is_right_whatever_it_costs():
    # Deciding "worn" costs nothing, but is not true of the healthy.
    cost = [[0, 1], [0, 0]]
    classes = ["healthy", "worn"]
    truths, decided = ["healthy", "healthy"], ["healthy", "worn"]
    right = right_decisions(truths, decided, classes, classes, cost)
    np.testing.assert_array_equal(right, [True, False])


def test_decisions_that_cost_the_same_least_are_right_alike():
    cost = [[5, 2], [5, 2], [7, 3]]
    right = right_decisions([0, 0, 1], ["a", "b", "c"], ["a", "b", "c"], [0, 1], cost)
    np.testing.assert_array_equal(right, [True, True, False])


def test_a_family_given_as_the_truth_is_compared_by_name():
    right = right_decisions(["dry", "dry"], ["dry", "spalled"], FAMILIES, STATES, COST)
    np.testing.assert_array_equal(right, [True, False])


def test_a_truth_that_no_class_and_no_decision_names_is_refused():
    message = "y holds 'dry 3' at recording 1, which is none of the classes .* leave such"
    with pytest.raises(ValueError, match=f"(?i){message}"):
        right_decisions(["dry 1", "dry 3"], ["dry", "dry"], FAMILIES, STATES, COST)


def test_a_classifier_of_classes_is_wrong_about_an_unknown_class():
    right = right_decisions(["worn", "new"], ["worn", "worn"], ["worn"], ["worn"], [[0]])
    np.testing.assert_array_equal(right, [True, False])


def test_numbers_and_names_of_numpy_and_python_are_the_same_labels():
    truths = np.array([0, 1, 1])
    decided = np.array([0, 1, "inspect"], dtype=object)
    cost = [[0, 1], [1, 0], [0.2, 0.2]]
    right = right_decisions(truths, decided, [0, 1, "inspect"], np.array([0, 1]), cost)
    np.testing.assert_array_equal(right, [True, True, False])


def test_unequal_lengths_are_refused():
    with pytest.raises(ValueError, match="equally long, got 2 and 1"):
        right_decisions([0, 1], [0], [0, 1], [0, 1], np.eye(2))
