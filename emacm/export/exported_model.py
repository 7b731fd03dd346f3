"""What a fitted pipeline computes, as numbers for a program on a controller."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaln
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.decisions.pipelines import parts_of, search_estimator
from emacm.decisions.risks import canonical_cost
from emacm.decisions.typicality import distance_scales, upper_share
from emacm.explanations.opened_pipelines import apply_step, column_responses
from emacm.orders.bin_transformer import BinTransformer
from emacm.streams.streamed_models import StreamedModel

Array = NDArray[np.floating]
_LOGARITHMS = np.log, np.log10, np.log2  # of the same names in C


class ExportedModel(StreamedModel):
    """A fitted pipeline whose steps are those that a controller can compute.

    Parameters
    ----------
    model : estimator
        Fitted pipeline, or a search over one.

    Raises
    ------
    TypeError, ValueError
        If a step or an option cannot be exported; the message names it.
    """

    classifier: Any

    def __init__(self, model: Any) -> None:
        super().__init__(model)
        final = type(self.classifier).__name__
        if type(self.classifier) is not CostSensitiveGaussianBayes:
            raise ValueError(
                f"only CostSensitiveGaussianBayes can be exported as the last step, got {final}."
            )
        for part in parts_of(search_estimator(model)):
            if isinstance(part, Pipeline | type(self.psd)) and part.memory is not None:
                raise ValueError(
                    f"memory= of {type(part).__name__} cannot be exported: a controller has no "
                    f"files. Set it to None; the results are the same."
                )
        if self.psd.plan_.detrend == "linear":
            raise ValueError('detrend="linear" of OrderPSD cannot be exported. Use "constant".')
        self.radices = radices(self.psd.plan_.n_per_segment)
        self.stages = list(self._stages())

    @cached_property
    def bins(self) -> Array:
        """Operator from the powers of a channel to its bins, shape (n_bins, n_lines)."""
        plan, first = self.psd.plan_, [*self.transformers, None][0]
        operator = np.eye(plan.n_orders)
        if isinstance(first, BinTransformer):
            n_bins = first.operator_.shape[0] // self.n_blocks
            operator = first.operator_[:n_bins, : plan.n_orders].toarray()
        n_lines = int(np.flatnonzero(operator.any(axis=0)).max(initial=0)) + 1
        scale = plan.sides / plan.window_factor(plan.weights)
        return (operator * scale)[:, :n_lines]

    @property
    def n_blocks(self) -> int:
        """Number of channels, times that of the directions that are separate."""
        return len(self.resampler.channels_) * (1 + self.psd.plan_.by_direction)

    def _stages(self) -> Iterator[tuple[Any, ...]]:
        """Yield what is applied to the bins: ("log10",), or (matrix, constant) of an affine map.

        Of a scaling, the matrix is its diagonal.
        """
        width = len(self.bins) * self.n_blocks
        for step in self.transformers:
            if step is self.transformers[0] and isinstance(step, BinTransformer):
                continue
            if isinstance(step, FunctionTransformer) and step.func in _LOGARITHMS:
                yield (step.func.__name__,)
                continue
            matrix, constant = _affine(step, width)
            width = len(constant)
            yield matrix, constant

    def gaussians(self) -> dict[str, Any]:
        """Return the tables of densities, priors and costs."""
        final = self.classifier
        final.predict_joint_log_proba(np.zeros((1, final.n_features_in_)) + final.means_[:1])
        classes, n_features = final._gaussians, final.means_.shape[1]
        determinants = np.resize(classes.log_determinants, len(final.classes_))
        with np.errstate(divide="ignore"):
            log_priors = np.log(final.priors_)
        decisions, costs = final.decisions_.tolist(), final.cost_
        return {
            "MEANS": final.means_,
            "FACTORS": classes.factors.reshape(len(classes.factors), -1),
            "LOG_SCALE": n_features * np.log(2 * np.pi) + determinants,
            "LOG_PRIORS": log_priors,
            "TEMPERATURE": final.temperature_,
            "N_GROUPS": len(classes.factors),
            "FACTOR_COLUMNS": n_features if classes.factors.ndim == 3 else 0,
            "HAS_UNKNOWN": int(final.unknown is not None),
            "UNKNOWN_ROW": -1 if final.unknown is None else decisions.index(final.unknown),
            "COST": costs,
            "CANONICAL_COST": canonical_cost(costs),
        }

    def typicality(self) -> dict[str, Any]:
        """Return the tables of the typicality; empty if the model has none."""
        known = self.classifier._typicality
        if known is None:
            return {}
        distances, tail = known.distances, known.combined
        slopes, levels = distance_scales(known.levels, known.peaks, known.used)
        degrees, total = tail.peaks.n_peaks + tail.n_expected, tail.weight_from[0] + 1
        at, mean = upper_share(degrees, tail.share)
        return {
            "CLASS_MEANS": distances.means,
            "DIRECTIONS": np.append(distances.directions.ravel(), 0.0),
            "N_DIRECTIONS": distances.directions.shape[1],
            "FACTOR": distances.factor.ravel(),
            "DEVIATIONS": distances.deviations,
            "USED": known.used.astype(int),
            "SLOPES": slopes,
            "LEVELS": levels,
            "VALUES": tail.values,
            "N_VALUES": len(tail.values),
            "SURVIVAL": (tail.weight_from + 1) / total,
            "THRESHOLD": tail.peaks.threshold,
            "DEGREES": degrees,
            "LOG_BETA": -betaln(degrees / 2, 0.5),
            "TAIL_AT": at,
            "TAIL_MEAN": mean / tail.peaks.mean_excess,
            "TAIL_SHARE": tail.share,
            "TAIL_PEAKS": (tail.peaks.n_peaks + 1) / total,
            "UNKNOWN_PRIOR": float(self.classifier.unknown_prior_),
            "UNKNOWN_LIMIT": float(self.classifier.unknown_limit_ or 0.0),
        }


def radices(length: int, largest: int = 61) -> list[int]:
    """Return the prime factors of half a segment, by which it is transformed, the largest last.

    Raises
    ------
    ValueError
        If the segment is odd, shorter than 16 samples, or has a larger prime factor.

    Examples
    --------
    >>> radices(832)
    [2, 2, 2, 2, 2, 13]
    """
    found = _prime_factors(length // 2)
    if length % 2 or length < 16 or found[-1] > largest:
        possible = (n for n in range(16, 2 * length, 2) if _prime_factors(n // 2)[-1] <= largest)
        nearest = min(possible, key=lambda n: abs(n - length), default=16)
        raise ValueError(
            f"segments of OrderPSD of {length} samples cannot be exported; the nearest that can "
            f"have {nearest}. Set n_per_segment, or revolutions or theta_s."
        )
    return found


def _prime_factors(n: int) -> list[int]:
    found, factor = [], 2
    while n > 1:
        if n % factor:
            factor += 1
        else:
            found.append(factor)
            n //= factor
    return found or [1]


def _affine(step: Any, width: int) -> tuple[Array, Array]:
    """Return matrix and constant of a step, found by applying it to unit vectors.

    Raises
    ------
    ValueError
        If the step is not an affine map of its input.
    """
    zero, probes = np.zeros((1, width)), 1e3 * np.random.default_rng(0).normal(size=(8, width))
    is_affine = False
    with suppress(Exception):  # a step that needs another input is not affine
        constant, found = apply_step(step, zero)[0], apply_step(step, probes)
        matrix = column_responses(step, zero, np.ones(width))[0]
        scale = np.abs(probes) @ np.abs(matrix) + np.abs(constant)
        is_affine = (np.abs(found - probes @ matrix - constant) <= 1e-9 * scale).all()
    if not is_affine:
        raise ValueError(
            f"the step {type(step).__name__} cannot be exported: only BinTransformer, "
            f"FunctionTransformer of a logarithm, and affine maps (scaling, PCA, a choice of "
            f"columns) can. Apply the model on a computer by OrderMonitor, or change the step."
        )
    is_scaling = len(matrix) == len(constant) and not np.any(matrix - np.diag(matrix.diagonal()))
    return matrix.diagonal() if is_scaling else matrix.T, constant
