"""Facts about Fourier transforms of any length."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import fft

from emacm._kernels import using
from emacm.orders import fourier
from emacm.orders.fourier import segments_at_once, summed_powers

# Powers of two, primes within and beyond the range that is split, their multiples, a square.
LENGTHS = [8, 60, 63, 64, 100, 101, 131, 262, 393, 524, 655, 263, 526, 307, 311, 997, 4 * 997]
LENGTHS += [4096, 101 * 101]
LINES = {"lowest": 1 / 16, "few": 1 / 8, "all": 1 / 2}  # of a segment's samples


def by_scipy(signals, first, step, window, n_segments, remove_mean):
    """Sum powers the plain way."""
    cut = np.stack([signals[:, first + k * step :][:, : len(window)] for k in range(n_segments)])
    if remove_mean:
        cut = cut - cut.mean(axis=-1, keepdims=True)
    return (np.abs(fft.rfft(cut * window)) ** 2).sum(axis=0)


@pytest.mark.parametrize("n_lines", LINES)
@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-12), (np.float32, 1e-5)])
def test_powers_are_those_of_scipy_at_any_length(length, dtype, tolerance, n_lines):
    signals = np.random.default_rng(length).standard_normal((2, 3 * length)).astype(dtype)
    cut = signals, 3, length // 2, np.hanning(length).astype(dtype), 4
    wanted = max(1, int(length * LINES[n_lines])) + (n_lines != "lowest")
    expected = by_scipy(*cut, remove_mean=True)[:, :wanted]
    found = summed_powers(*cut, wanted, remove_mean=True)
    assert found.dtype == np.float64
    np.testing.assert_allclose(found, expected, atol=tolerance * expected.max())


@pytest.mark.parametrize("kernels", ["numpy", "numba"])
@pytest.mark.parametrize("length", [524, 600, 4096])
def test_a_mean_far_above_a_signal_in_float32_leaves_no_more_than_the_rounding(length, kernels):
    if kernels == "numba":
        pytest.importorskip("numba", reason="numba is not installed (extra 'fast')")
    tone = np.cos(2 * np.pi * 10 / length * np.arange(4 * length))
    signals = (1e4 + tone).astype(np.float32)[np.newaxis]
    cut = 0, length, np.hanning(length).astype(np.float32), 4
    with using(kernels):
        found = summed_powers(signals, *cut, length // 16, remove_mean=True)
    expected = by_scipy(signals.astype(float), *cut, remove_mean=True)[:, : length // 16]
    np.testing.assert_allclose(found, expected, atol=1e-6 * expected.max())


@given(
    quarter=st.integers(16, 300),
    share=st.floats(0, 1),
    step=st.integers(1, 500),
    window=st.sampled_from([np.ones, np.hanning, np.kaiser]),
    remove_mean=st.booleans(),
    seed=st.integers(0, 1000),
)
def test_the_lowest_lines_are_those_of_scipy(quarter, share, step, window, remove_mean, seed):
    length = 4 * quarter
    weights = window(length, 8.0) if window is np.kaiser else window(length)
    signals = np.random.default_rng(seed).standard_normal((3, length + 4 * step))
    n_lines = max(1, int(share * length / 16))
    cut = signals, 0, step, weights, 5
    expected = by_scipy(*cut, remove_mean=remove_mean)
    found = summed_powers(*cut, n_lines, remove_mean=remove_mean)
    np.testing.assert_allclose(found, expected[:, :n_lines], atol=1e-13 * expected.max(), rtol=0)


@pytest.mark.parametrize("length", [64, 512, 4096])
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 2e-14), (np.float32, 3e-7)])
def test_no_tone_above_the_lines_wanted_is_found_among_them(length, dtype, tolerance):
    n_lines = length // 16
    orders = np.arange(n_lines, length // 2)
    if len(orders) > 300:  # those next to where lines fold onto the wanted ones, and some others
        folding = np.abs(orders - length // 4 * np.round(4 * orders / length)) < n_lines
        orders = np.union1d(orders[folding], orders[::7])
    turns = np.outer(orders, np.arange(length)) % length / length
    tones = np.sin(2 * np.pi * turns + 1).astype(dtype)
    powers = summed_powers(tones, 0, length, np.ones(length), 1, n_lines, remove_mean=False)
    assert np.sqrt(powers.max()) < tolerance * length / 2


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-12), (np.float32, 2e-6)])
def test_each_of_the_lowest_lines_has_the_power_of_its_tone(dtype, tolerance):
    lines = np.arange(1, 32)
    tones = np.sin(2 * np.pi / 512 * np.outer(lines, np.arange(512))).astype(dtype)
    powers = summed_powers(tones, 0, 512, np.ones(512), 1, 32, remove_mean=True)
    expected = 256.0**2 * np.eye(32)[1:]
    np.testing.assert_allclose(powers, expected, atol=tolerance * 256**2)


def test_the_mean_stays_where_it_is_wanted():
    signals = np.full((1, 524), 2.0)
    powers = summed_powers(signals, 0, 524, np.ones(524), 1, 10, remove_mean=False)
    np.testing.assert_allclose(powers[0], [(2 * 524) ** 2] + [0] * 9, atol=1e-18 * 524**4)


@pytest.mark.parametrize("at_once", [1, 3, 10, 126])
def test_more_segments_than_are_in_work_at_once_add_up(monkeypatch, at_once):
    signals = np.random.default_rng(0).standard_normal((2, 4096))
    cut = signals, 0, 32, np.ones(64), 127
    monkeypatch.setattr(fourier, "segments_at_once", lambda *_: at_once)
    np.testing.assert_allclose(
        summed_powers(*cut, 33, remove_mean=False), by_scipy(*cut, remove_mean=False), rtol=1e-11
    )


def test_at_least_one_segment_is_in_work():
    assert segments_at_once(np.empty((3, 8)), 1 << 40) == 1


@pytest.mark.parametrize("length", [524, 262, 131])
def test_a_length_with_a_large_prime_is_split_where_loops_are_compiled(monkeypatch, length):
    pytest.importorskip("numba", reason="numba is not installed (extra 'fast')")
    asked = []
    original = fourier.fft.rfft
    monkeypatch.setattr(fourier.fft, "rfft", lambda *a, **k: asked.append(1) or original(*a, **k))
    cut = np.ones((1, length)), 0, length, np.ones(length), 1, 10
    with using("numba"):
        summed_powers(*cut, remove_mean=False)
        assert not asked
    with using("numpy"):
        summed_powers(*cut, remove_mean=False)
        assert asked


@pytest.mark.parametrize("n_segments", [1, 2])
def test_a_quarter_is_transformed_for_the_lowest_lines_where_loops_are_compiled(
    monkeypatch, n_segments
):
    pytest.importorskip("numba", reason="numba is not installed (extra 'fast')")
    lengths = []

    def noting(transform):
        def noted(segments, *args, **kwargs):
            lengths.append(segments.shape[-1])
            return transform(segments, *args, **kwargs)

        return noted

    cut = np.ones((1, 8192)), 0, 4096, np.ones(4096), n_segments
    with using("numba"):
        summed_powers(*cut, 256, remove_mean=False)  # works out the low pass, by a transform
        for name in ("fft", "rfft"):
            monkeypatch.setattr(fourier.fft, name, noting(getattr(fourier.fft, name)))
        summed_powers(*cut, 256, remove_mean=False)
        summed_powers(*cut, 257, remove_mean=False)
    with using("numpy"):
        summed_powers(*cut, 256, remove_mean=False)
    assert lengths == [1024, 4096, 4096]


@pytest.mark.parametrize("kernels", ["numpy", "numba"])
@pytest.mark.parametrize("n_segments", [1, 2, 3, 8])
@pytest.mark.parametrize("length", [9, 16, 75, 128])
def test_segments_may_be_odd_in_number_and_in_length(kernels, n_segments, length):
    pytest.importorskip(kernels)
    signals = 3 + np.random.default_rng(0).standard_normal((3, 8 * length))
    cut = signals, 2, length // 2, np.hanning(length), n_segments
    with using(kernels):
        found = summed_powers(*cut, length // 2 + 1, remove_mean=True)
    np.testing.assert_allclose(found, by_scipy(*cut, remove_mean=True), rtol=1e-11, atol=1e-20)


@pytest.mark.parametrize(
    ("length", "prime"), [(524, 131), (512, 2), (997, 997), (10_201, 101), (2, 2), (77, 11)]
)
def test_the_largest_prime_of_a_length(length, prime):
    assert fourier._largest_prime(length) == prime
