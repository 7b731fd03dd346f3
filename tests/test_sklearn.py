"""Facts about the steps inside scikit-learn: its checks, pipelines, searches, caches."""

import joblib
import numpy as np
import pandas as pd
import polars as pl
import pytest
from order_models import log, order_bins
from sklearn.decomposition import PCA
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.naive_bayes import GaussianNB
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

import emacm
from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    OrderPSD,
    OrderResampler,
    Recording,
    neg_expected_cost,
)

THETA_S = 2 * np.pi / 32
COST = {("healthy", "worn"): 10.0}


def run(unit, condition, seed, fs=500, seconds=4):
    """A drive that goes forth and back; a worn one has a line at order 3."""
    rng = np.random.default_rng(seed)
    times = np.arange(int(fs * seconds)) / fs
    velocity = 2 * np.pi * (8 + rng.uniform()) * np.sin(2 * np.pi * 0.2 * times + 0.1)
    angle = np.cumsum(velocity) / fs
    current = np.sin(6 * angle) + 0.3 * rng.standard_normal(len(times))
    if condition == "worn":
        current += 0.3 * np.sin(3 * angle)
    position = 0.01 * angle[::5] + 0.01 * rng.standard_normal(len(angle[::5]))
    return Recording(
        {"current": current, "position": position},
        {"current": fs, "position": fs / 5},
        velocity=velocity,
        shaft_fs=fs,
        meta={"unit": unit},
    )


