"""Differences between units: a mixed model with a random effect of each unit.

A recording of unit u in class k is z = m_k + b_u + e. The offset b_u of a unit is the same in all
classes, with covariance B over the units; e varies from recording to recording with covariance W.
Along suitable directions both are uncorrelated, and each direction is a model of its own.

References
----------
.. [1] Searle, Casella and McCulloch, Variance Components, Wiley 1992: section 5.5 (Henderson's
   method of fitting constants) and chapter 7 (best linear unbiased prediction).
.. [2] Amemiya, What should be done when an estimated between-group covariance matrix is not
   nonnegative definite?, The American Statistician 39 (2), 1985.
.. [3] Paule and Mandel, Consensus values and weighting factors, Journal of Research of the National
   Bureau of Standards 87 (5), 1982.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from emacm.calibration.left_out import Array, Indices
from emacm.decisions.gaussians import (
    GaussianClasses,
    inverse_factor,
    population_eigenvalues,
    shrink,
)


class UnitLevels(NamedTuple):
    """Estimates for a new unit: its level m_k + b in each class.

    Attributes
    ----------
    directions : ndarray of shape (n_features, n_features)
        D, with W = D D' and B diagonal: coordinates along its columns are independent.
    means : ndarray of shape (n_features, n_classes)
        Expected coordinate, along each direction, of the level in each class.
    variances : ndarray of shape (n_features, n_classes)
        Its variance along each direction, where that within a unit is 1.
    """

    directions: Array
    means: Array
    variances: Array

    def gaussians(self) -> GaussianClasses:
        """Return the densities of a recording of the unit in each class."""
        total = 1 + np.maximum(self.variances.T, 0.0)[:, np.newaxis, :]  # rounding leaves -1e-17
        inverse = np.linalg.inv(self.directions).T
        determinants = 2 * np.linalg.slogdet(self.directions)[1] + np.log(total).sum(axis=(1, 2))
        return GaussianClasses(
            self.means.T @ self.directions.T,
            (self.directions * total) @ self.directions.T,
            inverse / np.sqrt(total),
            determinants,
            np.zeros(len(total), bool),
        )


class UnitScatter(NamedTuple):
    """Scatter of recordings about the means of their classes, divided into two parts.

    Attributes
    ----------
    within, between : ndarray of shape (n_features, n_features)
        Mean squares within units, and of what the offsets of the units explain.
    between_divisor : int
        Degrees of freedom of the second.
    multiplicity : float
        Effective number of recordings of a unit, n: the expected values are W and W + n B.
    """

    within: Array
    between: Array
    between_divisor: int
    multiplicity: float


def unit_scatter(X: Array, codes: Indices, units: Indices) -> UnitScatter:
    """Divide the scatter about class means by Henderson's method of fitting constants, [1]_.

    Parameters
    ----------
    X : ndarray of shape (n_recordings, n_features)
        Features.
    codes, units : ndarray of int, shape (n_recordings,)
        Number of the class, and of the unit, of each recording; none is left out.

    Returns
    -------
    UnitScatter

    Raises
    ------
    ValueError
        If no class was recorded on several units, or no unit has several recordings.

    Examples
    --------
    >>> X = np.array([[1.0], [3.0], [5.0], [7.0]])
    >>> parts = unit_scatter(X, np.zeros(4, int), np.array([0, 0, 1, 1]))
    >>> parts.within.round(9), parts.between.round(9), parts.multiplicity
    (array([[2.]]), array([[16.]]), 2.0)
    """
    classes = np.eye(codes.max() + 1)[codes]
    counts = _sums(classes, units)
    sizes, totals = counts.sum(axis=1, keepdims=True), counts.sum(axis=0)
    deviations = X - (_sums(X, codes) / totals[:, np.newaxis])[codes]
    inside = deviations - (_sums(deviations, units) / sizes)[units]
    classes_inside = classes - (counts / sizes)[units]
    fitted, _, rank, _ = np.linalg.lstsq(classes_inside, inside, rcond=None)
    rest = inside - classes_inside @ fitted
    explained = deviations - rest
    rank += len(counts)  # of the classes and the units together
    within, between = len(X) - int(rank), int(rank) - len(totals)
    if between < 1:
        raise ValueError(
            "no class was recorded on two units, so that units and classes cannot be told apart. "
            "Record one class on two units, or use CostSensitiveGaussianBayes."
        )
    if within < 1:
        raise ValueError(
            "no unit has recordings beyond one, so that the variance within units is unknown. "
            "Record units several times, or use CostSensitiveGaussianBayes."
        )
    shared = float(np.sum(counts**2 / totals))
    return UnitScatter(
        rest.T @ rest / within,
        explained.T @ explained / between,
        between,
        (len(X) - shared) / between,
    )


def fit_unit_levels(
    X: Array, codes: Indices, units: Indices, plain: Array, *shrinkage: ArrayLike
) -> UnitLevels:
    """Estimate what is known of a new unit before any recording of it.

    Both mean squares of `unit_scatter` are shrunk like the covariance of the classifier. The
    eigenvalues of that between units, which has few degrees of freedom, are corrected where W is
    the identity (`population_eigenvalues`). B is not negative along any direction, [2]_.

    Parameters
    ----------
    X, codes, units : ndarray
        As for `unit_scatter`.
    plain : ndarray of shape (n_features, n_features)
        Covariance within the classes without a difference between units: W if none is found.
    *shrinkage : array-like
        Arguments `coefficients` and `squared_scales` of `shrink`.

    Returns
    -------
    UnitLevels

    Raises
    ------
    ValueError
        As `unit_scatter`, or if W is singular.
    """
    parts = unit_scatter(X, codes, units)
    within, between = (shrink(part[np.newaxis], *shrinkage)[0] for part in parts[:2])
    white, of_plain = inverse_factor(within), inverse_factor(plain)
    if white is None or of_plain is None:
        raise ValueError(
            f"the covariance within units is singular, for {X.shape[1]} features and {len(X)} "
            f'recordings. Use shrinkage="auto", more recordings of each unit or fewer features.'
        )
    mean_square = white[0].T @ between @ white[0]
    values, vectors = np.linalg.eigh(mean_square)
    values = population_eigenvalues(values, parts.between_divisor)
    ratios = np.maximum(values - 1, 0) / parts.multiplicity
    directions = within @ white[0] @ vectors if ratios.any() else plain @ of_plain[0]
    return UnitLevels(directions, *_class_levels(directions, ratios, X, codes, units))


def _class_levels(
    directions: Array, ratios: Array, X: Array, codes: Indices, units: Indices
) -> tuple[Array, Array]:
    """Return means and variances of `UnitLevels` by generalised least squares.

    The uncertainty of the class means counts as far as it stems from the units: without it, classes
    recorded on different units would seem to differ by the offsets of these units.
    """
    coordinates = np.linalg.solve(directions, X.T).T
    counts = _sums(np.eye(codes.max() + 1)[codes], units)
    totals = counts.sum(axis=0)
    weight = ratios / (1 + np.outer(counts.sum(axis=1), ratios))  # (I + r Z Z')^-1, by Woodbury
    sums = _sums(coordinates, codes) - counts.T @ (weight * _sums(coordinates, units))
    information = np.diag(totals) - np.einsum("uj,uk,ul->jkl", weight, counts, counts)
    prior = _contrast_precision(information, sums)
    means = np.einsum("jkl,lj->jk", np.linalg.inv(information + prior), sums)
    excess = np.linalg.inv(information + prior) - np.linalg.inv(np.diag(totals) + prior)
    return means, np.diagonal(excess, axis1=1, axis2=2) + ratios[:, np.newaxis]


def _sums(rows: NDArray[Any], numbers: Indices) -> Array:
    """Add up the rows of each number."""
    sums = np.zeros((numbers.max() + 1, rows.shape[1]))
    np.add.at(sums, numbers, rows)
    return sums


def _contrast_precision(information: Array, sums: Array) -> Array:
    """Return the prior precision of the differences between the classes, (n_classes, n_classes).

    Where units differ much, means of classes recorded on different units differ by chance; this
    must not pass for a difference between the classes. The differences have the same variance t
    along every direction, for which sum y^2 / (t + variance of y) has its expected value [3]_.
    """
    n_classes = len(sums)
    centring = np.eye(n_classes) - 1 / n_classes
    contrasts = np.linalg.eigh(centring)[1][:, 1:]  # orthonormal, without the common level
    of_means = np.linalg.inv(information)
    variances, axes = np.linalg.eigh(contrasts.T @ of_means @ contrasts)
    means = np.einsum("jkl,lj->jk", of_means, sums) @ contrasts
    squares = np.einsum("jkl,jk->jl", axes, means) ** 2

    def excess(variance: float) -> float:
        return float(np.sum(squares / (variance + variances))) - squares.size

    smallest = 1e-6  # where the variance within a unit is 1
    if excess(smallest) <= 0:  # no difference is proven
        return centring / smallest
    return centring / brentq(excess, smallest, squares.mean())
