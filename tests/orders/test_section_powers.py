"""Facts about the powers of segments, of any length."""

import numpy as np
import pytest
from scipy import fft

from emacm._kernels import using
from emacm.orders.segment_plan import SegmentPlan

pytest.importorskip("numba", reason="numba is not installed (extra 'fast')")
both_kernels = pytest.mark.parametrize("name", ["numpy", "numba"])

# Powers of two, primes, their multiples, a square.
LENGTHS = [2, 8, 60, 63, 64, 100, 101, 131, 393, 524, 526, 997, 4 * 997, 4096, 101 * 101]
LINES = {"lowest": 1 / 16, "few": 1 / 8, "all": 1 / 2}  # of a segment's samples


def segment_powers(name, signals, first, step, window, n_segments, n_lines, remove_mean):
    """Sum the powers of the lowest lines over segments, with the named loops."""
    detrend = "constant" if remove_mean else None
    plan = SegmentPlan(1.0, n_per_segment=len(window), detrend=detrend)
    plan.step, plan.n_orders, plan.weights = step, n_lines, window
    with using(name):
        return plan.section_powers(signals[:, first:], n_segments)


def by_scipy(signals, first, step, window, n_segments, remove_mean):
    """Sum powers in the simplest way."""
    cut = np.stack([signals[:, first + k * step :][:, : len(window)] for k in range(n_segments)])
    if remove_mean:
        cut = cut - cut.mean(axis=-1, keepdims=True)
    return (np.abs(fft.rfft(cut * window)) ** 2).sum(axis=0)


@both_kernels
@pytest.mark.parametrize("n_lines", LINES)
@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_powers_are_those_of_scipy_at_any_length(name, length, dtype, n_lines):
    signals = np.random.default_rng(length).standard_normal((2, 3 * length + 3)).astype(dtype)
    cut = signals, 3, max(1, length // 2), np.hanning(length + 2)[1:-1], 4
    wanted = max(1, int(length * LINES[n_lines])) + (n_lines != "lowest")
    expected = by_scipy(signals.astype(float), *cut[1:], True)[:, :wanted]
    found = segment_powers(name, *cut, wanted, True)
    assert found.dtype == np.float64
    np.testing.assert_allclose(found, expected, atol=1e-13 * expected.max(), rtol=0)


@both_kernels
@pytest.mark.parametrize("length", [524, 600, 4096])
def test_a_mean_far_above_a_signal_in_float32_changes_nothing(name, length):
    tone = np.cos(2 * np.pi * 10 / length * np.arange(4 * length))
    signals = (1e4 + tone).astype(np.float32)[np.newaxis]
    cut = 0, length, np.hanning(length), 4
    found = segment_powers(name, signals, *cut, length // 16, True)
    expected = by_scipy(signals.astype(float), *cut, True)[:, : length // 16]
    np.testing.assert_allclose(found, expected, atol=1e-12 * expected.max())


@both_kernels
def test_the_mean_is_kept_unless_it_is_to_be_removed(name):
    signals = np.full((1, 524), 2.0)
    powers = segment_powers(name, signals, 0, 524, np.ones(524), 1, 10, False)
    np.testing.assert_allclose(powers[0], [(2 * 524) ** 2] + [0] * 9, atol=1e-18 * 524**4)
