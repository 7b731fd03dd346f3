"""Pipelines from recordings to a decision: of an actuator, and of spectra in orders or in Hz."""

from __future__ import annotations

from typing import Any

import numpy as np
from sklearn.pipeline import FeatureUnion, Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from emacm._checks import check_choice, check_number
from emacm.conditions.signal_baseline import SignalBaseline
from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.orders.band_powers import BandPowers
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_cross_spectrum import OrderCrossSpectrum
from emacm.orders.order_psd import OrderPSD
from emacm.resampling.order_resampler import OrderResampler
from emacm.stroke_features.harmonics import ShaftHarmonics
from emacm.stroke_features.profile import StrokeProfile
from emacm.stroke_features.statistics import RecordingStatistics


def actuator_recipe(
    *,
    phase: bool = False,
    healthy: Any = None,
    condition: Any = "load",
    cost: Any = None,
    priors: Any = None,
    unknown: Any = "unknown",
    unknown_rate: float | None = 0.02,
    temperature: Any = "groups",
    revolutions: float = 4,
    max_order: float = 2.5,
    min_speed: float = 0.0,
    n_jobs: int | None = None,
) -> Pipeline:
    """Return an unfitted pipeline from recordings of an actuator to a decision.

    The features describe forward and reverse strokes separately: powers in order bins; the
    frequency response and the coherence between channels over orders; mean, standard
    deviation and slope of each channel; its profile along the stroke; and the 1x component. The
    classifier is a Gaussian for each class, with one covariance for all. A recording that is unlike
    the training recordings, such as one of another machine, is decided to be "unknown".

    Parameters
    ----------
    phase : bool
        Use the 1x component with its phase against the shaft angle. **Only for recordings of the
        same assemblies**: this phase depends on how the parts were assembled, and changes when
        a machine is reassembled. If False, phases are relative to the 1x component of forward
        strokes, and no feature depends on the mounting angle of a part (except through
        incomplete revolutions at the ends of strokes).
    healthy : label, or collection of labels, optional
        Healthy recordings, as for `SignalBaseline`. All features except the 1x component are then
        computed from the residual signal: the mean healthy signal of the same condition is
        subtracted at each shaft angle. It needs at least two healthy recordings of each condition,
        since a single one has no residual. It needs ``phase=True``, because the residual of the
        1x component depends on both phases.
    condition : hashable, tuple or callable
        Key of `meta` within which recordings are compared with `healthy` ones. For a
        separate classifier for each condition, put the recipe into a `ConditionRouter`.
    cost, priors
        As for `CostSensitiveGaussianBayes`; for decisions on families, a table of `family_costs`.
    unknown, unknown_rate, temperature
        As for `CostSensitiveGaussianBayes`: the label of the unknown state, the share of known
        recordings whose decision it may change (ignored without it), and the calibration of
        the posterior. They are estimated by leaving out groups of recordings that were
        measured together: ``fit(X, y, costsensitivegaussianbayes__groups=runs)``. `evaluate`
        passes them; without groups, single recordings are left out, with a warning that
        near-duplicates make the model over-confident. None, for all, is the method of the thesis.
        These groups do not reach the limits of new spectral lines; with scikit-learn's metadata
        routing they do, see `BinTransformer.fit`.
        With fewer than six groups of each class, a new spectral line, and with two also a channel
        without a signal, may still be given a class.
    revolutions : float
        Length of a segment of the spectra, and the inverse of the bin width. Short segments give
        few bins with little scatter.
    max_order : float
        Highest order of the spectra; `OrderResampler.quality` gives the highest valid order.
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s].
    n_jobs : int, optional
        Number of recordings processed in parallel.

    Returns
    -------
    Pipeline
        Steps "featureunion", "standardscaler" and "costsensitivegaussianbayes". X is a list of
        `Recording` with at least two channels. Directions are separate if a recording of `fit`
        has strokes in both; a machine with one direction needs no setting.

    Raises
    ------
    ValueError
        If `healthy` is given without `phase`, or a number is out of range. When fitted: if
        a channel of a recording has no power (the message gives both).

    See Also
    --------
    emacm.bearing_recipe : For vibration of rolling bearings.
    emacm.evaluate : What the fitted model can do.

    Notes
    -----
    The profile along the stroke has 12 coefficients. In strokes that are much longer than 6
    revolutions they do not depend on the 1x component. Starts, stops and peaks are not
    used, as they depend on the start and end positions; `RecordingStatistics` provides them.

    With `healthy`, the mean healthy signals are learned from all training recordings, also from
    those that are left out to calibrate the unknown state: new recordings are then less typical
    than these, especially if there are few healthy ones.

    The features and the classifier were selected on runs 1 to 7 of a ball screw sampled 5 times
    per revolution; ``benchmarks/real_actuator.py`` states the number of variants tried. For another
    machine, start here: set `revolutions`, `max_order` and `min_speed` to suit the recordings, and
    compare variants by `evaluate`.

    Examples
    --------
    >>> from emacm import ConditionRouter, actuator_recipe
    >>> model = ConditionRouter(actuator_recipe(max_order=20), condition="load")
    >>> [name for name, _ in model.estimator.steps]
    ['featureunion', 'standardscaler', 'costsensitivegaussianbayes']
    """
    check_choice(phase, "phase", (True, False))
    check_number(revolutions, "revolutions", above=0)
    check_number(max_order, "max_order", at_least=2 / 2.4)
    check_number(revolutions * max_order, "revolutions * max_order, the bins,", at_most=1000)
    if healthy is not None and not phase:
        raise ValueError(
            f"healthy = {healthy!r} needs phase=True, on which the residual of the 1x component "
            f"depends: for recordings of the same assemblies only."
        )
    # Anything shorter than a revolution is noise of the shaft reference at rest.
    strokes: dict[str, Any] = {"min_revolutions": 1.0, "n_jobs": n_jobs}
    residual = SignalBaseline(condition=condition, healthy=healthy)
    over_angle = make_pipeline(
        OrderResampler(2 * np.pi / (2.4 * max_order), min_speed=min_speed),
        "passthrough" if healthy is None else residual,
        _over_angle(revolutions, max_order, strokes),
    )
    reference = "absolute" if phase else "relative"
    lines = ShaftHarmonics((1,), phase=reference, n_sections=2, min_speed=min_speed, **strokes)
    features = _union(over_angle=over_angle, lines=lines)
    gaussians = recipe_classifier(
        cost, priors=priors, unknown=unknown, unknown_rate=unknown_rate, temperature=temperature
    )
    return make_pipeline(features, StandardScaler(), gaussians)


