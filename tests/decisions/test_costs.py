"""Facts about costs: the table, the decision of least risk, the mean cost."""

import numpy as np
import pandas as pd
import pytest
from sklearn.calibration import CalibratedClassifierCV
from sklearn.dummy import DummyClassifier
from sklearn.ensemble import VotingClassifier
from sklearn.metrics import confusion_matrix
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from emacm import ConditionRouter, CostSensitiveGaussianBayes, PosteriorProduct
from emacm.decisions.costs import cost_table
from emacm.decisions.metrics import expected_cost
from emacm.decisions.pipelines import narrowed, stated_costs

CLASSES = ["ball", "healthy", "screw"]
MATRIX = np.array([[0.0, 10.0, 2.0], [5.0, 0.0, 7.0], [1.0, 3.0, 0.0]])


def test_the_default_cost_is_0_for_correct_decisions_and_1_for_others():
    decisions, matrix = cost_table(None, CLASSES)
    assert decisions.tolist() == CLASSES
    np.testing.assert_array_equal(matrix, [[0, 1, 1], [1, 0, 1], [1, 1, 0]])


def test_an_array_is_read_with_rows_as_decisions_in_the_order_of_the_classes():
    decisions, matrix = cost_table(MATRIX.tolist(), CLASSES)
    assert decisions.tolist() == CLASSES
    np.testing.assert_array_equal(matrix, MATRIX)


def test_a_frame_need_not_offer_the_classes_as_decisions():
    frame = pd.DataFrame([[9, 0, 9], [0, 1, 0]], index=["fly", "ground"], columns=CLASSES)
    decisions, matrix = cost_table(frame, CLASSES)
    assert decisions.tolist() == ["fly", "ground"]
    assert decisions.dtype.kind == "U"
    assert matrix.shape == (2, 3)


def test_a_mapping_leaves_the_rest_at_zero_and_one():
    _, matrix = cost_table({("healthy", "screw"): 50}, CLASSES)
    np.testing.assert_array_equal(matrix, [[0, 1, 1], [1, 0, 50], [1, 1, 0]])


def test_a_mapping_lists_other_decisions_after_the_classes_as_they_appear():
    prices = {(d, k): 0.1 for d in ("stop", "inspect") for k in reversed(CLASSES)}
    decisions, matrix = cost_table(prices, CLASSES)
    assert decisions.tolist() == [*CLASSES, "stop", "inspect"]
    np.testing.assert_array_equal(matrix[3:], 0.1)


def test_the_mean_cost_is_the_product_with_the_transposed_confusion_matrix():
    rng = np.random.default_rng(0)
    truth, decision = rng.integers(0, 3, 200), rng.integers(0, 3, 200)
    counts = confusion_matrix(truth, decision)
    mean = expected_cost(truth, decision, cost=MATRIX)
    assert mean == pytest.approx((MATRIX.T * counts).sum() / 200, rel=1e-14)
    assert expected_cost(truth, decision) == pytest.approx(np.mean(truth != decision))


def test_the_mean_cost_counts_recordings_by_their_weight():
    cost = [[0, 10], [1, 0]]
    repeated = expected_cost([0, 1, 1, 1], [1, 0, 0, 0], cost=cost)
    weighted = expected_cost([0, 1], [1, 0], cost=cost, sample_weight=[1, 3])
    assert weighted == repeated == 7.75


def test_the_mean_cost_is_the_same_for_every_form_of_cost():
    truth, decision = ["ball", "screw", "healthy"], ["healthy", "healthy", "screw"]
    frame = pd.DataFrame(MATRIX, index=CLASSES, columns=CLASSES).sample(frac=1, random_state=1)
    mapping = {(d, k): MATRIX[i, j] for i, d in enumerate(CLASSES) for j, k in enumerate(CLASSES)}
    means = {
        expected_cost(truth, decision, cost=MATRIX, labels=CLASSES),
        expected_cost(pd.Series(truth), np.array(decision), cost=frame),
        expected_cost(truth, decision, cost=mapping),
        expected_cost(truth, decision, cost=mapping, labels=CLASSES[::-1]),
    }
    assert means == {(5 + 7 + 3) / 3}


SQUARE = pd.DataFrame(MATRIX, index=CLASSES, columns=CLASSES)


