"""How far the columns of a recording are from the training, in decibels where they are powers.

A column of a `BinTransformer` is a power, and its logarithm after a `FunctionTransformer` a level:
for these, differences are exact in dB, whatever scaling follows. Other columns differ by standard
deviations within the classes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.explanations.opened_pipelines import (
    FeatureTrace,
    OpenedPipeline,
    TracedRecordings,
    one_recording,
)

Array = NDArray[np.float64]


def find_deviations(
    traced: TracedRecordings, mean: Array, spread: Array, *, low: Any = np.nan, high: Any = np.nan
) -> pd.DataFrame:
    """Determine how far a recording is from the training.

    Parameters
    ----------
    traced : TracedRecordings
        One recording.
    mean : ndarray of shape (n_columns,)
        Position of the nearest class.
    spread : ndarray of shape (n_columns,)
        Standard deviations of the positions within the classes; NaN where they are not known.
    low, high : ndarray of shape (n_columns,)
        Positions of the least and the largest training value; NaN where they are not known.

    Returns
    -------
    DataFrame of shape (n_columns, 7)
        Differences from the mean of the nearest class ("deviation") and from the "least" and the
        "largest" value of the training; "outside_training", the deviation from this range:
        positive above, negative below, 0 within; their "unit", "dB" or "standard deviations"; and
        "level" and "reference_level" of the class [dB]. NaN where they are not known.
    """
    row, scales = traced.table[0], traced.scales
    by_level = np.array([_in_decibels(traced, each) for each in (mean, low, high)])
    with np.errstate(all="ignore"):
        by_spread = [(traced.positions[0] - each) / spread for each in (mean, low, high)]
        levels = np.where(np.isinf(scales), 10 * np.log10(row), row * scales)
    exact = np.isfinite(by_level[0])
    deviation, least, largest = np.where(exact, by_level, by_spread)
    table = pd.DataFrame({"deviation": deviation, "least": least, "largest": largest})
    table["outside_training"] = np.where(largest > 0, largest, np.minimum(least, 0))
    table["level"] = np.where(exact, levels, np.nan)
    table["reference_level"] = table["level"] - deviation
    return table.assign(unit=np.where(exact, "dB", "standard deviations"))


def _in_decibels(traced: TracedRecordings, reference: Array) -> Array:
    """Return the differences from reference positions [dB]; NaN where they cannot be determined.

    Each position depends on its own column, so that all can be changed at once, by 10 dB.
    """
    row, scales, found = traced.table[0], traced.scales, traced.positions[0]
    power = np.isinf(scales)
    with np.errstate(all="ignore"):
        step = np.nan_to_num(10.0 / scales)
        changed = [np.where(power, row * 10, row + step), np.where(power, row / 10, row - step)]
        up, down = traced.trace.positions(np.array(changed)) - found
        logarithmic = np.abs(up + down) <= 1e-6 * np.abs(up)
        decibels = (found - reference) * 10.0 / up
        # In a position that is linear in the power, ten times the power adds nine times as much.
        linear = power & (np.abs(up + 10 * down) <= 1e-6 * np.abs(up))
        by_power = -10 * np.log10(1 - (found - reference) / up * 9)
    result = np.where(logarithmic, decibels, np.where(linear, by_power, np.nan))
    return np.where(np.isnan(scales) | ~np.isfinite(result), np.nan, result)


@dataclass(frozen=True)
class StatementLimits:
    """Limits by which sentences about a recording are chosen; assumed, and the same for all data.

    Attributes
    ----------
    gain : float
        Common deviation from which it is called a gain [dB].
    covered : float
        Fraction of the bins of a channel that a gain must explain.
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

    gain: float = 2.0
    covered: float = 0.9
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


def unknown_statements(table: pd.DataFrame, nearest: str) -> list[str]:
    """State which channels and orders of a recording deviate from the training, and how.

    Parameters
    ----------
    table : DataFrame
        Columns "column", "channel", "low", "high", those of `find_deviations`, and "contribution"
        to the distance; one row for each column of the table of the model.
    nearest : str
        Name of the nearest class.

    Returns
    -------
    list of str
        The most important first.
    """
    is_band = (table["unit"] == "dB") & table["low"].notna()
    bands = table[is_band].sort_values("low", kind="stable")
    channels = {str(name): own for name, own in bands.groupby("channel", sort=False)}
    if common := _common_gain(channels):
        return [common]
    stated = _of_others(table[~is_band], nearest)
    for name, own in channels.items():
        stated += _of_channel(name, own)
    stated.sort(key=lambda pair: -pair[0])
    least = _LIMITS.share * stated[0][0] if stated else 0.0
    texts = [text for weight, text in stated[: _LIMITS.most] if weight >= least]
    if not texts:
        order = np.argsort(-table["contribution"].abs())[:3]
        largest = ", ".join(map(repr, table["column"].iloc[order]))
        texts = [f"no column is far outside the training; together they are, above all {largest}"]
    return texts


