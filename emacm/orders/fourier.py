"""Powers of the lowest spectral lines of segments, summed over segments, at any length.

`scipy.fft` is as fast as anything where a length has small factors only. Segments are cut to a
wanted number of revolutions, so their length is what it is: 524 samples are 4 times 131, and that
prime makes the transform four times as slow as that of 512. Such a length is split by the prime
factor algorithm (Good 1958, Thomas 1963): transformed over the 4 first, and the transforms of prime
length are done as products with cosines and sines, of real signals folded about their middle.

Where loops are compiled, real segments are transformed two at a time, as the real and the imaginary
part of one: the sum of their powers at a line is half of that of the pair's at this line and at its
mirror image, which is all that is wanted. It is done in place.

Where only the lowest lines are wanted, a segment is thinned first: passed, as if it went round,
through a short low pass, of which every fourth value is transformed,

    y_m = sum_n h_(n - 4 m) z_(n mod L),    |Y_k| = |H_k Z_k + H_(k + L/4) Z_(k + L/4) + ...| / 4.

H is the transform of the very taps, so that dividing by it is exact, and less than 2e-14 of a line
folds onto those wanted (in float32: 3e-7). To convolve by Kaiser and Bessel's function, to
transform fewer points and to divide is the gridding of magnetic resonance imaging (Jackson, Meyer,
Nishimura and Macovski, IEEE Trans. Med. Imaging 10(3), 473-478, 1991), here of points that are even
already.
"""

from __future__ import annotations

from functools import lru_cache
from math import gcd
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from emacm._kernels import kernels
from emacm.shaft.motion import parts

# Measured: outside of these ranges, and without compiled kernels, scipy.fft is faster.
_LEAST_PRIME, _LARGEST_PRIME, _MOST_PARTS = 101, 310, 4
_PRODUCT = 250_000  # multiplications in one product: more, and the library would start threads
# Of the low pass; tests measure what it lets fold onto the lines wanted.
_THINNED = 4  # samples for each one that is kept
_MOST_LINES = 1 / 16  # of the samples: half of what those that are kept could tell apart
_WIDTHS = {"float64": 16, "float32": 8}  # in samples kept; what folds is 1e-14 and 2e-7
_SHAPE = 0.98  # of the Kaiser-Bessel function whose stop band begins where the first line folds
_LEAST_THINNED = 64  # samples; the low pass must not be longer


