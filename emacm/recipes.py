"""A pipeline to start with, for actuators that stroke to and fro."""

from __future__ import annotations

from typing import Any

import numpy as np
from sklearn.pipeline import FeatureUnion, Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from emacm._checks import check_choice, check_number
from emacm.conditions.signal_baseline import SignalBaseline
from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_cross_spectrum import OrderCrossSpectrum
from emacm.orders.order_psd import OrderPSD
from emacm.resampling.order_resampler import OrderResampler
from emacm.resampling.signal_cache import SignalCache
from emacm.stroke_features.harmonics import ShaftHarmonics
from emacm.stroke_features.profile import StrokeProfile
from emacm.stroke_features.statistics import RecordingStatistics

_STROKE = 1.0  # revolutions; what is shorter is jitter of a shaft that stands
_OVERSAMPLED = (
    2.4  # samples per cycle of the highest order, so that it lies where the filter is flat
)


def actuator_recipe(
    *,
    phase: bool = False,
    healthy: Any = None,
    condition: Any = "load",
    cost: Any = None,
    priors: Any = None,
    revolutions: float = 4,
    max_order: float = 2.5,
    min_speed: float = 0.0,
    n_jobs: int | None = None,
) -> Pipeline:
    """Return an unfitted pipeline from recordings of an actuator to a decision.

    It looks at what an engineer would look at, forward and reverse strokes apart: powers over
    orders; how one channel answers another, as frequency response and coherence over orders;
    level, spread and trend of each stroke and the slow course along it; and the wave once per
    revolution. The classifier is a Gaussian for each class, with one covariance for all.

    Parameters
    ----------
    phase : bool
        Take the wave once per revolution with its phase against the shaft angle. **For the
        same assemblies only**: that phase tells which parts were put together how, and a
        machine put together anew has another one. Without it, phases are counted from the
        forward wave, and no feature depends on where on the shaft, or in the stroke, the wave
        stands, but for what the ends of strokes let through that are not whole revolutions.
    healthy : label, collection of labels, mapping or callable, optional
        Which recordings are healthy, as for `SignalBaseline`. All but the wave once per
        revolution is then relative to them, condition by condition: the mean healthy signal
        at each shaft angle is taken off before spectra are (of two recordings at the least, as one
        is nothing beside itself). For conditions from which there
        are healthy recordings alone. It needs ``phase=True``, as the difference of two waves
        depends on where each stands.
    condition : hashable, tuple or callable
        Key of `meta` within which recordings are compared with `healthy` ones. For a
        classifier for each condition, put the recipe into a `ConditionRouter`.
    cost, priors
        As for `CostSensitiveGaussianBayes`; a table of `family_costs` decides on families.
    revolutions : float
        Length of a segment of the spectra, and so 1 / (width of a bin). Short segments give
        few bins of small scatter.
    max_order : float
        Highest order of the spectra; `OrderResampler.quality` tells what recordings hold.
    min_speed : float
        Speed up to which the shaft counts as standing [rad/s].
    n_jobs : int, optional
        Recordings in work at the same time.

    Returns
    -------
    Pipeline
        Steps "featureunion", "standardscaler" and "costsensitivegaussianbayes". It takes a
        list of `Recording`, each with forward and reverse strokes.

    Raises
    ------
    ValueError
        If `healthy` is given without `phase`, or a number is not what it should be.

    Notes
    -----
    The profile along the stroke has 12 coefficients. They are blind to the wave once per
    revolution in strokes that are far longer than 6 revolutions. Starts, stops and peaks are left
    out, as they depend on where the shaft starts and stops; `RecordingStatistics` has them.

    Which features, and this classifier, were chosen on runs 1 to 7 of a ball screw sampled 5 times
    per revolution; ``benchmarks/real_actuator.py`` says how many variants were tried. On another
    machine it is a place to start from: set `revolutions`, `max_order` and `min_speed` by what
    recordings hold, and compare by `evaluate`.

    Examples
    --------
    >>> from emacm import ConditionRouter
    >>> from emacm.recipes import actuator_recipe
    >>> model = ConditionRouter(actuator_recipe(max_order=20), condition="load")
    >>> [name for name, _ in model.estimator.steps]
    ['featureunion', 'standardscaler', 'costsensitivegaussianbayes']
    """
    check_choice(phase, "phase", (True, False))
    check_number(revolutions, "revolutions", above=0)
    check_number(max_order, "max_order", above=0)
    if healthy is not None and not phase:
        raise ValueError(
            f"healthy = {healthy!r} needs phase=True: what is left of a wave, once a healthy one "
            f"is taken off, depends on where both stand on the shaft. Leave healthy out, or set "
            f"phase=True and mind that this is for the same assemblies only."
        )
    relative: dict[str, Any] = (
        {} if healthy is None else {"condition": condition, "healthy": healthy}
    )
    strokes: dict[str, Any] = {"min_speed": min_speed, "min_revolutions": _STROKE, "n_jobs": n_jobs}
    over_angle = make_pipeline(
        OrderResampler(2 * np.pi / (_OVERSAMPLED * max_order), min_speed=min_speed),
        SignalBaseline(**relative) if relative else "passthrough",
        SignalCache(),
        _over_angle(revolutions, max_order, n_jobs),
    )
    reference = "absolute" if phase else "relative"
    lines = ShaftHarmonics((1,), phase=reference, n_sections=2, **strokes)
    features = _union(over_angle=over_angle, lines=lines)
    gaussians = CostSensitiveGaussianBayes(cost, priors=priors, covariance="tied", shrinkage="auto")
    return Pipeline(
        [
            ("featureunion", features),
            ("standardscaler", StandardScaler()),
            ("costsensitivegaussianbayes", gaussians),
        ]
    )


def _over_angle(revolutions: float, max_order: float, n_jobs: int | None) -> FeatureUnion:
    """Return the features of recordings over the shaft angle."""
    spectra: dict[str, Any] = {"by_direction": True, "n_jobs": n_jobs}
    bins: dict[str, Any] = {"bin_size": 1 / revolutions, "max_order": max_order}
    strokes: dict[str, Any] = {"min_revolutions": _STROKE, "n_jobs": n_jobs}
    return _union(
        powers=make_pipeline(
            OrderPSD(revolutions, **spectra),
            BinTransformer(**bins),
            FunctionTransformer(np.log, feature_names_out="one-to-one"),
        ),
        answers=OrderCrossSpectrum(revolutions, kind=("response", "coherence"), **bins, **spectra),
        levels=RecordingStatistics(("mean", "std", "slope"), **strokes),
        profile=StrokeProfile(12, **strokes),
    )


def _union(**blocks: Any) -> FeatureUnion:
    """Join features under their own names, which are unlike one another."""
    return FeatureUnion([*blocks.items()], verbose_feature_names_out=False)
