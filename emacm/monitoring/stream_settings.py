"""What is known of a stream before its first sample, and the loops that are compiled for it."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from emacm._version import __version__
from emacm.monitoring.spectrum_stream import Settings, SpectrumStream
from emacm.monitoring.streamed_models import StreamedModel
from emacm.resampling.inputs import check_angle_step
from emacm.resampling.spreading import spread_rows
from emacm.shaft.paths import ShaftPath


def stream_settings(
    model: StreamedModel,
    reference: str,
    rates: Sequence[float],
    shaft_fs: float,
    max_speed: float,
) -> Settings:
    """Return what the spectra of a stream depend on.

    Parameters
    ----------
    model : StreamedModel
        The model.
    reference : {"velocity", "angle"}
        What is measured of the shaft.
    rates : sequence of float
        Sampling rate of each channel of the model [Hz].
    shaft_fs : float
        Sampling rate of the shaft reference [Hz].
    max_speed : float
        Highest speed of the measured shaft [rad/s].

    Returns
    -------
    Settings
    """
    resampler = model.resampler
    groups = {r: tuple(i for i, rate in enumerate(rates) if rate == r) for r in rates}
    return Settings(
        reference,
        shaft_fs,
        tuple(groups.items()),
        check_angle_step(resampler.theta_s),
        resampler.direction,
        float(resampler.min_speed),
        resampler.max_rest,
        float(resampler.ratio),
        max_speed,
        model.psd.plan,
    )


def settings_text(model: StreamedModel, facts: Mapping[str, Any]) -> str:
    """Return settings of a stream as text: facts, and those of resampling and of segments."""
    plan, resampler = model.psd.plan, model.resampler
    own = {
        "version": __version__,
        "channels": list(resampler.channels_),
        "resampler": [
            float(resampler.theta_s),
            resampler.direction,
            float(resampler.min_speed),
            resampler.max_rest,
            float(resampler.ratio),
        ],
        "segments": [plan.n_per_segment, plan.step, plan.n_orders, plan.by_direction],
    }
    return json.dumps({**facts, **own})


def compile_loops(model: StreamedModel, settings: Settings) -> None:
    """Run all inner loops once, so that the first samples need not wait for the compiler."""
    plan, theta_s = settings.plan, settings.theta_s
    n_rows = sum(len(group) for _, group in settings.groups)
    path = ShaftPath(np.linspace(0, 100 * theta_s, 201), 1000.0, 0.0, 0.0, 1)
    for fs in (1000.0, 1e5):  # upsampled, and not
        list(spread_rows([np.zeros(int(fs / 5) + 1)] * n_rows, fs, path, theta_s))
    stream = SpectrumStream(settings)
    stream.append([[np.zeros(3)] * len(group) for _, group in settings.groups], np.full(3, 1.0))
    stream.shaft.advance()
    section = np.random.default_rng(0).normal(size=(n_rows, plan.n_per_segment + plan.step))
    powers = plan.spectrum_of(plan.section_powers(section, 0, 2), 2)
    with warnings.catch_warnings(), suppress(ValueError):
        warnings.simplefilter("ignore")
        model.reading(0.0, 0.0, np.stack([powers] * len(settings.kinds), axis=1))
