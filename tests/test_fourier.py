"""Facts about Fourier transforms of any length."""

import numpy as np
import pytest
from scipy import fft

from emacm import fourier
from emacm._kernels import using
from emacm.fourier import segments_at_once, summed_powers

# A power of two, primes within and beyond the range that is split, their multiples, a square.
LENGTHS = [8, 63, 100, 101, 131, 262, 393, 524, 655, 263, 526, 307, 311, 997, 101 * 101]


def by_scipy(signals, first, step, window, n_segments, remove_mean):
    """Sum powers the plain way."""
    cut = np.stack([signals[:, first + k * step :][:, : len(window)] for k in range(n_segments)])
    if remove_mean:
        cut = cut - cut.mean(axis=-1, keepdims=True)
    return (np.abs(fft.rfft(cut * window)) ** 2).sum(axis=0)


@pytest.mark.parametrize("n_lines", ["few", "all"])
@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-12), (np.float32, 1e-5)])
def test_powers_are_those_of_scipy_at_any_length(length, dtype, tolerance, n_lines):
    signals = np.random.default_rng(length).standard_normal((2, 3 * length)).astype(dtype)
    cut = signals, 3, length // 2, np.hanning(length).astype(dtype), 4
    wanted = length // 8 + 1 if n_lines == "few" else length // 2 + 1
    expected = by_scipy(*cut, remove_mean=True)[:, :wanted]
    found = summed_powers(*cut, wanted, remove_mean=True)
    assert found.dtype == np.float64
    np.testing.assert_allclose(found, expected, atol=tolerance * expected.max())


def test_the_mean_stays_where_it_is_wanted():
    signals = np.full((1, 524), 2.0)
    powers = summed_powers(signals, 0, 524, np.ones(524), 1, 10, remove_mean=False)
    np.testing.assert_allclose(powers[0], [(2 * 524) ** 2] + [0] * 9, atol=1e-18 * 524**4)


def test_more_segments_than_are_in_work_at_once_add_up(monkeypatch):
    signals = np.random.default_rng(0).standard_normal((2, 4096))
    cut = signals, 0, 32, np.ones(64), 127
    monkeypatch.setattr(fourier, "segments_at_once", lambda *_: 10)
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


@pytest.mark.parametrize(
    ("length", "prime"), [(524, 131), (512, 2), (997, 997), (10_201, 101), (2, 2), (77, 11)]
)
def test_the_largest_prime_of_a_length(length, prime):
    assert fourier._largest_prime(length) == prime
