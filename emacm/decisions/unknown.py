"""The unknown state: a true state without recordings, "Unhealthy - Unknown" in Eq. (2.35) of [1]_.

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, section 2.2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SMALL = 1e-4  # logarithm below which the quotient of differences loses digits


def evidence_for_unknown(typicality: Array) -> Array:
    """Return the Bayes factor for the unknown state against the known ones.

    The typicality p of known recordings is uniform; that of unknown ones has the density
    ``xi p^(xi - 1)`` with an unknown xi, uniform in (0, 1). The ratio of both densities is
    ``(1 - p + p log p) / (p log(p)^2)`` [1]_. Its mean over known recordings is 1, so that it does
    not exaggerate; -1 / (e p log p) [2]_ is an upper bound over all xi, with a mean above 1.

    Parameters
    ----------
    typicality : ndarray
        In (0, 1], of any shape.

    Returns
    -------
    ndarray of the shape of `typicality`
        Between 0.5, for the most typical recording, and infinity.

    References
    ----------
    .. [1] Vovk and Wang, E-values: calibration, combination and applications, Annals of
       Statistics 49 (2021), section 2.
    .. [2] Sellke, Bayarri and Berger, Calibration of p values for testing precise null
       hypotheses, The American Statistician 55 (2001).

    Examples
    --------
    >>> evidence_for_unknown(np.array([1.0, 0.1, 0.01, 0.0001])).round(2)
    array([  0.5 ,   1.26,   4.45, 117.76])
    """
    surprise = -np.log(typicality)
    small = surprise < _SMALL
    safe = np.where(small, 1.0, surprise)
    return np.where(small, 0.5 + surprise / 6, (np.expm1(safe) - safe) / safe**2)


def unknown_probability(typicality: Array, prior: float) -> Array:
    """Return the probability of the unknown state, by Bayes' rule.

    Parameters
    ----------
    typicality : ndarray
        In (0, 1], of any shape.
    prior : float
        Of the unknown state, 0 to 1.

    Returns
    -------
    ndarray of the shape of `typicality`

    Examples
    --------
    >>> unknown_probability(np.array([1.0, 0.01, 1e-6]), 0.01).round(3)
    array([0.005, 0.043, 0.981])
    """
    unknown = prior * evidence_for_unknown(typicality)
    return unknown / (1 - prior + unknown)
