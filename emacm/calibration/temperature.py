"""Temperature of posteriors: calibration of over-confident densities on left-out groups."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.special import logsumexp

Array = NDArray[np.float64]


def fit_temperature(
    log_densities: Array, codes: NDArray[np.intp], weight: Array, priors: Array
) -> float:
    """Return the temperature of least log loss, with posteriors ``prior * density ** (1 / T)``.

    Correlated features, and recordings that are near copies, make densities over-confident; a
    temperature above 1 widens them [1]_. Priors are not scaled, so that they keep their meaning
    when they change. The log loss is convex in 1 / T.

    Parameters
    ----------
    log_densities : ndarray of shape (n_recordings, n_classes)
        Of recordings under models that were fitted without them; -inf for classes that these
        models do not contain.
    codes : ndarray of shape (n_recordings,)
        Number of the true class, with a finite log density.
    weight : ndarray of shape (n_recordings,)
        Number of times each recording is counted.
    priors : ndarray of shape (n_classes,)
        Prior probabilities, positive.

    Returns
    -------
    float
        Between 1e-6 and 1e6; 1 if there are no recordings, or one class only.

    References
    ----------
    .. [1] Guo, Pleiss, Sun and Weinberger, On calibration of modern neural networks, ICML 2017.

    Examples
    --------
    >>> logs = 10 * np.array([[0.0, -1.0], [-1.0, 0.0], [0.0, -1.0], [0.0, -1.0]])
    >>> round(fit_temperature(logs, np.array([0, 1, 0, 1]), np.ones(4), np.full(2, 0.5)), 3)
    9.102
    """
    if not len(codes) or log_densities.shape[1] < 2:
        return 1.0
    own = np.arange(len(codes)), codes
    with np.errstate(divide="ignore"):
        log_priors = np.log(priors)
    scores = log_densities - log_densities[own][:, np.newaxis]

    def log_loss(log_temperature: float) -> float:
        joint = scores * np.exp(-log_temperature) + log_priors
        return float(weight @ (logsumexp(joint, axis=1) - log_priors[codes]))

    # Unimodal over the logarithm; the bounds are beyond every calibration that makes sense.
    found = minimize_scalar(log_loss, bounds=np.log([1e-6, 1e6]), options={"xatol": 1e-8})
    return float(np.exp(found.x))
