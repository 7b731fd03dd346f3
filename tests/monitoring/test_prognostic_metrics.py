"""Facts about prognostic metrics: known answers."""

import numpy as np
import pytest
from scipy.stats import norm

from emacm.monitoring import (
    alpha_lambda,
    coverage_by_unit,
    crps,
    monotonicity,
    phm2012_lives,
    phm2012_score,
    prognosability,
    prognostic_horizon,
    trendability,
)


def test_the_challenge_score_is_one_half_for_5_percent_late_and_20_percent_early():
    assert phm2012_score([1000.0], [1000.0]) == 1
    assert phm2012_score([1000.0], [1050.0]) == pytest.approx(0.5)
    assert phm2012_score([1000.0], [800.0]) == pytest.approx(0.5)
    assert phm2012_score([1000.0, 300.0], [1100.0, 180.0]) == pytest.approx(0.25)


def test_the_two_lives_of_bearing_1_4_give_different_scores():
    official, files = phm2012_lives(), phm2012_lives("files")
    assert official["Bearing1_4"] == 339
    assert files["Bearing1_4"] == 2890
    assert official.drop("Bearing1_4").equals(files.drop("Bearing1_4"))
    assert phm2012_score(official, files) == pytest.approx(10 / 11, abs=1e-6)


def test_a_random_factor_scores_what_the_docstring_says():
    rng = np.random.default_rng(3)
    scores = [phm2012_score(np.ones(11), np.exp(0.5 * rng.standard_normal(11))) for _ in range(999)]
    np.testing.assert_allclose(np.quantile(scores, [0.05, 0.95]), [0.13, 0.40], atol=0.02)


def test_alpha_lambda_takes_the_prediction_at_the_fraction_of_the_remaining_time():
    ages, true = [100.0, 130.0, 150.0, 190.0], [100.0, 70.0, 50.0, 10.0]
    predicted = [0.0, 0.0, 59.0, 0.0]
    assert alpha_lambda(ages, true, predicted, alpha=0.2, fraction=0.5)
    assert not alpha_lambda(ages, true, predicted, alpha=0.1, fraction=0.5)
    with pytest.raises(ValueError, match="last prediction is at age 190, before 195"):
        alpha_lambda(ages, true, predicted, fraction=0.95)


def test_the_prognostic_horizon_counts_from_where_predictions_stay_inside():
    ages, true = np.arange(5) * 10.0, 50.0 - np.arange(5) * 10.0
    assert prognostic_horizon(ages, true, true + [0, 9, 4, -4, 5], alpha=0.1) == 30
    assert prognostic_horizon(ages, true, true + 5, alpha=0.1) == 50
    assert prognostic_horizon(ages, true, true + [0, 0, 0, 0, 6], alpha=0.1) == 0


def test_indices_have_the_known_metrics():
    rising, noisy = np.linspace(0, 3, 31), np.tile([0.0, 1.0], 15)
    assert monotonicity([rising, rising[::-1] * 2]) == 1
    assert monotonicity([noisy]) == pytest.approx(1 / 29)
    assert trendability([rising, -5 * rising[::3]]) == pytest.approx(1)
    assert trendability([rising, rising**3], ranks=True) == pytest.approx(1)
    assert trendability([rising, np.sin(np.linspace(0, 2 * np.pi, 9)) ** 2]) < 0.2
    scaled = [1e200 * rising, 1e-200 * rising**3]
    assert trendability(scaled) == pytest.approx(trendability([rising, rising**3]), rel=1e-12)
    assert prognosability([rising, rising + 7 * (rising == 0)]) == 1
    assert prognosability([[0, 4.0], [0, 6.0]]) == pytest.approx(np.exp(-np.sqrt(2) / 5))


def test_the_crps_of_a_normal_distribution_is_its_closed_form():
    quantiles = norm.ppf((np.arange(4000) + 0.5) / 4000, 2.0, 3.0)
    z = (np.array([2.0, -1.3]) - 2.0) / 3.0
    closed = 3.0 * (z * (2 * norm.cdf(z) - 1) + 2 * norm.pdf(z) - 1 / np.sqrt(np.pi))
    np.testing.assert_allclose(crps([2.0, -1.3], np.tile(quantiles, (2, 1))), closed, rtol=2e-3)


def test_coverage_counts_units_and_not_readings():
    groups = np.repeat(["B", "A", "C"], [8, 1, 1])
    table = coverage_by_unit(np.zeros(10), np.r_[np.full(8, -1.0), 1, -1], np.full(10, 2), groups)
    assert table.loc["all", "coverage"] == pytest.approx(2 / 3)
    assert table.loc["B", "n_readings"] == 8
    # Clopper and Pearson for 2 of 3.
    np.testing.assert_allclose(table.loc["all", ["low", "high"]], [0.0943, 0.9916], atol=1e-4)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: phm2012_score([1.0, 0.0], [1.0, 1.0]), "true must be positive, got 0"),
        (lambda: phm2012_score([1.0], [1.0, 2.0]), "of the same length"),
        (lambda: alpha_lambda([2, 1], [1, 2], [1, 2]), "ages must increase"),
        (lambda: trendability([[1.0, 2.0], [3.0, 3.0]]), "unit 1 is constant"),
        (lambda: monotonicity([[1.0]]), "at least two readings"),
        (lambda: crps([1.0], [[np.inf, 1.0]]), "must be finite"),
        (lambda: crps([1.0], np.empty((1, 0))), "at least one draw in each, got shape"),
        (lambda: coverage_by_unit([1.0], [0.0, 0.0], [1.0], ["A"]), "the same length"),
        (lambda: coverage_by_unit([1.0, 1], [0.0, 3], [1.0, 2], "AB"), "got 3 and 2 in row 1"),
        (lambda: coverage_by_unit([1.0], [np.nan], [1.0], ["A"]), "got nan and 1 in row 0"),
        (lambda: coverage_by_unit([1.0], [0], [1], ["A"], confidence=1), "confidence must be"),
    ],
)
def test_invalid_values_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
