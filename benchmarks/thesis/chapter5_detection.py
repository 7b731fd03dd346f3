"""Which signal shows which fault from which severity on: detection at a false alarm rate of 1 %."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from laboratory import FAULTS
from numpy.typing import NDArray

from chapter4_spectra import SIGNALS
from chapter5_data import Features

FALSE_ALARMS = 0.01
ALL = "all signals"
PHASED = "three phases"
_RESAMPLES = 2000


class Detector(NamedTuple):
    """Largest deviation from healthy units over the bins of a signal, and its threshold.

    Attributes
    ----------
    mean, scale : Series
        Mean and standard deviation over the healthy recordings of the training units.
    threshold : float
        Quantile of the deviation over healthy recordings of other units.
    """

    mean: pd.Series
    scale: pd.Series
    threshold: float

    def deviation(self, table: pd.DataFrame) -> NDArray[np.floating]:
        """Return the largest deviation of each recording [standard deviations]."""
        return (((table - self.mean) / self.scale).abs()).max(axis=1).to_numpy()


def detectors(features: Features) -> dict[str, Detector]:
    """Return the detector of each signal.

    The mean and the scatter over units and runs are those of the training units; the threshold is
    exceeded by at most 1 % of the healthy recordings of the calibration units.
    """
    role = features.frame["role"]
    found = {}
    for name, table in features.fine.items():
        training = table[role == "training"]
        detector = Detector(training.mean(), training.std(), np.inf)
        scores = detector.deviation(table[role == "calibration"])
        found[name] = detector._replace(threshold=_limit(scores))
    return found


def _limit(scores: NDArray[np.floating]) -> float:
    return float(np.quantile(scores, 1 - FALSE_ALARMS, method="higher"))


def ratios(features: Features, found: dict[str, Detector]) -> pd.DataFrame:
    """Return the deviation of each recording over the threshold, by signal.

    That of `ALL` is the largest over the signals, over the value that 1 % of the healthy
    recordings of the calibration units exceed.
    """
    table = pd.DataFrame(
        {name: d.deviation(features.fine[name]) / d.threshold for name, d in found.items()}
    )
    largest = table.max(axis=1)
    calibration = (features.frame["role"] == "calibration").to_numpy()
    return table.assign(**{ALL: largest / _limit(largest[calibration].to_numpy())})


def flagged_recordings(features: Features, found: dict[str, Detector]) -> pd.DataFrame:
    """Return one row per recording of the tested units: whether each detector responds."""
    tested = features.frame["role"] == "tested"
    flags = ratios(features, found)[tested] > 1
    return features.frame[tested].join(flags).reset_index(drop=True)


def false_alarms(tested: pd.DataFrame) -> pd.DataFrame:
    """Return the false alarm rate of each signal on healthy recordings of the tested units [%].

    These units contribute to neither the mean nor the threshold.
    """
    healthy = tested[tested["label"] == "healthy"]
    rates = {name: 100 * healthy[name].mean() for name in (*SIGNALS, PHASED, ALL)}
    table = pd.DataFrame({"false alarms [%]": rates, "recordings": len(healthy)})
    return table.rename(index=SIGNALS).rename_axis("signal")


def threshold_table(features: Features, found: dict[str, Detector]) -> pd.DataFrame:
    """Return the threshold of each signal, and how certain it is.

    Returns
    -------
    DataFrame
        One row per signal: number of bins, threshold [standard deviations], and the limits of its
        95 % interval from a bootstrap over the calibration units.
    """
    calibration = features.rows(features.frame["role"] == "calibration")
    rows_of = list(calibration.frame.groupby("unit").indices.values())
    rng = np.random.default_rng(0)
    rows = {}
    for name, detector in found.items():
        scores = detector.deviation(calibration.fine[name])
        drawn = [
            _limit(scores[np.concatenate([rows_of[k] for k in units])])
            for units in rng.integers(len(rows_of), size=(_RESAMPLES // 4, len(rows_of)))
        ]
        low, high = np.quantile(drawn, (0.025, 0.975))
        rows[SIGNALS.get(name, name)] = (len(detector.mean), detector.threshold, low, high)
    columns = ["bins", "threshold", "low", "high"]
    table = pd.DataFrame.from_dict(rows, orient="index", columns=columns)
    return table.rename_axis("signal")


def severity_of_detection(tested: pd.DataFrame) -> pd.DataFrame:
    """Return from which severity on each signal detects each fault of each unit.

    Returns
    -------
    DataFrame
        One row per fault and unit, one column per signal: the smallest tested severity from which
        on all recordings are detected; inf if the largest is not.

    Examples
    --------
    >>> rows = [("screw", 7, s, s > 0.2, False) for s in (0.1, 0.3, 1.0)]
    >>> columns = ["label", "unit", "severity", "lvdt", "velocity"]
    >>> table = severity_of_detection(pd.DataFrame(rows, columns=columns))
    >>> table[["lvdt", "velocity"]].values.tolist()
    [[0.3, inf]]
    """
    names = [name for name in (*SIGNALS, PHASED, ALL) if name in tested]
    faulty = tested[tested["label"] != "healthy"].sort_values("severity")
    rows = {}
    for key, group in faulty.groupby(["label", "unit"], sort=False):
        severities = group["severity"].to_numpy()
        rows[key] = {name: _from_which_on(severities, group[name].to_numpy()) for name in names}
    table = pd.DataFrame.from_dict(rows, orient="index")
    table.index = pd.MultiIndex.from_tuples(rows, names=["fault", "unit"])
    return table


def _from_which_on(severities: NDArray[Any], detected: NDArray[np.bool_]) -> float:
    missed = np.flatnonzero(~detected)
    first = missed[-1] + 1 if len(missed) else 0
    return float(severities[first]) if first < len(severities) else np.inf


def detection_table(by_unit: pd.DataFrame) -> pd.DataFrame:
    """Return the median over units of the severity of detection, with its confidence interval.

    Returns
    -------
    DataFrame
        One row per fault and signal: "severity", and "low" and "high", the limits of the 95 %
        interval from a bootstrap over units; inf where it is not detected.
    """
    rng = np.random.default_rng(0)
    rows = {}
    for fault in [name for name in FAULTS if name in by_unit.index.get_level_values("fault")]:
        units = by_unit.loc[fault]
        draws = rng.integers(len(units), size=(_RESAMPLES, len(units)))
        for name in by_unit.columns:
            values = units[name].to_numpy()
            medians = np.sort(_median(values[draws]))
            low, high = medians[[int(0.025 * _RESAMPLES), int(0.975 * _RESAMPLES) - 1]]
            rows[fault, SIGNALS.get(name, name)] = (_median(values[np.newaxis])[0], low, high)
    table = pd.DataFrame.from_dict(rows, orient="index", columns=["severity", "low", "high"])
    table.index = pd.MultiIndex.from_tuples(rows, names=["fault", "signal"])
    return table


def _median(values: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the upper median of each row: at least half of the units are detected by it."""
    return np.sort(values, axis=1)[:, (values.shape[1] - 1) // 2 + (values.shape[1] % 2 == 0)]


def as_text(row: pd.Series) -> str:
    """Return a severity and its interval in a few characters.

    Examples
    --------
    >>> as_text(pd.Series({"severity": 0.1, "low": 0.05, "high": np.inf}))
    '0.1 (0.05 to –)'
    """
    severity, low, high = (f"{v:g}" if np.isfinite(v) else "–" for v in row)
    return severity if low == high else f"{severity} ({low} to {high})"


def as_text_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return a `detection_table` as text: one row per fault, one column per signal."""
    names, signals = (list(dict.fromkeys(table.index.get_level_values(k))) for k in (0, 1))
    texts = table.apply(as_text, axis=1).unstack("signal")
    return texts.loc[names, signals].rename_axis(columns=None)


def draw_detection(table: pd.DataFrame) -> Any:
    """Draw the severities of detection as a table of coloured cells.

    Parameters
    ----------
    table : DataFrame
        Result of `detection_table`.

    Returns
    -------
    matplotlib Figure
    """
    from matplotlib import pyplot

    wide = table["severity"].unstack("signal")
    faults = list(dict.fromkeys(table.index.get_level_values("fault")))
    signals = list(dict.fromkeys(table.index.get_level_values("signal")))
    values = wide.loc[faults, signals].to_numpy()
    shown = np.log10(np.where(np.isfinite(values), values, 2.0))
    figure, ax = pyplot.subplots(figsize=(7.4, 5.2), layout="constrained")
    ax.imshow(shown, cmap="YlGnBu_r", vmin=-1.7, vmax=0.4, aspect="auto")
    for i, fault in enumerate(faults):
        for j, signal in enumerate(signals):
            text = as_text(table.loc[(fault, signal)]).replace(" (", "\n(")
            colour = "white" if shown[i, j] < -0.9 else "black"
            ax.text(j, i, text, ha="center", va="center", fontsize=8, color=colour)
    ax.set_xticks(range(len(signals)), signals)
    ax.set_yticks(range(len(faults)), faults)
    ax.xaxis.tick_top()
    ax.tick_params(length=0)
    return figure
