"""Facts about the distribution of distances with a modelled tail."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.stats import norm

from emacm.decisions.typicality import student_tail

VALUES = st.lists(st.floats(-50, 50), min_size=1, max_size=40)


def test_up_to_the_threshold_survival_is_counted():
    values = np.array([3.0, 1.0, 7.0, 4.0, 9.0])
    tail = student_tail(values, np.ones(5))
    assert tail.peaks.threshold == 7.0
    assert_allclose(tail.survival(np.array([0.0, 1.0, 3.5, 7.0])), [1, 1, 4 / 6, 3 / 6])


def test_without_an_expected_excess_20_peaks_of_a_normal_distribution_are_expected():
    values, weight = np.array([9.0, 1.0, 4.0, 3.0, 7.0]), np.array([1.0, 2.0, 3.0, 3.0, 1.0])
    deviation = np.sqrt(weight @ (values - 3.9) ** 2 / 10)  # 3.9: the mean
    peaks = student_tail(values, weight).peaks
    assert (peaks.threshold, peaks.n_peaks) == (4.0, 2.0)
    assert peaks.mean_excess == pytest.approx((5 + 3 + 20 * 0.7 * deviation) / 22)


def test_the_tail_of_normal_values_is_found():
    rng = np.random.default_rng(0)
    tail = student_tail(3 + 2.0 * rng.normal(size=20_000), np.ones(20_000))
    at = np.array([1.5, 2.5, 3.5, 4.5])
    assert_allclose(np.log(tail.survival(3 + 2 * at)), norm.logsf(at), rtol=0.05)


def test_new_values_from_few_peaks_exceed_a_level_as_often_as_stated():
    rng = np.random.default_rng(1)
    samples, new = rng.normal(size=(3000, 20)), rng.normal(size=(3000, 50))
    # 0.56: mean excess over the upper fifth, in standard deviations.
    tails = [student_tail(values, np.ones(20), expected=0.56) for values in samples]
    found = np.array([tail.survival(values) for tail, values in zip(tails, new, strict=True)])
    for level in (0.1, 0.03, 0.01):
        assert 0.4 * level < np.mean(found <= level) < 1.3 * level


def test_few_peaks_give_a_heavier_tail_than_many():
    few, many = (
        student_tail(np.tile(np.arange(10.0), n), np.ones(10 * n), expected=1.5) for n in (1, 100)
    )
    assert few.peaks.mean_excess == pytest.approx(many.peaks.mean_excess)
    assert few.survival(np.array([20.0])) > 100 * many.survival(np.array([20.0]))


@given(values=VALUES, at=st.lists(st.floats(-1e4, 1e4), min_size=2, max_size=10))
@example(values=[-2.2250738585e-313], at=[0.0, 0.0])
def test_survival_lies_in_0_to_1_and_never_rises(values, at):
    survival = student_tail(np.array(values), np.ones(len(values))).survival(np.sort(at))
    assert (survival <= 1).all()
    assert (survival > 0).all()
    assert (np.diff(survival) <= 0).all()
