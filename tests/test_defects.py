"""Defects that were found in use, one test for each, so that they do not come back."""

import re
from contextlib import contextmanager

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline

from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    LeastRiskClassifier,
    NewUnitClassifier,
    OrderMonitor,
    OrderPSD,
    OrderResampler,
    Recording,
    load_model,
    save_model,
)
from emacm._saved import locked

# Estimators


BAYES, LOGISTIC = CostSensitiveGaussianBayes(), LogisticRegression()
GROUPS = {"groups": np.arange(40) % 5}
FITS = [
    (CostSensitiveGaussianBayes(unknown="unknown"), GROUPS),
    (CostSensitiveGaussianBayes(temperature="groups"), GROUPS),
    (NewUnitClassifier(), GROUPS),
    (LeastRiskClassifier(LOGISTIC, temperature="groups"), GROUPS),
    (BAYES, {}),
    (BAYES, GROUPS),
    (LeastRiskClassifier(BAYES), {}),
    (LeastRiskClassifier(LOGISTIC, unknown="new", detector=IsolationForest(max_samples=9)), GROUPS),
]


@pytest.mark.parametrize(("classifier", "options"), FITS)
def test_a_fitted_model_is_displayed_and_completed_by_tab(classifier, options):
    X, y = np.random.default_rng(0).normal(size=(40, 2)), np.repeat(["healthy", "worn"], 20)
    fitted = clone(classifier).fit(X, y, **options)
    for model in (classifier, fitted, make_pipeline(fitted)):
        assert "predict" in dir(model)
        assert type(classifier).__name__ in model._repr_html_()


def test_a_model_file_does_not_state_where_spectra_are_stored(tmp_path):
    pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
    stored = OrderPSD(2, memory=str(tmp_path / "spectra")).fit(np.ones((3, 9)))
    save_model(stored, tmp_path / "model")
    assert load_model(tmp_path / "model").memory is None


@contextmanager
def full_disk():
    """No file can grow beyond 50 bytes, also not one that pytest writes to."""
    resource = pytest.importorskip("resource", reason="not on Windows")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_a_full_disk_is_named_with_the_file_and_leaves_nothing_behind(tmp_path):
    pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
    model = CostSensitiveGaussianBayes().fit([[0.0], [1.0], [5.0], [7.0]], ["a", "a", "b", "b"])
    with pytest.raises(OSError, match="bench"), full_disk():
        save_model(model, tmp_path / "bench.emacm")
    assert not list(tmp_path.iterdir())


# Channels and the shaft


@pytest.mark.parametrize("width", [1, 3])
@pytest.mark.parametrize("size", [7.0, -4.0])
def test_spikes_of_the_shaft_angle_are_named_and_refused_as_jumps_are(size, width):
    angle = 0.01 * np.arange(20_000) + 0.2 * np.sin(np.arange(20_000) / 3000)
    for place in (300, 5000, 9001, 12_345, 19_000):
        angle[place : place + width] += size
    noise = np.random.default_rng(0).standard_normal(len(angle))
    recordings = [Recording({"x": noise}, 20_000, angle=angle)]
    assert f"angle jumps by {abs(size):.0f}" in OrderResampler().quality(recordings).warnings[0]
    with pytest.raises(ValueError, match="Repair it"):
        OrderResampler().fit_transform(recordings)


TIMES = np.arange(150_000) / 50_000
TONE = np.sin(2 * np.pi * 37 * TIMES)
CURRENT = TONE + 0.02 * np.random.default_rng(1).standard_normal(len(TIMES))
IN_GAP = np.isin(np.arange(len(TIMES)) // 250, [7 + 40 * k + k % 7 for k in range(15)])  # of 5 ms
LAST = np.maximum.accumulate(np.where(IN_GAP, 0, np.arange(len(TIMES))))  # sample before a gap
CHANNELS = {
    "int8": ((150 * TONE).astype(np.int64).astype(np.int8), "integers overflow"),
    "int16, scaled": (1e-3 * (4e4 * CURRENT).astype(np.int64).astype(np.int16), "overflow"),
    "an offset": (1e6 + CURRENT, "offset of 1e.06"),
    "an offset in float32": (np.float32(1e6 + CURRENT), "offset of 1e.06"),
    "zeros in 2.5 % of the time": (np.where(IN_GAP, 0.0, CURRENT), "drop-outs"),
    "held in 2.5 % of the time": (CURRENT[LAST], "drop-outs"),
    "a tone of 16 bits": (np.round(32_767 * TONE), "^$"),
    "a temperature": (300 + 0.02 * CURRENT, "^$"),
    "a wrapped angle": ((200 * TIMES + 0.1 * TONE) % (2 * np.pi), "^$"),
    "a square wave with noise": (0.1 * CURRENT + np.sign(TONE), "^$"),
    "a fast tone": (np.sin(2 * np.pi * 14_900 * TIMES), "^$"),
}


@pytest.mark.parametrize(("values", "warning"), CHANNELS.values(), ids=CHANNELS)
def test_overflow_offsets_and_short_drop_outs_are_named_and_nothing_else(values, warning):
    recording = Recording({"x": values}, 50_000, velocity=np.full(len(values), 60.0))
    assert re.search(warning, OrderResampler().quality([recording]).warnings[0])


def test_a_monitor_names_a_channel_that_begins_to_overflow():
    force, speed = np.random.default_rng(0).standard_normal((12, 8000)), np.full(8000, 60.0)
    force = force / 20 + np.sin(np.arange(8000) / 30)
    model = make_pipeline(OrderResampler(), OrderPSD(4), BinTransformer(max_order=2), BAYES)
    model.fit([Recording({"x": x}, 2000, velocity=speed) for x in force[:10]], ["a", "b"] * 5)
    monitor = OrderMonitor(model, fs=2000, channels=["x"], max_speed=100)
    alarms = []
    for block in (force[10], (120 * force[11]).astype(int).astype(np.int8) / 120):
        monitor.push([block], velocity=speed)
        alarms += [" ".join(reading.alarms) for reading in monitor.flush()]
    assert ["overflow" in text for text in alarms] == [False, True]


# Files

# Scores and pages

# Monitors


def test_a_file_is_used_by_one_process_at_a_time(tmp_path):
    pytest.importorskip("fcntl", reason="not on Windows")
    path = tmp_path / "rows.csv"
    with locked(path), pytest.raises(ValueError, match="used by another process"), locked(path):
        pass
    with locked(path):
        pass
    assert not list(tmp_path.iterdir())
