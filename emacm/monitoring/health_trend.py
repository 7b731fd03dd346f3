"""Trend of the health index of each unit, from recordings such as those of a folder."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import check_is_fitted

from emacm.monitoring.health_index import HealthIndex
from emacm.recordings.inputs import as_list
from emacm.recordings.meta import read_meta


def health_trend(model: Any, recordings: Any, *, unit: Any = None, time: Any) -> pd.DataFrame:
    """Return the trend of each unit from recordings; one that is invalid is a row with its error.

    Parameters
    ----------
    model : Pipeline
        Fitted on healthy recordings; ends in a `HealthIndex`. Its other steps turn recordings into
        features.
    recordings : sequence of Recording
        Such as a `RecordingFolder`; they are read one by one.
    unit : key of meta, tuple of keys, callable or array-like, optional
        The unit of each recording. Default: all are of one unit, compared with the population.
    time : key of meta, callable or array-like
        Time of each recording: dates, or numbers such as hours or cycles.

    Returns
    -------
    DataFrame
        As of `HealthIndex.trend`, with the columns "recording" (path, or number in `recordings`)
        and "error" (empty if there is none); rows with an error have no index.

    Raises
    ------
    TypeError, ValueError
        If `model` is no such pipeline, units or times are invalid, or there are too few groups for
        the limit.

    Examples
    --------
    >>> from emacm import OrderPSD, OrderResampler, Recording
    >>> from sklearn.pipeline import make_pipeline
    >>> rng = np.random.default_rng(0)
    >>> runs = [
    ...     Recording({"vib": level * rng.normal(size=4000)}, 1000, velocity=100.0, meta={"day": k})
    ...     for k, level in enumerate(12 * [1.0] + [1.5, 2.0])
    ... ]
    >>> index = HealthIndex(false_alarm=0.1)
    >>> model = make_pipeline(OrderResampler(2 * np.pi / 16), OrderPSD(0.25), index)
    >>> model = model.fit(runs[:12], healthindex__groups=range(12))
    >>> health_trend(model, runs[10:], time="day")["alarm"].tolist()
    [False, False, True, True]
    """
    index = _index_of(model)
    entries = as_list(recordings)
    units = ["all"] * len(entries)
    if unit is not None:
        units = read_meta(entries, unit, role="unit", arrays=True)
    times = read_meta(entries, time, role="time", arrays=True)
    names = [getattr(entry, "path", number) for number, entry in enumerate(entries)]
    features, errors = _features(model, entries)
    table = pd.DataFrame(
        {"unit": units, "time": times, "index": np.nan, "limit": np.nan, "alarm": False}
    )
    table = table.assign(baseline="", recording=names, error=errors)
    good = [k for k, error in enumerate(errors) if not error]
    if good:
        columns = ["unit", "time", "index", "limit", "alarm", "baseline"]
        found = index.rows(np.vstack(features), [times[k] for k in good], [units[k] for k in good])
        table.loc[good, columns] = found[columns].to_numpy(object)
    table = table.astype({"index": float, "limit": float, "alarm": bool})
    table = table.sort_values(["unit", "time"], kind="stable", ignore_index=True)
    table.attrs = {"false_alarm": index.false_alarm}
    return table


def _index_of(model: Any) -> HealthIndex:
    if not isinstance(model, Pipeline) or not isinstance(model[-1], HealthIndex):
        raise TypeError(
            f"model must be a Pipeline that ends in a HealthIndex, got {type(model).__name__}."
        )
    check_is_fitted(model[-1])
    return model[-1]


def _features(model: Pipeline, entries: Sequence[Any]) -> tuple[list[Any], list[str]]:
    """Return the features of the recordings that are valid, and the error of each."""
    rows: list[Any] = []
    errors: list[str] = []
    for entry in entries:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                rows.append(np.asarray(model[:-1].transform([entry])))
            errors.append("")
        except Exception as error:  # whatever it is, it is the result for this recording
            errors.append(" ".join(str(error).split()) or type(error).__name__)
    return rows, errors