def spectrum_recipe(
    features: str = "both",
    *,
    max_order: float = 20.0,
    revolutions: float = 16,
    min_speed: float = 0.0,
    low: float | None = None,
    high: float | None = None,
    cost: Any = None,
    priors: Any = None,
    unknown: Any = "unknown",
    unknown_rate: float | None = 0.02,
    temperature: Any = "groups",
) -> Pipeline:
    """Return an unfitted pipeline from powers in order bins, in third octaves or in both.

    Order bins follow the speed of the shaft: they are right for unbalance, misalignment, gears and
    bearings, whose lines have fixed orders. Bands of fixed frequency are right for what does not
    follow the shaft: resonances that a fault excites or shifts, noise of rubbing, of flow or of the
    supply. Which is better is a question to the data; a search on units left out answers it.

    Parameters
    ----------
    features : {"both", "orders", "bands"}
        Powers in order bins (`BinTransformer`), in third octaves (`BandPowers`), or in both; their
        logarithms.
    max_order : float
        Highest order of the order spectra.
    revolutions : float
        Length of a segment of the order spectra. The bins are one order wide, with fewer than
        two revolutions 2/revolutions.
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s].
    low, high : float, optional
        As for `BandPowers`.
    cost, priors, unknown, unknown_rate, temperature
        As for `CostSensitiveGaussianBayes`.

    Returns
    -------
    Pipeline
        With "both", the steps "featureunion", of "orders" and "bands", and
        "costsensitivegaussianbayes", which is a Gaussian for each class with one covariance.

    Raises
    ------
    TypeError, ValueError
        If `features` is none of these; when fitted, as of the steps.

    See Also
    --------
    emacm.actuator_recipe : For strokes of an actuator.
    emacm.bearing_recipe : Levels of fault lines.

    Examples
    --------
    Which features are best, for units that are left out:

    >>> from sklearn.model_selection import GridSearchCV, GroupKFold
    >>> from emacm import spectrum_recipe
    >>> choices = {
    ...     "orders": {"featureunion__bands": ["drop"]},
    ...     "bands": {"featureunion__orders": ["drop"]},
    ...     "both": {},
    ... }
    >>> search = GridSearchCV(
    ...     spectrum_recipe(), [*choices.values()], cv=GroupKFold(5), scoring="balanced_accuracy"
    ... )

    ``search.fit(X, y, groups=units)`` fits the best one to all recordings.
    """
    check_choice(features, "features", ("both", "orders", "bands"))
    orders = order_levels(max_order, revolutions, min_speed)
    bands = [BandPowers(low=low, high=high), _logarithm()]
    both = _union(orders=make_pipeline(*orders), bands=make_pipeline(*bands))
    gaussians = recipe_classifier(
        cost, priors=priors, unknown=unknown, unknown_rate=unknown_rate, temperature=temperature
    )
    steps = {"orders": orders, "bands": bands, "both": [both]}[features]
    return make_pipeline(*steps, gaussians)


