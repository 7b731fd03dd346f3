"""Decisions on many recordings: one row for each, also for those that cannot be read.

With each decision, what is unusual about its recording: `outside_training` and the quality.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from itertools import chain
from threading import local
from typing import Any

import numpy as np
import pandas as pd
from joblib import effective_n_jobs
from numpy.typing import NDArray
from sklearn.utils.validation import check_is_fitted

from emacm._statements import Statement
from emacm.conditions.router import ConditionRouter
from emacm.decisions.least_risk import CombinedRiskMixin
from emacm.decisions.pipelines import (
    before_the_last_step,
    check_unknown_states,
    final_estimator,
    fitted_resamplers,
    parts_of,
    parts_with_input,
    search_estimator,
)
from emacm.decisions.risks import LeastRiskMixin, risks_of
from emacm.explanations.deviations import second_state_statement
from emacm.explanations.explain import explain_decision
from emacm.files.folder import FileRecording
from emacm.findings.quality import Quality, recording_quality
from emacm.orders.bin_transformer import BinTransformer
from emacm.recordings.inputs import as_list, described, paths_or_numbers, received, run
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler
from emacm.stroke_features.transformer import StrokeFeatures

Row = dict[str, Any]
_show = warnings.showwarning
P_UNKNOWN = "P(unknown)"  # the column, whatever the label of the unknown state


def score(model: Any, recordings: Any, *, n_jobs: int | None = None) -> pd.DataFrame:
    """Decide on recordings; one that is invalid gives a row with its error.

    Parameters
    ----------
    model : estimator, Pipeline, ConditionRouter or search
        A fitted classifier of recordings.
    recordings : sequence of Recording
        Such as a `RecordingFolder`. Up to 32 files of together about 32 MiB are in memory at once,
        in each thread; a larger file by itself.
    n_jobs : int, optional
        Number of recordings processed in parallel.

    Returns
    -------
    DataFrame
        One row for each recording:

        - ``recording``: path of the file, or the number in `recordings`,
        - ``decision``: decision of least expected cost,
        - ``expected_cost`` of this decision, in the unit of the costs,
        - ``typicality``, if the model has it (fitted with ``unknown`` or ``groups``),
        - ``P(<class>)``: posterior probability of each class, given that one of them is true, as of
          `predict_proba`: they add up to 1, also far from all classes,
        - ``P(unknown)``, if the model has an unknown state: its probability,
        - ``warnings``: findings of `OrderResampler.quality`,
        - ``outside_training``: properties outside the range of the training recordings, see
          `outside_training`, what deviates where the decision is the unknown state, and lines of
          another class beside those of the decision (`CostSensitiveGaussianBayes.second_states`),
        - ``error``: why there is no decision; empty if there is one.

        ``attrs["statements"]`` lists what is stated of all recordings together, see
        `batch_statements`.

    Raises
    ------
    TypeError, ValueError
        If `model` is not a fitted classifier, or `recordings` is not a sequence.

    See Also
    --------
    emacm.outside_training : Its statement of conditions outside of training.
    emacm.maintenance_report : Pages of the same recordings.
    emacm.save_model : Stores the model.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import CostSensitiveGaussianBayes, OrderPSD, OrderResampler, Recording, score
    >>> from sklearn.pipeline import make_pipeline
    >>> rng = np.random.default_rng(0)
    >>> runs = [
    ...     Recording({"vibration": level * rng.normal(size=4000)}, 1000, velocity=100.0)
    ...     for level in (1.0, 1.1, 0.9, 3.0, 3.3, 2.7)
    ... ]
    >>> bayes = CostSensitiveGaussianBayes(covariance="diag", shrinkage=0.1)
    >>> model = make_pipeline(OrderResampler(2 * np.pi / 16), OrderPSD(0.25), bayes)
    >>> model = model.fit(runs, ["healthy"] * 3 + ["worn"] * 3)
    >>> table = score(model, [runs[0], runs[4], None])
    >>> table["decision"].tolist()[:2], table["error"][2]
    (['healthy', 'worn'], 'expected a recording, got None.')
    """
    check_model(model)
    columns = score_columns(model)
    if hasattr(recordings, "__len__") and not len(recordings):
        return pd.DataFrame(columns=columns)
    entries = as_list(recordings)
    names = paths_or_numbers(entries)
    table = pd.DataFrame(scored_rows(model, entries, names, n_jobs), columns=columns)
    table.attrs["statements"] = batch_statements(table.get("typicality", ()))
    return table


def batch_statements(typicality: Sequence[float]) -> list[Statement]:
    """State that recordings are shifted as a whole, whatever their states.

    The typicality of recordings like those that were left out of the training is uniform, of any
    known state. A rate of known recordings that are called unknown holds for such recordings only.

    Parameters
    ----------
    typicality : sequence of float
        Typicality of each recording; NaN where it is not known.

    Returns
    -------
    list of Statement
        One, if three quarters of at least ten recordings have a typicality below 0.25, which a
        quarter should have; otherwise none. Recordings of one unit are alike: the limits are far
        apart, so that an unusual unit is seldom stated.

    Examples
    --------
    >>> batch_statements([0.9, 0.2, 0.4, 0.6, 0.1] * 4)
    []
    >>> batch_statements([0.03, 0.2, 0.04, 0.01, 0.1] * 4)[0].text[:59]
    '20 of 20 recordings are less typical than three quarters of'
    """
    known = np.asarray(typicality, dtype=np.float64)
    known = known[~np.isnan(known)]
    n_low = int(np.count_nonzero(known < 0.25))
    if len(known) < 10 or n_low < 0.75 * len(known):
        return []
    text = (
        f"{n_low} of {len(known)} recordings are less typical than three quarters of those of the "
        f"training (expected: {len(known) / 4:.0f}): they are shifted as a whole, by another "
        f"machine, sensor or condition. Known states are called unknown more often than "
        f"unknown_rate says. Give healthy recordings of this unit (add_baseline, emacm score "
        f"--healthy), or train with some"
    )
    return [Statement("shift", "", text, value=n_low / len(known), limit=0.75)]


def check_model(model: Any) -> list[Any]:
    """Return the classes of a fitted classifier.

    Raises
    ------
    TypeError, ValueError
        If it is not a classifier with `predict_proba`, not fitted, or hides the unknown state of
        a classifier inside.
    """
    check_is_fitted(model)
    if not hasattr(model, "predict_proba"):
        raise TypeError(
            f"model must be a classifier with posterior probabilities, got {type(model).__name__}."
        )
    check_unknown_states(model)
    return list(model.classes_)


def score_columns(model: Any) -> list[str]:
    """Return the columns of the table of `score` for a fitted model."""
    first = ["recording", "decision", "expected_cost", "typicality"]
    posteriors = [f"P({c})" for c in np.asarray(model.classes_).tolist()]
    if getattr(final_estimator(model), "unknown", None) is not None:
        if P_UNKNOWN in posteriors:
            raise ValueError(
                "a class of the model is named 'unknown', and so is the column of the probability "
                "that no class is true. Rename this class, or set unknown=None."
            )
        posteriors.append(P_UNKNOWN)
    return [*first, *posteriors, "warnings", "outside_training", "error"]


def scored_rows(
    model: Any,
    sources: Sequence[Any],
    names: Sequence[Any],
    n_jobs: int | None = None,
    *,
    facts: Callable[[Any], Row] | None = None,
) -> list[Row]:
    """Return the rows of recordings, also of those that functions open.

    Parameters
    ----------
    model : estimator
        Fitted classifier.
    sources : sequence of Recording or callable
        A function returns a recording, or raises an error, which is written into the row.
    names : sequence
        Name of each recording.
    n_jobs : int, optional
        Number of recordings processed in parallel.
    facts : callable, optional
        Returns further values of an opened recording for its row.

    Returns
    -------
    list of dict
        With the columns of `score`, and "features": the input of the classifier.
    """
    at_once = min(32, -(-len(sources) // effective_n_jobs(n_jobs))) or 1
    starts = range(0, len(sources), at_once)
    batches = [[part[i : i + at_once] for i in starts] for part in (sources, names)]
    with _warnings_by_thread():
        rows = run(partial(_scored_batch, model, facts), *batches, n_jobs=n_jobs)
    return list(chain.from_iterable(rows))


_reading = local()  # `warnings`: those of the recording that a thread reads


def _keep(message: Any, category: Any, *place: Any, **more: Any) -> None:
    """Keep a warning for the row of the recording that is read; the rows contain what matters."""
    if (kept := getattr(_reading, "warnings", None)) is not None:
        kept.append(str(message))
    elif not issubclass(category, UserWarning):
        _show(message, category, *place, **more)


@contextmanager
def _warnings_by_thread() -> Iterator[None]:
    """Pass warnings to `_keep`: those that are recorded by `catch_warnings` are of all threads."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = _keep
        yield


