"""Facts about the remaining life: known laws, coverage by unit, refusals, decisions."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binom, invgauss, kstest, weibull_min
from sklearn.model_selection import GroupKFold, cross_val_predict
from sklearn.utils.estimator_checks import parametrize_with_checks

from emacm.life.life_calibration import half_width, redistributed
from emacm.life.life_models import WeibullRegression, WienerProcess
from emacm.monitoring import MaintenanceCosts, RemainingLife
from emacm.simulation import WearLaw

EXPECTED = {"check_positive_only_tag_during_fit": "the age must not be negative"}
CHECKS = parametrize_with_checks(
    [RemainingLife("weibull")], expected_failed_checks=lambda _: EXPECTED
)
LAW = WearLaw()
NO_DAMAGE = -40.0  # dB


@pytest.mark.slow
@pytest.mark.parametrize(CHECKS.args[0], list(CHECKS.args[1]), **CHECKS.kwargs)
def test_every_check_of_scikit_learn_passes(estimator, check):
    check(estimator)


def followed(units, interval=10.0, censored=0.0, seed=0):
    """Return X (age, severity in dB), y, groups and censored of units that wear out."""
    rng = np.random.default_rng([seed, *units])
    X, y, groups, ends = [], [], [], []
    for unit in units:
        life = LAW.draw(unit, interval, seed=seed)
        if rng.uniform() < censored:
            end = rng.uniform(0.3, 1.0) * life.life
            life = LAW.draw(unit, interval, observed=end, seed=seed)
        with np.errstate(divide="ignore"):
            level = np.maximum(20 * np.log10(life.severity), NO_DAMAGE)
        X.append(np.column_stack([life.ages, level]))
        y.append(life.observed - life.ages)
        groups += [unit] * len(life.ages)
        ends += [life.censored] * len(life.ages)
    return np.vstack(X), np.concatenate(y), np.array(groups), np.array(ends)


def model(kind, **options):
    threshold = 0.0 if kind == "wiener" else None
    options = {"onset": -35.0, "consecutive": 1, "threshold": threshold} | options
    return RemainingLife(kind, **options)


# Distributions


def test_the_first_passage_of_a_known_drift_is_inverse_gaussian():
    process = WienerProcess(threshold=10.0, drift=0.7, drift_variance=1e-12, diffusion=0.5)
    lives = np.array([2.0, 9.0, 14.0, 40.0])
    found = process.cdf(lives, np.tile([4.0, 0.0, 0.0], (4, 1)))
    mean, shape = 6.0 / 0.7, 6.0**2 / 0.5
    np.testing.assert_allclose(found, invgauss.cdf(lives, mean / shape, scale=shape), rtol=1e-6)


def test_the_first_passage_of_a_random_drift_is_that_of_a_simulation():
    process = WienerProcess(threshold=5.0, drift=0.5, drift_variance=0.04, diffusion=0.3)
    rng = np.random.default_rng(0)
    drift = 0.5 + 0.2 * rng.standard_normal(600)
    steps = 0.01 * drift[:, np.newaxis] + np.sqrt(0.003) * rng.standard_normal((600, 4000))
    reached = (np.cumsum(steps, axis=1) >= 5.0 - 0.58 * np.sqrt(0.003)).argmax(axis=1) * 0.01
    lives = np.sort(reached[reached > 0])  # 0.58: discrete steps miss the crossing by this much
    # Some do not reach the threshold in 40 h; among the others the law must hold.
    expected = process.cdf(lives, np.tile([0.0, 0.0, 0.0], (len(lives), 1)))
    limit = process.cdf(np.array([40.0]), np.zeros((1, 3)))[0]
    assert kstest(expected / limit, "uniform").pvalue > 0.01


def test_the_drift_of_a_unit_is_learned_from_what_it_climbed():
    process = WienerProcess(threshold=5.0, drift=0.5, drift_variance=0.04, diffusion=0.3)
    mean, variance = process.posterior(np.array([0.0, 30.0, 1e9]), np.array([0.0, 27.0, 0.9e9]))
    by_hand = (0.5 / 0.04 + 27.0 / 0.3) / (1 / 0.04 + 30.0 / 0.3)
    np.testing.assert_allclose(mean, [0.5, by_hand, 0.9])
    np.testing.assert_allclose(variance, [0.04, 1 / (1 / 0.04 + 30.0 / 0.3), 0], atol=1e-8)


def test_the_law_of_a_simulated_fleet_is_found_again():
    X, _, groups, _ = followed(range(300))
    paths = [X[(groups == u) & (X[:, 1] > NO_DAMAGE)] for u in range(300)]
    paths = [(path[:, 0], path[:, 1]) for path in paths if len(path)]
    found = WienerProcess.fit(paths, 0.0)
    per_neper = 20 / np.log(10)
    assert found.diffusion == pytest.approx(0.004 * per_neper**2, rel=0.1)
    assert found.drift == pytest.approx(0.03 * per_neper, rel=0.1)
    assert np.sqrt(found.drift_variance) == pytest.approx(0.008 * per_neper, rel=0.3)


def test_a_weibull_distribution_is_found_with_and_without_censored_units():
    rng = np.random.default_rng(4)
    lives, every = 70 * rng.weibull(2.5, 2000), np.ones(2000, bool)

    def shape_and_scale(lives, failed):
        found = WeibullRegression.fit(np.zeros((2000, 0)), lives, failed, np.ones(2000))
        return 1 / found.spread, np.exp(found.intercept)

    shape, _, scale = weibull_min.fit(lives, floc=0)
    assert shape_and_scale(lives, every) == pytest.approx((shape, scale), rel=1e-3)
    ends = rng.uniform(20, 120, 2000)
    observed = np.minimum(lives, ends)
    assert shape_and_scale(observed, lives <= ends) == pytest.approx((2.5, 70), rel=0.06)
    assert shape_and_scale(observed, every)[1] < 60  # what censored units are for


def test_accelerated_failure_times_are_found_again():
    rng = np.random.default_rng(7)
    table = np.column_stack([rng.normal(50, 10, 3000), rng.normal(0, 0.1, 3000)])
    lives = np.exp(9 - 0.08 * table[:, 0] + 3 * table[:, 1]) * rng.weibull(1 / 0.4, 3000)
    found = WeibullRegression.fit(table, lives, np.ones(3000, bool), np.ones(3000))
    np.testing.assert_allclose(found.slopes, [-0.08, 3.0], rtol=0.05)
    assert (found.intercept, found.spread) == pytest.approx((9, 0.4), rel=0.03)


# Intervals


def test_weights_of_censored_units_are_those_of_kaplan_and_meier():
    levels = np.array([0.9, 0.1, 0.4, 0.6])
    weights = redistributed(levels, np.array([False, False, True, False]))
    # One fifth each; that of 0.4 goes in thirds to 0.6, to 0.9 and to the new unit.
    np.testing.assert_allclose(weights, [0.2 + 0.2 / 3, 0.2, 0, 0.2 + 0.2 / 3])


@pytest.mark.parametrize("n_units", [9, 13, 30])
def test_a_half_width_covers_what_is_stated_between_multiples_of_one_unit(n_units):
    rng = np.random.default_rng(3)
    levels, new = rng.uniform(size=(6000, n_units)), rng.uniform(size=6000)
    coverage = 0.5 * (n_units / (n_units + 1) + (n_units - 1) / (n_units + 1))
    widths = np.array([half_width(row, np.zeros(n_units, bool), coverage) for row in levels])
    assert np.mean(np.abs(new - 0.5) <= widths) == pytest.approx(coverage, abs=0.013)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "censored"), [("wiener", 0.0), ("weibull", 0.2)])
def test_intervals_cover_the_stated_fraction_of_units_at_five_ages(kind, censored):
    covered = {age: [] for age in (40.0, 80.0, 120.0, 160.0, 200.0)}
    for fleet in range(25):  # about 100 units at each age: standard error of 3 %
        units = range(1000 * fleet, 1000 * fleet + 29)
        X, y, groups, ends = followed(units[:25], 40.0, censored)
        fitted = model(kind).fit(X, y, groups=groups, censored=ends)
        X, y, groups, _ = followed(units[25:], 40.0)
        table = fitted.predict_interval(X, groups)
        inside = (table["lower"] <= y) & (y <= table["upper"])
        for age, hits in covered.items():
            hits += inside[X[:, 0] == age].tolist()
    assert len(covered[40.0]) >= 90
    for age, hits in covered.items():
        assert binom.ppf(0.005, len(hits), 0.9) <= np.sum(hits), (age, np.mean(hits))
        if not censored:  # which makes intervals wider
            most = binom.ppf(0.995, len(hits), 0.9)
            assert np.sum(hits) <= most, (age, np.mean(hits))


def test_an_age_that_few_units_reached_has_the_interval_of_the_latest_that_enough_reached():
    X, y, groups, _ = followed(range(30))
    fitted = model("weibull").fit(X, y, groups=groups)
    ages = np.arange(0.0, 400.0, 10.0)
    table = fitted.predict_interval(np.column_stack([ages, np.full(40, NO_DAMAGE)]), np.zeros(40))
    early = table[table["calibration"] == "same age"]
    late = table[table["calibration"] == "earlier age"]
    assert early["age"].max() < late["age"].min()
    assert (late["n_units"] >= 9).all()
    assert np.isfinite(late["upper"]).all()
    assert late["statement"].str.endswith("earlier: too few of this age.").all()


def test_limits_that_censored_units_do_not_support_are_infinite_and_stated():
    X, y, groups, ends = followed(range(30), censored=0.5)
    fitted = model("weibull").fit(X, y, groups=groups, censored=ends)
    table = fitted.predict_interval([[0.0, NO_DAMAGE], [150.0, NO_DAMAGE]])
    assert np.isinf(table["upper"]).all()
    assert (table["lower"] == 0).all()
    np.testing.assert_array_equal(
        table["median"], fitted.predict([[0.0, NO_DAMAGE], [150.0, NO_DAMAGE]])
    )
    assert table["statement"].str.contains("do not support an upper limit").all()


def test_before_the_onset_the_life_of_the_population_is_given_and_stated():
    X, y, groups, _ = followed(range(30))
    fitted = model("weibull").fit(X, y, groups=groups)
    table = fitted.predict_interval([[30.0, NO_DAMAGE], [30.0, -12.0]])
    assert table["stage"].tolist() == ["before onset", "damage"]
    assert table["statement"][0].startswith("No damage is known: this is the life of")
    population = fitted.models_.population
    shape, scale = 1 / population.spread, np.exp(population.intercept)
    median = scale * ((30.0 / scale) ** shape + np.log(2)) ** (1 / shape) - 30
    assert table["median"][0] == pytest.approx(median)
    assert table["median"][1] < 0.7 * median


def test_a_prediction_uses_readings_of_its_unit_up_to_its_age_only():
    X, y, groups, _ = followed(range(30))
    fitted = model("wiener").fit(X, y, groups=groups)
    X, _, units, _ = followed([77, 78])
    together = fitted.predict(X, units)
    order = np.random.default_rng(0).permutation(len(X))
    np.testing.assert_allclose(fitted.predict(X[order], units[order]), together[order])
    part = X[units == 77][:-4]
    np.testing.assert_allclose(fitted.predict(part, np.zeros(len(part))), together[: len(part)])


def test_a_single_reading_above_the_onset_is_none_if_several_are_required():
    X, y, groups, _ = followed(range(30))
    fitted = model("weibull", consecutive=3).fit(X, y, groups=groups)
    ages = np.arange(8) * 5.0
    levels = np.array([-40, -40, -9, -40, -20, -19, -18, -40.0])
    table = fitted.predict_interval(np.column_stack([ages, levels]), np.zeros(8))
    assert table["stage"].eq("damage").tolist() == [False] * 6 + [True] * 2


# Refusals


def falling(X):
    return np.column_stack([X[:, 0], -X[:, 1]])


@pytest.mark.parametrize(
    ("kind", "options", "censored", "message"),
    [
        ("weibull", {"coverage": 0.95}, None, "12 units that failed cannot .* of 95%"),
        ("weibull", {}, lambda X, groups: groups < 4, "8 units that failed cannot .* of 90%"),
        ("weibull", {}, lambda X, groups: groups >= 0, "0 units that failed cannot"),
        ("weibull", {"onset": 99.0}, None, r"0 units .* onset of damage \(onset=99.0\)"),
        ("wiener", {"threshold": -39.0}, None, "threshold must be a number above -35"),
        ("wiener", {"onset": None, "threshold": 40.0}, None, "does not increase .* Turn its sign"),
        ("weibull", {}, lambda X, groups: X[:, 0] > 20, "censored is True for some .* of unit 0"),
        ("weibull", {}, lambda X, groups: [True], "censored must hold True or False for each of"),
    ],
)
def test_units_that_cannot_support_a_model_are_refused(kind, options, censored, message):
    X, y, groups, _ = followed(range(12))
    ends = None if censored is None else censored(X, groups)
    X = falling(X) if "Turn its sign" in message else X
    with pytest.raises(ValueError, match=message):
        model(kind, **options).fit(X, y, groups=groups, censored=ends)


@pytest.mark.parametrize("value", [np.nan, -np.inf])
def test_a_reading_that_is_not_finite_is_named(value):
    X, y, groups, _ = followed(range(12))
    fitted = model("weibull").fit(pd.DataFrame(X, columns=["age", "level"]), y, groups=groups)
    with pytest.raises(ValueError, match=r"in reading 1, column 'level'. Leave it out"):
        fitted.predict(pd.DataFrame({"age": [3.0, 4.0], "level": [-40.0, value]}))


def test_what_is_outside_the_fit_is_stated():
    X, y, groups, _ = followed(range(12))
    fitted = model("weibull").fit(X, y, groups=groups)
    longest = (X[:, 0] + y).max()
    table = fitted.predict_interval([[90.0, -20.0], [3600 * 90.0, -20.0], [90.0, 7.5]])
    inside, old, high = table["statement"]
    assert "fit" not in inside
    assert f"The age 324000 is outside that of the fit, 0 to {longest:g}." in old
    assert "The health index 7.5 is outside that of the fit, -40 to -" in high
    assert high.endswith("Check the units of measurement.")


def test_predictions_far_outside_the_fit_warn():
    X, y, groups, _ = followed(range(12))
    fitted = model("weibull").fit(X, y, groups=groups)
    longest = (X[:, 0] + y).max()
    fitted.predict([[1.09 * longest, -20.0]])  # any warning is an error
    with pytest.warns(UserWarning, match="1 of 2 readings are far .* row 1: The age"):
        fitted.decide([[1.09 * longest, -20.0], [1.11 * longest, -20.0]], COSTS)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda X, y, g: (X, y + np.arange(len(y)), g), "remaining life of unit 0 is"),
        (lambda X, y, g: (X, y - 1e3, g), "y must not be negative"),
        (lambda X, y, g: (X - 1, y, g), "first column is the age, got -1 in row 0"),
        (lambda X, y, g: (X, y, np.zeros(len(X))), "unit 0.0 has two readings at age 0"),
    ],
)
def test_inconsistent_tables_are_refused(change, message):
    X, y, groups, _ = followed(range(12))
    X, y, groups = change(X, y, groups)
    with pytest.raises(ValueError, match=message):
        model("weibull").fit(X, y, groups=groups)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.* far outside the range of the fit")  # the longest-lived unit
def test_units_are_held_out_as_wholes_by_scikit_learn():
    X, y, groups, _ = followed(range(30), 30.0)
    folds = GroupKFold(3)
    found = cross_val_predict(RemainingLife("weibull", onset=None), X, y, groups=groups, cv=folds)
    assert np.median(np.abs(found - y)) < 0.6 * np.median(np.abs(y - np.median(y)))


COSTS = MaintenanceCosts(failure=5000, waiting=100, early=2, holding=1, lead_time=40, review=10)


def test_decisions_follow_the_remaining_life():
    X, y, groups, _ = followed(range(60))
    fitted = model("wiener").fit(X, y, groups=groups)
    X, _, units, _ = followed([500], interval=5.0)
    found = fitted.decide(X, COSTS, units)["decision"].tolist()
    assert found[0] == "continue"
    assert found[-1] == "stop"
    assert "order" in found
    changes = [a for a, b in zip(found, [*found[1:], None], strict=True) if a != b]
    assert changes.index("order") < changes.index("stop")


@pytest.mark.slow
def test_an_index_that_says_nothing_gives_intervals_that_are_stated_to_be_too_wide():
    X, y, groups, _ = followed(range(30), 30.0)
    noise = X.copy()
    noise[:, 1] = np.random.default_rng(1).normal(size=len(X))
    ages = RemainingLife().fit(X[:, :1], y, groups=groups).predict_interval(X[:, :1], groups)
    stated = {}
    for name, table in {"index": X, "noise": noise}.items():
        fitted = RemainingLife("weibull", onset=None if name == "noise" else -35.0, consecutive=1)
        found = fitted.fit(table, y, groups=groups).predict_interval(table, groups)
        words = found["statement"].str.extract("from the age alone, (.*) to (.*)[.]").astype(float)
        too_wide, width = words[0].notna(), found["upper"] - found["lower"]
        plain = (ages["upper"] - ages["lower"])[too_wide]
        assert (width[too_wide] > plain).all()
        np.testing.assert_allclose((words[1] - words[0])[too_wide], plain, rtol=0.02)
        stated[name] = too_wide[found["stage"] == "damage"].mean()
    assert stated["index"] < 0.1
    assert stated["noise"] > 0.4
