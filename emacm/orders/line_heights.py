"""Spectral lines over their local background."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage


def line_heights(
    psd: NDArray[np.floating], width: int, quantile: float = 0.5
) -> NDArray[np.float64]:
    """Return each spectral line over the median of the lines around it, or another quantile.

    The height of a line does not depend on the gain of a channel, nor on the level of its noise. A
    structure that is wider than half of `width` is a background and has no height. With a lower
    quantile, it is the floor between dense lines that is the background.

    Parameters
    ----------
    psd : ndarray of shape (n_rows, n_orders)
        Order spectra [U²/order] in any unit U; they are mirrored at their ends.
    width : int
        Odd number of lines of which the quantile is taken.
    quantile : float
        In [0, 1).

    Returns
    -------
    ndarray of shape (n_rows, n_orders)
        Heights [dB]; 0 where line and background are both 0.

    Examples
    --------
    >>> line_heights(np.array([[1.0, 1.0, 100.0, 1.0, 1.0]]), 5)
    array([[ 0.,  0., 20.,  0.,  0.]])
    """
    psd, half = np.asarray(psd, dtype=np.float64), width // 2
    padded = np.pad(psd, ((0, 0), (half, half)), mode="reflect")
    # As one row, for which SciPy has a fast algorithm; the padding keeps the rows apart.
    floor = ndimage.rank_filter(padded.ravel(), int(quantile * width), size=width)
    floor = floor.reshape(padded.shape)
    tiny = np.finfo(np.float64).tiny
    heights = np.maximum(psd, tiny)
    heights /= np.maximum(floor[:, half : half + psd.shape[1]], tiny)
    np.log10(heights, out=heights)
    heights *= 10
    return heights