@_warnings_by_thread()  # in another process
def _scored_batch(
    model: Any, facts: Callable[[Any], Row] | None, sources: Sequence[Any], names: Sequence[Any]
) -> list[Row]:
    """Return the rows of some recordings; those in memory at once are few or small."""
    texts = {"decision": None, "warnings": "", "outside_training": "", "error": ""}
    empty = dict.fromkeys(score_columns(model), np.nan) | texts
    rows: list[Row] = []
    opened: list[tuple[Row, Recording]] = []
    n_bytes = 0
    for source, name in zip(sources, names, strict=True):
        rows.append(empty | {"recording": name})
        _reading.warnings = caught = list[str]()
        try:
            recording = source() if callable(source) else source
            if not isinstance(recording, Recording):
                raise TypeError(f"expected a recording, got {received(recording)}")
            series = recording.series.values()  # read now
            rows[-1] |= facts(recording) if facts else {}
        except Exception as error:  # any error is the result for this recording
            rows[-1]["error"] = _text_of(error)
            continue
        finally:
            _reading.warnings = None
        rows[-1]["warnings"] = "; ".join(caught)
        opened.append((rows[-1], recording))
        n_bytes += sum(len(samples) * samples.dtype.itemsize for samples in series)
        if n_bytes > 1 << 25:
            _fill_and_release(model, opened)
            opened, n_bytes = [], 0
    _fill_and_release(model, opened)
    return rows


