"""Facts about classifiers with an unknown state: decisions, costs, priors, compositions."""

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.costs import cost_table, truth_labels, truth_priors
from emacm.decisions.least_risk import LeastRiskClassifier
from emacm.decisions.new_units import NewUnitClassifier
from emacm.decisions.posterior_product import PosteriorProduct

NAMES = np.array(["worn", "healthy", "dry"])
PLACES = np.array([[6.0, 0, 0, 1], [0, 0, 0, 0], [0, 5.0, 1, 0]])
CLASSES = np.array(["dry", "healthy", "worn"])
FAR = np.array([[300.0, -40, 7, 9]])
KINDS = [("tied", "auto"), ("diag", None), ("full", 0.1)]


def draw(seed, n_units=7, n_runs=3):
    """Three runs of each unit in each state; units have offsets that their runs share."""
    rng = np.random.default_rng(seed)
    codes = np.tile(np.repeat(np.arange(3), n_runs), n_units)
    units = np.repeat(np.arange(n_units), 3 * n_runs)
    X = PLACES[codes] + 0.5 * rng.normal(size=(n_units, 3, 4))[units, codes]
    return X + rng.normal(size=X.shape), NAMES[codes], np.array([f"u{10 - k}" for k in units])


def fitted(covariance="tied", shrinkage="auto", seed=0, **options):
    options = {"unknown": "unknown", "temperature": "groups"} | options
    model = CostSensitiveGaussianBayes(covariance=covariance, shrinkage=shrinkage, **options)
    return model.fit(*draw(seed)[:2], groups=draw(seed)[2])


def as_product(member):
    return PosteriorProduct([("one", member), ("other", clone(member))])


# Decisions


@pytest.mark.parametrize(("covariance", "shrinkage"), KINDS)
def test_known_recordings_are_classified_and_distant_ones_are_unknown(covariance, shrinkage):
    model = fitted(covariance, shrinkage)
    X, y, _ = draw(1)
    assert np.mean(model.predict(X) == y) > 0.9
    assert model.predict(FAR) == ["unknown"]
    assert model.unknown_proba(FAR) > 0.9
    assert model.unknown_proba(X).mean() < 0.03


@pytest.mark.parametrize(("covariance", "shrinkage"), KINDS)
def test_without_unknown_state_and_temperature_nothing_changes(covariance, shrinkage):
    X, y, units = draw(2)
    plain = CostSensitiveGaussianBayes(covariance=covariance, shrinkage=shrinkage).fit(X, y)
    by_groups = clone(plain).fit(X, y, groups=units)
    for method in ("predict_joint_log_proba", "predict_proba", "risk", "predict"):
        first, second = (getattr(model, method)(X) for model in (plain, by_groups))
        np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(plain.truths_, plain.classes_)
    assert plain.unknown_prior_ == 0
    assert plain.temperature_ == 1
    with_unknown = clone(plain).set_params(unknown="new").fit(X, y, groups=units)
    np.testing.assert_array_equal(with_unknown.predict_proba(X), plain.predict_proba(X))


def test_inspection_is_decided_where_it_is_cheaper():
    inspect = {("inspect", name): 0.3 for name in NAMES}
    model = fitted(cost=inspect)
    nearly_known = draw(0)[0][:1] + np.linspace(0, 20, 60)[:, np.newaxis]
    decided = model.predict(nearly_known).tolist()
    changes = [a for a, b in zip(decided, [None, *decided], strict=False) if a != b]
    assert changes[-2:] == ["inspect", "unknown"]
    is_unknown = model.unknown_proba(nearly_known) > 0.5
    np.testing.assert_array_equal(np.array(decided) == "unknown", is_unknown)
    dearer = inspect | {("unknown", name): 0.31 for name in (*NAMES, "unknown")}
    assert "unknown" not in model.set_params(cost=dearer).predict(nearly_known)


def test_calling_everything_unknown_is_expected_to_cost_an_inspection_each():
    priors = dict.fromkeys(NAMES, 1e-12 / 3) | {"unknown": 1 - 1e-12}
    model = fitted(cost={("inspect", name): 0.3 for name in NAMES}, priors=priors)
    X = np.vstack([draw(3)[0], FAR])
    assert set(model.predict(X)) == {"unknown"}
    np.testing.assert_allclose(model.risk(X).min(axis=1), 0.3)


def test_the_risk_is_the_cost_weighted_by_all_truths():
    model = fitted(cost={("healthy", "unknown"): 7.0, ("worn", "dry"): 2.0})
    X = np.vstack([draw(3)[0], FAR])
    unknown = model.unknown_proba(X)[:, np.newaxis]
    truth = np.hstack([model.predict_proba(X) * (1 - unknown), unknown])
    np.testing.assert_allclose(model.risk(X), truth @ model.cost_.T, rtol=1e-12)
    np.testing.assert_array_equal(model.truths_, ["dry", "healthy", "worn", "unknown"])
    np.testing.assert_array_equal(model.decisions_, model.truths_)
    assert model.unknown_prior_ == 0.01
    assert model.cost_[1, 3] == 7


