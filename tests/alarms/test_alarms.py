"""Facts about alarms: published run lengths, estimated baselines, readings one by one."""

import pickle

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter
from sklearn.base import clone
from sklearn.utils.estimator_checks import parametrize_with_checks

from emacm.alarms.run_lengths import cusum_run_length, ewma_run_length
from emacm.alarms.stationarity import trend_probability
from emacm.monitoring import CUSUM, EWMA

CHECKS = parametrize_with_checks([EWMA(limit=3.0), CUSUM(limit=5.0)])


@pytest.mark.filterwarnings("ignore:the baseline drifts")
@pytest.mark.parametrize(CHECKS.args[0], list(CHECKS.args[1]), **CHECKS.kwargs)
def test_every_check_of_scikit_learn_passes(estimator, check):
    check(estimator)


def correlated(shape, correlation, rng):
    """Return autoregressive series over the last axis, of mean 0 and standard deviation 1."""
    noise = rng.standard_normal(shape)
    series = np.empty(shape)
    series[..., 0] = noise[..., 0]
    for time in range(1, shape[-1]):
        innovation = np.sqrt(1 - correlation**2) * noise[..., time]
        series[..., time] = correlation * series[..., time - 1] + innovation
    return series


def test_the_limit_has_the_average_run_length_that_was_asked_for():
    assert EWMA(0.37, arl=812).fit(np.eye(9)).limit_ > 2
    assert ewma_run_length(0.37, EWMA(0.37, arl=812).fit(np.eye(9)).limit_) == pytest.approx(812)
    assert cusum_run_length(0.7, CUSUM(0.7, arl=333).fit(np.eye(9)).limit_) == pytest.approx(333)


@pytest.mark.parametrize("chart", [EWMA(0.15, arl=150), CUSUM(0.4, arl=150)])
def test_the_run_length_of_a_known_baseline_is_that_of_a_simulation(chart):
    rng = np.random.default_rng(5)
    baseline = np.tile(rng.standard_normal((40, 1)), 40)
    fitted = chart.fit((baseline - baseline.mean()) / baseline[:, 0].std(ddof=1))  # 0 and 1 exactly
    readings = rng.standard_normal((10, 150, 40))
    alarms = sum(fitted.reset().update(new).alarm.any(axis=0).sum() for new in readings)
    # Run lengths are nearly geometric: the fraction without alarm in 150 readings is exp(-1).
    assert alarms / 400 == pytest.approx(1 - np.exp(-1), abs=0.07)


def readings_per_alarm(n_readings, correlation, weight, limit, rng, n_machines=3000):
    """Simulate machines that each have their own baseline."""
    baselines = correlated((n_machines, n_readings), correlation, rng)
    future = correlated((n_machines, 2000), correlation, rng)
    mean, scale = baselines.mean(axis=1), baselines.std(axis=1, ddof=1)
    statistic, n_alarms = np.zeros(n_machines), 0
    for readings in future.T:
        statistic = (1 - weight) * statistic + weight * (readings - mean) / scale
        alarm = np.abs(statistic) > limit * np.sqrt(weight / (2 - weight))
        n_alarms += alarm.sum()
        statistic[alarm] = 0
    return future.size / n_alarms


@pytest.mark.filterwarnings("ignore:the baseline drifts")  # a few of many
@pytest.mark.slow
@pytest.mark.parametrize(("n_readings", "correlation"), [(50, 0.0), (100, 0.5)])
def test_the_stated_run_length_includes_size_and_correlation_of_the_baseline(
    n_readings, correlation
):
    rng = np.random.default_rng(11)
    truth = readings_per_alarm(n_readings, correlation, 0.2, 2.962, rng)
    known = readings_per_alarm(20_000, correlation, 0.2, 2.962, rng, n_machines=300)
    stated = [
        EWMA(0.2, 2.962).fit(correlated((1, n_readings), correlation, rng).T).run_length_.stated
        for _ in range(60)
    ]
    # One statement varies with its baseline; over baselines, the number of false alarms holds.
    assert 0.5 * truth < 1 / np.mean(1 / np.array(stated)) < 1.1 * truth
    assert np.mean(stated) < 1.02 * known
    assert truth < 0.8 * 500  # nominal