def _text_of(error: Any, recording: Recording | None = None) -> str:
    """Return an error as a text; its row says which recording it is."""
    while recording is not None and getattr(error, "place", "") == described(recording, 0):
        error = error.__cause__
    known = isinstance(error, ValueError | TypeError | OSError | ImportError)
    text = str(error) if known else f"{type(error).__name__}: {error}"
    return " ".join(text.split()) or type(error).__name__


def _fill_and_release(model: Any, opened: list[tuple[Row, Recording]]) -> None:
    """Fill the rows of recordings, and drop those of files from memory."""
    try:
        _fill(model, opened)
    finally:
        for _, recording in opened:
            if isinstance(recording, FileRecording):
                recording.release()


def _fill(model: Any, opened: list[tuple[Row, Recording]]) -> None:
    """Fill the rows of recordings together; in parts, down to single ones, if one is invalid."""
    if not opened:
        return
    recordings = [recording for _, recording in opened]
    try:
        parts = _by_condition(model, recordings)
        if len(parts) == 1:
            for (row, _), result in zip(opened, _results(model, recordings), strict=True):
                stated = filter(None, [row["warnings"], result["warnings"]])
                row |= result | {"warnings": "; ".join(stated)}
            return
    except Exception as error:
        if len(opened) == 1:
            opened[0][0]["error"] = _text_of(error, recordings[0])
            with suppress(Exception):  # defects, such as a dead channel, are often the reason
                opened[0][0].update(_findings(model, recordings)[0])
            return
        parts = np.array_split(np.arange(len(opened)), 2)
    for part in parts:
        _fill(model, [opened[i] for i in part])


