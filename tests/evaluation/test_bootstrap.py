"""Confidence intervals from a bootstrap over whole groups of recordings."""

import numpy as np
import pytest
from scipy.stats import norm, t

from emacm.evaluation.bootstrap import GroupBootstrap, Tally, gap_of_cells


def rate(values, cells=None, **options):
    return Tally(values, np.zeros(len(values), int) if cells is None else cells, **options)


def limits(tally, groups):
    row = GroupBootstrap().figures({"x": tally}, groups)
    assert row["x"] == pytest.approx(tally.figure(), nan_ok=True)
    return [row["x_low"], row["x_high"]]


def interval(values, groups):
    return limits(rate(values), groups)


def test_recordings_without_a_cell_are_not_counted():
    assert Tally([1, 0, 0], [0, -1, -1]).figure() == 1
    assert np.isnan(Tally([1, 0], [-1, -1]).figure())
    wide = rate([0.0, 1.0, 0.4, 1.0, -7.0, 9.0], [0, 0, 0, 0, -1, -1])
    assert limits(wide, [0, 0, 1, 1, 0, 1]) == [0, 1]


def test_copies_within_groups_change_no_interval_but_narrow_it_if_counted_as_independent():
    values, groups = np.random.default_rng(3).random(12), np.arange(12)
    low, high = interval(values, groups)
    copies = np.repeat(values, 9)
    assert interval(copies, np.repeat(groups, 9)) == pytest.approx([low, high], rel=1e-12)
    narrow = interval(copies, np.arange(108))
    assert narrow[1] - narrow[0] < 0.5 * (high - low)


@pytest.mark.parametrize("n_groups", [3, 5, 20])
def test_intervals_have_about_their_nominal_coverage(n_groups):
    rng, covered = np.random.default_rng(n_groups), 0
    for _ in range(400):
        rates = rng.beta(6, 4, n_groups)  # runs differ
        right = (rng.random((n_groups, 20)) < rates[:, np.newaxis]).astype(float)
        low, high = interval(right.ravel(), np.repeat(np.arange(n_groups), 20))
        covered += low <= 0.6 <= high
    assert 0.89 <= covered / 400 <= 0.99  # single recordings as groups would give about 0.6


@pytest.mark.parametrize("confidence", [95, 1.0])
def test_the_confidence_is_checked(confidence):
    with pytest.raises(ValueError, match="confidence must be"):
        GroupBootstrap(confidence)


@pytest.mark.parametrize(("n_groups", "expanded"), [(4, False), (5, True)])
@pytest.mark.parametrize("confidence", [0.95, 0.8])
def test_draws_of_five_groups_have_percentiles_and_of_fewer_student_t(
    n_groups, expanded, confidence
):
    drawn = np.random.default_rng(0).gamma(2.0, size=5000)
    quantile = t.ppf((1 + confidence) / 2, n_groups - 1)
    widening = np.sqrt(n_groups / (n_groups - 1)) * quantile
    student = 2.5 - widening * drawn.std(), 2.5 + widening * drawn.std()
    percentiles = np.quantile(drawn, norm.cdf([-widening, widening]))
    unknown, bootstrap = np.append(drawn, np.nan), GroupBootstrap(confidence)
    found = bootstrap.interval("x", unknown, 2.5, n_groups)
    assert [found["x_low"], found["x_high"]] == pytest.approx(percentiles if expanded else student)
    narrow = bootstrap.interval("x", unknown, 2.5, n_groups, bounds=(2.4, 2.7))
    expected = percentiles if expanded else (2.4, 2.7)
    assert [narrow["x_low"], narrow["x_high"]] == pytest.approx(expected)


def test_the_same_groups_and_seed_give_paired_draws():
    first, second = np.random.default_rng(1).random((2, 60))
    tallies = {"a": rate(first), "b": rate(second), "difference": rate(first - second)}
    found = GroupBootstrap().draws(tallies, np.repeat(np.arange(12), 5))
    assert np.allclose(found["a"] - found["b"], found["difference"])


def test_gaps_of_opposite_sign_within_one_bin_cancel_and_between_bins_add_up():
    values = np.array([0.4, -0.4, 0.2, -0.1])
    assert Tally(values, [0, 0, 0, 0], gap_of_cells).figure() == pytest.approx(0.1 / 4)
    assert Tally(values, [0, 1, 0, 1], gap_of_cells).figure() == pytest.approx(1.1 / 4)


def test_a_rate_without_any_event_has_the_exact_binomial_limit_of_its_groups():
    cells, groups = np.repeat([0, 1], [20, 60]), np.repeat(np.arange(16), 5)  # 4 and 12 groups
    none = np.zeros(80, bool)
    rates = {"all": Tally(none, np.zeros(80, int)), "each": Tally(~none, cells)}
    found = GroupBootstrap().figures(rates, groups)
    assert (found["all_low"], round(found["all_high"], 4)) == (0, 0.2059)  # tables: 0 of 16
    assert (round(found["each_low"], 4), found["each_high"]) == (0.3976, 1)  # 0 of 4
    costs = GroupBootstrap().figures({"cost": Tally(0.0 * none, np.zeros(80, int))}, groups)
    assert costs["cost_high"] == 0