def summed_powers(
    signals: NDArray[np.floating],
    first: int,
    step: int,
    window: NDArray[np.floating],
    n_segments: int,
    n_lines: int,
    *,
    remove_mean: bool,
) -> NDArray[np.floating]:
    """Sum the squared size of the first spectral lines over segments.

    Parameters
    ----------
    signals : ndarray of shape (n_signals, n_angles)
    first : int
        Start of the first segment.
    step : int
        Samples from one segment to the next.
    window : ndarray of shape (length,)
        Weights of a segment's samples.
    n_segments : int
        How many; the last one ends within the signals.
    n_lines : int
        Lines wanted, at most ``length // 2 + 1``.
    remove_mean : bool
        Subtract the mean of each segment first.

    Returns
    -------
    ndarray of shape (n_signals, n_lines)
        In float64, of float32 signals too.

    Examples
    --------
    >>> signals = np.random.default_rng(0).standard_normal((2, 524))
    >>> window = np.ones(524)
    >>> powers = summed_powers(signals, 0, 524, window, 1, 200, remove_mean=False)
    >>> bool(np.allclose(powers, np.abs(fft.rfft(signals)[:, :200]) ** 2))
    True
    """
    window = window.astype(signals.dtype, copy=False)
    length = len(window)
    thinning = None
    if kernels().COMPILED:
        split = _split(length, n_lines, signals.dtype.str)
        if split is not None:
            total = kernels().split_powers(
                signals, first, step, window, n_segments, remove_mean, *split.tables
            )
            return np.take(total.reshape(len(signals), -1), split.lines, axis=1)
        thinning = _thinning(length, n_lines, signals.dtype.str)
    taps, gains = thinning or (None, 1.0)
    in_pairs = taps is not None or (kernels().COMPILED and n_segments > 1)
    together, n_kept = 1 + in_pairs, length if taps is None else length // _THINNED
    total = np.zeros((len(signals), n_lines))
    at_once = max(1, segments_at_once(signals, n_kept) // together)
    for start, stop in parts(0, -(-n_segments // together), at_once):
        begin, end = together * start, min(together * stop, n_segments)
        cut = signals, first + begin * step, step, window, end - begin, remove_mean
        total += _pair_powers(cut, n_lines, taps) if in_pairs else _powers(cut, n_lines)
    return total * gains


def _powers(cut: tuple[Any, ...], n_lines: int) -> NDArray[np.floating]:
    lines = fft.rfft(kernels().windowed(*cut), overwrite_x=True)
    return kernels().powers(lines[..., :n_lines])


def _pair_powers(
    cut: tuple[Any, ...], n_lines: int, taps: NDArray[np.floating] | None
) -> NDArray[np.floating]:
    pairs = kernels().paired(*cut) if taps is None else kernels().thinned(*cut, taps)
    return kernels().pair_powers(fft.fft(pairs, overwrite_x=True), n_lines)


def segments_at_once(signals: NDArray[np.floating], length: int) -> int:
    """Return how many segments of each signal fit into the processor's cache."""
    return max(1, kernels().SEGMENT_BYTES // (signals.itemsize * length) // len(signals))


class _Split(NamedTuple):
    """How a length a * p, p a prime that does not divide a, is split.

    Attributes
    ----------
    tables : tuple
        Of arrays ``places`` of shape (a, p), which sample stands where (Good's map); ``mix``,
        (a, a), the transform over parts in real numbers: line 0, real and imaginary part of lines
        1, 2, ..., and of an even a the middle line; ``cosines`` and ``sines``,
        (p // 2 + 1, p // 2 + 1), of products of sample and line; and of how many segments go into
        one product of matrices.
    lines : ndarray of shape (n_lines,)
        Where the powers of the lines stand in what `split_powers` returns, made flat.
    """

    tables: tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any], int]
    lines: NDArray[np.intp]


@lru_cache(maxsize=64)
def _split(length: int, n_lines: int, dtype: str) -> _Split | None:
    """Work out how to split a length, or None where scipy.fft is faster."""
    prime = _largest_prime(length)
    others = length // prime
    small = others <= _MOST_PARTS and gcd(others, prime) == 1
    if not (small and _LEAST_PRIME <= prime <= _LARGEST_PRIME):
        return None
    part, sample = np.arange(others)[:, np.newaxis], np.arange(prime)
    places = ((prime * part + others * sample) % length).astype(np.uint32)
    folded = np.arange(prime // 2 + 1)
    # Multiples of the whole are taken off first, as sin and cos of large angles are less exact.
    angles = 2 * np.pi / prime * (np.outer(folded, folded) % prime)
    tables = [_mixed(others), np.cos(angles), np.sin(angles)]
    at_once = max(1, _PRODUCT // len(folded) ** 2 // others)
    return _Split(
        (places, *(table.astype(dtype) for table in tables), at_once),
        _places_of_lines(np.arange(n_lines), others, prime),
    )


def _mixed(n_parts: int) -> NDArray[np.floating]:
    """Return the real transform of a few parts: a row for each real and imaginary part."""
    unit = np.exp(-2j * np.pi / n_parts * (np.outer(np.arange(n_parts), np.arange(n_parts))))
    rows = [unit[0].real]
    for line in range(1, (n_parts + 1) // 2):
        rows += [unit[line].real, unit[line].imag]
    return np.stack(rows if n_parts % 2 else [*rows, unit[n_parts // 2].real])


def _places_of_lines(lines: NDArray[np.intp], n_parts: int, prime: int) -> NDArray[np.intp]:
    """Find lines by their remainders; where that of the parts is beyond the middle, by -line."""
    of_parts = lines % n_parts
    of_prime = np.where(of_parts > n_parts // 2, -lines, lines) % prime
    of_parts = np.minimum(of_parts, n_parts - of_parts)
    size = np.minimum(of_prime, prime - of_prime)
    # Lines of real parts are alike for either sign, and stand under the first.
    below = (of_prime > size) & (of_parts > 0) & (2 * of_parts < n_parts)
    return np.ravel_multi_index((of_parts, below, size), (n_parts // 2 + 1, 2, prime // 2 + 1))


@lru_cache(maxsize=64)
def _thinning(
    length: int, n_lines: int, dtype: str
) -> tuple[NDArray[np.floating], NDArray[np.floating]] | None:
    """Work out taps and gains of the lines' powers, or None where scipy.fft is faster.

    Shapes (n_taps,) and (n_lines,).
    """
    if length % _THINNED or length < _LEAST_THINNED or n_lines > length * _MOST_LINES:
        return None
    n_kept, width = length // _THINNED, _WIDTHS[np.dtype(dtype).name]
    # sinh(sqrt(shape² - w²)) / sqrt(shape² - w²), the transform (Jackson et al.), is small beyond
    # w = shape; w is the turn within half a width, here that of the first line that folds.
    shape = _SHAPE * np.pi * width * (1 - (n_lines - 1) / n_kept)
    n_taps = _THINNED * width
    place = (2 * np.arange(n_taps) + 1) / n_taps - 1
    taps = np.i0(shape * np.sqrt(1 - place**2)) / np.i0(shape)
    taps = taps.astype(dtype)
    response = fft.rfft(taps.astype(np.float64), length)[:n_lines]
    gains = _THINNED**2 / (response.real**2 + response.imag**2)
    return taps, gains


def _largest_prime(number: int) -> int:
    largest, factor = 1, 2
    while factor * factor <= number:
        while number % factor == 0:
            largest, number = factor, number // factor
        factor += 1
    return max(largest, number)