def _by_condition(model: Any, recordings: Any) -> list[NDArray[np.intp]]:
    """Return the numbers of the recordings of each condition; of one, those of a router inside."""
    parts = [np.arange(len(recordings))]
    while len(parts) == 1 and isinstance(final_estimator(model), ConditionRouter):
        router, entries = before_the_last_step(model, recordings)
        models = router.models_of(entries)
        parts = [np.flatnonzero([own is each for each in models]) for own in dict.fromkeys(models)]
        model, recordings = models[0], router.inner(entries)
    return parts


def _results(model: Any, recordings: list[Recording]) -> list[Row]:
    """Return decisions and findings of recordings of one condition."""
    final, table = opened_classifier(model, recordings)
    decisions = _decisions(model, final, table)
    unknown = getattr(final, "unknown", None)
    seconds = [None] * len(decisions)
    if hasattr(final, "second_states"):
        seconds = final.second_states(table, [row["decision"] for row in decisions])
    rows = []
    for number, found in enumerate(_findings(model, recordings)):
        row = decisions[number] | found | {"features": np.asarray(table)[number]}
        outside = row["outside_training"]
        if unknown is not None and row["decision"] == unknown:
            known_least = _least_typical(model, recordings[number])
            outside = _reasons(*known_least, outside, decision=unknown)
        elif seconds[number] is not None:
            second = second_state_statement(row["decision"], seconds[number])
            outside = _reasons(model, recordings[number], outside, second)
        rows.append(row | {"outside_training": outside})
    return rows


def _decisions(model: Any, final: Any, table: Any) -> list[Row]:
    """Return decision, cost, typicality and probabilities of each row of a table."""
    probabilities, known, columns = final.predict_proba(table), final.classes_, Row()
    typicality = None
    if hasattr(final, "typicality"):
        with suppress(ValueError):  # the model has no typicality; the features are valid
            typicality = final.typicality(table)
            columns["typicality"] = typicality
    of_state = dict(zip(known.tolist(), probabilities.T, strict=True))
    for label in np.asarray(model.classes_).tolist():
        columns[f"P({label})"] = of_state.get(label, np.zeros(len(probabilities)))
    if isinstance(final, LeastRiskMixin):
        truths = final.truth_proba(table, probabilities, typicality)
        columns["expected_cost"] = risks_of(truths, final.cost_).min(axis=1)
        columns["decision"] = final.decided(truths)
        if final.unknown is not None:
            columns[P_UNKNOWN] = truths[:, -1]
    else:
        columns["decision"] = np.asarray(final.predict(table))
    values = [values.tolist() for values in columns.values()]
    return [dict(zip(columns, row, strict=True)) for row in zip(*values, strict=True)]


def opened_classifier(model: Any, X: list[Any]) -> tuple[Any, Any]:
    """Return the classifier behind routers and pipelines, with its present costs, and its input.

    Parameters
    ----------
    model : estimator
        Fitted classifier.
    X : list of Recording
        Of one condition, if the model has several.

    Returns
    -------
    classifier : estimator
    table : table of shape (n_recordings, n_features)
    """
    final, table = before_the_last_step(model, X)
    if not isinstance(final, ConditionRouter):
        return final, table
    inner, features = opened_classifier(final.models_of(table)[0], final.inner(table))
    return final.with_present_costs(inner), features


def _least_typical(model: Any, recording: Any) -> tuple[Any, Any]:
    """Return the classifier that knows least of a recording, of those combined, and its input."""
    X = [recording]
    if isinstance(final_estimator(model), ConditionRouter):
        model, X = before_the_last_step(model, X)
    final, table = opened_classifier(model, X)
    while isinstance(final, CombinedRiskMixin):
        model, X = final.least_typical(table), table
        final, table = before_the_last_step(model, table)
    return model, X


def _reasons(model: Any, recording: Any, known: str, *otherwise: str, decision: Any = None) -> str:
    """Return the sentences on properties outside the training range, then what else deviates."""
    statements = [*otherwise]
    with suppress(TypeError, ValueError):  # some models decide but cannot be explained
        explained = explain_decision(model, recording, decision=decision)
        statements = explained.attrs.get("statements", statements)
    return "; ".join(filter(None, [known, *statements]))


