"""A search on a cluster: the results of one process, on files that only the workers read."""

import joblib
import numpy as np
import pytest
from order_models import log, order_bins
from sklearn.model_selection import GridSearchCV, GroupKFold

from emacm import CostSensitiveGaussianBayes, Layout, RecordingFolder
from emacm.files.folder import FileRecording
from emacm.recordings.inputs import run

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]  # of the schedulers

FS, N_TIMES, N_FILES = 12_000.0, 48_000, 20
GRID = {"orderpsd__revolutions": [8], "bintransformer__bin_size": [1.0, 2.5]}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Write 23 MB: three columns of 4 s, five units, the worn ones with a line at order 3.58."""
    path = tmp_path_factory.mktemp("files")
    rng = np.random.default_rng(8)
    speed = 150 + 20 * np.sin(np.arange(N_TIMES) / FS)
    angle = np.cumsum(speed) / FS
    for number in range(N_FILES):
        state = ("healthy", "worn")[number % 2]
        line = (0.02 + 0.03 * (number % 2)) * np.sin(3.58 * angle)
        noise = rng.normal(size=(2, N_TIMES))
        np.savez(
            path / f"{'QBZAM'[number // 2 % 5]}_{state}_{number}.npz",
            vibration=noise[0] + line,
            current=2.5 * noise[1] + np.sin(angle),
            speed=speed,
        )
    layout = Layout(fs=FS, velocity="speed", meta="{unit}_{state}_{run:d}")
    return RecordingFolder(path, layout)


def search_of(folder):
    """Search, and fit the best pipeline in a task of its own: no file is read outside of tasks."""
    states = [recording.meta["state"] for recording in folder]
    units = [recording.meta["unit"] for recording in folder]
    bayes = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto")
    pipeline = order_bins(log(), bayes, samples=50, max_order=20)
    options = {"scoring": "neg_log_loss", "refit": False, "error_score": "raise"}
    search = GridSearchCV(pipeline, GRID, cv=GroupKFold(3), **options)
    search.fit(folder, states, groups=units)
    best = pipeline.set_params(**search.best_params_)
    (best,) = joblib.Parallel()([joblib.delayed(best.fit)(folder, states)])
    return search, best


def assert_same_results(found, expected):
    (search, best), (search_expected, best_expected) = found, expected
    assert search.best_params_ == search_expected.best_params_
    for fold in range(3):
        scores = search_expected.cv_results_[f"split{fold}_test_score"]
        assert np.ptp(scores) > 0
        np.testing.assert_array_equal(search.cv_results_[f"split{fold}_test_score"], scores)
    features = np.random.default_rng(2).normal(size=(9, best_expected[-1].n_features_in_))
    np.testing.assert_array_equal(
        best[-1].predict_log_proba(features), best_expected[-1].predict_log_proba(features)
    )


@pytest.fixture(scope="module")
def expected(folder):
    return search_of(folder)


@pytest.fixture
def unreadable_here(monkeypatch):
    """In this process, a recording in a file cannot be read."""

    def refuse(recording):
        raise AssertionError(f"{recording.path} was read outside of the workers")

    monkeypatch.setattr(FileRecording, "_read", refuse)


@pytest.fixture(scope="module")
def dask_client():
    distributed = pytest.importorskip("distributed", reason="needs dask[distributed]")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with (
        distributed.LocalCluster(processes=True, **options) as cluster,
        distributed.Client(cluster) as client,
    ):
        client.wait_for_workers(2, timeout=60)
        yield client


def test_a_search_on_dask_has_the_results_of_one_process_and_reads_files_in_workers(
    folder, expected, dask_client, unreadable_here
):
    with joblib.parallel_config("dask"):
        assert_same_results(search_of(folder), expected)


def test_within_a_task_of_dask_no_further_tasks_are_made(dask_client):
    def processes(n_jobs):
        import os

        with joblib.parallel_config("dask"):
            return {os.getpid(), *run(lambda _: os.getpid(), range(20), n_jobs=n_jobs)}

    for n_jobs in (None, 1, 3):
        assert len(dask_client.submit(processes, n_jobs).result(timeout=60)) == 1
