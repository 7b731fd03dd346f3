"""Facts about the distribution of distances with a modelled tail."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from emacm.decisions.tails import exponential_tail

VALUES = st.lists(st.floats(-50, 50), min_size=1, max_size=40)


def test_up_to_the_threshold_survival_is_counted():
    values = np.array([3.0, 1.0, 7.0, 4.0, 9.0])
    tail = exponential_tail(values, np.ones(5))
    assert tail.threshold == 7.0
    assert_allclose(tail.survival(np.array([0.0, 1.0, 3.5, 7.0])), [1, 1, 4 / 6, 3 / 6])


def test_the_tail_of_exponential_values_is_found():
    rng = np.random.default_rng(0)
    tail = exponential_tail(2.0 * rng.exponential(size=20_000), np.ones(20_000))
    far = np.array([10.0, 20.0, 30.0])
    assert_allclose(np.log(tail.survival(far)), -far / 2, rtol=0.06)


def test_few_peaks_give_a_heavier_tail_than_many():
    few, many = (exponential_tail(np.tile(np.arange(10.0), n), np.ones(10 * n)) for n in (1, 100))
    assert few.mean_excess == pytest.approx(many.mean_excess)
    assert few.survival(np.array([50.0])) > 1e6 * many.survival(np.array([50.0]))


@given(values=VALUES, at=st.lists(st.floats(-1e4, 1e4), min_size=2, max_size=10))
def test_survival_lies_in_0_to_1_and_never_rises(values, at):
    survival = exponential_tail(np.array(values), np.ones(len(values))).survival(np.sort(at))
    assert (survival <= 1).all()
    assert (survival > 0).all()
    assert (np.diff(survival) <= 0).all()


@given(values=VALUES, shift=st.integers(-9, 9), scale=st.sampled_from([0.5, 2.0, 4.0]))
def test_shift_and_scale_of_all_values_change_no_survival(values, shift, scale):
    values = np.unique(np.round(values, 2))
    tail = exponential_tail(values, np.ones(len(values)))
    moved = exponential_tail(scale * values + shift, np.ones(len(values)))
    at = np.linspace(-60, 60, 7)
    if min(tail.mean_excess, moved.mean_excess) > 1e-3:
        assert_allclose(moved.survival(scale * at + shift), tail.survival(at), rtol=1e-6)


def test_weights_equal_repetitions():
    rng = np.random.default_rng(1)
    values, weight = rng.normal(size=30), rng.integers(1, 5, 30)
    weighted = exponential_tail(values, weight.astype(float))
    repeated = exponential_tail(np.repeat(values, weight), np.ones(weight.sum()))
    at = np.linspace(-3, 6, 50)
    assert_allclose(weighted.survival(at), repeated.survival(at), rtol=1e-12)


def test_equal_values_have_a_survival_that_still_falls():
    tail = exponential_tail(np.full(6, 2.0), np.ones(6))
    assert_array_equal(tail.survival(np.array([1.0, 2.0])), 1)
    assert tail.survival(np.array([3.0])) < 0.01