@pytest.mark.parametrize(("covariance", "shrinkage"), KINDS)
def test_costs_and_priors_set_later_equal_those_of_a_refit(covariance, shrinkage):
    later = {
        "cost": {("inspect", name): 0.2 for name in (*NAMES, "unknown")} | {("dry", "worn"): 9},
        "priors": {"healthy": 0.8, "worn": 0.1, "dry": 0.05, "unknown": 0.05},
    }
    model, anew = fitted(covariance, shrinkage), fitted(covariance, shrinkage, **later)
    between = np.linspace(0, 1, 9)[:, np.newaxis] * PLACES[0]
    X = np.vstack([draw(5)[0], FAR, between])
    assert not np.allclose(model.unknown_proba(X), anew.unknown_proba(X))
    assert model.risk(X).shape != anew.risk(X).shape
    model.set_params(**later)
    for method in ("predict_proba", "unknown_proba", "typicality", "risk", "predict"):
        np.testing.assert_array_equal(getattr(model, method)(X), getattr(anew, method)(X))


# Costs and priors


def test_costs_that_are_not_stated_have_defaults():
    families = pd.DataFrame(
        [[0.0, 5.0, 5.0], [1.0, 0.0, 0.0], [0.4, 0.2, 0.2]],
        index=["ok", "bad", "look"],
        columns=["healthy", "dry", "worn"],
    )
    decisions, table = cost_table(families, CLASSES, "new")
    assert decisions.tolist() == ["ok", "bad", "look", "new"]
    np.testing.assert_array_equal(table[:, -1], [1, 1, 0.4, 0.4])
    np.testing.assert_array_equal(table[-1], table[2])
    np.testing.assert_array_equal(cost_table(None, CLASSES, "new")[1], 1 - np.eye(4))


@pytest.mark.parametrize("form", ["frame", "mapping"])
def test_what_is_stated_of_the_unknown_state_replaces_its_defaults(form):
    inspect = {("look", state): 0.3 for state in CLASSES}
    stated = {("healthy", "new"): 9, ("look", "new"): 0.2, ("new", "dry"): 4, ("new", "new"): -1}
    if form == "mapping":
        cost, order = stated | inspect, [*CLASSES, "new", "look"]
    else:
        order = ["look", "worn", "healthy", "dry", "new"]
        columns = {"dry": [0.3, 1, 1, 0, 4], "new": [0.2, 1, 9, 1, -1]}
        columns |= {"worn": [0.3, 0, 1, 1, 0.3], "healthy": [0.3, 1, 0, 1, 0.3]}
        cost = pd.DataFrame(columns, order)
    decisions, table = cost_table(cost, CLASSES, "new")
    assert decisions.tolist() == order
    found = dict(zip(order, table.tolist(), strict=True))
    assert found == {
        "dry": [0, 1, 1, 1],
        "healthy": [1, 0, 1, 9],
        "worn": [1, 1, 0, 1],
        "new": [4, 0.3, 0.3, -1],
        "look": [0.3, 0.3, 0.3, 0.2],
    }


def test_only_what_is_the_cheapest_for_some_class_is_wrong_of_the_unknown_state():
    cost = pd.DataFrame(
        [[0, 2, 3], [5, 0.5, 0.2], [1.5, 0.6, 0.1], [4, 0.7, 0.9], [0.8] * 3],
        list("abcde"),
        CLASSES,
    )
    decisions, table = cost_table(cost, CLASSES, "new")
    assert decisions.tolist() == [*"abcde", "new"]
    assert table[:, -1].tolist() == [1.5, 1.5, 1.5, 4, 0.8, 0.8]
    assert table[-1].tolist() == table[-2].tolist()  # the cheaper one of two inspections
    table = cost_table(cost[:4], CLASSES, "new")[1]
    # None is cheaper than a wrong class: 1.5 more than the right decision costs.
    assert table[-1].tolist() == [1.5, 2.0, 1.6, 0]
    square = np.arange(9.0).reshape(3, 3) / 3
    decisions, table = cost_table(square, CLASSES, "new")
    assert decisions.tolist() == [*CLASSES, "new"]
    np.testing.assert_array_equal(table[:3, :3], square)
    np.testing.assert_allclose(table[3], [1, 4 / 3, 5 / 3, 0])