@pytest.mark.slow
@pytest.mark.parametrize(
    ("chart", "true_length"),
    [
        (EWMA(0.2, 2.962), lambda mean, scale: ewma_run_length(0.2, 2.962 * scale, -mean)),
        (CUSUM(0.5, 5.0), lambda mean, scale: cusum_run_length(0.5 * scale, 5.0 * scale, -mean)),
    ],
)
def test_a_run_length_is_at_most_that_of_a_known_baseline_and_its_interval_has_the_true_one(
    chart, true_length
):
    rng, covered, stated = np.random.default_rng(2), [], []
    for _ in range(50):  # readings of mean 0 and standard deviation 1
        chart.fit(rng.standard_normal((100, 1)))
        low, high = chart.run_length_.interval
        covered.append(low <= true_length(chart.mean_[0], chart.scale_[0]) <= high)
        stated.append(chart.run_length_.stated)
    assert np.mean(covered) >= 0.9
    assert max(stated) <= chart.arl()
    assert np.mean(stated) > 0.4 * chart.arl()


def test_a_negative_correlation_does_not_lengthen_the_stated_run_length():
    rng = np.random.default_rng(3)
    lengths = []
    for correlation in (-0.4, 0.0):
        baseline = correlated((1, 500), correlation, rng).T
        lengths.append(EWMA(0.2, 2.962).fit(baseline).run_length_)
    assert lengths[0].correlation == pytest.approx(-0.4, abs=0.1)
    assert max(length.stated for length in lengths) <= 500
    assert "in 90 of 100 such charts" in str(lengths[0])


def test_differences_between_units_shorten_the_stated_run_length():
    rng = np.random.default_rng(3)
    units = np.repeat(np.arange(12), 40)
    noise = rng.standard_normal((480, 1))
    offset = 2.0 * rng.standard_normal((12, 1))[units]
    alike = CUSUM(0.5, 5.0).fit(noise, groups=units).run_length_
    unlike = CUSUM(0.5, 5.0).fit(noise + offset, groups=units).run_length_
    assert alike.kind == unlike.kind == "bootstrap"
    assert unlike.stated < 0.2 * alike.stated
    assert unlike.n_groups == 12


def test_a_small_baseline_gives_a_nominal_run_length_and_says_so():
    rng = np.random.default_rng(0)
    found = EWMA(0.2, 2.962).fit(rng.standard_normal((49, 1))).run_length_
    assert found.kind == "nominal"
    assert "a baseline of 49 readings is too small" in str(found)
    for units in (np.repeat([3, 1], 50), np.arange(100)):  # single readings state no correlation
        found = CUSUM().fit(rng.standard_normal((100, 1)), groups=units).run_length_
        assert found.kind == "nominal"
        assert f"100 readings in {len(set(units))} groups is too small" in str(found)


def test_a_run_length_lost_in_rounding_is_infinite():
    assert np.isinf(EWMA(1.0, limit=8.0).arl(0.0))
    assert np.isinf(CUSUM(0.5, limit=40.0).arl(0.0))


def test_a_run_length_too_long_to_simulate_is_a_lower_limit():
    found = EWMA(1.0, limit=8.0).fit(np.random.default_rng(0).uniform(size=(300, 1))).run_length_
    assert found.kind == "at least"
    assert 1e4 < found.stated < found.nominal
    assert str(found).startswith("at least")


@pytest.mark.parametrize("chart", [EWMA(0.3, 2.0), CUSUM(0.2, 3.0)])
def test_readings_one_by_one_give_the_same_as_all_at_once(chart):
    rng = np.random.default_rng(4)
    chart.fit(rng.normal([3.0, -8.0], [0.1, 2.0], (80, 2)))
    readings = rng.normal([3.05, -8.0], [0.1, 2.0], (31, 2))
    at_once = chart.update(readings)
    chart.reset()
    singly = [chart.update(row) for row in readings[:17]]
    again = pickle.loads(pickle.dumps(chart))
    singly += [again.update(row) for row in readings[17:]]
    np.testing.assert_array_equal(np.vstack([r.statistic for r in singly]), at_once.statistic)
    np.testing.assert_array_equal(np.vstack([r.alarm for r in singly]), at_once.alarm)
    assert at_once.alarm.any()


