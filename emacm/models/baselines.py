"""Models whose features are relative to healthy recordings of the same unit or sensor."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np
import pandas as pd
from sklearn import config_context
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import check_is_fitted

from emacm._statements import warn
from emacm.conditions.feature_baseline import FeatureBaseline, left_out_differences
from emacm.conditions.healthy import healthy_recordings
from emacm.decisions.pipelines import groups_options, search_estimator
from emacm.evaluation.evaluate import Evaluation, evaluate
from emacm.machine.fault_orders import Parts
from emacm.machine.find_faults import find_faults
from emacm.recordings.inputs import as_list, described
from emacm.recordings.meta import condition_name, read_meta


def add_baseline(model: Any, recordings: Any, *, parts: Parts | None = None) -> Any:
    """Return a fitted model that knows healthy recordings of further units or sensors.

    The classifier stays as it is: only the mean features that are subtracted are added, so that
    nothing has to be trained again. **A fault that is present in all of these recordings would be
    subtracted, and hidden**; they are checked, and refused if they look like a fault.

    Parameters
    ----------
    model : Pipeline
        Fitted, with a `FeatureBaseline` as its first step and a classifier as its last one; it is
        not changed.
    recordings : list of Recording
        Healthy recordings, at least one of each new unit; their `meta` names it.
    parts : part, or sequence of parts, optional
        Components of the machine, of whose faults the recordings must not have lines.

    Returns
    -------
    Pipeline
        A copy; ``model[0].n_healthy_`` gives the number of recordings of each unit.

    Raises
    ------
    TypeError, ValueError
        If the model has no such steps, or a recording is invalid or looks faulty: `find_faults`
        names a fault of `parts`; relative to the other recordings of its unit it is probably a
        fault; or the recordings of a unit together differ from the healthy ones of the most similar
        unit of the training as a faulty class does.

    Warns
    -----
    EmacmWarning
        If the recordings of a unit differ from the known ones by more than a fault does, but in
        another way, as those of another sensor: then a fault in them cannot be seen.

    See Also
    --------
    emacm.FeatureBaseline : The step, with the limits of the method.
    emacm.outside_training : States which recordings are of a new unit.

    Notes
    -----
    Together they look like a fault if the difference of their mean from that of the most similar
    known unit has a cosine of at least 0.6 with the difference of a faulty class from the healthy
    ones, both in the metric of the covariance within the classes, and at least half its length in
    this direction; a quarter of it also without the median change of each channel, as another gain
    raises all its features. Another microphone changes the features in other directions.
    A fault of a kind that the training does not have is not found by this.
    ``benchmarks/frequency_bands.py`` states how often each is right.

    Examples
    --------
    >>> import warnings
    >>> import numpy as np
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.preprocessing import FunctionTransformer
    >>> from emacm import BandPowers, CostSensitiveGaussianBayes, EmacmWarning, FeatureBaseline
    >>> from emacm import Recording, add_baseline
    >>> rng = np.random.default_rng(0)
    >>> def run(unit, gain, worn):
    ...     noise = gain * rng.normal(size=(2, 4000))
    ...     sound = noise[0] + worn * 3 * gain * np.sin(np.arange(4000) * 0.5)
    ...     return Recording({"sound": sound}, 1000, velocity=10.0, meta={"unit": unit})
    >>> log = FunctionTransformer(np.log10, feature_names_out="one-to-one")
    >>> model = make_pipeline(
    ...     FeatureBaseline(make_pipeline(BandPowers("octave"), log), condition="unit"),
    ...     CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto"),
    ... )
    >>> states = ["healthy"] * 6 + ["worn"] * 6
    >>> model = model.fit([run("A", 1.0, state == "worn") for state in states], states)
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore", EmacmWarning)  # B has another gain
    ...     model = add_baseline(model, [run("B", 9.0, False) for _ in range(3)])
    >>> model.predict([run("B", 9.0, False), run("B", 9.0, True)]).tolist()
    ['healthy', 'worn']
    """
    model = copy.deepcopy(search_estimator(model))
    if not isinstance(model, Pipeline) or not isinstance(model[0], FeatureBaseline):
        raise TypeError(
            "the model has no baseline: it must be a Pipeline that begins with a FeatureBaseline. "
            "Train it so (emacm train --baseline)."
        )
    check_is_fitted(model)
    recordings = as_list(recordings)
    if parts is not None:
        _check_lines(recordings, parts)
    baseline, known = model[0], [*model[0].means_.values()]
    baseline.add_healthy(recordings)
    conditions = read_meta(recordings, baseline.condition)
    for value in dict.fromkeys(conditions):
        own = [row for row, other in enumerate(conditions) if other == value]
        unit = condition_name(baseline.condition, value)
        beyond = _check_healthy(model, recordings, own, known, unit)
        if beyond and parts is None:
            warn("baseline", beyond)
    return model


def _check_lines(recordings: Sequence[Any], parts: Parts) -> None:
    """Raise if a recording has lines of a fault."""
    found = find_faults(recordings, parts)
    for row in found[~found["named"].isin(["none", "not assessed"])].itertuples():
        raise ValueError(
            f"{described(recordings[row.recording], row.recording)} is not healthy: its channel "
            f"{row.channel!r} has lines of {row.named}. Leave it out of the baseline."
        )


def _check_healthy(
    model: Pipeline, recordings: Sequence[Any], own: Sequence[int], known: Sequence[Any], unit: str
) -> str:
    """Raise if recordings of a unit look like a fault, each by itself or all together.

    Return why a fault in all of them would not be seen; "" if it would.
    """
    baseline, classifier = model[0], model[-1]
    features = np.asarray(baseline.transformer_.transform([recordings[row] for row in own]))
    labels = classifier.classes_.tolist()
    healthy = baseline.healthy if isinstance(baseline.healthy, list | tuple) else [baseline.healthy]
    is_healthy = np.isin(labels, healthy)
    if len(own) > 1:
        apart = left_out_differences(features, [unit] * len(own), np.full(len(own), True))
        probability = classifier.predict_proba(_through(model, apart))
        likely = probability.argmax(axis=1)
        # With calibrated probabilities, one in a hundred baselines without a fault is refused.
        is_odd = probability[:, is_healthy].sum(axis=1) < 0.01 / len(own)
        for k in np.flatnonzero(is_odd).tolist():
            raise ValueError(
                f"{described(recordings[own[k]], own[k])} is not like the other healthy ones of "
                f"{unit}: relative to them it is most like {labels[likely[k]]!r}. Leave it "
                f"out of the baseline."
            )
    if not hasattr(classifier, "means_"):
        return (
            f"{type(classifier).__name__} does not show whether all recordings of {unit} are faulty"
        )
    within, n_features = classifier.covariances_, classifier.means_.shape[1]
    if getattr(classifier, "covariance", "") == "diag":
        within = within[:, :, np.newaxis] * np.eye(n_features)
    root = np.linalg.cholesky(within.reshape(-1, n_features, n_features).mean(axis=0))
    centre = classifier.means_[is_healthy].mean(axis=0)
    apart = pd.DataFrame(features.mean(axis=0) - known)
    gains = apart.T.groupby(_channels(baseline, features)).transform("median").T
    shifts, others = (
        np.linalg.solve(root, (_through(model, each.to_numpy()) - centre).T).T
        for each in (apart, apart - gains)  # another gain raises all features of a channel
    )
    place = np.linalg.norm(shifts, axis=1).argmin()
    shift, without_gain = shifts[place], others[place]
    moved, sizes = float(np.linalg.norm(shift)), {}
    for label, mean in zip(labels, classifier.means_, strict=True):
        if label in healthy:
            continue
        fault = np.linalg.solve(root, mean - centre)
        sizes[label], along = float(np.linalg.norm(fault)), float(shift @ fault)
        # Of other microphones a tenth is like a fault by chance (benchmark above).
        is_like = along >= sizes[label] * max(0.6 * moved, 0.5 * sizes[label])
        if is_like and without_gain @ fault >= 0.25 * sizes[label] ** 2:
            raise ValueError(
                f"the {len(own)} recordings of {unit} differ from the healthy ones of the training "
                f"as those of {label!r} do: a fault would be hidden. Check the machine; if it is "
                f"known to be healthy, call add_healthy of the FeatureBaseline."
            )
    smallest = min(sizes, key=lambda label: sizes[label])
    if moved <= sizes[smallest]:
        return ""
    return (
        f"the {len(own)} recordings of {unit} differ from the healthy ones of the training as "
        f"those of another sensor or type do, by {moved / sizes[smallest]:.1f} times as much as "
        f"{smallest!r}: a fault in all of them is not seen, and would be hidden. Make sure that "
        f"the machine was healthy, or state its parts"
    )


def _channels(baseline: FeatureBaseline, features: Any) -> list[str]:
    """Return the channel of each feature; "" for those without names."""
    with suppress(AttributeError, ValueError):
        return [str(name).rpartition("@")[0] for name in baseline.get_feature_names_out()]
    return [""] * features.shape[1]


def _through(model: Pipeline, features: Any) -> Any:
    """Return differences of features as the classifier gets them."""
    return model[1:-1].transform(features) if len(model) > 2 else features


def evaluated_and_fitted(
    model: Any, X: Any, y: Sequence[Any], groups: Sequence[Any], healthy: Any
) -> tuple[Evaluation, Any, Any]:
    """Evaluate a model on groups that are left out, and fit it to all recordings.

    If the model is relative to a baseline, also that of a unit which is left out is known, as when
    it is commissioned: each healthy recording is relative to the other healthy ones of its unit.

    Parameters
    ----------
    model : Pipeline or classifier
        It is fitted in place. With a baseline, it has a classifier as its second and last step.
    X : sequence of Recording, or table
        Recordings, or their features.
    y, groups : sequence of shape (n_recordings,)
        State and group of each.
    healthy : label
        The healthy state.

    Returns
    -------
    evaluation : Evaluation
    model : Pipeline or classifier
        Fitted.
    features : ndarray of shape (n_recordings, n_features)
        What the classifier was fitted to.
    """
    if not isinstance(model, Pipeline) or not isinstance(model[0], FeatureBaseline):
        found = evaluate(model, X, y, units=groups, healthy=healthy)
        with config_context(enable_metadata_routing=True):  # they reach bins in a FeatureUnion
            model.fit(X, y, **groups_options(model, groups))
        features = model[:-1].transform(X) if isinstance(model, Pipeline) else X
        return found, model, np.asarray(features)
    with config_context(enable_metadata_routing=True):
        baseline, last = model[0].fit(X, y, groups), model[-1]
    features, is_healthy = baseline.transformer_.transform(X), healthy_recordings(X, y, healthy)
    conditions = read_meta(X, baseline.condition)
    features = left_out_differences(np.asarray(features), conditions, is_healthy)
    found = evaluate(last, features, y, units=groups, healthy=healthy)
    last.fit(features, y, **groups_options(last, groups))
    return found, model, features
