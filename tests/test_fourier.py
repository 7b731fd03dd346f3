"""Facts about Fourier transforms of any length."""

import numpy as np
import pytest
from scipy import fft

from emacm import fourier
from emacm._kernels import using
from emacm.fourier import lowest_lines

# A power of two, primes within and beyond the range that is split, their multiples, a square.
LENGTHS = [8, 63, 100, 101, 131, 262, 393, 524, 655, 263, 526, 307, 311, 997, 101 * 101]


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-12), (np.float32, 1e-5)])
def test_lines_are_those_of_scipy_at_any_length(length, dtype, tolerance):
    segments = np.random.default_rng(length).standard_normal((2, 3, length)).astype(dtype)
    n_lines = length // 2 + 1
    expected = fft.rfft(segments)
    found = lowest_lines(segments.copy(), n_lines)
    assert found.dtype == expected.dtype
    np.testing.assert_allclose(found, expected, atol=tolerance * np.abs(expected).max())


def test_only_the_lines_wanted_are_returned():
    segments = np.random.default_rng(0).standard_normal((4, 524))
    expected = fft.rfft(segments)[:, :206]
    np.testing.assert_allclose(lowest_lines(segments, 206), expected, atol=1e-12)


@pytest.mark.parametrize("length", [524, 262, 131])
def test_a_length_with_a_large_prime_is_split_where_loops_are_compiled(monkeypatch, length):
    pytest.importorskip("numba", reason="numba is not installed (extra 'fast')")
    asked = []
    original = fourier.fft.rfft
    monkeypatch.setattr(fourier.fft, "rfft", lambda *a, **k: asked.append(1) or original(*a, **k))
    with using("numba"):
        lowest_lines(np.ones((1, length)), 10)
        assert not asked
    with using("numpy"):
        lowest_lines(np.ones((1, length)), 10)
        assert asked


@pytest.mark.parametrize(
    ("length", "prime"), [(524, 131), (512, 2), (997, 997), (10_201, 101), (2, 2), (77, 11)]
)
def test_the_largest_prime_of_a_length(length, prime):
    assert fourier._largest_prime(length) == prime
