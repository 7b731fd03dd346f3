"""Facts about families of states: what decisions on them cost, and how they are scored."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.metrics import accuracy_score, balanced_accuracy_score
from sklearn.model_selection import GridSearchCV

from emacm import (
    CostSensitiveGaussianBayes,
    expected_cost,
    group_costs,
    group_labels,
    neg_expected_cost,
)

GROUPS = {"normal": ["normal"], "spalling": ["spalling1", "spalling2"], "backlash": ["backlash1"]}
STATES = ["normal", "spalling1", "spalling2", "backlash1"]


@pytest.fixture(scope="module")
def states():
    """One feature, and the states in a row along it: spalling lies on both sides of normal."""
    rng = np.random.default_rng(0)
    centre = {"spalling1": 0.0, "normal": 4.0, "spalling2": 8.0, "backlash1": 20.0}
    y = np.repeat(list(centre), 20)
    return np.array([[centre[label] + rng.standard_normal()] for label in y]), y


def test_a_decision_costs_nothing_if_the_truth_is_in_its_family_and_one_elsewhere():
    frame = group_costs(GROUPS)
    assert frame.index.tolist() == list(GROUPS)
    assert frame.columns.tolist() == STATES
    np.testing.assert_array_equal(frame, [[0, 1, 1, 1], [1, 0, 0, 1], [1, 1, 1, 0]])


def test_a_family_of_one_state_may_be_written_without_a_list():
    assert group_costs(GROUPS | {"normal": "normal"}).equals(group_costs(GROUPS))


@given(st.lists(st.integers(0, 2), min_size=1, max_size=6))
def test_families_decide_by_the_sum_of_the_posteriors_of_their_states(members):
    groups = {family: [i for i, m in enumerate(members) if m == family] for family in set(members)}
    rng = np.random.default_rng(len(members))
    posterior = rng.dirichlet(np.ones(len(members)), size=5)
    cost = group_costs(groups)[list(range(len(members)))].to_numpy()
    risk = posterior @ cost.T
    sums = np.stack([posterior[:, states].sum(axis=1) for states in groups.values()], axis=1)
    np.testing.assert_allclose(risk, 1 - sums, atol=1e-12)


def test_costs_between_families_hold_for_all_their_states():
    frame = group_costs(GROUPS, {("normal", "spalling"): 10, ("backlash", "normal"): 2})
    np.testing.assert_array_equal(frame, [[0, 10, 10, 1], [1, 0, 0, 1], [2, 1, 1, 0]])


def test_a_frame_of_costs_may_have_decisions_that_are_no_family():
    costs = pd.DataFrame(
        [[0, 9, 5], [1, 0, 0]], index=["fly", "repair"], columns=["normal", "spalling", "backlash"]
    )
    frame = group_costs(GROUPS, costs)
    assert frame.index.tolist() == ["fly", "repair"]
    assert frame.loc["fly"].tolist() == [0, 9, 9, 5]


def test_a_further_decision_costs_the_same_whatever_is_true():
    frame = group_costs(GROUPS, extra={"inspect": 0.3})
    assert frame.loc["inspect"].tolist() == [0.3] * 4
    assert frame.loc["normal"].tolist() == [0, 1, 1, 1]


def test_missed_faults_and_false_alarms_refer_to_the_healthy_family():
    frame = group_costs(GROUPS, healthy="normal", missed=10, false_alarm=2)
    np.testing.assert_array_equal(frame, [[0, 10, 10, 10], [2, 0, 0, 1], [2, 1, 1, 0]])


def test_a_price_of_its_own_goes_before_that_of_all_missed_faults():
    frame = group_costs(GROUPS, {("normal", "backlash"): 50}, healthy="normal", missed=10)
    assert frame.loc["normal"].tolist() == [0, 10, 10, 50]


def test_families_of_numbers_and_of_tuples_stay_what_they_are():
    frame = group_costs({0: [0, 1], 1: [2]}, extra={"inspect": 1})
    assert frame.index.tolist() == [0, 1, "inspect"]
    assert frame.columns.tolist() == [0, 1, 2]
    assert group_costs({("a", 1): [("s", 1)], ("b", 2): ["t"]}).index.tolist() == [
        ("a", 1),
        ("b", 2),
    ]


def test_a_classifier_trained_on_states_decides_on_families(states):
    X, y = states
    model = CostSensitiveGaussianBayes(group_costs(GROUPS), covariance="tied").fit(X, y)
    answers = model.predict([[0.0], [4.0], [8.0], [20.0]])
    assert answers.tolist() == ["spalling", "normal", "spalling", "backlash"]


def test_training_on_states_beats_training_on_families_that_are_not_gaussian(states):
    X, y = states
    families = group_labels(y, GROUPS)
    by_states = CostSensitiveGaussianBayes(group_costs(GROUPS), covariance="tied").fit(X, y)
    directly = CostSensitiveGaussianBayes(covariance="tied").fit(X, families)
    assert balanced_accuracy_score(families, by_states.predict(X)) > 0.95
    assert balanced_accuracy_score(families, directly.predict(X)) < 0.75


def test_inspection_is_chosen_where_families_are_in_doubt(states):
    X, y = states
    cost = group_costs(GROUPS, extra={"inspect": 0.2})
    model = CostSensitiveGaussianBayes(cost, covariance="tied").fit(X, y)
    assert model.predict([[2.0], [4.0]]).tolist() == ["inspect", "normal"]


def test_the_metric_takes_states_as_truths_and_families_as_decisions():
    cost = group_costs(GROUPS, healthy="normal", missed=10)
    assert expected_cost(["spalling2", "normal"], ["normal", "normal"], cost=cost) == 5


def test_a_search_over_costs_and_covariances_takes_them(states):
    X, y = states
    model = CostSensitiveGaussianBayes(group_costs(GROUPS))
    search = GridSearchCV(model, {"covariance": ["tied", "diag"]}, scoring=neg_expected_cost)
    assert search.fit(X, y).best_score_ > -0.1


def test_accuracy_compares_families_with_families(states):
    X, y = states
    model = CostSensitiveGaussianBayes(group_costs(GROUPS), covariance="tied").fit(X, y)
    accuracy = accuracy_score(group_labels(y, GROUPS), model.predict(X))
    assert accuracy > 0.95
    assert model.score(X, y) == accuracy


def test_labels_of_families_keep_their_kind():
    assert group_labels([0, 2, 1], {0: [0, 1], 1: [2]}).tolist() == [0, 1, 0]
    assert group_labels(np.array(STATES), GROUPS).dtype.kind == "U"


@pytest.mark.parametrize(
    ("groups", "options", "error", "message"),
    [
        (["a"], {}, TypeError, "groups must be a mapping of family to states"),
        ({}, {}, ValueError, "groups must hold at least one family"),
        ({"a": []}, {}, ValueError, "family 'a' has no states"),
        ({"a": ["x"], "b": ["x"]}, {}, ValueError, "state 'x' is in family 'a' and in 'b'"),
        ({"a": ["x", "x"]}, {}, ValueError, "state 'x' is in family 'a' and in 'a'"),
        (
            GROUPS,
            {"costs": {("normal", "wear"): 1}},
            ValueError,
            r"costs between families, .*: cost names the class 'wear' .* \['normal', 'spalling'",
        ),
        (GROUPS, {"costs": {("stop", "normal"): 1}}, ValueError, "must then price every class"),
        (GROUPS, {"costs": {("normal", "spalling"): np.nan}}, ValueError, "must be a number"),
        (GROUPS, {"extra": {"normal": 1}}, ValueError, "extra names the decision 'normal'"),
        (GROUPS, {"extra": {"inspect": "x"}}, TypeError, "the cost of 'inspect' in extra must be"),
        (GROUPS, {"extra": ["inspect"]}, TypeError, "extra must be a mapping"),
        (GROUPS, {"missed": 10}, ValueError, "missed and false_alarm need healthy, one of"),
        (GROUPS, {"healthy": "fine", "missed": 10}, ValueError, "got healthy='fine'"),
        (GROUPS, {"healthy": "normal", "missed": "x"}, TypeError, "missed must be a number"),
        (
            GROUPS,
            {"healthy": "normal", "missed": 2, "costs": np.eye(3)},
            ValueError,
            "costs is a whole table",
        ),
    ],
)
def test_what_is_no_family_or_price_is_refused(groups, options, error, message):
    with pytest.raises(error, match=message):
        group_costs(groups, **options)


def test_a_label_of_no_family_is_named_with_its_place():
    with pytest.raises(ValueError, match="y holds 'wear' at position 1, which is in no family"):
        group_labels(["normal", "wear"], GROUPS)
