"""Facts about spectra that are kept: found again, never wrong, bounded, shared."""

from functools import cache, wraps
from pathlib import Path

import joblib
import numpy as np
import pytest
from joblib import parallel_config
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline

from emacm import BinTransformer, CostSensitiveGaussianBayes, OrderPSD, OrderResampler, Recording
from emacm.orders.segment_plan import SegmentPlan

THETA_S = 2 * np.pi / 32
FS = 500


def run(seed=0, seconds=4, **options):
    """A drive at 8 rev/s with noise."""
    times = np.arange(int(FS * seconds)) / FS
    velocity = 2 * np.pi * (8 + np.sin(times))
    signal = np.random.default_rng(seed).standard_normal(len(times))
    return Recording({"current": signal}, FS, **{"velocity": velocity} | options)


def over_angle(*recordings, theta_s=THETA_S):
    return OrderResampler(theta_s).fit_transform(list(recordings))


@pytest.fixture
def calls(monkeypatch):
    """Rows that were resampled and estimated in this process."""
    rows = []
    original = SegmentPlan.spectra_of

    @wraps(original)  # so that worker processes find the original by its name
    def counting(plan, row):
        rows.append(row)
        return original(plan, row)

    monkeypatch.setattr(SegmentPlan, "spectra_of", counting)
    return rows


@pytest.mark.parametrize("kind", [str, Path, lambda folder: joblib.Memory(folder, verbose=0)])
def test_a_folder_is_a_folder_however_it_is_named(calls, tmp_path, kind):
    for _ in range(2):
        OrderPSD(4, memory=kind(tmp_path)).fit_transform(over_angle(run()))
    assert len(calls) == 1


def test_a_folder_that_cannot_be_made_is_an_error_that_names_it(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match="file' cannot be used as a folder"):
        OrderPSD(4, memory=tmp_path / "file").fit_transform(over_angle(run()))


@pytest.mark.parametrize("damage", [lambda raw: raw[:100], lambda raw: raw[:-9] + bytes(9)])
def test_a_damaged_spectrum_is_estimated_again(calls, tmp_path, damage):
    psd = OrderPSD(4, memory=tmp_path)
    expected = psd.fit_transform(over_angle(run()))
    (file,) = tmp_path.rglob("*.npy")
    file.write_bytes(damage(file.read_bytes()))
    for _ in range(2):
        np.testing.assert_array_equal(psd.transform(over_angle(run())), expected)
    assert len(calls) == 2


def test_a_recording_that_comes_twice_is_estimated_once(calls, tmp_path):
    X = over_angle(run(0), run(1), run(0))
    table = OrderPSD(4, memory=tmp_path).fit_transform(X)
    assert len(calls) == 2
    np.testing.assert_array_equal(table, OrderPSD(4).fit_transform(X))


def test_meta_does_not_count(calls, tmp_path):
    for unit in "AB":
        X = over_angle(run(meta={"unit": unit}))
        OrderPSD(4, memory=tmp_path).fit_transform(X)
    assert len(calls) == 1


@pytest.mark.parametrize(
    "other",
    [
        run(0, velocity=np.full(4 * FS, 50.0)),
        run(0, velocity=None, angle=np.linspace(0, 200, 4 * FS)),
        Recording({"current": run(0).signals["current"]}, 501, velocity=run(0).velocity),
        Recording({"current": np.float32(run(0).signals["current"])}, FS, velocity=run(0).velocity),
    ],
    ids=["velocity", "angle", "rate", "float32"],
)
def test_recordings_that_differ_in_one_thing_are_kept_apart(calls, tmp_path, other):
    OrderPSD(4, memory=tmp_path).fit_transform(over_angle(run(0)))
    table = OrderPSD(4, memory=tmp_path).fit_transform(over_angle(other))
    assert len(calls) == 2
    np.testing.assert_array_equal(table, OrderPSD(4).fit_transform(over_angle(other)))