def _findings(model: Any, recordings: list[Recording]) -> list[Row]:
    """Return what is unusual about recordings of one condition as measured."""
    resamplers = fitted_resamplers(search_estimator(model))
    if not any(isinstance(part, OrderResampler | StrokeFeatures) for part in parts_of(model)):
        return [{"warnings": "", "outside_training": ""}] * len(recordings)
    outside = outside_training(model, recordings)
    return [
        {
            "warnings": joined(defects_of(resamplers, recording)),
            "outside_training": joined(statements),
        }
        for recording, statements in zip(recordings, outside, strict=True)
    ]


def joined(statements: Iterable[Statement]) -> str:
    """Return the texts of statements as one text."""
    return "; ".join(statement.text for statement in statements)


def measured_quality(resampler: OrderResampler, recording: Recording) -> Quality:
    """Return the quality of a recording for a fitted resampler, of the channels that it has."""
    known = [name for name in resampler.channels_ if name in recording.channels]
    return recording_quality(resampler.over_angle(recording, known or recording.channels))


def defects_of(resamplers: Sequence[OrderResampler], recording: Recording) -> list[Statement]:
    """Return the defects of a recording in the channels of all resamplers of a model."""
    found = (measured_quality(resampler, recording).defects for resampler in resamplers)
    return list(dict.fromkeys(chain.from_iterable(found)))


def outside_training(model: Any, recordings: Sequence[Any]) -> list[list[Statement]]:
    """State which properties of recordings are outside the range of the training recordings.

    The units of channels and the range of level, speed, sampling rate, revolutions and highest
    valid order are those of the recordings that the `OrderResampler` of the model was fitted on,
    the largest height of each spectral line over its background those of its `BinTransformer`. A
    `ConditionRouter` compares each recording with the training recordings of its condition.

    Parameters
    ----------
    model : OrderResampler, Pipeline, ConditionRouter or fitted search
        Fitted; contains an `OrderResampler`, `BandPowers`, or features computed from strokes over
        time, for which the direction of rotation is stated.
    recordings : list of Recording
        Recordings as for `predict` of the model.

    Returns
    -------
    list of list of Statement
        For each recording, one for each property outside its range; empty if there is none.
        Load, speed, torque, temperature and pressure in `meta` are stated if they differ by
        more than 10 % from each value of the training; levels from 3 dB beyond the range, speeds,
        lengths and valid orders from 10 %, sampling rates from 0.1 %, a direction of rotation that
        the training does not have from 10 % of the revolutions; a unit or sensor (see
        `emacm.findings.training_range.UNITS`) that is not in a training of fewer than four; if
        nothing else is stated, new spectral lines (`BinTransformer.new_lines`), as another speed or
        gain changes all lines.

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
    >>> for statement in outside_training(model, [in_mv])[0]:
    ...     print(statement.text)
    highest speed 191 rpm is below that of the training, 1432 rpm
    12.73 revolutions, in the training at least 95.48
    channel 'vibration' 60 dB above training, 0.7071 (root mean square)
    """
    return [_outside_training(model, recording) for recording in as_list(recordings)]


def _outside_training(model: Any, recording: Any) -> list[Statement]:
    """Return what is stated of one recording, which has one condition."""
    parts = [*parts_with_input(model, [recording], (OrderResampler, StrokeFeatures))]
    if not parts:
        raise TypeError(
            f"{type(model).__name__} contains no OrderResampler, which knows the range of the "
            f"training recordings, and no BandPowers."
        )
    found = [statement for part, X in parts for statement in part.outside_training(X)[0]]
    if all(statement.kind == "new unit" for statement in found):
        with suppress(ValueError):  # it may be too short, or so
            bins = parts_with_input(model, [recording], BinTransformer)
            found += [line for part, X in bins for line in part.new_lines(X)[0]]
    return list(dict.fromkeys(found))