def test_ewma_is_two_sided_and_cusum_upward():
    baseline = np.random.default_rng(4).standard_normal((200, 1))
    down = np.full((30, 1), -3.0)
    assert EWMA().fit(baseline).update(down).alarm[-1, 0]
    assert not CUSUM().fit(baseline).update(down).alarm.any()
    assert CUSUM().fit(baseline).update(-down).alarm[-1, 0]


def test_a_constant_column_never_gives_an_alarm():
    baseline = np.random.default_rng(4).standard_normal((60, 2))
    baseline[:, 0] = 7.0
    chart = EWMA().fit(baseline)
    assert not chart.update([[900.0, 0.0]]).alarm[0, 0]


def test_parameter_and_function_arl_do_not_disturb_each_other():
    chart = EWMA(0.3, arl=700)
    assert chart.get_params() == {"weight": 0.3, "limit": None, "arl": 700}
    assert clone(chart.set_params(arl=900)).arl() == pytest.approx(900)
    assert repr(chart) == "EWMA(arl=900, weight=0.3)"


@pytest.mark.parametrize(
    ("chart", "message"),
    [
        (EWMA(0.0), "weight must be a number above 0 and at most 1, got 0.0"),
        (CUSUM(-1.0), "reference must be a number at least 0"),
        (CUSUM(0.5, limit=4.0, arl=500), "give limit or arl, got both"),
        (EWMA(0.2, arl=1.0), "arl must be a number above 1"),
        (CUSUM(0.5, arl=1.2), "the shortest is 3.24 readings"),
        (CUSUM(9.0, arl=500), "Give .* a smaller reference"),
    ],
)
def test_an_invalid_parameter_is_named(chart, message):
    with pytest.raises(ValueError, match=message):
        chart.fit(np.eye(3))


def test_invalid_readings_are_named():
    with pytest.raises(ValueError, match="no variation in any of 2 columns"):
        EWMA().fit(np.ones((9, 2)))
    chart = EWMA().fit(pd.DataFrame({"rms": [1.0, 2.0, 4.0], "crest": [3.0, 2.0, 4.0]}))
    with pytest.raises(ValueError, match="3 features"):
        EWMA().fit(np.eye(2)).update([[1.0, 2.0, 3.0]])
    with pytest.raises(ValueError, match=r"got NaN in reading 0, column 'rms'. Leave it out"):
        chart.update(pd.DataFrame({"rms": [np.nan], "crest": [1.0]}))
    with pytest.raises(TypeError, match="X has masked samples"):
        EWMA().fit(np.ma.masked_less(np.eye(3), 0.5))
    with pytest.raises(TypeError, match=r"datetime64.* in column 'when'"):
        EWMA().fit(pd.DataFrame({"when": pd.date_range("2024", periods=9)}))


def test_simulated_baselines_without_variation_give_no_alarms():
    baseline = np.append(np.full(99, 5.0), 6.0)[:, np.newaxis]  # one reading differs
    found = EWMA().fit(baseline).run_length_
    assert np.isfinite(found.stated)


@pytest.mark.slow
@pytest.mark.parametrize(("rho", "most"), [(0.0, 0.02), (0.6, 0.06)])
def test_correlated_baselines_do_not_drift_and_a_run_in_does(rho, most):
    rng, one = np.random.default_rng(5), np.zeros(60, dtype=np.intp)
    series = lfilter([np.sqrt(1 - rho**2)], [1, -rho], rng.normal(size=(400, 160)))[:, 100:]
    assert np.mean([trend_probability(x, one) < 0.01 for x in series]) < most
    run_in = 8 * np.exp(-4 * np.linspace(0, 1, 60))
    assert np.mean([trend_probability(x + run_in, one) < 0.01 for x in series]) > 0.85
    with pytest.warns(UserWarning, match="baseline drifts in column 1"):
        EWMA().fit(np.column_stack([series[0], series[1] + run_in]))
