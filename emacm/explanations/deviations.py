"""How far the columns of a recording are from the training, in decibels where they are powers.

A column of a `BinTransformer` is a power, and its logarithm after a `FunctionTransformer` a level:
for these, differences are exact in dB, whatever scaling follows. Other columns differ by standard
deviations within the classes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.pipeline import FeatureUnion, Pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.explanations.feature_traces import FeatureTrace, trace_features
from emacm.explanations.opened_pipelines import OpenedPipeline, names_of, one_recording
from emacm.machine.fault_lines import FaultLines
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_psd import OrderPSD

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Deviations:
    """Differences of the columns of one recording from the training.

    Attributes
    ----------
    of_mean : ndarray of shape (n_columns,)
        From the mean of the nearest class.
    of_least, of_largest : ndarray of shape (n_columns,)
        From the least and the largest value of the training recordings; NaN if they are not
        known, as after a projection.
    in_decibels : ndarray of bool, shape (n_columns,)
        Unit of both: dB, or standard deviations within the classes.
    levels, mean_levels : ndarray of shape (n_columns,)
        Levels of the recording and of the nearest class [dB], NaN for other columns.
    """

    of_mean: Array
    of_least: Array
    of_largest: Array
    in_decibels: NDArray[np.bool_]
    levels: Array
    mean_levels: Array

    @property
    def outside(self) -> Array:
        """Deviations from the range of the training: positive above, negative below, 0 within."""
        below = np.where(self.of_least < 0, self.of_least, 0.0)
        inside = np.where(np.isnan(self.of_least), np.nan, below)
        return np.where(self.of_largest > 0, self.of_largest, inside)

    def columns(self) -> dict[str, Any]:
        """Return columns of a table: "deviation", "outside_training" and their "unit"."""
        units = np.where(self.in_decibels, "dB", "standard deviations")
        return {"deviation": self.of_mean, "outside_training": self.outside, "unit": units}


def find_deviations(
    trace: FeatureTrace,
    row: Array,
    scales: Array,
    references: tuple[Array, Array, Array],
    spread: Array,
) -> Deviations:
    """Determine how far a recording is from the training.

    Parameters
    ----------
    trace : FeatureTrace
        From the columns to the features.
    row : ndarray of shape (n_columns,)
        The recording.
    scales : ndarray of shape (n_columns,)
        Of `power_scales`.
    references : (ndarray, ndarray, ndarray), each of shape (n_positions,)
        Positions of the nearest class, and of the least and the largest training value; NaN where
        they are not known.
    spread : ndarray of shape (n_positions,)
        Standard deviations of the positions within the classes; NaN where they are not known.

    Returns
    -------
    Deviations
    """
    place = np.full(len(row), -1)
    place[trace.sources[::-1]] = np.arange(len(trace.sources))[::-1]
    known = place >= 0  # the others were dropped by a selection
    found = trace.positions(row[np.newaxis])[0]
    mean, low, high = (
        _in_decibels(trace, row, scales, found, reference)[place] for reference in references
    )
    exact = known & np.isfinite(mean)
    with np.errstate(invalid="ignore"):
        sigmas = [((found - reference) / spread)[place] for reference in references]
        mean, low, high = (
            np.where(exact, db, sigma) for db, sigma in zip((mean, low, high), sigmas, strict=True)
        )
    levels = np.where(exact, _levels(row, scales), np.nan)
    hidden = np.where(known, 1.0, np.nan)
    return Deviations(mean * hidden, low * hidden, high * hidden, exact, levels, levels - mean)


def power_scales(maker: Any, n_columns: int) -> Array:
    """Return what one unit of each column of a table is in dB.

    Parameters
    ----------
    maker : transformer or None
        The fitted step that makes the table.
    n_columns : int
        Number of its columns.

    Returns
    -------
    ndarray of shape (n_columns,)
        dB per unit of a logarithm of a power, inf for a power, NaN for anything else.
    """
    if isinstance(maker, BinTransformer | OrderPSD):
        return np.full(n_columns, np.inf)
    if isinstance(maker, FaultLines):  # levels in dB
        return np.ones(n_columns)
    if isinstance(maker, FeatureUnion):
        blocks = [step for _, step in maker.transformer_list if step != "drop"]
        widths = [len(names_of(step)) for step in blocks]
        parts = [power_scales(*pair) for pair in zip(blocks, widths, strict=True)]
        whole = np.concatenate([*parts, np.empty(0)])
        return whole if len(whole) == n_columns else np.full(n_columns, np.nan)
    scale: Any = np.nan
    for _, step in maker.steps if isinstance(maker, Pipeline) else ():
        if isinstance(step, BinTransformer | OrderPSD | FaultLines | FeatureUnion):
            scale = power_scales(step, len(names_of(step)))
        elif isinstance(step, FunctionTransformer):
            scale = np.where(np.isinf(scale), _decibels_per_unit(step), np.nan)
        elif step not in (None, "passthrough"):
            scale = np.nan
    return (
        np.resize(scale, n_columns)
        if np.size(scale) in (1, n_columns)
        else np.full(n_columns, np.nan)
    )


def _decibels_per_unit(logarithm: FunctionTransformer) -> float:
    """Return what one unit of a logarithm of a power is in dB; NaN if it is another function."""
    if logarithm.func is None:
        return np.inf
    powers = 10.0 ** np.arange(-3, 4)[:, np.newaxis]  # 10 dB apart
    with np.errstate(all="ignore"):
        try:
            values = logarithm.func(powers, **(logarithm.kw_args or {}))
            steps = np.diff(np.asarray(values, np.float64), axis=0)
        except (TypeError, ValueError, AttributeError):  # a function of DataFrames, for example
            return np.nan
        straight = np.ptp(steps) <= 1e-6 * np.abs(steps).max()
    return float(10.0 / steps.mean()) if straight and steps.any() else np.nan


def _levels(row: Array, scales: Array) -> Array:
    """Return the columns in dB."""
    with np.errstate(all="ignore"):
        return np.where(np.isinf(scales), 10 * np.log10(row), row * scales)


def _in_decibels(
    trace: FeatureTrace, row: Array, scales: Array, found: Array, reference: Array
) -> Array:
    """Return the differences from reference positions [dB]; NaN where they cannot be determined.

    Each position depends on one column, so that all can be changed at once, by 10 dB.
    """
    power = np.isinf(scales)
    with np.errstate(all="ignore"):
        factor = 10 ** (10.0 / 10)
        changed = [
            np.where(power, row * factor**sign, row + np.nan_to_num(sign * 10.0 / scales))
            for sign in (1, -1)
        ]
        up, down = (trace.positions(x[np.newaxis])[0] - found for x in changed)
        own_row, own_scale = row[trace.sources], scales[trace.sources]
        logarithmic = np.abs(up + down) <= 1e-6 * np.abs(up)
        decibels = (found - reference) * 10.0 / up
        # In a position that is linear in the power, ten times the power adds nine times as much.
        linear = np.isinf(own_scale) & (np.abs(up + factor * down) <= 1e-6 * np.abs(up))
        before = own_row - (found - reference) / up * (factor - 1) * own_row
        by_power = 10 * np.log10(own_row / before)
    result = np.where(logarithmic, decibels, np.where(linear, by_power, np.nan))
    return np.where(np.isnan(own_scale) | ~np.isfinite(result), np.nan, result)


@dataclass(frozen=True)
class StatementLimits:
    """Limits by which sentences about a recording are chosen; assumed, and the same for all data.

    Attributes
    ----------
    same : float
        Difference of bins under one gain [dB].
    gain : float
        Common deviation from which it is called a gain [dB].
    covered : float
        Fraction of the bins of a channel that a gain must explain.
    silent : float
        Deviation of all bins of a channel without signal [dB].
    least : float
        Deviation outside of the training that is stated [dB, or standard deviations].
    line : int
        Number of adjacent bins that a line and its leakage fill.
    peak, high_peak : float
        Height of a line over these bins, and over those of a longer range [dB].
    broad : float
        Fraction of the bins of a channel that deviate in a broad band.
    most : int
        Number of sentences.
    share : float
        Fraction of the largest contribution below which a sentence is left out.
    """

    same: float = 3.0
    gain: float = 2.0
    covered: float = 0.9
    silent: float = -20.0
    least: float = 1.0
    line: int = 4
    peak: float = 6.0
    high_peak: float = 15.0
    broad: float = 0.5
    most: int = 5
    share: float = 0.03


_LIMITS = StatementLimits()

PROJECTED = (
    "the features are projections of the bins, so that the bins that deviate are not determined; "
    "give training recordings as background"
)


def unknown_statements(
    bins: pd.DataFrame, shares: Array, found: Deviations, nearest: str
) -> list[str]:
    """State which channels and orders of a recording deviate from the training, and how.

    Parameters
    ----------
    bins : DataFrame
        Columns "column", "channel", "low" and "high", one row for each column of the table.
    shares : ndarray of shape (n_columns,)
        Contribution of each to the distance.
    found : Deviations
        Of the recording.
    nearest : str
        Name of the nearest class.

    Returns
    -------
    list of str
        The most important first.
    """
    powers = found.in_decibels & bins["low"].notna().to_numpy()  # in bands of orders
    channels = {
        str(name): np.flatnonzero((bins["channel"] == name) & powers)
        for name in bins["channel"].unique()
        if ((bins["channel"] == name) & powers).any()
    }
    gain = _common_gain(channels, found)
    if gain:
        return [gain]
    swapped = _swapped(channels, bins, found)
    if swapped:
        return [swapped]
    stated: list[tuple[float, str]] = []
    for name, rows in channels.items():
        stated += _of_channel(name, rows, bins, shares, found, nearest)
    stated += _of_others(np.flatnonzero(~powers), bins, shares, found, nearest)
    stated.sort(key=lambda pair: -pair[0])
    texts = [
        text for weight, text in stated[: _LIMITS.most] if weight >= _LIMITS.share * stated[0][0]
    ]
    if not texts:
        largest = ", ".join(map(repr, bins["column"].iloc[np.argsort(-np.abs(shares))[:3]]))
        texts = [f"no column is far outside the training; together they are, above all {largest}"]
    return texts


def _gain(rows: NDArray[np.intp], found: Deviations) -> float | None:
    """Return the gain [dB] without which the bins are in the range of the training; None if none.

    0 if they are in this range. One bin in ten may deviate.
    """
    least, most = found.of_largest[rows] - _LIMITS.least, found.of_least[rows] + _LIMITS.least
    if np.isnan(least).any():
        least, most = found.of_mean[rows] - _LIMITS.same, found.of_mean[rows] + _LIMITS.same
    candidates = np.concatenate([[0.0], least, most])
    covered = ((least <= candidates[:, np.newaxis]) & (candidates[:, np.newaxis] <= most)).mean(1)
    if covered.max() < _LIMITS.covered:
        return None
    if covered[0] >= _LIMITS.covered:
        return 0.0
    return float(candidates[covered == covered.max()].mean())


def _common_gain(channels: dict[str, NDArray[np.intp]], found: Deviations) -> str:
    """Return a sentence if all channels have the same gain."""
    if len(channels) < 2 or not all(_gain(rows, found) for rows in channels.values()):
        return ""
    gain = _gain(np.concatenate([*channels.values()]), found)
    if gain is None or abs(gain) < _LIMITS.gain:
        return ""
    return f"all channels {_decibels(gain)} training: gain or unit?"


def _swapped(channels: dict[str, NDArray[np.intp]], bins: pd.DataFrame, found: Deviations) -> str:
    """Return a sentence if two channels have the levels of each other."""
    for one, other in combinations(channels, 2):
        first, second = channels[one], channels[other]
        if not np.array_equal(
            *(bins[["low", "high"]].to_numpy()[rows] for rows in (first, second))
        ):
            continue
        own, crossed = (
            np.mean(np.abs(found.levels[to] - found.mean_levels[of]))
            for to, of in (
                (np.r_[first, second], np.r_[first, second]),
                (np.r_[first, second], np.r_[second, first]),
            )
        )
        if own > 2 * _LIMITS.same and crossed < own / 3:
            return f"channels {one!r} and {other!r} as if exchanged: are they swapped?"
    return ""


def _of_channel(
    name: str,
    rows: NDArray[np.intp],
    bins: pd.DataFrame,
    shares: Array,
    found: Deviations,
    nearest: str,
) -> list[tuple[float, str]]:
    """Return the sentences about the bins of one channel, each with its contribution."""
    rows = rows[np.argsort(bins["low"].to_numpy()[rows], kind="stable")]
    outside, limit, of = found.outside[rows], _LIMITS.least, "the training"
    if np.isnan(outside).all():
        outside, limit, of = found.of_mean[rows], 2 * _LIMITS.same, repr(nearest)
    weight = np.abs(shares[rows])
    gain = _gain(rows, found)
    if (outside < -limit).all() and np.median(found.of_mean[rows]) <= _LIMITS.silent:
        level = _decibels(float(np.median(found.of_mean[rows])))
        return [(weight.sum(), f"channel {name!r} {level} training: cable or sensor?")]
    if gain is not None and abs(gain) >= _LIMITS.gain:
        text = f"channel {name!r} {_decibels(gain)} training at all orders: gain or unit?"
        return [(weight.sum(), text)]
    far = np.abs(outside) > limit
    if far.mean() > _LIMITS.broad:
        text = (
            f"channel {name!r} {_span(outside[far])} {of} in {100 * far.mean():.0f} % of its "
            f"order bins: broad band"
        )
        return [(weight.sum(), text)]
    return [
        (weight[part].sum(), _of_orders(name, bins.iloc[rows[part]], outside[part], of))
        for part in _adjacent(np.sign(outside) * far)
    ]


def _of_orders(name: str, bins: pd.DataFrame, outside: Array, of: str) -> str:
    """Return a sentence about adjacent bins."""
    end = "maximum" if outside[0] > 0 else "minimum"
    of = f"the training {end}" if of == "the training" else of
    peak = int(np.abs(outside).argmax())
    others = np.abs(np.delete(outside, peak))
    height = _LIMITS.peak if len(bins) <= _LIMITS.line else _LIMITS.high_peak
    if (others <= abs(outside[peak]) - height).all():
        bins, outside = bins.iloc[[peak]], outside[[peak]]
    low, high = bins["low"].min(), bins["high"].max()
    orders = f"order {low:g} to {high:g}"
    if len(bins) > 2:
        return f"orders {low:g} to {high:g} of {name!r} {_span(outside)} {of}"
    kind = "line at " if outside[0] > 0 else ""
    return f"{kind}{orders} of {name!r}, {_decibels(float(outside[np.abs(outside).argmax()]))} {of}"


def _of_others(
    rows: NDArray[np.intp], bins: pd.DataFrame, shares: Array, found: Deviations, nearest: str
) -> list[tuple[float, str]]:
    """Return sentences about columns that are not powers in a band of orders."""
    stated = []
    for row in rows:
        outside, deviation = found.outside[row], found.of_mean[row]
        if not (np.abs(outside) > _LIMITS.least or (np.isnan(outside) and np.abs(deviation) > 3)):
            continue
        way = "above" if deviation > 0 else "below"
        size = f"{abs(deviation):.3g} standard deviations {way}"
        if found.in_decibels[row]:
            size = _decibels(float(deviation))
        text = f"{bins['column'].iloc[row]!r} {size} {nearest!r}"
        stated.append((float(np.abs(shares[row])), text))
    return stated


def _adjacent(signs: Array) -> list[slice]:
    """Return the ranges of equal signs other than 0."""
    edges = np.flatnonzero(np.diff(signs)) + 1
    parts = zip([0, *edges.tolist()], [*edges.tolist(), len(signs)], strict=True)
    return [slice(start, stop) for start, stop in parts if signs[start]]


def _decibels(value: float) -> str:
    return f"{abs(value):.0f} dB {'above' if value > 0 else 'below'}"


def _span(values: Array) -> str:
    """Return a range of deviations in words; of both signs, that of the majority."""
    way = 1 if (values > 0).mean() >= 0.5 else -1
    sizes = np.abs(values[np.sign(values) == way])
    low, high = f"{sizes.min():.0f}", f"{sizes.max():.0f}"
    return f"{low if low == high else f'{low} to {high}'} dB {'above' if way > 0 else 'below'}"


def class_deviations(
    pipeline: Any, x: Any, reference: Any, *, background: Any = None
) -> pd.DataFrame:
    """Return how far each bin or feature of a recording is from the mean of a class.

    Unlike the contributions of `explain_decision`, this does not depend on the other classes: a
    line that a fault raises is raised, also if another fault raises it more.

    Parameters
    ----------
    pipeline : Pipeline, CostSensitiveGaussianBayes, fitted search or ConditionRouter
        As for `explain_decision`.
    x : Recording, or one row of a table
        Input of the pipeline.
    reference : label
        The class.
    background : recordings or table, optional
        Recordings of this class. Default: the mean and the covariance that the classifier has
        learned, which are those of the bins unless they were projected (PCA).

    Returns
    -------
    DataFrame
        One row for each bin or feature: "column", "channel", "low" and "high" [orders],
        "deviation" from the mean of the class, its "unit" ("dB" for powers, exactly, and "standard
        deviations" for other features), the same in "sigmas" (standard deviations within the
        class), "level" of the recording and "reference_level" of the class [dB; NaN for other
        features]. NaN for columns that a selection has dropped.

    Raises
    ------
    TypeError, ValueError
        As `explain_decision`; or if `reference` is not a class, or the features are projections and
        there is no `background`.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.preprocessing import FunctionTransformer
    >>> X = pd.DataFrame({"torque@0-1": [1.0, 2, 3, 4], "torque@1-2": [0.0, 1, 8, 9]})
    >>> model = CostSensitiveGaussianBayes(shrinkage=0.5).fit(X, ["new", "new", "old", "old"])
    >>> class_deviations(model, X.iloc[[3]], "new")["deviation"].round(1).tolist()
    [3.5, 12.0]
    """
    x = one_recording(x)
    opened = OpenedPipeline.of(pipeline, x)
    values, bins = opened.table(x)
    trace = trace_features(opened.steps, values)
    if background is None:
        mean, spread = _learned(opened.classifier, trace, reference)
    else:
        others = trace.positions(opened.table(background)[0])
        mean, spread = others.mean(axis=0), others.std(axis=0)
    row, unknown = values[0], np.full(len(mean), np.nan)
    found, sigmas = (
        find_deviations(trace, row, scales, (mean, unknown, unknown), spread)
        for scales in (power_scales(opened.maker, len(row)), np.full(len(row), np.nan))
    )
    return bins.assign(
        deviation=found.of_mean,
        unit=np.where(found.in_decibels, "dB", "standard deviations"),
        sigmas=sigmas.of_mean,
        level=found.levels,
        reference_level=found.mean_levels,
    )


def _learned(
    classifier: CostSensitiveGaussianBayes, trace: FeatureTrace, reference: Any
) -> tuple[Array, Array]:
    """Return mean and standard deviations of the positions of a class, as learned."""
    classes = classifier.classes_.tolist()
    if reference not in classes:
        raise ValueError(f"reference must be one of the classes {classes}, got {reference!r}.")
    if trace.linear:
        raise ValueError(f"{PROJECTED}.")
    code = classes.index(reference)
    covariances = np.asarray(classifier.covariances_)
    if classifier.covariance == "tied":
        variances = np.diag(covariances)
    else:
        variances = covariances[code] if covariances.ndim == 2 else np.diag(covariances[code])
    return classifier.means_[code], np.sqrt(variances)
