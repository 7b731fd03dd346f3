"""Posteriors of several classifiers, brought to one.

References
----------
.. [1] Chirico, A Data Driven Frequency Based Method for Electrical-Mechanical Actuator
   Condition Monitoring, chapter 5: to fuse the condition assessments of separate signals
   is named as a next step; no formula is given.
.. [2] Kittler, Hatef, Duin and Matas, On combining classifiers, IEEE Transactions on Pattern
   Analysis and Machine Intelligence 20 (3), 1998: the product rule.
.. [3] Genest and Zidek, Combining probability distributions: a critique and an annotated
   bibliography, Statistical Science 1 (1), 1986: logarithmic opinion pools.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp

Array = NDArray[np.float64]

# The least probability that a float holds in full precision. One that reads 0 has underflowed,
# or was counted (the leaf of a tree): it is not known to be smaller.
_LEAST = float(np.log(np.finfo(np.float64).tiny))
_LOWEST = -1e300  # so that no sum of logarithms overflows


def pooled_log_posterior(
    log_posteriors: Sequence[ArrayLike],
    member_priors: ArrayLike,
    priors: ArrayLike,
    weights: ArrayLike | None = None,
) -> Array:
    """Multiply what each member has learnt about a recording, and the prior, once.

    A member's posterior divided by the member's own prior is, but for a constant, the
    likelihood of what the member has seen. With weights of 1, likelihoods are multiplied: the
    product rule [2]_, exact where the members see things that are independent within
    each class. Weights are exponents of the likelihoods: the logarithmic opinion pool [3]_.

    Parameters
    ----------
    log_posteriors : sequence of n_members array-likes of shape (n_recordings, n_classes)
        Logarithm of each member's posterior.
    member_priors : array-like of shape (n_members, n_classes)
        The prior within each member's posterior.
    priors : array-like of shape (n_classes,)
        The prior of the result, once. A class of prior 0 stays impossible.
    weights : array-like of shape (n_members,), optional
        Exponents, at least 0. Default: 1 each.

    Returns
    -------
    log_posterior : ndarray of shape (n_recordings, n_classes)
        Normalised. Never NaN: a posterior of exactly 0 (of a class with a prior) counts
        as the smallest positive number, or as the least of its row if that is smaller;
        so members that contradict each other with certainty cancel.

    Raises
    ------
    ValueError
        If a class has a prior, but none within a member: its posterior of 0 says nothing.

    Examples
    --------
    Two channels, each 4:1 for the second class, whose prior is a half:

    >>> one = np.log([[0.2, 0.8]])
    >>> half = [0.5, 0.5]
    >>> np.exp(pooled_log_posterior([one, one], [half, half], half)).round(3)
    array([[0.059, 0.941]])

    Were they one channel given twice, weights of a half would return it:

    >>> np.exp(pooled_log_posterior([one, one], [half, half], half, [0.5, 0.5])).round(3)
    array([[0.2, 0.8]])
    """
    shared, own = np.asarray(priors, dtype=np.float64), np.asarray(member_priors, dtype=np.float64)
    possible = shared > 0
    mute = np.argwhere(possible & ~(own > 0))
    if len(mute):
        member, code = mute[0].tolist()
        raise ValueError(
            f"class number {code} has the prior {shared[code]:g}, but 0 within member number "
            f"{member}, whose posterior of it is 0 whatever is recorded."
        )
    exponents = np.ones(len(own)) if weights is None else np.asarray(weights, dtype=np.float64)
    pooled = np.full((len(np.asarray(log_posteriors[0])), len(shared)), -np.inf)
    pooled[:, possible] = np.log(shared[possible])
    for logs, prior, exponent in zip(log_posteriors, own, exponents, strict=True):
        # log p(k|x_1..x_m) = log P(k) + sum_j [log p_j(k|x_j) - log P_j(k)] + constant
        evidence = _finite(np.asarray(logs, dtype=np.float64)[:, possible]) - np.log(
            prior[possible]
        )
        pooled[:, possible] += exponent * (evidence - evidence.max(axis=1, keepdims=True))
    return pooled - logsumexp(pooled, axis=1, keepdims=True)


def _finite(logs: Array) -> Array:
    """Replace the logarithm of 0 by that of the smallest number that it may stand for."""
    zero = np.isneginf(logs)
    least = np.where(zero, _LEAST, logs).min(axis=1, keepdims=True)
    return np.maximum(np.where(zero, least, logs), _LOWEST)