def order_levels(max_order: float, revolutions: float, min_speed: float) -> list[Any]:
    """Return the steps from recordings to logarithms of the powers in order bins.

    With 2.6 samples per cycle of the highest order, the filter of the resampling is still flat.
    """
    return [
        OrderResampler(2 * np.pi / (2.6 * max_order), min_speed=min_speed),
        OrderPSD(revolutions, max_order=max_order),
        BinTransformer(max(1.0, 2 / revolutions), max_order=max_order),
        _logarithm(),
    ]


def recipe_classifier(
    cost: Any = None,
    *,
    unknown: Any = "unknown",
    unknown_rate: float | None = 0.02,
    temperature: Any = "groups",
    **options: Any,
) -> CostSensitiveGaussianBayes:
    """Return the classifier of the recipes: a Gaussian for each class, with one covariance."""
    return CostSensitiveGaussianBayes(
        cost,
        covariance="tied",
        shrinkage="auto",
        unknown=unknown,
        unknown_rate=None if unknown is None else unknown_rate,
        temperature=temperature,
        **options,
    )


def _logarithm() -> FunctionTransformer:
    return FunctionTransformer(np.log10, feature_names_out="one-to-one")


def _over_angle(revolutions: float, max_order: float, strokes: dict[str, Any]) -> FeatureUnion:
    """Return the features that are computed from recordings over the shaft angle."""
    spectra: dict[str, Any] = {"by_direction": "auto", "n_jobs": strokes["n_jobs"]}
    bins: dict[str, Any] = {"bin_size": 1 / revolutions, "max_order": max_order}
    return _union(
        powers=make_pipeline(
            OrderPSD(revolutions, **spectra),
            BinTransformer(**bins),
            FunctionTransformer(np.log, feature_names_out="one-to-one"),
        ),
        responses=OrderCrossSpectrum(
            revolutions, kind=("response", "coherence"), **bins, **spectra
        ),
        levels=RecordingStatistics(("mean", "std", "slope"), **strokes),
        profile=StrokeProfile(12, **strokes),
    )


def _union(**blocks: Any) -> FeatureUnion:
    """Join features under their own names, which all differ."""
    return FeatureUnion([*blocks.items()], verbose_feature_names_out=False)