def test_labels_of_truths_are_the_classes_and_then_the_unknown_state():
    assert truth_labels(CLASSES, None) is CLASSES
    assert truth_labels(np.array([3, 5]), 0).tolist() == [3, 5, 0]
    assert truth_labels(np.array([3, 5]), "new").tolist() == [3, 5, "new"]
    with pytest.raises(ValueError, match="unknown = 5 is a class of recordings"):
        truth_labels(np.array([3, 5]), 5)


def test_priors_may_contain_the_unknown_state():
    stated = {"worn": 0.18, "dry": 0.09, "healthy": 0.63, "new": 0.1}
    for priors in (stated, pd.Series(stated), [0.09, 0.63, 0.18, 0.1]):
        of_classes, of_unknown = truth_priors(priors, CLASSES, np.ones(3), "new")
        np.testing.assert_allclose(of_classes, [0.1, 0.7, 0.2])
        assert of_unknown == pytest.approx(0.1)
    of_classes, of_unknown = truth_priors([0.0, 0.5, 0.4, 0.1], CLASSES, np.ones(3), "new")
    np.testing.assert_allclose(of_classes, [0, 5 / 9, 4 / 9])
    of_classes, of_unknown = truth_priors([0.0, 0.0, 0.9, 0.1], CLASSES, np.ones(3), "new")
    assert of_classes.tolist() == [0, 0, 1]
    of_classes, of_unknown = truth_priors([0.9, 0.0, 0.0, 0.1], CLASSES, np.ones(3), "new")
    assert of_classes.tolist() == [1, 0, 0]
    for priors in (None, "uniform", [0.2, 0.3, 0.5], {"worn": 0.5, "dry": 0.2, "healthy": 0.3}):
        assert truth_priors(priors, CLASSES, np.ones(3), "new")[1] == 0.01


# Fitting


def test_without_groups_a_warning_names_the_remedy():
    X, y, _ = draw(11)
    for model in (CostSensitiveGaussianBayes(unknown="unknown"), NewUnitClassifier()):
        with pytest.warns(UserWarning, match=r"without groups.*__groups=") as caught:
            model.fit(X, y)
        assert [warning.filename for warning in caught] == [__file__]


def test_what_was_not_left_out_cannot_be_asked_for():
    X, y, units = draw(12)
    plain = CostSensitiveGaussianBayes().fit(X, y)
    assert not hasattr(plain, "unknown_proba")
    for model in (plain, clone(plain).set_params(unknown="unknown")):
        with pytest.raises(ValueError, match="groups="):
            plain.set_params(unknown=model.unknown).typicality(X)
    plain.set_params(temperature="groups", unknown=None)
    with pytest.raises(ValueError, match="temperature is found by leaving groups out"):
        plain.predict(X)
    assert (plain.set_params(temperature=None).fit(X, y, groups=units).typicality(X) > 0).all()
    with pytest.raises(ValueError, match="temperature is found by leaving groups out"):
        plain.set_params(temperature="groups").predict(X)


def test_partial_fit_discards_an_earlier_calibration():
    X, y, units = draw(13)
    model = CostSensitiveGaussianBayes(shrinkage=0.1).fit(X, y, groups=units)
    with pytest.raises(ValueError, match="groups="):
        model.partial_fit(X, y).typicality(X)


def test_a_number_as_temperature_scales_the_log_densities():
    X, y, _ = draw(15)
    sharp = CostSensitiveGaussianBayes(priors="uniform").fit(X, y)
    soft = CostSensitiveGaussianBayes(priors="uniform", temperature=4.0).fit(X, y)
    ratio = np.diff(sharp.predict_log_proba(X)) / np.diff(soft.predict_log_proba(X))
    np.testing.assert_allclose(ratio, 4)
    gradient = sharp.log_density_gradient(X)
    sharp.set_params(temperature=4.0)
    np.testing.assert_array_equal(sharp.predict_proba(X), soft.predict_proba(X))
    np.testing.assert_allclose(sharp.log_density_gradient(X), gradient / 4)


def test_temperature_by_groups_reduces_the_log_loss_of_new_units():
    def log_loss(model, X, y):
        logs = model.predict_log_proba(X)
        return -np.mean(logs[np.arange(len(y)), np.searchsorted(CLASSES, y)])

    X, y, units = draw(16, n_units=6)
    X, new = np.repeat(X, 3, axis=0), draw(17, n_units=60)[:2]
    X = X + 0.05 * np.random.default_rng(0).normal(size=X.shape)  # near-duplicates
    y, units = np.repeat(y, 3), np.repeat(units, 3)
    calibrated = CostSensitiveGaussianBayes(temperature="groups").fit(X, y, groups=units)
    assert calibrated.temperature_ > 1
    assert log_loss(calibrated, *new) < log_loss(CostSensitiveGaussianBayes().fit(X, y), *new)


