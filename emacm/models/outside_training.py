"""Properties of recordings that are outside the range of the training recordings."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from itertools import chain
from typing import Any

from sklearn.pipeline import FeatureUnion, Pipeline

from emacm._statements import Statement
from emacm.conditions.router import ConditionRouter
from emacm.decisions.pipelines import search_estimator
from emacm.models.model_files import parts_of
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.new_lines import collected_statements
from emacm.recordings.inputs import as_list
from emacm.resampling.order_resampler import OrderResampler
from emacm.stroke_features.transformer import StrokeFeatures


def outside_training(model: Any, recordings: Sequence[Any]) -> list[list[str]]:
    """State which properties of recordings are outside the range of the training recordings.

    The units of channels and the range of level, speed, sampling rate, revolutions and highest
    valid order were stored by the `OrderResampler` of the model when it was fitted, and the largest
    height of each spectral line over its background by its `BinTransformer`. A `ConditionRouter`
    compares each recording with the training recordings of its condition.

    Parameters
    ----------
    model : OrderResampler, Pipeline, ConditionRouter or fitted search
        Fitted; contains an `OrderResampler`, or features computed from strokes over time, for which
        the direction of rotation is stated.
    recordings : list of Recording
        Recordings as for `predict` of the model.

    Returns
    -------
    list of list of str
        For each recording, one sentence for each property outside its range; empty if there is
        none. Levels are stated from 3 dB beyond the range, speeds, lengths and valid orders from
        10 %, sampling rates from 0.1 %, a direction of rotation that the training does not have
        from 10 % of the revolutions; if nothing else is stated, new spectral lines from
        `BinTransformer.new_line_limits_`.

    Raises
    ------
    TypeError
        If the model contains neither.
    ValueError
        If the model is not fitted, or a recording is invalid (the message gives its number).

    See Also
    --------
    OrderResampler.quality : Defects that are known without any training, such as clipping.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import OrderResampler, Recording, outside_training
    >>> wave = np.sin(0.3 * np.arange(8000))
    >>> new = Recording({"vibration": wave}, 2000, velocity=np.full(8000, 150.0))
    >>> model = OrderResampler(2 * np.pi / 16).fit([new])
    >>> in_mv = Recording({"vibration": 1000 * wave}, 2000, velocity=np.full(8000, 20.0))
    >>> for sentence in outside_training(model, [in_mv])[0]:
    ...     print(sentence)
    speed 20 rad/s is below the training range 150 rad/s
    12.73 revolutions, in the training at least 95.48
    channel 'vibration' 60 dB above training, 0.7071 (root mean square)
    """
    X = as_list(recordings)
    found = training_statements(model, X)
    if found is None:
        raise TypeError(
            f"{type(model).__name__} contains no OrderResampler, which stores the range of the "
            f"training recordings."
        )
    # Another speed, gain or rate changes all lines.
    lines = [[] if own else new_lines(model, x) for own, x in zip(found, X, strict=True)]
    return [[s.text for s in own] or new for own, new in zip(found, lines, strict=True)]


def new_lines(model: Any, recording: Any) -> list[str]:
    """Return the statements of each `BinTransformer` in a model about one recording."""
    with collected_statements() as found, suppress(ValueError):  # it may be too short, or so
        for part in filter(_has_bins, [search_estimator(model)]):
            _state_lines(part, [recording])
    return found


def _has_bins(model: Any) -> bool:
    return any(isinstance(part, BinTransformer) for part in parts_of(model))


def _state_lines(model: Any, X: Any) -> None:
    """Apply what leads to the bins of a fitted model, and these; they state new lines."""
    if isinstance(model, Pipeline):
        steps = [step for _, step in model.steps if step not in (None, "passthrough")]
        while not _has_bins(steps[-1]):
            steps.pop()
        for step in steps[:-1]:
            X = step.transform(X)
        _state_lines(steps[-1], X)
    elif isinstance(model, ConditionRouter):
        _state_lines(model.models_of(X)[0], X)
    elif hasattr(model, "transform") and not isinstance(model, FeatureUnion):
        model.transform(X)
    else:
        for part in filter(_has_bins, _members(model)):
            _state_lines(part, X)


def _members(model: Any) -> list[Any]:
    """Return the fitted estimators that a model is made of."""
    parts = [step for _, step in getattr(model, "transformer_list", ())]
    parts += [*getattr(model, "estimators_", ()), getattr(model, "estimator_", None)]
    return [part for part in parts if hasattr(part, "fit")]


def training_statements(model: Any, X: list[Any]) -> list[list[Statement]] | None:
    """Return what `outside_training` states, and whether it is severe.

    Returns
    -------
    list of list of Statement, or None
        None without an `OrderResampler`.
    """
    model = search_estimator(model)
    if isinstance(model, OrderResampler | StrokeFeatures):
        return model.outside_training(X)
    if isinstance(model, ConditionRouter):
        parts = [
            training_statements(own, [x]) for own, x in zip(model.models_of(X), X, strict=True)
        ]
        return None if None in parts else [part[0] for part in parts if part is not None]
    if isinstance(model, Pipeline):
        for _, step in model.steps:
            found = training_statements(step, X)
            if found is not None:
                return found
            if step in (None, "passthrough") or not hasattr(step, "transform"):
                continue
            X = step.transform(X)
            if not isinstance(X, list):  # features
                return None
        return None
    return _merged([training_statements(part, X) for part in _members(model)])


def _merged(parts: Sequence[list[list[Statement]] | None]) -> list[list[Statement]] | None:
    """Join the statements of several parts of a model, each once."""
    known = [part for part in parts if part is not None]
    if not known:
        return None
    return [list(dict.fromkeys(chain(*own))) for own in zip(*known, strict=True)]
