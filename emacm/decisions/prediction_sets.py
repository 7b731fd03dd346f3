"""Sets of classes that contain the true one with a stated probability, by left-out units.

References
----------
.. [1] Dunn, Wasserman and Ramdas, Distribution-free prediction sets for two-layer hierarchical
   models, Journal of the American Statistical Association 118, 2023: pooling of distributions.
.. [2] Podkopaev and Ramdas, Distribution-free uncertainty quantification for classification under
   label shift, UAI 2021.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

Array = NDArray[np.float64]


class LeftOutDensities(NamedTuple):
    """Densities of recordings under models that were fitted without their units.

    Attributes
    ----------
    log_densities : ndarray of shape (n_recordings, n_classes)
        -inf for classes that the model does not contain.
    codes, units : ndarray of int, shape (n_recordings,)
        Number of the true class, whose density is finite, and of the unit.
    """

    log_densities: Array
    codes: NDArray[np.intp]
    units: NDArray[np.intp]


def classes_above(posterior: Array, threshold: float) -> NDArray[np.bool_]:
    """Return the most probable class, and all that are at least as probable as a threshold.

    Examples
    --------
    >>> classes_above(np.array([[0.8, 0.15, 0.05], [0.5, 0.3, 0.2]]), 0.3).astype(int)
    array([[1, 0, 0],
           [1, 1, 0]])
    """
    return (posterior >= threshold) | (posterior == posterior.max(axis=1, keepdims=True))


def probability_threshold(
    left_out: LeftOutDensities, priors: Array, temperature: float, coverage: float
) -> float:
    """Return the largest threshold for which `classes_above` contains the true class often enough.

    Recordings of one unit are not independent, units are exchangeable: the distributions of the
    units are pooled with equal weights, [1]_ of the module. The classes have the weights of the
    priors, [2]_.

    Parameters
    ----------
    left_out : LeftOutDensities
        Of the training recordings.
    priors : ndarray of shape (n_classes,)
        Prior probabilities in service.
    temperature : float
        Of the posteriors.
    coverage : float
        Fraction of recordings of new units whose set is to contain the true class.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If there are fewer than coverage / (1 - coverage) units.
    """
    numbers = np.unique(left_out.units, return_inverse=True)[1]
    n_units = int(numbers.max()) + 1
    needed = int(np.ceil(coverage / (1 - coverage) - 1e-9))
    if n_units < needed:
        raise ValueError(
            f"{n_units} units cannot support a coverage of {coverage:g}, which takes at least "
            f"{needed}; {n_units} units support at most {n_units / (n_units + 1):.3g}. Fit with "
            f"more units, or give a smaller coverage."
        )
    with np.errstate(divide="ignore"):
        posterior = softmax(left_out.log_densities / temperature + np.log(priors), axis=1)
    own = posterior[np.arange(len(posterior)), left_out.codes]
    own[own == posterior.max(axis=1)] = 1.0  # always in the set
    weight = 1 / np.bincount(numbers)[numbers]
    shares = np.bincount(left_out.codes, weight, len(priors))
    weight = (
        weight
        * np.divide(priors, shares, out=np.zeros_like(shares), where=shares > 0)[left_out.codes]
    )
    order = np.argsort(-own)
    covered = np.cumsum(weight[order]) / weight.sum()
    return float(own[order[np.argmax(covered >= coverage - 1e-9)]])
