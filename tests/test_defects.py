"""Defects that were found in use, one test for each, so that they do not come back."""

from contextlib import contextmanager

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline

from emacm import (
    CostSensitiveGaussianBayes,
    LeastRiskClassifier,
    NewUnitClassifier,
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
