"""Costs with which a missed detection rate holds in fleets drawn anew."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binom, binomtest
from sklearn.exceptions import NotFittedError
from sklearn.naive_bayes import GaussianNB

from emacm import CostSensitiveGaussianBayes, evaluate
from emacm.evaluation.miss_rate import largest_missed, miss_rate_limit

INSPECT = {("inspect", "healthy"): 0.3, ("inspect", "worn"): 0.3, ("inspect", "dry"): 0.3}


def fleet(n_units, n_runs, seed, between=1.0, within=1.0, states=("healthy", "worn")):
    """Return runs of units with their own offsets; each unit has one state."""
    rng = np.random.default_rng(seed)
    units = np.repeat(np.arange(n_units), n_runs)
    codes = units % len(states)
    centres = np.array([[0.0, 1.0], [2.5, 1.0], [0.0, 4.5]])[: len(states)]
    X = centres[codes] + between * rng.normal(size=(n_units, 2))[units]
    return X + within * rng.normal(size=X.shape), np.array(states)[codes], units


def three_states(n_units, seed, n_runs=2):
    return fleet(n_units, n_runs, seed, states=("healthy", "worn", "dry"))


@pytest.mark.slow
@pytest.mark.parametrize(("between", "within", "n_runs"), [(1.4, 0.1, 5), (1, 1, 1)])
def test_the_rate_holds_in_19_of_20_fleets_and_is_not_half_of_what_was_asked(
    between, within, n_runs
):
    model = CostSensitiveGaussianBayes().fit(*fleet(600, n_runs, 0, between, within)[:2])
    X, y, _ = fleet(400_000, 1, 1, between, within)
    log_odds = np.diff(model.predict_log_proba(X[y == "worn"]), axis=1)[:, 0]
    true_rates = []
    for seed in range(40):  # of a share of 0.95: standard error of 0.034
        limit = miss_rate_limit(
            model, *fleet(240, n_runs, 10 + seed, between, within), rate=0.1, healthy="healthy"
        )
        true_rates.append(np.mean(log_odds <= -np.log(limit.factor)))
    assert np.mean(log_odds <= 0) > 0.14  # without the limit, more than the rate is missed
    assert np.mean(np.array(true_rates) <= 0.1) >= 0.95
    assert np.mean(true_rates) > 0.045


def test_the_rates_of_the_given_cost_are_those_of_evaluate():
    X, y, units = three_states(120, 0)
    model = CostSensitiveGaussianBayes(INSPECT)
    parts = np.arange(len(y)) < 120
    limit = miss_rate_limit(
        model.fit(X[parts], y[parts]), X[~parts], y[~parts], units[~parts], 0.2, healthy="healthy"
    )
    split = {"later": (parts, ~parts)}
    result = evaluate(model, X, y, units=units, splits=split, healthy="healthy", n_splits=2)
    rates = [name for name in limit.table if "_rate" in name]
    assert len(rates) == 9
    found, expected = limit.table.loc["given cost", rates], result.table.loc["later", rates]
    pd.testing.assert_series_equal(found.astype(float), expected.astype(float), check_names=False)


def test_the_factor_multiplies_what_a_missed_detection_costs_more_than_the_cheapest_decision():
    # Two decisions are right for the healthy state, and no decision is free for a fault.
    rows, states = ["cruise", "fly", "ground"], ["dry", "healthy", "worn"]
    cost = pd.DataFrame([[0.9, 0, 0.75], [1.5, 0, 0.6], [0.5, 1, 0.25]], rows, states)
    X, y, _ = three_states(90, 0)
    new, truths, of = three_states(240, 1)
    model = CostSensitiveGaussianBayes(cost).fit(X, y)
    limit = miss_rate_limit(model, new, truths, of, rate=0.05, healthy="healthy")
    cheapest = np.array([0.5, 0, 0.25])
    excess = (cost - cheapest).loc[["cruise", "fly"]] * limit.factor
    assert limit.factor > 1
    assert {"cruise", "fly"} < set(model.predict(new))
    assert limit.cost.loc["ground"].tolist() == [0.5, 1, 0.25]
    assert (limit.cost - cheapest).loc[["cruise", "fly"]].to_numpy() == pytest.approx(
        excess.to_numpy() * [1, 0, 1]
    )

    def missed(factor):
        changed = cost.copy()
        changed.loc[["cruise", "fly"], ["dry", "worn"]] += (factor - 1) * (cost - cheapest).loc[
            ["cruise", "fly"], ["dry", "worn"]
        ]
        decided = CostSensitiveGaussianBayes(changed).fit(X, y).predict(new)
        return np.mean(decided[truths != "healthy"] != "ground")

    allowed = largest_missed(160, 0.05, 0.95)
    assert missed(limit.factor) <= allowed < missed(limit.factor * (1 - 1.5e-6))
    assert limit.table.loc["limit", "missed_by_unit"] == pytest.approx(missed(limit.factor))


def test_one_recording_of_each_unit_is_tested_by_the_exact_binomial():
    for n_units, rate, confidence in ((100, 0.1, 0.95), (299, 0.01, 0.95), (57, 0.15, 0.9)):
        missed = round(n_units * largest_missed(n_units, rate, confidence, exact=True))
        upper = [
            binomtest(k, n_units).proportion_ci(2 * confidence - 1).high
            for k in (missed, missed + 1)
        ]
        assert upper[0] <= rate < upper[1]  # Clopper and Pearson


def test_the_bound_of_means_is_at_least_those_of_hoeffding_and_bentkus():
    n_units, rate = 140, 0.1
    fraction = largest_missed(n_units, rate, 0.95)
    divergence = fraction * np.log(fraction / rate)
    divergence += (1 - fraction) * np.log((1 - fraction) / (1 - rate))
    assert np.exp(-n_units * divergence) >= 0.05
    assert np.e * binom.cdf(np.ceil(n_units * fraction), n_units, rate) >= 0.05


def test_many_recordings_do_not_replace_units():
    X, y, units = fleet(40, 50, 1)
    model = CostSensitiveGaussianBayes().fit(X, y)
    message = (
        r"20 units with faults cannot prove .* 0.01 with confidence 0.95: .* "
        r"as high as 0.139. It takes 299 units"
    )
    units = np.where(y == "worn", units, 1000 + np.arange(len(y)))  # enough healthy units
    with pytest.raises(ValueError, match=message):
        miss_rate_limit(model, X, y, units, healthy="healthy")


@pytest.mark.parametrize(("n_units", "enough"), [(298, False), (299, True)])
def test_299_units_without_a_missed_detection_prove_one_in_a_hundred(n_units, enough):
    X, y = [[0.0], [0.2], [9.0], [9.1]], ["healthy", "healthy", "worn", "worn"]
    model = CostSensitiveGaussianBayes(covariance="tied").fit(X, y)
    tested = model, np.full((n_units, 1), 9.0), ["worn"] * n_units, np.arange(n_units)
    if enough:
        assert miss_rate_limit(*tested, healthy="healthy").factor == 1
    else:
        with pytest.raises(ValueError, match="It takes 299 units"):
            miss_rate_limit(*tested, healthy="healthy")


def test_a_fault_of_an_unknown_state_is_missed_if_it_is_decided_healthy():
    X, y, units = three_states(150, 0)
    known = y != "dry"
    model = CostSensitiveGaussianBayes(unknown="new").fit(X[known], y[known], groups=units[known])
    X, y, units = three_states(150, 1)
    y[y == "dry"] = "new"
    limit = miss_rate_limit(model, X, y, units, rate=0.1, healthy="healthy")
    decided = model.set_params(cost=limit.cost).predict(X)
    assert limit.n_units == 100
    assert np.mean(decided[y != "healthy"] == "healthy") == limit.table.loc[
        "limit", "missed_detection_rate"
    ] <= largest_missed(100, 0.1, 0.95) + 1e-9  # fmt: skip


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rate": 0.0}, "rate must be .* above 0"),
        ({"confidence": 1.0}, "confidence must be .* below 1"),
        ({"confidence": 0.0}, "confidence must be .* above 0"),
        ({"healthy": "good"}, "healthy='good' is neither a class nor a family"),
        ({"groups": None}, "groups must give the unit of each recording"),
        ({"groups": [1, 2]}, "groups must hold one label for each of 240 recordings"),
        ({"y": ["healthy"]}, "y has 1 states for 240 recordings"),
        ({"y": ["stuck"] * 240}, "y contains 'stuck' at position 0, which is not a known state"),
    ],
)
def test_invalid_arguments(options, message):
    X, y, units = fleet(120, 2, 0)
    model = CostSensitiveGaussianBayes().fit(X, y)
    arguments = {"y": y, "groups": units, "rate": 0.1, "healthy": "healthy"} | options
    with pytest.raises(ValueError, match=message):
        miss_rate_limit(model, X, **arguments)


def test_what_no_cost_can_attain():
    X, y, units = fleet(120, 2, 0)
    free = CostSensitiveGaussianBayes({("healthy", "worn"): 0}).fit(X, y)
    with pytest.raises(ValueError, match="deciding 'healthy' when 'worn' is true must cost more"):
        miss_rate_limit(free, X, y, units, 0.1, healthy="healthy")
    certain = CostSensitiveGaussianBayes(priors={"healthy": 1, "worn": 0}).fit(X, y)
    with pytest.raises(ValueError, match="probability 0 for 120 of 120 faulty recordings"):
        miss_rate_limit(certain, X, y, units, 0.1, healthy="healthy")
    # Deciding "worn" is as good, but "healthy" is decided, whatever a missed detection costs.
    tied = {("worn", "healthy"): 0.0}
    tied = CostSensitiveGaussianBayes(tied, priors={"healthy": 1, "worn": 0}).fit(X, y)
    assert (tied.predict(X) == "healthy").all()
    with pytest.raises(ValueError, match="probability 0 for 120 of 120 faulty recordings"):
        miss_rate_limit(tied, X, y, units, 0.1, healthy="healthy")
    with pytest.raises(TypeError, match=r"GaussianNB has no cost_. Use LeastRiskClassifier"):
        miss_rate_limit(GaussianNB().fit(X, y), X, y, units, 0.1, healthy="healthy")
    with pytest.raises(NotFittedError):
        miss_rate_limit(CostSensitiveGaussianBayes(), X, y, units, 0.1, healthy="healthy")
