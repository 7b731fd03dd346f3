"""Facts about families of states: what decisions on them cost, and how they are scored."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.metrics import balanced_accuracy_score

from emacm import CostSensitiveGaussianBayes, as_families, family_costs, set_costs
from emacm.decisions.families import family_mapping

FAMILIES = {"normal": ["normal"], "spalling": ["spalling1", "spalling2"], "backlash": ["backlash1"]}
STATES = ["normal", "spalling1", "spalling2", "backlash1"]


@pytest.fixture(scope="module")
def states():
    """One feature, and the states in a row along it: spalling lies on both sides of normal."""
    rng = np.random.default_rng(0)
    centre = {"spalling1": 0.0, "normal": 4.0, "spalling2": 8.0, "backlash1": 20.0}
    y = np.repeat(list(centre), 20)
    return np.array([[centre[label] + rng.standard_normal()] for label in y]), y


def test_a_decision_costs_nothing_if_the_truth_is_in_its_family_and_one_elsewhere():
    frame = family_costs(FAMILIES)
    assert frame.index.tolist() == list(FAMILIES)
    assert frame.columns.tolist() == STATES
    np.testing.assert_array_equal(frame, [[0, 1, 1, 1], [1, 0, 0, 1], [1, 1, 1, 0]])


@given(st.lists(st.integers(0, 2), min_size=1, max_size=6))
def test_families_decide_by_the_sum_of_the_posteriors_of_their_states(members):
    families = {-1 - name: [i for i, m in enumerate(members) if m == name] for name in set(members)}
    rng = np.random.default_rng(len(members))
    posterior = rng.dirichlet(np.ones(len(members)), size=5)
    cost = family_costs(families)[list(range(len(members)))].to_numpy()
    risk = posterior @ cost.T
    sums = np.stack([posterior[:, states].sum(axis=1) for states in families.values()], axis=1)
    np.testing.assert_allclose(risk, 1 - sums, atol=1e-12)


def test_costs_between_families_hold_for_all_their_states():
    frame = family_costs(FAMILIES, {("normal", "spalling"): 10, ("backlash", "normal"): 2})
    np.testing.assert_array_equal(frame, [[0, 10, 10, 1], [1, 0, 0, 1], [2, 1, 1, 0]])


def test_a_frame_of_costs_may_have_decisions_that_are_not_families():
    costs = pd.DataFrame(
        [[0, 9, 5], [1, 0, 0]], index=["fly", "repair"], columns=["normal", "spalling", "backlash"]
    )
    frame = family_costs(FAMILIES, costs)
    assert frame.index.tolist() == ["fly", "repair"]
    assert frame.loc["fly"].tolist() == [0, 9, 9, 5]


def test_missed_faults_and_false_alarms_refer_to_the_healthy_family():
    frame = family_costs(FAMILIES, healthy="normal", missed_cost=10, false_alarm_cost=2)
    np.testing.assert_array_equal(frame, [[0, 10, 10, 10], [2, 0, 0, 1], [2, 1, 1, 0]])


def test_a_single_cost_takes_precedence_over_that_of_all_missed_detections():
    frame = family_costs(FAMILIES, {("normal", "backlash"): 50}, healthy="normal", missed_cost=10)
    assert frame.loc["normal"].tolist() == [0, 10, 10, 50]


def test_training_on_states_beats_training_on_families_that_are_not_gaussian(states):
    X, y = states
    families = as_families(y, FAMILIES)
    by_states = CostSensitiveGaussianBayes(family_costs(FAMILIES), covariance="tied").fit(X, y)
    directly = CostSensitiveGaussianBayes(covariance="tied").fit(X, families)
    assert balanced_accuracy_score(families, by_states.predict(X)) > 0.95
    assert balanced_accuracy_score(families, directly.predict(X)) < 0.75


def test_labels_of_families_keep_their_kind():
    assert as_families([0, 2, 1], {10: [0, 1], 2: [2]}).tolist() == [10, 2, 10]
    assert as_families(np.array(STATES), FAMILIES).dtype.kind == "U"


def test_a_label_without_a_family_is_reported_with_its_position():
    with pytest.raises(ValueError, match="y contains 'wear' at position 1"):
        as_families(["normal", "wear"], FAMILIES)


# The reader of families


def test_families_of_one_state_each_are_read_as_the_family_of_each_state():
    assert family_mapping({"screw": "bad", "healthy": "ok"}) == {"screw": "bad", "healthy": "ok"}
    frame = family_costs({"screw": "bad", "healthy": "ok"}, {("ok", "bad"): 7})
    assert frame.index.tolist() == ["bad", "ok"]
    assert frame.columns.tolist() == ["screw", "healthy"]
    assert frame.loc["ok", "screw"] == 7


@pytest.mark.parametrize(
    ("families", "options", "error", "message"),
    [
        (["a"], {}, TypeError, "families must map each state to its family"),
        ({"a": []}, {}, ValueError, "list of states for 'a'"),
        ({"c": ["y"], "a": ["x"], "b": ["x"]}, {}, ValueError, "state 'x' into 'a' and into 'b'"),
        ({"a": ["x", "y"], "b": "z"}, {}, ValueError, "for 'b', as others; got 'z'"),
        ({"a": "b", "b": "c"}, {}, ValueError, "a family 'b' and a state 'b' that belongs to 'c'"),
        (
            FAMILIES,
            {"costs": {("normal", "wear"): 1}},
            ValueError,
            "costs between families .*'wear'",
        ),
        (FAMILIES, {"costs": {("stop", "normal"): 1}}, ValueError, "a cost for every class"),
        (FAMILIES, {"other_decisions": {"normal": 1}}, ValueError, "contains 'normal'"),
        (FAMILIES, {"other_decisions": {"inspect": "x"}}, TypeError, "cost of 'inspect'"),
        (FAMILIES, {"missed_cost": 10}, ValueError, "need healthy, one of"),
        (FAMILIES, {"healthy": "normal", "missed_cost": "x"}, TypeError, "must be a number"),
        (FAMILIES, {"healthy": "normal", "costs": np.eye(3)}, ValueError, "no complete table"),
    ],
)
def test_invalid_families_and_costs_are_refused(families, options, error, message):
    with pytest.raises(error, match=message):
        family_costs(families, **options)


OPENING, LEFT = {"screw": 2.0, "bearing": 1.0, "motor": 4.0}, {"screw": 9, "bearing": 5, "motor": 6}
SETS = ["healthy", "screw", "bearing", "motor", "screw + bearing", "motor + screw"]


@given(st.lists(st.floats(0.01, 1), min_size=6, max_size=6))
def test_a_part_is_opened_where_its_probability_exceeds_the_ratio_of_its_costs(weights):
    posterior = np.array(weights) / np.sum(weights)
    cost = set_costs(SETS, OPENING, LEFT)
    risk = cost.to_numpy() @ posterior
    opened = set(cost.index[risk.argmin()].split(" + ")) - {"healthy"}
    for part in OPENING:
        faulty = sum(p for p, state in zip(posterior, SETS, strict=True) if part in state)
        if abs(faulty * LEFT[part] - OPENING[part]) > 1e-9:
            assert (part in opened) == (faulty * LEFT[part] > OPENING[part])


def test_sets_are_decided_by_a_classifier_of_sets():
    rng = np.random.default_rng(0)
    y = np.repeat(["healthy", "bearing", "screw", "bearing + screw"], 40)
    X = np.array([[5.0 * ("bearing" in label), 5.0 * ("screw" in label)] for label in y])
    X += rng.standard_normal(X.shape)
    opening, left = {"bearing": 1, "screw": 1}, {"bearing": 20, "screw": 1.5}
    cost = set_costs(y, opening, left, other_decisions={"inspect": 5})  # inspecting costs too much
    model = CostSensitiveGaussianBayes(cost=cost).fit(X, y)
    decided = model.predict([[0, 0], [0, 5], [5, 0], [5, 5], [2.3, 0], [0, 2.5]]).tolist()
    # Of the last two one part each is faulty or not: 20 P > 1, but 1.5 P < 1.
    assert decided == ["healthy", "screw", "bearing", "bearing + screw", "bearing", "healthy"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"left": {"screw": 1}}, "same parts"),
        ({"states": ["screw", "gear"]}, "'gear'"),
        ({"opening": {"screw": "a lot"}, "left": {"screw": 1}, "states": ["screw"]}, "'screw'"),
        ({"other_decisions": {"screw": 1}}, "'screw', which has costs"),
        ({"opening": dict.fromkeys(range(11), 1), "left": dict.fromkeys(range(11), 1)}, "alone"),
    ],
)
def test_costs_of_sets_that_cannot_be_meant_are_refused(change, words):
    with pytest.raises((TypeError, ValueError), match=words):
        set_costs(**{"states": SETS, "opening": OPENING, "left": LEFT} | change)


def test_the_unit_of_costs_changes_no_decision_on_an_unknown_state():
    X, y = [[0.0], [0.4], [0.8], [5.0], [5.6], [6.0]], ["healthy"] * 3 + ["screw"] * 3
    new = [*X, [2.8], [200.0]]
    model = CostSensitiveGaussianBayes(covariance="tied", unknown="unknown")
    for unit in (1, 200, 1e-3):
        cost = set_costs(y, {"screw": unit}, {"screw": 15 * unit})
        model.set_params(cost=cost).fit(X, y, groups=[0, 1, 2, 0, 1, 2])
        assert model.cost_[:, -1].tolist() == [unit, unit, 0]
        assert model.predict(new).tolist() == [*y, "healthy", "unknown"]
