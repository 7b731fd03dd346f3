"""Product of the posterior probabilities of several classifiers.

References
----------
.. [1] Kittler, Hatef, Duin and Matas, On combining classifiers, IEEE Transactions on Pattern
   Analysis and Machine Intelligence 20 (3), 1998: the product rule.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp

Array = NDArray[np.float64]

# The smallest probability that a float stores in full precision. A probability that is 0 has
# underflowed, or was counted (the leaf of a tree): it is not known to be smaller.
_LEAST = float(np.log(np.finfo(np.float64).tiny))
_LOWEST = -1e300  # so that no sum of logarithms overflows


def pooled_log_posterior(
    log_posteriors: Sequence[ArrayLike], member_priors: ArrayLike, priors: ArrayLike
) -> Array:
    """Multiply the likelihoods of all members and the prior.

    The posterior of a member divided by the prior of this member is, up to a constant, the
    likelihood. The product rule [1]_ is exact if the members are independent within each class.

    Parameters
    ----------
    log_posteriors : sequence of n_members array-likes of shape (n_recordings, n_classes)
        Logarithm of the posterior of each member.
    member_priors : array-like of shape (n_members, n_classes)
        The prior within the posterior of each member.
    priors : array-like of shape (n_classes,)
        The prior of the result. A class of prior 0 stays impossible.

    Returns
    -------
    log_posterior : ndarray of shape (n_recordings, n_classes)
        Normalised. Never NaN: a posterior of exactly 0 (of a class with a prior) counts
        as the smallest positive number, or as the least of its row if that is smaller;
        members that contradict each other with certainty cancel.

    Raises
    ------
    ValueError
        If a class has a prior, but none within a member, whose posterior of it is always 0.

    References
    ----------
    .. [1] Kittler, Hatef, Duin and Matas, On combining classifiers, IEEE Transactions on Pattern
       Analysis and Machine Intelligence 20 (3), 1998.

    Examples
    --------
    Two channels, each 4:1 for the second class, whose prior is 0.5:

    >>> one = np.log([[0.2, 0.8]])
    >>> half = [0.5, 0.5]
    >>> np.exp(pooled_log_posterior([one, one], [half, half], half)).round(3)
    array([[0.059, 0.941]])
    """
    shared, own = np.asarray(priors, dtype=np.float64), np.asarray(member_priors, dtype=np.float64)
    possible = shared > 0
    impossible = np.argwhere(possible & ~(own > 0))
    if len(impossible):
        member, code = impossible[0].tolist()
        raise ValueError(
            f"class number {code} has the prior {shared[code]:g}, but 0 within member number "
            f"{member}, whose posterior of it is always 0."
        )
    pooled = np.full((len(np.asarray(log_posteriors[0])), len(shared)), -np.inf)
    pooled[:, possible] = np.log(shared[possible])
    for logs, prior in zip(log_posteriors, own, strict=True):
        # log p(k|x_1..x_m) = log P(k) + sum_j [log p_j(k|x_j) - log P_j(k)] + constant
        likelihood = _finite(np.asarray(logs, dtype=np.float64)[:, possible])
        likelihood = likelihood - np.log(prior[possible])
        pooled[:, possible] += likelihood - likelihood.max(axis=1, keepdims=True)
    return pooled - logsumexp(pooled, axis=1, keepdims=True)


def _finite(logs: Array) -> Array:
    """Replace the logarithm of 0 by that of the smallest number that it may stand for."""
    zero = np.isneginf(logs)
    least = np.where(zero, _LEAST, logs).min(axis=1, keepdims=True)
    return np.maximum(np.where(zero, least, logs), _LOWEST)