def test_one_unit_per_class_is_an_error_that_names_the_remedy():
    X, y, _ = draw(18)
    with pytest.raises(ValueError, match=r"no class has recordings in two groups.*groups="):
        CostSensitiveGaussianBayes(unknown="unknown").fit(X, y, groups=y)


def test_a_temperature_needs_a_class_whose_covariance_remains_without_a_group():
    X, y = np.array([[0.0], [1.0], [5.0], [6.0], [8.0]]), ["dry", "dry", "new", "new", "new"]
    model = CostSensitiveGaussianBayes(temperature="groups")
    with pytest.raises(ValueError, match=r"two groups"):
        model.fit(X, y, groups=[0, 1, 2, 2, 2])
    tied = clone(model).set_params(covariance="tied").fit(X, y, groups=[0, 1, 2, 2, 2])
    assert tied.temperature_ > 0


def test_recordings_without_weight_take_no_part_in_the_calibration():
    X, y, units = draw(20)
    X = np.vstack([X, 9 * FAR, 5 * FAR, X[:5] + 3])
    y, units = np.append(y, ["worn", "dry", *y[:5]]), np.append(units, ["u1", "u2", *units[:5]])
    weight = np.ones(len(X))
    weight[63:] = 0.0
    model = CostSensitiveGaussianBayes(shrinkage=0.1, unknown="unknown", temperature="groups")
    weighted = clone(model).fit(X, y, weight, groups=units)
    without = clone(model).fit(X[:63], y[:63], groups=units[:63])
    assert weighted.temperature_ == pytest.approx(without.temperature_)
    np.testing.assert_allclose(weighted.typicality(X), without.typicality(X))
    np.testing.assert_array_equal(weighted.feature_range_, without.feature_range_)


def test_groups_of_another_length_or_with_gaps_are_errors():
    X, y, units = draw(19)
    with pytest.raises(ValueError, match="63"):
        CostSensitiveGaussianBayes(unknown="unknown").fit(X, y, groups=units[:-1])
    gaps = pd.Series(units).where(np.arange(63) != 4)
    with pytest.raises(ValueError, match="recording 4 is missing"):
        CostSensitiveGaussianBayes(unknown="unknown").fit(X, y, groups=gaps)


# Left-out groups


def test_a_stated_share_of_known_recordings_of_new_units_is_called_unknown():
    X, y, units = draw(0, n_units=40)
    model = CostSensitiveGaussianBayes(unknown="unknown", covariance="tied", unknown_rate=0.1)
    model.fit(X, y, groups=units)
    new, _, _ = draw(5, n_units=200)
    rare = model.typicality(new) <= model.unknown_limit_
    np.testing.assert_array_equal(model.predict(new) == "unknown", rare)
    assert np.mean(rare) == pytest.approx(0.1, abs=0.03)
    fewer = model.set_params(unknown_rate=0.02).predict(new)
    assert np.mean(fewer == "unknown") == pytest.approx(0.02, abs=0.01)
    assert model.unknown_proba(new)[~rare].max() < 0.04  # an ordinary recording looks certain


def test_priors_that_name_the_unknown_state_override_its_rate():
    priors = {"dry": 0.3, "healthy": 0.3, "worn": 0.3, "unknown": 0.1}
    assert fitted(priors=priors, unknown_rate=0.02).unknown_prior_ == pytest.approx(0.1)


@pytest.mark.parametrize("outer", [None, LeastRiskClassifier, as_product])
def test_no_probability_depends_on_costs(outer):
    model = fitted(unknown_rate=0.1)
    if outer:
        X, y, units = draw(0)
        model = outer(clone(model)).fit(X, y, groups=units)
    X = np.vstack([draw(6)[0], FAR])
    names = ("predict_proba", "unknown_proba", "typicality")
    before = [getattr(model, name)(X) for name in names] + [model.unknown_prior_]
    for price in (0.3, 0.01):
        cost = {("inspect", name): price for name in CLASSES} | {("healthy", "worn"): 50.0}
        model.set_params(cost=cost)
        after = [getattr(model, name)(X) for name in names] + [model.unknown_prior_]
        for one, other in zip(before, after, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("options", [{"unknown_rate": 2.0}, {"unknown_rate": 0.1, "unknown": None}])
def test_an_invalid_unknown_rate_is_refused(options):
    with pytest.raises(ValueError, match="unknown_rate"):
        fitted(**options)


def test_no_fold_holds_all_groups_of_a_class():
    groups = np.repeat(np.arange(30), 2)
    y, rng = groups % 10, np.random.default_rng(0)
    X = np.column_stack([y, y % 3]) + 0.1 * rng.normal(size=(60, 2))
    model = CostSensitiveGaussianBayes(covariance="tied", temperature="groups", unknown=-1)
    assert np.isfinite(model.fit(X, y, groups=groups).typicality(X)).all()
