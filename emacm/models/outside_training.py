"""Properties of recordings that are outside the range of the training recordings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import chain
from typing import Any

from sklearn.pipeline import Pipeline

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
    return [_outside_training(model, recording) for recording in as_list(recordings)]


def _outside_training(model: Any, recording: Any) -> list[str]:
    found = training_statements(model, recording)
    if found is None:
        raise TypeError(
            f"{type(model).__name__} contains no OrderResampler, which stores the range of the "
            f"training recordings."
        )
    # Another speed, gain or rate changes all lines.
    return [statement.text for statement in found] or _new_lines(model, recording)


def _new_lines(model: Any, recording: Any) -> list[str]:
    """Return the statements of each `BinTransformer` in a model about one recording."""
    with collected_statements() as found, suppress(ValueError):  # it may be too short, or so
        for part, X in parts_with_input(model, [recording], BinTransformer):
            part.transform(X)
    return found


def training_statements(model: Any, recording: Any) -> list[Statement] | None:
    """Return what `outside_training` states of a recording; None without an `OrderResampler`."""
    kinds = (OrderResampler, StrokeFeatures)
    found = [part.outside_training(X)[0] for part, X in parts_with_input(model, [recording], kinds)]
    return list(dict.fromkeys(chain.from_iterable(found))) if found else None


def parts_with_input(model: Any, X: Any, kinds: Any) -> Iterator[tuple[Any, Any]]:
    """Yield the fitted parts of a model that are of some kinds, with their input.

    Parameters
    ----------
    model : estimator
        Fitted.
    X : list of Recording
        Of one condition, if the model has several.
    kinds : type or tuple of types
        A pipeline is followed up to the first step that contains one of them.
    """
    model = search_estimator(model)
    if isinstance(model, kinds):
        yield model, X
    elif isinstance(model, ConditionRouter):
        yield from parts_with_input(model.models_of(X)[0], X, kinds)
    elif not isinstance(model, Pipeline):
        for part in _members(model):
            yield from parts_with_input(part, X, kinds)
    elif any(isinstance(part, kinds) for part in parts_of(model)):
        for _, step in model.steps:
            found = list(parts_with_input(step, X, kinds))
            yield from found
            if found:
                return
            X = step.transform(X) if hasattr(step, "transform") else X


def _members(model: Any) -> list[Any]:
    """Return the fitted estimators that a model is made of."""
    parts = [step for _, step in getattr(model, "transformer_list", ())]
    parts += [*getattr(model, "estimators_", ()), getattr(model, "estimator_", None)]
    return [part for part in parts if hasattr(part, "fit")]
