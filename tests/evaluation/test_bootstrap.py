"""Confidence intervals from a bootstrap over whole groups of recordings."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm, t
from sklearn.metrics import recall_score

from emacm.evaluation import bootstrap
from emacm.evaluation.bootstrap import (
    cell_mean,
    draw_interval,
    gap_of_cells,
    group_draws,
    group_intervals,
    mean_of_cells,
)


def interval(values, groups, **options):
    cells = np.zeros((1, len(values)), int)
    return group_intervals([values], cells, groups, **options)[0]


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=1))
@settings(max_examples=30)
def test_the_mean_over_classes_is_the_balanced_accuracy(pairs):
    truths, decided = np.array(pairs).T
    right = (truths == decided).astype(float)
    theirs = recall_score(truths, decided, labels=np.unique(truths), average="macro")
    assert cell_mean(right, truths) == pytest.approx(theirs)


def test_recordings_without_a_cell_are_not_counted():
    assert cell_mean([1, 0, 0], [0, -1, -1]) == 1
    assert np.isnan(cell_mean([1, 0], [-1, -1]))


def test_copies_within_groups_change_no_interval():
    values, groups = np.random.default_rng(3).random(12), np.arange(12)
    once = interval(values, groups)
    assert np.allclose(interval(np.repeat(values, 9), np.repeat(groups, 9)), once, rtol=1e-12)


def test_copies_counted_as_single_recordings_narrow_the_interval():
    values, groups = np.random.default_rng(3).random(12), np.repeat(np.arange(12), 9)
    low, high = interval(np.repeat(values, 9), groups)
    narrow_low, narrow_high = interval(np.repeat(values, 9), np.arange(108))
    assert narrow_high - narrow_low < 0.5 * (high - low)


def test_the_interval_of_many_recordings_is_given_by_percentiles():
    values = np.random.default_rng(5).normal(size=400)
    reach = np.sqrt(400 / 399) * t.ppf(0.975, 399)
    means = values[np.random.default_rng(1).integers(0, 400, (20_000, 400))].mean(axis=1)
    theirs = np.quantile(means, norm.cdf([-reach, reach]))
    assert np.allclose(interval(values, np.arange(400), n_resamples=20_000), theirs, atol=0.004)


@pytest.mark.parametrize("n_groups", [3, 5, 8, 20])
def test_intervals_have_about_their_nominal_coverage(n_groups):
    rng, covered = np.random.default_rng(n_groups), 0
    for _ in range(400):
        rates = rng.beta(6, 4, n_groups)  # runs differ
        right = (rng.random((n_groups, 20)) < rates[:, np.newaxis]).astype(float)
        low, high = interval(right.ravel(), np.repeat(np.arange(n_groups), 20), n_resamples=300)
        covered += low <= 0.6 <= high
    assert 0.89 <= covered / 400 <= 0.99  # single recordings as groups would give about 0.6


def test_the_interval_of_two_groups_is_given_by_student_t():
    # Means 0.5 and 0.7: deviation of their mean 0.1, times t of one degree of freedom, 12.7.
    groups = [0, 0, 1, 1]
    assert interval([0.0, 1.0, 0.4, 1.0], groups).tolist() == [0, 1]  # no value lies beyond
    wide = interval([-9.0, 10.0, 0.4, 1.0], groups)
    assert np.allclose(wide, [0.6 - 1.27, 0.6 + 1.27], atol=0.03)


def test_values_without_a_cell_do_not_widen_the_interval_of_few_groups():
    values, cells = [[0.0, 1.0, 0.4, 1.0, -7.0, 9.0]], [[0, 0, 0, 0, -1, -1]]
    assert group_intervals(values, cells, [0, 0, 1, 1, 0, 1]).tolist() == [[0, 1]]


def test_one_group_has_no_interval():
    assert np.isnan(interval([0.0, 1.0], ["a", "a"])).all()


def test_groups_without_counted_recordings_are_not_observations():
    cells = np.array([[0, 0, -1, -1]])
    assert np.isnan(group_intervals([[0.0, 1.0, 1.0, 1.0]], cells, list("aabb"))).all()


def test_there_is_no_interval_if_nearly_every_draw_misses_a_cell():
    cells = np.arange(8)[np.newaxis]
    assert np.isnan(group_intervals([np.ones(8)], cells, np.arange(8))).all()


def test_equal_values_have_an_interval_of_zero_width():
    assert interval(np.ones(6), np.arange(6)).tolist() == [1, 1]


def test_the_same_seed_gives_the_same_interval():
    values, groups = np.random.default_rng(0).random(30), np.arange(30)
    assert (interval(values, groups) == interval(values, groups)).all()
    assert (interval(values, groups) != interval(values, groups, random_state=1)).any()


def test_confidence_and_draws_are_checked():
    with pytest.raises(ValueError, match="confidence must be a number above 0 and below 1, got 95"):
        interval([0.0, 1.0], [0, 1], confidence=95)
    for options in ({"confidence": 1.0}, {"n_resamples": 99}):
        with pytest.raises(ValueError, match=f"{next(iter(options))} must be"):
            interval([0.0, 1.0], [0, 1], **options)


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
    unknown = np.append(drawn, np.nan)
    found = draw_interval(unknown, 2.5, n_groups, confidence=confidence)
    assert found == pytest.approx(percentiles if expanded else student)
    narrow = draw_interval(unknown, 2.5, n_groups, (2.4, 2.7), confidence)
    assert narrow == pytest.approx(percentiles if expanded else (2.4, 2.7))


@pytest.mark.parametrize(("n_known", "is_known"), [(0, False), (9, False), (10, True)])
def test_one_draw_in_ten_must_be_known(n_known, is_known):
    drawn = np.append(np.arange(n_known), np.full(100 - n_known, np.nan))
    assert np.isfinite(draw_interval(drawn, 1.0, 6)).all() == is_known
    assert np.isfinite(draw_interval(drawn, 1.0, 2)).all() == is_known
    assert np.isnan(draw_interval(drawn, 1.0, 1)).all()


def test_no_draws_have_no_interval():
    assert np.isnan(draw_interval(np.empty(0), np.nan, 9)).all()


def test_draws_that_miss_a_cell_are_unknown_and_figures_without_cells_have_none():
    values, cells = np.ones((3, 4)), [[0, 0, 1, 1], [5, 5, 5, 2], [-1, -1, -1, -1]]
    first, second, none = group_draws(values, cells, [0, 0, 7, 7], n_resamples=400)
    assert 0.4 < np.isnan(first).mean() < 0.6  # one of two groups twice
    assert np.isnan(second).mean() == pytest.approx(0.25, abs=0.06)  # the first group twice
    assert set(first[np.isfinite(first)]) == {1.0}
    assert (len(first), len(none)) == (400, 0)


def test_as_many_groups_are_drawn_as_there_are_with_equal_probability():
    (times,) = bootstrap.drawn_groups(4, 5000, 1)
    assert times.dtype == float
    assert (times.sum(axis=1) == 4).all()
    np.testing.assert_allclose(times.mean(axis=0), 1, atol=0.06)
    np.testing.assert_allclose(times.var(axis=0), 3 / 4, atol=0.06)


def test_the_interval_of_an_absolute_sum_is_moved_to_it_and_is_never_negative():
    values, bins, groups = np.array([0.4, -0.4, 0.3, -0.3]), np.zeros(4, int), np.arange(4)
    options = {"combine": [gap_of_cells], "n_resamples": 500}
    ((low, high),) = group_intervals([values], [bins], groups, **options)
    (drawn,) = group_draws([values], [bins], groups, **options)
    moved = np.clip(drawn - drawn.mean(), 0, 0.4)  # the values themselves cancel
    assert (low, high) == (0, pytest.approx(min(0.4, draw_interval(moved, 0.0, 4)[1])))
    none = group_intervals([values], [bins - 1], groups, **options)
    assert np.isnan(none).all()


def test_defaults_are_2000_draws_of_seed_0_and_95_percent():
    values, cells, groups = (
        np.random.default_rng(2).random((1, 30)),
        np.zeros((1, 30), int),
        np.arange(30),
    )
    given = {"n_resamples": 2000, "random_state": 0}
    (drawn,) = group_draws(values, cells, groups, **given)
    assert group_draws(values, cells, groups)[0].tolist() == drawn.tolist()
    stated = group_intervals(values, cells, groups, confidence=0.95, **given)
    assert group_intervals(values, cells, groups).tolist() == stated.tolist()
    assert stated.tolist() == [list(draw_interval(drawn, values.mean(), 30))]
    (times,), (first,) = bootstrap.drawn_groups(3, 100, 0), bootstrap.drawn_groups(3, 100)
    assert times.tolist() == first.tolist()


def test_one_group_is_drawn_alone_and_no_recordings_have_no_draws():
    values, cells = [[0.0, 1.0, 1.0], [5.0, 2.0, 3.0]], [[0, 0, 0], [1, 0, -1]]
    first, second = group_draws(values, cells, ["a"] * 3, n_resamples=100)
    assert first.tolist() == pytest.approx([2 / 3] * 100)
    assert second.tolist() == [3.5] * 100
    (none,) = group_draws(np.empty((1, 0)), np.empty((1, 0), int), [], n_resamples=100)
    assert none.shape == (0,)
    assert np.isnan(cell_mean([], np.empty(0, int)))


@pytest.mark.parametrize("n_combine", [1, 3])
def test_each_figure_of_merit_has_its_own_combination(n_combine):
    values, cells = np.ones((2, 4)), np.zeros((2, 4), int)
    with pytest.raises(ValueError, match="zip"):
        group_draws(values, cells, [*"abcd"], combine=[mean_of_cells] * n_combine)


def test_figures_of_different_cells_in_one_call_are_those_of_separate_calls():
    rng = np.random.default_rng(11)
    values, groups = rng.normal(size=(3, 60)), rng.integers(0, 7, 60)
    cells = np.array([rng.integers(-1, 3, 60), np.zeros(60, int), rng.integers(-1, 2, 60)])
    combine = [gap_of_cells, mean_of_cells, gap_of_cells]
    together = group_draws(values, cells, groups, combine=combine, n_resamples=150)
    for place, drawn in enumerate(together):
        one = slice(place, place + 1)
        (alone,) = group_draws(
            values[one], cells[one], groups, combine=combine[one], n_resamples=150
        )
        assert drawn == pytest.approx(alone, nan_ok=True)
