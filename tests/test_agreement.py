"""The same question put to several subpackages has one answer."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sklearn.base import clone

from emacm import (
    ConditionRouter,
    CostSensitiveGaussianBayes,
    LeastRiskClassifier,
    PosteriorProduct,
    as_families,
    evaluate,
    expected_cost,
    family_costs,
    neg_expected_cost,
)
from emacm.displays import OutcomesDisplay

STATES = ["spall", "dry", "new", "worn"]  # not in alphabetical order
FAMILIES = {"stop": ["spall", "worn"], "grease": ["dry"], "fly": ["new"]}


def recordings(seed=0, n_each=9):
    """Two features of four overlapping states; the states, in a random order."""
    rng = np.random.default_rng(seed)
    y = rng.permutation(np.repeat(STATES, n_each))
    centres = dict(zip(STATES, [(3.0, 0.5), (-1.0, 2.0), (0.0, 0.0), (1.5, -2.5)], strict=True))
    return np.array([rng.normal(centres[label], (1.0, 1.4)) for label in y]), y


X, Y = recordings()
LATER, Y_LATER = recordings(1, n_each=7)


def answers_of_evaluate(model):
    """Train on X, decide on LATER: the figures, and one row for each decision."""
    together, truths = np.vstack([X, LATER]), np.append(Y, Y_LATER)
    train, test = np.arange(len(X)), np.arange(len(X), len(together))
    found = evaluate(model, together, truths, splits={"later": (train, test)}, n_splits=2)
    rows = found.predictions
    return found.table.loc["later"], rows[rows["scheme"] == "later"]


# Which decisions are correct

prices = st.integers(-9, 9).map(lambda tenths: tenths / 10)
DECISIONS = [["fly", "ground"], ["stop", "new", "grease"], [*reversed(STATES), "inspect"], STATES]
cost_tables = st.sampled_from(DECISIONS).flatmap(
    lambda rows: arrays(float, (len(rows), 4), elements=prices).map(
        lambda values: pd.DataFrame(values, index=rows, columns=sorted(STATES))
    )
)
GAIN = pd.DataFrame(
    [[1, -1, 9, 9], [0, 0, 2, 1]], index=["fly", "ground"], columns=["dry", "new", "spall", "worn"]
)


@pytest.mark.slow
@settings(max_examples=10)
@given(cost_tables, st.sampled_from([-2.0, 0.0, 3.0]))
@example(GAIN, 0.0)
@example(GAIN, 3.0)
def test_score_and_evaluate_call_the_same_decisions_correct(cost, constant):
    model = CostSensitiveGaussianBayes(cost + constant, priors="uniform").fit(X, Y)
    row, judged = answers_of_evaluate(model)
    assert row["accuracy"] == pytest.approx(model.score(LATER, Y_LATER), abs=1e-12)
    assert row["expected_cost"] == pytest.approx(-neg_expected_cost(model, LATER, Y_LATER))
    assert judged["decision"].tolist() == model.predict(LATER).tolist()


@settings(max_examples=12)
@given(cost_tables)
def test_a_wrapped_classifier_is_scored_as_the_classifier_itself(cost):
    model = CostSensitiveGaussianBayes(cost).fit(X, Y)
    routed = ConditionRouter(CostSensitiveGaussianBayes(cost), "load")
    table = pd.DataFrame(X, columns=["level", "slope"]).assign(load=20)
    share = routed.fit(table, Y).score(table, Y)
    assert share == model.score(X, Y)
    for other in (
        LeastRiskClassifier(CostSensitiveGaussianBayes(), cost),
        PosteriorProduct([("all", CostSensitiveGaussianBayes())], cost),
    ):
        assert other.fit(X, Y).score(X, Y) == share


def test_the_picture_of_outcomes_and_evaluate_count_the_same_decisions_as_correct():
    cost = family_costs(FAMILIES, other_decisions={"inspect": 0.1})
    model = CostSensitiveGaussianBayes(cost).fit(X, Y)
    decided = model.predict(LATER)
    truths = as_families(Y_LATER, FAMILIES)
    display = OutcomesDisplay.from_predictions(truths, decided, healthy="fly")
    row, _ = answers_of_evaluate(model)
    assert "inspect" in decided
    assert display.frame()["correct"].iloc[0] == pytest.approx(100 * model.score(LATER, Y_LATER))
    assert row["accuracy"] == pytest.approx(model.score(LATER, Y_LATER))


def test_the_cost_of_a_member_is_not_the_cost_of_the_product():
    member = CostSensitiveGaussianBayes({("new", "spall"): 50}, priors="uniform")
    for outer in (PosteriorProduct([("one", member)]), LeastRiskClassifier(member)):
        row, _ = answers_of_evaluate(outer)
        model = outer.fit(X, Y)
        assert row["expected_cost"] == pytest.approx(-neg_expected_cost(model, LATER, Y_LATER))
        wrong = expected_cost(Y_LATER, model.predict(LATER))
        assert row["expected_cost"] == pytest.approx(wrong)


# What families are

BY_STATE = {state: family for family, states in FAMILIES.items() for state in states}
FORMS = {
    "families of lists": FAMILIES,
    "families of Series": {family: pd.Series(states) for family, states in FAMILIES.items()},
    "families of arrays": {family: np.array(states) for family, states in FAMILIES.items()},
}


def readings(families):
    """How three functions read families: the family of each of Y_LATER."""
    truths = np.array(Y_LATER)

    def by_cost():
        cost = family_costs(families)
        return [cost.index[cost[label] == 0].tolist() for label in truths]

    def by_evaluation():
        model = CostSensitiveGaussianBayes(family_costs(families))
        return answers_of_evaluate(model)[1]["true_label"].tolist()

    def by_labels():
        return as_families(truths, families).tolist()

    return by_cost(), by_evaluation(), by_labels()


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_families_is_read_alike_by_all(form):
    expected = [BY_STATE[label] for label in Y_LATER]
    by_cost, by_evaluation, by_labels = readings(FORMS[form])
    assert by_cost == [[family] for family in expected]
    assert by_evaluation == expected
    assert by_labels == expected


# What is decided


@settings(max_examples=20)
@given(
    cost_tables,
    st.sampled_from([None, "uniform", [0.1, 0.2, 0.3, 0.4]]),
    st.sampled_from(["full", "tied", "diag"]),
)
def test_all_classifiers_take_the_same_decisions_of_least_risk(cost, priors, covariance):
    gaussian = CostSensitiveGaussianBayes(cost, priors=priors, covariance=covariance).fit(X, Y)
    plain = CostSensitiveGaussianBayes(priors=priors, covariance=covariance)
    others = [LeastRiskClassifier(plain, cost), PosteriorProduct([("all", plain)], cost)]
    if priors is not None:
        trained_otherwise = clone(plain).set_params(priors=[0.4, 0.3, 0.2, 0.1])
        others += [LeastRiskClassifier(trained_otherwise, cost, priors=priors)]
    risk = np.sort(gaussian.risk(LATER), axis=1)
    # Risks that are equal but for rounding may be decided either way once priors are converted.
    assume(((risk[:, 1] - risk[:, 0] > 1e-9) | (risk[:, 1] == risk[:, 0])).all())
    for other in others:
        other.fit(X, Y)
        np.testing.assert_array_equal(other.decisions_, gaussian.decisions_)
        np.testing.assert_allclose(other.risk(LATER), gaussian.risk(LATER), atol=1e-9)
        np.testing.assert_array_equal(other.predict(LATER), gaussian.predict(LATER))