@pytest.mark.parametrize(
    ("cost", "error", "message"),
    [
        (np.ones((4, 3)), ValueError, r"shape \(3, 3\).*got shape \(4, 3\).*need names"),
        (3.0, ValueError, r"got shape \(\)"),
        ([[0, 1], [1]], ValueError, r"square array .*got shape \(2,\)"),
        ([[0, 1, 1], [1, 0, np.nan], [1, 1, 0]], ValueError, "'healthy' when 'screw'.*nan"),
        (np.full((3, 3), "1"), TypeError, "'ball' when 'ball' is true must be a number"),
        (np.eye(3, dtype=bool), TypeError, "'ball' when 'ball' is true must be a number, got True"),
        ({("healthy", "scew"): 1}, ValueError, "class 'scew'.*unknown.*'screw'"),
        ({("inspect", "ball"): 1}, ValueError, r"'inspect'.*missing: \['healthy', 'screw'\]"),
        ({"healthy": 1}, TypeError, r"\(decision, true class\), got 'healthy'"),
        ({("healthy", "ball"): None}, TypeError, "deciding 'healthy' when 'ball' .*None"),
        (SQUARE[CLASSES[1:]], ValueError, r"missing: \['ball'\]"),
        (SQUARE.assign(x=1.0), ValueError, "class 'x'.*unknown"),
        (SQUARE.set_axis(["a", "a", "b"]), ValueError, r"index.*more than once: \['a'\]"),
        (SQUARE.set_axis(["ball"] * 3, axis=1), ValueError, "columns.*more than once"),
        (SQUARE[:0], ValueError, "at least one decision"),
        ("ab", ValueError, r"square array of shape \(3, 3\)"),
    ],
)
def test_invalid_costs_are_refused_with_their_position(cost, error, message):
    with pytest.raises(error, match=message):
        cost_table(cost, CLASSES)


@pytest.mark.parametrize(
    ("truth", "decision", "options", "message"),
    [
        ([], [], {}, "at least one label"),
        ([0, None], [0, 1], {}, "y_true .* position 1 has None"),
        ([[0], [1]], [0, 1], {}, r"one-dimensional, got shape \(2, 1\)"),
        ([0, 1], [0, 0], {"cost": MATRIX}, r"square array of shape \(2, 2\), .*got shape \(3, 3\)"),
        ([0, 1], [0, 5], {"labels": [0, 1]}, "y_pred contains 5 at position 1"),
        ([0, 5], [0, 0], {"labels": [0, 1]}, "y_true contains 5 at position 1"),
        ([0, 1], [0, 0], {"sample_weight": [0]}, r"shape \(2,\), got shape \(1,\)"),
        ([0, 1], [0, 0], {"sample_weight": [1, -1]}, "got -1.0 at recording 1"),
    ],
)
def test_labels_and_weights_that_do_not_fit_are_refused(truth, decision, options, message):
    with pytest.raises(ValueError, match=message):
        expected_cost(truth, decision, **options)


def test_costs_may_be_objects_and_labels_without_an_order_need_their_classes():
    np.testing.assert_array_equal(cost_table(MATRIX.astype(object), CLASSES)[1], MATRIX)
    with pytest.raises(TypeError, match="different types have no order, give labels="):
        expected_cost([0, "a"], [0, 0])


# Costs of estimators


def member(cost=None, **options):
    return CostSensitiveGaussianBayes(cost, **options)


OTHER = {("ball", "screw"): 2}


@pytest.mark.parametrize(
    ("cost", "expected"),
    [
        (None, None),
        (MATRIX, [[0, 2], [1, 0]]),
        (np.arange(16).reshape(4, 4), [[0, 2, 3], [8, 10, 11], [12, 14, 15]]),  # unknown: the last
        (np.ones((2, 3)), np.ones((2, 3))),
        ({("ball", "healthy"): 1, ("healthy", "ball"): 2} | OTHER, OTHER),
    ],
)
def test_costs_are_narrowed_to_the_classes_that_occur_at_any_depth(cost, expected):
    product = PosteriorProduct([("a", member(cost)), ("b", DummyClassifier())], cost=cost)
    assert narrowed(product, np.array(["ball", "screw"]), np.array(CLASSES)) is product
    for found in (product.cost, product.estimators[0][1].cost):
        if isinstance(expected, dict | None):
            assert found == expected
        else:
            np.testing.assert_array_equal(found, expected)
    assert narrowed(member(cost), CLASSES, CLASSES).cost is cost


def test_the_cost_that_decides_is_that_of_the_last_step():
    inner = member(OTHER, unknown="odd", priors="uniform")
    stated = {"cost": OTHER, "unknown": "odd", "priors": "uniform"}
    chain = make_pipeline(StandardScaler(), inner)
    for estimator in (inner, chain, GridSearchCV(chain, {}), ConditionRouter(chain, "load")):
        assert stated_costs(estimator) == stated
    assert stated_costs(PosteriorProduct([("a", inner)], cost=MATRIX))["cost"] is MATRIX
    nothing = {"cost": None, "unknown": None, "priors": None}
    assert stated_costs(PosteriorProduct([("a", inner)])) == nothing | {"unknown": "odd"}
    assert stated_costs(VotingClassifier([("a", member())])) == nothing
    for estimator in (VotingClassifier([("a", inner)]), CalibratedClassifierCV(inner)):
        with pytest.raises(ValueError, match=r"no effect on decisions of .*LeastRiskClassifier"):
            stated_costs(make_pipeline(StandardScaler(), estimator))
