"""The lowest lines of the Fourier transform of segments, at any length.

`scipy.fft` is as fast as anything where a length has small factors only. Segments are cut to a
wanted number of revolutions, so their length is what it is: 524 samples are 4 times 131, and that
prime makes the transform four times as slow as that of 512. Such a length is split by the prime
factor algorithm (Good 1958, Thomas 1963), and the transforms of prime length are done as products
with cosines and sines, of real signals folded about their middle.
"""

from __future__ import annotations

from functools import lru_cache
from math import gcd
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from emacm._kernels import kernels

# Measured: outside of these ranges, and without compiled kernels, scipy.fft is faster.
_LEAST_PRIME, _LARGEST_PRIME, _MOST_PARTS = 101, 310, 4
_PRODUCT = 250_000  # multiplications in one product: more, and the library would start threads


def lowest_lines(segments: NDArray[np.floating], n_lines: int) -> NDArray[np.complexfloating]:
    """Return the first lines of the Fourier transform of real segments.

    Parameters
    ----------
    segments : ndarray of shape (..., length)
        May be overwritten.
    n_lines : int
        Lines wanted, at most ``length // 2 + 1``.

    Returns
    -------
    ndarray of shape (..., n_lines)
        As the first columns of `scipy.fft.rfft`.

    Examples
    --------
    >>> segments = np.random.default_rng(0).standard_normal((3, 524))
    >>> bool(np.allclose(lowest_lines(segments, 200), fft.rfft(segments)[:, :200]))
    True
    """
    split = _split(segments.shape[-1], n_lines, segments.dtype.str)
    if split is None or not kernels().COMPILED:
        return fft.rfft(segments, overwrite_x=True)[..., :n_lines]
    rows = np.ascontiguousarray(segments).reshape(-1, segments.shape[-1])
    even, odd = kernels().fold(rows, split.places)
    real = _product(even, split.cosines)
    imaginary = _product(odd, split.sines)
    lines = kernels().join(real, imaginary, split.twiddles)
    return lines.reshape(*segments.shape[:-1], n_lines)


class _Split(NamedTuple):
    """How a length a * p, p a prime that does not divide a, is split.

    Attributes
    ----------
    places : ndarray of shape (a, p)
        Which sample stands where: Good's map.
    cosines, sines : ndarray of shape (p // 2 + 1, p // 2 + 1)
        Of the products of sample and line.
    twiddles : ndarray of shape (a, n_lines)
        Factors with which the parts are joined.
    """

    places: NDArray[np.int32]
    cosines: NDArray[np.floating]
    sines: NDArray[np.floating]
    twiddles: NDArray[np.complexfloating]


@lru_cache(maxsize=64)
def _split(length: int, n_lines: int, dtype: str) -> _Split | None:
    """Work out how to split a length, or None where scipy.fft is faster."""
    prime = _largest_prime(length)
    others = length // prime
    small = others <= _MOST_PARTS and gcd(others, prime) == 1
    if not (small and _LEAST_PRIME <= prime <= _LARGEST_PRIME):
        return None
    part, sample = np.arange(others)[:, np.newaxis], np.arange(prime)
    places = ((prime * part + others * sample) % length).astype(np.int32)
    folded = np.arange(prime // 2 + 1)
    # Multiples of the whole are taken off first, as sin and cos of large angles are less exact.
    angles = 2 * np.pi / prime * (np.outer(folded, folded) % prime)
    turns = np.outer(np.arange(others), np.arange(n_lines)) % others
    return _Split(
        places,
        np.cos(angles).astype(dtype),
        np.sin(angles).astype(dtype),
        np.exp(-2j * np.pi / others * turns).astype(np.result_type(dtype, np.complex64)),
    )


def _largest_prime(number: int) -> int:
    largest, factor = 1, 2
    while factor * factor <= number:
        while number % factor == 0:
            largest, number = factor, number // factor
        factor += 1
    return max(largest, number)


def _product(rows: NDArray[np.floating], matrix: NDArray[np.floating]) -> NDArray[np.floating]:
    """Multiply rows (..., n) by a matrix (n, n), a few rows in each call of the library."""
    flat = rows.reshape(-1, rows.shape[-1])
    at_once = max(8, _PRODUCT // matrix.size // 8 * 8)
    product = np.empty_like(flat)
    whole = len(flat) - len(flat) % at_once
    stack = (-1, at_once, matrix.shape[0])
    np.matmul(flat[:whole].reshape(stack), matrix, out=product[:whole].reshape(stack))
    if whole < len(flat):
        np.matmul(flat[whole:], matrix, out=product[whole:])
    return product.reshape(rows.shape)