def second_state_statement(state: Any, second: Any, raised: pd.DataFrame | None = None) -> str:
    """State that a recording has lines of a second state.

    Parameters
    ----------
    state, second : label
        The decided state, and the one whose lines are also there.
    raised : DataFrame, optional
        Columns "column", "channel", "low", "high", "deviation" and "unit" of what is raised above
        the decided state; the most important first.

    Returns
    -------
    str

    Examples
    --------
    >>> second_state_statement("bearing", "screw")
    "lines that 'bearing' does not explain, as of 'screw'"
    """
    text = f"lines that {str(state)!r} does not explain, as of {str(second)!r}"
    if raised is None or not len(raised):
        return text
    parts = []
    for row in raised.itertuples():
        is_band = np.isfinite(row.low)
        name = f"order {row.low:g} to {row.high:g} of {row.channel!r}" if is_band else row.column
        parts.append(f"{name} {row.deviation:.2g} {row.unit} higher")
    return f"{text}: {', '.join(parts)}"


def _gain(own: pd.DataFrame) -> float | None:
    """Return the gain [dB] without which the bins are in the range of the training; None if none.

    0 if they are in this range. One bin in ten may deviate.
    """
    least = own["largest"].to_numpy() - _LIMITS.least
    most = own["least"].to_numpy() + _LIMITS.least
    candidates = np.concatenate([[0.0], least, most])
    gains = candidates[:, np.newaxis]
    covered = ((least <= gains) & (gains <= most)).mean(axis=1)
    if covered[0] >= _LIMITS.covered:
        return 0.0
    best = covered.max()
    return float(candidates[covered == best].mean()) if best >= _LIMITS.covered else None


def _common_gain(channels: dict[str, pd.DataFrame]) -> str:
    """Return a sentence if all channels have the same gain."""
    if len(channels) < 2 or not all(map(_gain, channels.values())):
        return ""
    gain = _gain(pd.concat([*channels.values()]))
    if gain is None or abs(gain) < _LIMITS.gain:
        return ""
    return f"all channels {_span(gain)} training: gain or unit?"


def _of_channel(name: str, own: pd.DataFrame) -> list[tuple[float, str]]:
    """Return the sentences about the bins of one channel, each with its contribution."""
    outside, weight = own["outside_training"], own["contribution"].abs()
    far, gain = outside.abs() > _LIMITS.least, _gain(own)
    if gain is not None and abs(gain) >= _LIMITS.gain:
        text = f"{_span(gain)} training at all orders: gain or unit?"
    elif far.mean() > _LIMITS.broad:
        share = f"{100 * far.mean():.0f} % of its order bins"
        text = f"{_span(*outside[far])} the training in {share}: broad band"
    else:
        signs = np.sign(outside) * far
        parts = [part for _, part in own.groupby((signs != signs.shift()).cumsum())]
        return [
            (weight[part.index].sum(), _of_orders(name, part))
            for part in parts
            if far[part.index[0]]
        ]
    return [(weight.sum(), f"channel {name!r} {text}")]


def _of_orders(name: str, part: pd.DataFrame) -> str:
    """Return a sentence about adjacent bins that are all above, or all below the training."""
    outside = part["outside_training"]
    above = outside.iloc[0] > 0
    peak = outside.abs().idxmax()
    height = _LIMITS.peak if len(part) <= _LIMITS.line else _LIMITS.high_peak
    if (outside.drop(peak).abs() <= abs(outside[peak]) - height).all():
        part = part.loc[[peak]]
    orders = f"{part['low'].min():g} to {part['high'].max():g} of {name!r}"
    limit = f"the training {'maximum' if above else 'minimum'}"
    if len(part) > 2:
        return f"orders {orders} {_span(*part['outside_training'])} {limit}"
    return f"{'line at order' if above else 'order'} {orders}, {_span(outside[peak])} {limit}"


def _of_others(table: pd.DataFrame, nearest: str) -> list[tuple[float, str]]:
    """Return sentences about columns that are not powers in a band of orders."""
    texts = []
    for row in table[table["outside_training"].abs() > _LIMITS.least].itertuples():
        size = _span(row.deviation)
        if row.unit != "dB":
            way = "above" if row.deviation > 0 else "below"
            size = f"{abs(row.deviation):.3g} standard deviations {way}"
        texts.append((abs(row.contribution), f"{row.column!r} {size} {nearest!r}"))
    return texts


def _span(*values: float) -> str:
    """Return a range of deviations in words; of both signs, that of the majority."""
    way = 1 if np.mean(np.greater(values, 0)) >= 0.5 else -1
    sizes = [abs(value) for value in values if np.sign(value) == way]
    low, high = f"{min(sizes):.0f}", f"{max(sizes):.0f}"
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
        features].

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
    traced = opened.traced(x)
    if background is None:
        mean, spread = _learned(opened.classifier, traced.trace, reference)
    else:
        others = traced.trace.positions(opened.table(background)[0])
        mean, spread = others.mean(axis=0), others.std(axis=0)
    found = find_deviations(traced, mean, spread)
    with np.errstate(all="ignore"):
        found["sigmas"] = (traced.positions[0] - mean) / spread
    return traced.bins.join(found[["deviation", "unit", "sigmas", "level", "reference_level"]])


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
