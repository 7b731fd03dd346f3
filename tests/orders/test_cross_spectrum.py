"""Facts about two channels over orders: cross spectrum, coherence, response."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal as filters
from scipy.integrate import trapezoid

from emacm.orders.bins import bin_operator
from emacm.orders.order_cross_spectrum import cross_averages
from emacm.orders.segment_plan import SegmentPlan
from emacm.orders.welch import order_psd

TURN = 2 * np.pi


def noise(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


def averages_of(x, y, samples_per_rev, **options):
    plan = SegmentPlan(samples_per_rev, **options)
    return plan, cross_averages(plan, plan.lines_of([np.stack([x, y])]), [(0, 1)], "xy")


def cross_spectrum(x, y, samples_per_rev, **options):
    plan, averages = averages_of(x, y, samples_per_rev, **options)
    return plan.orders, averages.cross[0]


def coherence(x, y, samples_per_rev, **options):
    plan, averages = averages_of(x, y, samples_per_rev, **options)
    return plan.orders, averages.coherence()[0]


def frequency_response(x, y, samples_per_rev, **options):
    plan, averages = averages_of(x, y, samples_per_rev, **options)
    return plan.orders, averages.response()[0]


def assert_same(ours, theirs):
    np.testing.assert_allclose(ours[0], theirs[0], rtol=1e-12)
    largest = np.abs(theirs[1]).max()
    np.testing.assert_allclose(ours[1], theirs[1], rtol=1e-12, atol=1e-12 * largest)


# The same samples, and scipy.signal


@pytest.mark.parametrize("length", [255, 256])
@pytest.mark.parametrize("detrend", ["constant", False])
@pytest.mark.parametrize("scaling", ["density", "spectrum"])
def test_the_cross_spectrum_is_that_of_scipy(length, detrend, scaling):
    x, y = noise(2, 5000)
    y[4:] += 2 * x[:-4]
    options = {"detrend": detrend, "scaling": scaling}
    ours = cross_spectrum(x, y, 60, n_per_segment=length, **options)
    assert_same(ours, filters.csd(x, y, 60, nperseg=length, **options))


def test_the_cross_spectrum_of_a_signal_with_itself_is_its_power_spectrum():
    x = noise(3000)
    csd = cross_spectrum(x, x, 50, revolutions=4)[1]
    np.testing.assert_allclose(csd.imag, 0, atol=1e-15)
    np.testing.assert_allclose(csd.real, order_psd(x, 50, revolutions=4)[1], rtol=1e-12)


# Known answers


def test_the_response_of_a_filter_is_its_response():
    x = noise(400_000)
    taps = [0.5, 0.3, -0.2]
    orders, response = frequency_response(x, np.convolve(x, taps)[: len(x)], 64, revolutions=16)
    expected = filters.freqz(taps, worN=TURN * orders / 64)[1]
    # Three taps against segments of 1024 samples: what leaks is of their ratio.
    np.testing.assert_allclose(response[2:-2], expected[2:-2], atol=5e-3)


def test_a_delay_turns_the_phase_in_proportion_to_the_order():
    x = noise(200_000)
    orders, response = frequency_response(x[3:], x[:-3], 64, revolutions=16)
    turned = np.unwrap(np.angle(response[2:-2]))
    np.testing.assert_allclose(turned, -orders[2:-2] * 3 * TURN / 64, atol=0.02)


def test_noise_in_the_output_leaves_the_response_as_it_is():
    x, z = noise(2, 400_000)
    response = frequency_response(x, 2 * x + z, 64, revolutions=4)[1]
    # 3100 segments: each line errs by 1 / 2 / sqrt(3100).
    assert abs(response.mean() - 2) < 0.01
    assert np.abs(response - 2).max() < 0.1


def test_noise_in_the_input_makes_the_response_smaller_by_its_share():
    x, z = noise(2, 400_000)
    response = frequency_response(x + z, 2 * x, 64, revolutions=4)[1]
    assert abs(response.mean() - 1) < 0.02


@settings(max_examples=15)
@given(n_segments=st.integers(2, 40), seed=st.integers(0, 1000))
def test_unrelated_noise_has_a_coherence_of_one_over_the_number_of_segments(n_segments, seed):
    x, y = noise(2, n_segments * 2000, seed=seed)
    shared = coherence(x, y, 100, n_per_segment=2000, overlap=0, window="boxcar", detrend=False)[1]
    inner = shared[1:-1]
    # Beta(1, n - 1) on 999 independent lines, to five standard errors.
    spread = np.sqrt((n_segments - 1) / (n_segments**2 * (n_segments + 1)))
    assert abs(inner.mean() - 1 / n_segments) < 5 * spread / np.sqrt(len(inner))


# Bins


def test_a_bin_is_the_ratio_of_integrals_and_so_never_more_than_coherent():
    x, y = noise(2, 2000)
    y += x
    plan, lines = averages_of(x, y, 50, revolutions=4)
    bins = lines.gathered(bin_operator(plan.orders, [(1, 2), (2, 25)]))
    line = plan.orders.searchsorted([1, 2])
    inside = slice(line[0], line[1] + 1)
    expected = trapezoid(lines.cross[0, inside]) / trapezoid(lines.power[0, inside])
    np.testing.assert_allclose(bins.response()[0, 0], expected, rtol=1e-12)
    assert np.all(bins.coherence() <= 1)
    assert np.all(bins.coherence() < lines.coherence()[0, 2:].max())


# What is refused


def test_a_single_segment_has_no_coherence():
    x, y = noise(2, 250)
    with pytest.raises(ValueError, match="single segment"):
        coherence(x, y, 50, revolutions=5)


@pytest.mark.parametrize("estimate", [frequency_response, coherence])
def test_a_dead_channel_is_named(estimate):
    x = noise(500)
    with pytest.raises(ValueError, match="channel 'x' has no power"):
        estimate(0 * x, x, 50, revolutions=4)


def test_where_the_mean_is_taken_out_nothing_is_coherent():
    x, y = noise(2, 4000)
    options = {"n_per_segment": 200, "overlap": 0, "window": "boxcar"}
    assert coherence(x, x + y, 50, **options)[1][0] == 0
    assert frequency_response(x, x + y, 50, **options)[1][0] == 0
