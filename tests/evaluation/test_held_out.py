"""Facts about the folds, what a classifier is given in each, and what is kept of its results."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator, ClassifierMixin

from emacm.evaluation.held_out import Decided, decide_held_out
from emacm.evaluation.novelty import left_out_families, novelty_predictions, score_novelty
from emacm.evaluation.scheme_scores import gather, score_scheme
from emacm.evaluation.schemes import (
    RANDOM,
    Fold,
    Scheme,
    all_schemes,
    given_scheme,
    group_scheme,
    random_scheme,
    strictest_scheme,
)
from emacm.evaluation.scoring import scoring_rule
from emacm.recordings.meta import Grouping

CLASSES = ["dry", "new", "worn"]
Y = np.array(["dry", "new", "worn", "new", "worn", "dry", "new", "worn"])
UNITS = Grouping("unit", np.array([5, 5, 6, 6, 7, 7, 8, 8]))
X = np.arange(16.0).reshape(8, 2)
BOOTSTRAP = {"confidence": 0.9, "n_resamples": 200, "random_state": 0}
FITTED = []


class Noted(ClassifierMixin, BaseEstimator):
    """Notes its parameters and what it is given, and decides by the last digit of a feature."""

    def __init__(self, cost=None, priors=None, unknown=None, refuse=None):
        self.cost = cost
        self.priors = priors
        self.unknown = unknown
        self.refuse = refuse

    def fit(self, X, y, groups=None):
        FITTED.append((self.cost, self.priors, X[:, 0].tolist(), list(y), groups))
        if self.refuse == "fit":
            raise ValueError("not this one")
        self.classes_ = np.unique(y)
        return self

    def predict(self, X):
        if self.refuse == "predict":
            raise ValueError("not that one")
        return self.classes_[(X[:, 0] % len(self.classes_)).astype(int)]

    def predict_proba(self, X):
        shares = 1 + (X[:, :1] + np.arange(len(self.classes_))) % len(self.classes_)
        return shares / shares.sum(axis=1, keepdims=True)

    def typicality(self, X):
        return 1 / (1 + X[:, 0])

    def unknown_proba(self, X):
        return X[:, 0] / 20


def scheme_of(*tests, **options):
    folds = [Fold(np.setdiff1d(np.arange(8), test), np.array(test)) for test in tests]
    return Scheme("by hand", folds, UNITS, **options)


def decided_by(estimator, *schemes, groups=None):
    FITTED.clear()
    return decide_held_out(estimator, X, Y, schemes, groups=groups)


def test_what_a_fold_has_no_class_of_leaves_costs_and_priors():
    cost, priors = {("new", "worn"): 10, ("dry", "new"): 2}, {"dry": 0.2, "new": 0.3, "worn": 0.5}
    all_but_worn = Fold(np.array([0, 1, 3, 5]), np.array([2, 6]))
    complete = Fold(np.arange(6), np.array([7]))
    scheme = Scheme("s", [all_but_worn, complete], UNITS)
    model = Noted(cost, priors, unknown="odd")
    schemes, ((first, second),) = decided_by(model, scheme, groups=UNITS.labels)
    (some_cost, some_priors, features, y, groups), (all_cost, all_priors, *_) = FITTED
    assert some_cost == {("dry", "new"): 2}
    assert some_priors == pytest.approx({"dry": 0.4, "new": 0.6})
    assert (all_cost, all_priors) == (cost, priors)
    assert features == [0, 2, 6, 10]
    assert y == ["dry", "new", "new", "dry"]
    assert groups.tolist() == [5, 5, 6, 7]
    assert (model.cost, model.priors) == (cost, priors)
    assert schemes == [scheme]
    # Features 4 and 12 of two classes, 14 of three.
    assert first.decisions == ["dry", "dry"]
    assert first.posterior.columns.tolist() == ["dry", "new"]
    assert first.posterior.to_numpy() == pytest.approx(np.tile([1 / 3, 2 / 3], (2, 1)))
    assert first.typicality == pytest.approx([1 / 5, 1 / 13])
    assert first.unknown_proba == pytest.approx([4 / 20, 12 / 20])
    assert second.decisions == ["worn"]


def test_groups_reach_only_a_classifier_that_learns_from_them():
    decided_by(Noted(), scheme_of([0], [1]), groups=UNITS.labels)
    assert [groups for *_, groups in FITTED] == [None, None]
    decided_by(Noted(unknown="odd"), scheme_of([0], [1]))
    assert [groups for *_, groups in FITTED] == [None, None]


@pytest.mark.parametrize("refuse", ["fit", "predict"])
def test_a_refusal_is_a_result_where_it_is_allowed_and_otherwise_an_error(refuse):
    model, tests = Noted(refuse=refuse), ([0, 1], [2, 3])
    allowed = scheme_of(*tests, may_refuse=(refuse,))
    possible, impossible = scheme_of([4]), scheme_of([5], impossible="It is not.")
    schemes, decided = decided_by(model, allowed, impossible)
    assert schemes[0].impossible.startswith("The estimator refuses: by hand, fold 0: not th")
    assert schemes[1] is impossible
    assert decided == [[], []]
    with pytest.raises(ValueError, match="by hand, fold 0: not th"):
        decided_by(model, allowed, possible)
    other = scheme_of(*tests, may_refuse=({"fit": "predict", "predict": "fit"}[refuse],))
    with pytest.raises(ValueError, match="by hand, fold 0: not th"):
        decided_by(model, other)
    named = Scheme("by unit", [Fold(np.arange(4), np.arange(4, 8), "unit 7, 8")], UNITS)
    with pytest.raises(ValueError, match=r"by unit, fold 0 \(unit 7, 8 left out\): not th"):
        decided_by(model, named)


def test_each_result_is_that_of_its_scheme_and_fold():
    schemes = scheme_of([0], [1]), scheme_of([2], impossible="No."), scheme_of([3, 4], [5], [6])
    _, decided = decided_by(Noted(), *schemes)
    assert [[len(fold.decisions) for fold in folds] for folds in decided] == [[1, 1], [], [2, 1, 1]]
    assert [rows[0] for _, _, rows, *_ in FITTED] == [2, 0, 0, 0, 0]


def by_hand():
    rule = scoring_rule(np.array(CLASSES), cost=None, unknown="odd", healthy="new")
    scheme = scheme_of([1, 6], [7, 0, 4])
    (scheme,), (decided,) = decided_by(Noted(unknown="odd"), scheme, groups=UNITS.labels)
    return scheme, decided, rule


def test_a_row_of_predictions_is_that_of_its_recording():
    scheme, decided, rule = by_hand()
    scheme.folds[1] = Fold(scheme.folds[1].train, scheme.folds[1].test, "unit 5")
    found = score_scheme(scheme, decided, Y, rule, BOOTSTRAP)
    held = found.predictions
    assert held.columns.tolist() == [
        "scheme", "fold", "left_out", "recording", "group", "truth", "decision", "true_label",
        "decided_label", "correct", "cost", "P(dry)", "P(new)", "P(worn)", "predicted_cost",
        "typicality", "unknown_proba",
    ]  # fmt: skip
    assert held["scheme"].tolist() == ["by hand"] * 5
    assert held["fold"].tolist() == [0, 0, 1, 1, 1]
    assert held["left_out"].tolist() == ["", "", "unit 5", "unit 5", "unit 5"]
    assert held["recording"].tolist() == [1, 6, 7, 0, 4]
    assert held["group"].tolist() == [5, 8, 8, 5, 7]
    assert held["truth"].tolist() == ["new", "new", "worn", "dry", "worn"]
    features = np.array([2.0, 12, 14, 0, 8])
    assert held["decision"].tolist() == [CLASSES[int(x) % 3] for x in features]
    assert held["typicality"].tolist() == pytest.approx(1 / (1 + features))
    assert held["unknown_proba"].tolist() == pytest.approx(features / 20)
    shares = (1 + (features[:, None] + np.arange(3)) % 3) / 6
    assert held[["P(dry)", "P(new)", "P(worn)"]].to_numpy() == pytest.approx(shares)
    of_decision = shares[np.arange(5), (features % 3).astype(int)] * (1 - features / 20)
    assert held["predicted_cost"].tolist() == pytest.approx(1 - of_decision)
    row = found.row
    assert [row[name] for name in ("recordings", "folds", "labels", "groups", "resampled")] == [
        5, 2, 3, 3, "unit",
    ]  # fmt: skip
    assert found.calibration["scheme"].tolist() == ["by hand"] * len(found.calibration)
    assert found.calibration.columns[0] == "scheme"


def test_results_without_probabilities_or_typicality_have_no_such_columns():
    scheme, decided, rule = by_hand()
    plain = [Decided(fold.decisions) for fold in decided]
    found = score_scheme(scheme, plain, Y, rule, BOOTSTRAP)
    assert found.predictions.columns[-1] == "cost"
    assert found.calibration.empty
    some = [decided[0], Decided(decided[1].decisions, decided[1].posterior)]
    found = score_scheme(scheme, some, Y, rule, BOOTSTRAP)
    assert found.predictions.columns[-1] == "predicted_cost"


class Nameless(Noted):
    """Does not say which classes it knows, and is one of two things that it needs to be unknown."""

    classes_ = property(lambda self: getattr(self, "_missing"), lambda self, value: None)  # noqa: B009
    unknown_proba = property(lambda self: getattr(self, "_missing"))  # noqa: B009

    def predict(self, X):
        return np.array(["new"] * len(X))

    def predict_proba(self, X):
        return np.tile([0.25, 0.75], (len(X), 1))


def test_classes_that_are_not_stated_are_those_of_the_training_data():
    all_but_worn = Fold(np.array([0, 1, 3, 5]), np.array([2, 6]))
    _, ((found,),) = decided_by(Nameless(), Scheme("s", [all_but_worn], UNITS))
    assert found.posterior.to_dict("list") == {"dry": [0.25, 0.25], "new": [0.75, 0.75]}
    assert found.typicality is found.unknown_proba is None


def test_the_table_has_all_figures_if_one_scheme_only_has_probabilities():
    scheme, decided, rule = by_hand()
    other = replace(scheme, name="another"), [Decided(fold.decisions) for fold in decided]
    for pairs in ([(scheme, decided), other], [other, (scheme, decided)]):
        table = gather(*zip(*pairs, strict=True), Y, rule, BOOTSTRAP).table
        assert np.isnan(table.loc["another", "log_loss"])
        assert table.loc["by hand", "log_loss"] > 0
        assert table.loc["another", "accuracy"] == table.loc["by hand", "accuracy"]


def test_schemes_that_cannot_be_scored_have_a_row_of_nothing():
    scheme, decided, rule = by_hand()
    impossible = Scheme("by run", [], Grouping("run", Y), "There is one run.")
    found = gather([impossible, scheme], [[], decided], Y, rule, BOOTSTRAP)
    assert found.table.index.tolist() == ["by run", "by hand"]
    assert found.table.index.name == "scheme"
    assert found.table["resampled"].tolist() == ["run", "unit"]
    counts = found.table[["recordings", "folds", "labels", "groups"]]
    assert counts.loc["by run"].tolist() == [0, 0, 0, 0]
    assert {dtype.kind for dtype in counts.dtypes} == {"i"}
    assert np.isnan(found.table.loc["by run", "accuracy"])
    assert list(found.confusions) == ["by hand"]
    assert found.predictions.index.tolist() == list(range(5))
    assert (found.confidence, found.caveats) == (0.9, [])
    twice = gather([scheme, replace(scheme, name="again")], [decided] * 2, Y, rule, BOOTSTRAP)
    assert twice.predictions.index.tolist() == list(range(10))
    assert twice.calibration.index.tolist() == list(range(2 * len(found.calibration)))
    assert twice.table.index.tolist() == ["by hand", "again"]
    with pytest.raises(ValueError, match="zip"):
        gather([scheme, impossible], [decided], Y, rule, BOOTSTRAP)
    nothing = gather([impossible], [[]], Y, rule, BOOTSTRAP)
    assert nothing.predictions.empty
    assert nothing.calibration.empty
    assert nothing.table.index.tolist() == ["by run"]


# Families that are left out


def test_each_family_of_faults_is_missing_in_the_training_data_of_all_folds():
    rule = scoring_rule(np.array(CLASSES), healthy="new")
    folds = [Fold(np.arange(4), np.arange(4, 8), "unit 7"), Fold(np.arange(4, 8), np.arange(4))]
    dry, worn = left_out_families(Scheme("by unit", folds, UNITS), Y.tolist(), rule)
    assert (dry.name, worn.name) == ("dry", "worn")
    assert [fold.train.tolist() for fold in dry.folds] == [[1, 2, 3], [4, 6, 7]]
    assert [fold.train.tolist() for fold in worn.folds] == [[0, 1, 3], [5, 6]]
    assert [fold.test.tolist() for fold in worn.folds] == [[4, 5, 6, 7], [0, 1, 2, 3]]
    assert [fold.left_out for fold in dry.folds] == ["dry, unit 7", "dry"]
    assert (dry.may_refuse, dry.resampled) == (("fit", "predict"), UNITS)
    only_worn = Scheme("s", [Fold(np.array([2]), np.array([0])), folds[0]], UNITS)
    assert [each.name for each in left_out_families(only_worn, Y.tolist(), rule)] == ["dry"]


def test_a_row_of_a_family_left_out_is_that_of_its_recording():
    scheme, decided, rule = by_hand()
    scheme = Scheme("worn", scheme.folds, UNITS)
    held = novelty_predictions(scheme, decided, Y, rule)
    expected = score_scheme(scheme, decided, Y, rule, BOOTSTRAP).predictions
    same = ["fold", "recording", "group", "true_label", "decision", "decided_label"]
    pd.testing.assert_frame_equal(held[same], expected[same])
    pd.testing.assert_frame_equal(
        held[["typicality", "unknown_proba"]], expected[["typicality", "unknown_proba"]]
    )
    assert held["left_out"].tolist() == ["worn"] * 5
    assert held["is_unknown"].tolist() == [False, False, True, False, True]
    largest = expected[["P(dry)", "P(new)", "P(worn)"]].max(axis=1)
    assert held["confidence"].tolist() == pytest.approx(largest.tolist())
    stated = [[[0.2, 0.5, 0.3], [0.0, 0.1, 0.9]], [[0.6, 0.3, 0.1], [0.4, 0.3, 0.3], [1.0, 0, 0]]]
    other = [
        replace(fold, posterior=pd.DataFrame(table, columns=CLASSES))
        for fold, table in zip(decided, stated, strict=True)
    ]
    of_labels = novelty_predictions(scheme, other, Y, rule)["confidence"]
    assert of_labels.tolist() == [0.5, 0.9, 0.6, 0.4, 1.0]
    half = [Decided(each.decisions, each.posterior) for each in decided]
    refused = Scheme("dry", [], UNITS, "Too few.")
    found = score_novelty([refused, scheme], [[], decided], Y, rule, BOOTSTRAP)
    assert found.refused == {"dry": "Too few."}
    pd.testing.assert_frame_equal(found.predictions, held)
    assert found.table.index.tolist() == ["worn"]
    assert found.table.loc["worn", "unknown_called_healthy"] == 0
    turned = score_novelty([scheme], [decided], Y, replace(rule, healthy="worn"), BOOTSTRAP)
    assert turned.table.loc["worn", "unknown_called_healthy"] == 1
    without = score_novelty([scheme], [decided], Y, replace(rule, healthy=None), BOOTSTRAP)
    assert "unknown_called_healthy" not in without.table
    pair = [scheme, replace(scheme, name="dry")]
    both = score_novelty(pair, [decided, decided], Y, rule, BOOTSTRAP).predictions
    assert both.index.tolist() == list(range(10))
    assert both["left_out"].tolist() == ["worn"] * 5 + ["dry"] * 5
    with pytest.raises(ValueError, match="zip"):
        score_novelty(pair, [decided], Y, rule, BOOTSTRAP)
    none = score_novelty([scheme], [[decided[0], half[1]]], Y, rule, BOOTSTRAP)
    assert none.table.empty
    assert none.predictions.empty


# Schemes


def test_the_random_split_has_as_many_folds_as_the_largest_class_allows():
    scheme = random_scheme(Y, Y.tolist(), UNITS, 10, 0)
    assert (scheme.name, len(scheme.folds), scheme.resampled) == (RANDOM, 3, UNITS)
    assert sorted(np.concatenate([fold.test for fold in scheme.folds])) == list(range(8))
    assert len(random_scheme(Y, Y.tolist(), UNITS, 2, 0).folds) == 2
    pair = np.array(["new", "new", "worn"])
    assert len(random_scheme(pair, pair.tolist(), UNITS, 10, 0).folds) == 2
    with pytest.raises(ValueError, match="y has one recording of each class"):
        random_scheme(pair[1:], pair[1:].tolist(), UNITS, 10, 0)


def test_a_label_that_is_held_out_without_training_is_named():
    labels = ["a", "a", "b", "b", "a", "c", "a", "c"]
    scheme = group_scheme(Y, labels, UNITS, UNITS, n_splits=None, seed=0)
    assert scheme.impossible == (
        "In 1 of 4 folds a label is absent from training: without unit 6, training has no 'b'."
    )
    masks = np.arange(8) < 2, np.arange(8) == 3
    found = given_scheme("later", [masks, ([0, 2], [3])], Y, None, labels, UNITS)
    assert "In 1 of 2 folds a label is absent from training: without fold 0, tr" in found.impossible
    assert [fold.train.tolist() for fold in found.folds] == [[0, 1], [0, 2]]
    two = group_scheme(Y, ["c", "b", "a", *"ccccc"], UNITS, UNITS, n_splits=None, seed=0)
    assert two.impossible == (
        "In 2 of 4 folds a label is absent from training: without unit 5, training has no 'b'."
    )
    several = given_scheme("s", [([4], range(4))], Y, None, ["c", "b", "a", *"ccccc"], UNITS)
    assert "without fold 0, training has no 'b'." in several.impossible
    one = group_scheme(Y, labels, Grouping("bench", np.full(8, 3)), UNITS, n_splits=2, seed=0)
    assert one.impossible == "There is only one bench, 3; two are required."
    assert (one.name, one.folds, one.resampled) == ("by bench", [], UNITS)


@pytest.mark.parametrize(("n_splits", "n_folds"), [(None, 4), (4, 4), (3, 3), (2, 2)])
def test_groups_are_left_out_together_only_if_there_are_more_than_folds(n_splits, n_folds):
    y = np.tile(["new", "worn"], 4)
    scheme = group_scheme(y, y.tolist(), UNITS, UNITS, n_splits=n_splits, seed=0)
    assert (len(scheme.folds), scheme.impossible, scheme.name) == (n_folds, "", "by unit")
    if n_folds == 4:  # one at a time, in their order
        assert [fold.left_out for fold in scheme.folds] == [f"unit {k}" for k in (5, 6, 7, 8)]
    for fold in scheme.folds:
        left_out = np.unique(UNITS.labels[fold.test])
        assert fold.left_out == "unit " + ", ".join(map(str, left_out))
        assert not set(left_out) & set(UNITS.labels[fold.train])


def test_groups_that_each_have_another_label_cannot_be_left_out():
    y, rigs = np.arange(12)[::-1], Grouping("rig", np.arange(12) + 3)
    for n_splits in (None, 12, 5):
        scheme = group_scheme(y, y.tolist(), rigs, UNITS, n_splits=n_splits, seed=0)
        assert scheme.impossible == (
            "In 12 of 12 folds a label is absent from training: without rig 3, training has no 11."
        )
        assert (scheme.name, len(scheme.folds), scheme.resampled) == ("by rig", 12, UNITS)


@pytest.mark.parametrize(
    ("n_groups", "listed"),
    [(6, r"rig \d, \d, \d"), (8, r"rig \d, \d, \d, \d"), (10, r"rig \d, \d, \d, \d and 1 more")],
)
def test_up_to_four_groups_left_out_are_listed(n_groups, listed):
    rigs, y = Grouping("rig", np.repeat(np.arange(n_groups), 2)), np.tile([7, 4], n_groups)
    scheme = group_scheme(y, y.tolist(), rigs, rigs, n_splits=2, seed=0)
    for fold in scheme.folds:
        assert re.fullmatch(listed, fold.left_out)


@pytest.mark.parametrize(
    ("pair", "message"),
    [
        (([0], [1], [2]), r"fold 0 must be a pair \(train, test\), got tuple"),
        (([0.0], [1]), "fold 0: train must contain the positions .* got float64 of shape"),
        (([0], []), "fold 0: test must contain the positions of at least one recording"),
        (([True, False], [1]), "mask of length 8; got bool of shape"),
        (([-1], [1]), "train must contain positions 0 to 7, got -1 to -1"),
        (([5, -1], [1]), "train must contain positions 0 to 7, got -1 to 5"),
        (([0], [3, 8]), "test must contain positions 0 to 7, got 3 to 8"),
        (([0, 4, 4], [1]), "train has recording 4 more than once"),
        (([6, 4, 0, 6, 4], [1]), "train has recording 4 more than once"),
        (([0, 3, 4], [5, 4]), "fold 0 has recording 4 in train and in test"),
        (([0, 3, 4], [4, 3]), "fold 0 has recording 3 in train and in test"),
    ],
)
def test_a_fold_has_two_parts_of_different_recordings(pair, message):
    with pytest.raises((TypeError, ValueError), match=message):
        given_scheme("later", [pair], Y, None, Y.tolist(), UNITS)
    bounds = given_scheme("later", [([0], [7])], Y, None, ["a"] * 8, UNITS)
    assert (bounds.folds[0].train.dtype, bounds.impossible) == (np.intp, "")


def test_runs_are_resampled_before_units_and_single_recordings():
    y, runs = np.tile(["new", "worn"], 4), Grouping("run", np.arange(8) // 2)
    loads = Grouping("load", np.tile([0, 0, 1, 1], 2))
    later = {"later": (np.arange(4), np.arange(4, 8))}

    def resampled(given, splits=None):
        groupings = dict.fromkeys(("runs", "units", "conditions")) | given
        schemes = all_schemes(y, y.tolist(), groupings, splits, 3, 0)
        strictest = strictest_scheme(schemes, groupings).name
        return {each.name: each.resampled.name for each in schemes}, strictest

    every = {"runs": runs, "units": UNITS, "conditions": loads}
    names, strictest = resampled(every, later)
    assert names == {
        RANDOM: "run", "by run": "run", "by unit": "unit", "by load": "run", "later": "run",
    }  # fmt: skip
    assert strictest == "by unit"
    assert resampled({"units": UNITS}) == ({RANDOM: "unit", "by unit": "unit"}, "by unit")
    assert resampled({"runs": runs})[1] == "by run"
    one = Grouping("unit", np.zeros(8, int))
    assert resampled({"runs": runs, "units": one})[1] == "by run"
    names, strictest = resampled({"conditions": loads})
    assert (names, strictest) == ({RANDOM: "recording", "by load": "recording"}, RANDOM)
    with pytest.raises(ValueError, match="two hold-out schemes have the name 'by run'"):
        resampled({"runs": runs}, {"by run": later["later"]})
    with pytest.raises(TypeError, match="splits must map names to splits"):
        resampled({}, [later["later"]])


def test_two_names_that_are_taken_are_refused_by_the_first():
    groupings = {"runs": UNITS, "units": None, "conditions": None}
    pair = (np.arange(4), np.arange(4, 8))
    with pytest.raises(ValueError, match="two hold-out schemes have the name 'random split'"):
        all_schemes(Y, ["a"] * 8, groupings, {RANDOM: pair, "by unit": pair}, 3, 0)


def test_no_scheme_is_the_strictest_if_none_can_be_scored():
    groupings = {"runs": None, "units": UNITS}
    schemes = [Scheme(name, [], UNITS, "No.") for name in (RANDOM, "by unit")]
    assert strictest_scheme(schemes, groupings) is None
    assert strictest_scheme([*schemes[1:], Scheme(RANDOM, [], UNITS)], groupings).name == RANDOM


class Splitter:
    """Notes what it is given, and holds out the second half."""

    def split(self, X, y, groups):
        self.given = X, y, groups
        yield np.arange(4), np.arange(4, 8)


def test_a_splitter_is_given_a_table_the_classes_and_the_runs():
    for runs in (None, UNITS):
        groupings = {"runs": runs, "units": None, "conditions": None}
        splitter = Splitter()
        *_, scheme = all_schemes(Y, ["a"] * 8, groupings, {"halves": splitter}, 3, 0)
        X, y, groups = splitter.given
        assert (X.shape, y.tolist()) == ((8, 1), Y.tolist())
        assert groups is (None if runs is None else UNITS.labels)
        assert [fold.test.tolist() for fold in scheme.folds] == [[4, 5, 6, 7]]


def test_only_conditions_may_be_refused_and_all_of_them_are_left_out_one_at_a_time():
    y = np.tile(["new", "worn"], 4)
    groupings = {"runs": None, "units": None, "conditions": UNITS}
    *_, by_load = all_schemes(y, y.tolist(), groupings, None, 2, 0)
    assert (len(by_load.folds), by_load.may_refuse) == (4, ("predict",))
    groupings = {"runs": UNITS, "units": None, "conditions": None}
    *_, by_run = all_schemes(y, y.tolist(), groupings, None, 2, 0)
    assert (len(by_run.folds), by_run.may_refuse) == (2, ())