ROWS = np.random.default_rng(0).standard_normal((3, 400))


def test_a_row_that_was_changed_is_estimated_again(tmp_path):
    rows = ROWS.copy()
    psd = OrderPSD(4, theta_s=THETA_S, memory=tmp_path)
    psd.fit_transform(rows)
    rows[0] *= 2
    expected = OrderPSD(4, theta_s=THETA_S).fit_transform(rows)
    np.testing.assert_array_equal(psd.transform(rows), expected)


def test_a_refused_recording_is_refused_each_time_and_the_others_are_kept(calls, tmp_path):
    X = over_angle(run(0), run(1, seconds=0.2))
    psd = OrderPSD(4, memory=tmp_path).fit(X)
    for expected in (2, 3):
        with pytest.raises(ValueError, match="recording 1: no stroke holds a segment"):
            psd.transform(X)
        assert len(calls) == expected


def test_no_resampled_signal_is_kept(tmp_path):
    table = OrderPSD(4, memory=tmp_path).fit_transform(over_angle(run(seconds=100)))
    (file,) = tmp_path.rglob("*.npy")
    assert file.stat().st_size < table.nbytes + 500


# Searches


def search(folder, grid, **options):
    steps = make_pipeline(
        OrderResampler(),
        OrderPSD(memory=folder),
        BinTransformer(max_order=8),
        CostSensitiveGaussianBayes(shrinkage=0.1),
    )
    return GridSearchCV(steps, grid, cv=3, error_score="raise", **options)


GRID = {
    "orderresampler__theta_s": [2 * np.pi / 32, 2 * np.pi / 40],
    "orderpsd__revolutions": [3, 4],
    "bintransformer__bin_size": [1, 2],
}
Y = ["healthy", "worn"] * 3


@cache
def plain_scores():
    X = [run(seed) for seed in range(6)]
    return search(False, GRID).fit(X, Y).cv_results_["mean_test_score"]


@pytest.mark.parametrize("in_folder", [True, False])
@pytest.mark.parametrize(("n_jobs", "most"), [(1, 24), (2, 48)])
def test_a_search_estimates_each_spectrum_once_or_once_a_worker(
    calls, tmp_path, n_jobs, most, in_folder
):
    X = [run(seed) for seed in range(6)]
    with parallel_config("threading"):
        found = search(tmp_path if in_folder else None, GRID, n_jobs=n_jobs).fit(X, Y)
    assert 6 * 2 * 2 <= len(calls) <= most
    np.testing.assert_array_equal(found.cv_results_["mean_test_score"], plain_scores())


def test_nothing_is_kept_where_that_is_stated(calls):
    X = over_angle(run())
    for memory, expected in ((False, 2), (None, 3)):
        for _ in range(2):
            OrderPSD(4, memory=memory).fit_transform(X)
        assert len(calls) == expected


@pytest.mark.slow
def test_what_worker_processes_estimate_is_found_by_all(calls, tmp_path):
    X = [run(seed) for seed in range(6)]
    with parallel_config("loky"):
        search(tmp_path, GRID, n_jobs=2, refit=False).fit(X, Y)
    search(tmp_path, GRID).fit(X, Y)
    assert not calls


# Progress


def test_nothing_is_printed_unasked(capfd, tmp_path):
    OrderPSD(4, memory=tmp_path).fit_transform(over_angle(run()))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("memory", [True, False])
@pytest.mark.parametrize("n_jobs", [1, 2])
def test_progress_shows_recordings_done_rate_and_time_left(capfd, tmp_path, memory, n_jobs):
    pytest.importorskip("tqdm")
    X = over_angle(*(run(seed) for seed in range(3)))
    psd = OrderPSD(4, memory=tmp_path if memory else None, verbose=True, n_jobs=n_jobs)
    psd.fit_transform(X)
    out, err = capfd.readouterr()
    assert not out
    assert "3/3" in err
    assert "recording" in err
    assert "<00:0" in err
