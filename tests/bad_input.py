"""Recordings and tables for tests of bad input, and what the error of each must say."""

import numpy as np
import pytest

from emacm import OrderPSD, OrderResampler, Recording

THETA_S = 2 * np.pi / 32
V, T = ValueError, TypeError


class Case:
    """One kind of bad input and what its error must say, such as "recording 0|finite"."""

    def __init__(self, what, call, error, *words):
        self.what, self.call, self.error = what, call, error
        self.words = [part for word in words for part in word.split("|")]


def run(seed=0, n_times=600, *, signals=None, velocity=None, meta=None, **options):
    """Six seconds at 100 Hz: forth for 4 s at 6 rad/s, back for 2 s."""
    rng = np.random.default_rng(seed)
    if signals is None:
        signals = {"a": rng.normal(size=n_times), "b": rng.normal(size=n_times)}
    if velocity is None and "angle" not in options:
        velocity = np.where(np.arange(n_times) < 400, 6.0, -6.0)
    return Recording(signals, options.pop("fs", 100), velocity=velocity, meta=meta, **options)


def spoilt(index, value, n_times=600):
    """Noise with one value that is none."""
    noise = np.random.default_rng(0).normal(size=n_times)
    noise[index] = value
    return noise


def over_angle(X=None, **options):
    return OrderResampler(**({"theta_s": THETA_S} | options)).fit_transform(X or [run(0), run(1)])


def spectra():
    return OrderPSD(2).fit_transform(over_angle())


def psd(X=None, **options):
    return OrderPSD(**({"revolutions": 2} | options)).fit_transform(X or over_angle())


def forward_only():
    return run(velocity=np.full(600, 6.0), meta={"unit": "F7"})


def features(seed=0, n_recordings=20):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n_recordings, 3)), np.array(["healthy", "worn"] * (n_recordings // 2))


def each(cases):
    """Run a test for every case; each has a name of its own."""
    names = [case.what for case in cases]
    assert len(set(names)) == len(names), "a kind of bad input is listed twice"
    return pytest.mark.parametrize("case", cases, ids=lambda case: case.what)


def check_refused(case):
    with pytest.raises(case.error) as caught:
        case.call()
    message = str(caught.value)
    assert not [word for word in case.words if word not in message], message