@pytest.fixture(scope="module")
def fleet():
    """Recordings of six units with unequal lengths and two sampling rates, y and groups."""
    y = np.array(["healthy", "worn"] * 6)
    groups = np.repeat(np.arange(6), 2)
    X = [run(i // 2, y[i], seed=i, fs=(500, 625)[i % 2], seconds=4 + i % 3) for i in range(12)]
    return X, y, groups


def monitoring(**options):
    bayes = CostSensitiveGaussianBayes(COST, shrinkage="oas")
    return order_bins(log(), StandardScaler(), PCA(3), bayes, **options)


@pytest.fixture(scope="module")
def fitted(fleet):
    X, y, _ = fleet
    return monitoring().fit(X, y)


@pytest.fixture(scope="module")
def over_angle(fleet):
    return OrderResampler(THETA_S).fit_transform(fleet[0])


@pytest.fixture(scope="module")
def spectra(over_angle):
    return OrderPSD(4).fit_transform(over_angle)


# A list, as pytest 9 complains of the generator that scikit-learn 1.6 hands it.
CHECKS = parametrize_with_checks([OrderPSD(), BinTransformer()])


@pytest.mark.slow
@pytest.mark.parametrize(CHECKS.args[0], list(CHECKS.args[1]), **CHECKS.kwargs)
def test_every_check_of_scikit_learn_passes(estimator, check):
    check(estimator)


# The whole pipeline


@pytest.mark.slow
def test_one_search_over_all_three_steps_is_right_for_every_candidate(fleet):
    X, y, groups = fleet
    grid = {
        "orderresampler__theta_s": [2 * np.pi / 32, 2 * np.pi / 50],
        "orderpsd__revolutions": [3, 4],
        "bintransformer__bin_size": [0.5, 1],
    }
    options = {"cv": GroupKFold(2), "scoring": neg_expected_cost, "error_score": "raise"}
    search = GridSearchCV(monitoring(), grid, n_jobs=2, **options).fit(X, y, groups=groups)
    scores = search.cv_results_["mean_test_score"]
    assert len(scores) == 8
    for candidate in (0, 7):
        parameters = search.cv_results_["params"][candidate]
        by_hand = [
            neg_expected_cost(
                monitoring().set_params(**parameters).fit([X[i] for i in train], y[train]),
                [X[i] for i in test],
                y[test],
            )
            for train, test in GroupKFold(2).split(X, y, groups)
        ]
        assert scores[candidate] == pytest.approx(np.mean(by_hand), abs=1e-12)
    assert search.predict(X).shape == (len(X),)


@pytest.mark.parametrize(("form", "frame"), [("pandas", pd.DataFrame), ("polars", pl.DataFrame)])
def test_output_as_a_frame_changes_no_number_and_has_exact_names(fleet, fitted, form, frame):
    X, y, _ = fleet
    framed = monitoring().set_output(transform=form).fit(X, y)
    psd, bins = framed[:2].transform(X[:5]), framed[:3].transform(X[:5])
    assert isinstance(psd, frame)
    assert isinstance(bins, frame)
    np.testing.assert_array_equal(np.asarray(psd), fitted[:2].transform(X[:5]))
    np.testing.assert_array_equal(np.asarray(bins), fitted[:3].transform(X[:5]))
    orders = [f"{k / 4:g}" for k in range(65)]
    both = ("current", "position")
    assert list(psd.columns) == [f"{name}@{order}" for name in both for order in orders]
    assert list(bins.columns) == [f"{name}@{k}-{k + 1}" for name in both for k in range(12)]
    expected = fitted.predict_proba(X)
    np.testing.assert_allclose(framed.predict_proba(X), expected, rtol=1e-6, atol=1e-9)


# Caches


@pytest.mark.filterwarnings("ignore:Persisting input arguments")  # joblib, of slow disks
def test_the_memory_of_a_pipeline_gives_the_same_decisions(fleet, fitted, tmp_path):
    X, y, _ = fleet
    for _ in range(2):
        cached = monitoring(memory=str(tmp_path)).fit(X, y)
        np.testing.assert_array_equal(cached.predict_proba(X), fitted.predict_proba(X))


@pytest.mark.parametrize(
    "settings",
    [
        {"theta_s": THETA_S / 1.001},
        {"antialias": False},
        {"direction": "forward"},
        {"direction": "travel"},
        {"min_speed": 20.0},
        {"channels": ["position", "current"]},
    ],
    ids=repr,
)
def test_the_memory_of_spectra_tells_settings_of_the_resampler_apart(fleet, settings, tmp_path):
    X = fleet[0][:2]
    OrderPSD(4, memory=str(tmp_path)).fit_transform(OrderResampler(THETA_S).fit_transform(X))
    other = OrderResampler(**({"theta_s": THETA_S} | settings)).fit_transform(X)
    cached = OrderPSD(4, memory=str(tmp_path)).fit_transform(other)
    np.testing.assert_array_equal(cached, OrderPSD(4).fit_transform(other))


# Workers


@pytest.mark.parametrize("backend", ["threading", pytest.param("loky", marks=pytest.mark.slow)])
def test_two_workers_give_the_very_numbers_of_one(over_angle, spectra, backend):
    with joblib.parallel_backend(backend):
        both = OrderPSD(4, n_jobs=2).fit_transform(over_angle)
    np.testing.assert_array_equal(both, spectra)


def test_a_recording_by_itself_has_the_spectrum_it_has_among_others(over_angle, spectra):
    alone = [OrderPSD(4).fit_transform([recording])[0] for recording in over_angle]
    np.testing.assert_array_equal(alone, spectra)


# Other axes


def spectra_in(container, X, theta_s=THETA_S, channels=None, **options):
    """Spectra of recordings, in a table of ours or a frame."""
    steps = make_pipeline(
        OrderResampler(theta_s, channels=channels), OrderPSD(**({"revolutions": 4} | options))
    )
    return steps.set_output(transform=container).fit_transform(X)


@pytest.mark.parametrize("container", ["default", "pandas", "polars"])
def test_bins_refuse_another_axis_than_that_of_fit(fleet, container):
    X = fleet[0][:2]
    bins = BinTransformer(max_order=12).fit(spectra_in(container, X))
    for other in (
        {"revolutions": 5},
        {"theta_s": THETA_S / 2},
        {"channels": ["current"]},
        {"channels": ["position", "current"]},
        {"by_direction": True},
    ):
        with pytest.raises(ValueError, match="another order axis"):
            bins.transform(spectra_in(container, X, **other))


def test_spectra_that_lost_their_orders_are_refused_by_the_bins(spectra):
    fitted = BinTransformer(max_order=2).fit(spectra)
    for lost in (spectra[:, :20], spectra.astype(np.float32), spectra * 2, np.asarray(spectra)):
        for use in (BinTransformer(max_order=2).fit, fitted.transform):
            with pytest.raises(ValueError, match="orders"):
                use(lost)


ARGUMENTS = {
    "EnvelopeDetector": [(50.0, 100.0)],
    "GearIndicators": [{"motor": 20}],
    "FeatureBaseline": [OrderPSD()],
    "ConditionRouter": [CostSensitiveGaussianBayes()],
    "FaultLines": [{"screw": 1.0}],
    "LeastRiskClassifier": [GaussianNB()],
    "PosteriorProduct": [[("one", GaussianNB())]],
}


@pytest.mark.parametrize("method", ["transform", "predict", "predict_proba"])
def test_every_estimator_says_that_it_is_not_fitted(method):
    X, found = [run("a", "healthy", 0)], 0
    for name in emacm.__all__:
        estimator = getattr(emacm, name)
        if isinstance(estimator, type) and hasattr(estimator, method):
            found += 1
            with pytest.raises(NotFittedError):
                getattr(estimator(*ARGUMENTS.get(name, [])), method)(X)
    assert found >= 5
