"""Facts about spectra that are kept: found again, never wrong, bounded, shared."""

import time
from functools import partial, wraps
from pathlib import Path

import joblib
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from joblib import parallel_config
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline

from emacm import BinTransformer, CostSensitiveGaussianBayes, OrderPSD, OrderResampler, Recording
from emacm.orders.segment_plan import SegmentPlan
from emacm.orders.store import SpectrumStore, clear_memory, open_store

A, B, C = ("a" * 64, "b" * 64, "c" * 64)
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


def files(folder):
    return [path for path in Path(folder).rglob("*") if path.is_file()]


def size(folder):
    return sum(path.stat().st_size for path in files(folder))


@pytest.fixture
def store(tmp_path):
    return SpectrumStore(tmp_path)


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


# One spectrum


@given(
    spectrum=hnp.arrays(
        st.sampled_from([np.float32, np.float64]),
        hnp.array_shapes(min_dims=1, max_dims=3),
        elements=st.floats(0, 1e6, width=32),
    )
)
@pytest.mark.parametrize("layer", ["memory", "files"])
def test_what_is_kept_is_found_to_the_last_bit(tmp_path_factory, layer, spectrum):
    store = SpectrumStore(tmp_path_factory.mktemp("store"))
    store.keep(A, spectrum)
    if layer == "files":
        clear_memory()
    found = store.find(A, spectrum.shape)
    assert found.dtype == np.float64
    np.testing.assert_array_equal(found, spectrum)


def test_what_was_not_kept_is_not_found(store):
    assert store.find(A, (3,)) is None


@pytest.mark.parametrize("layer", ["memory", "files"])
def test_nobody_can_write_to_what_is_found(store, layer):
    store.keep(A, np.ones(3))
    if layer == "files":
        clear_memory()
    with pytest.raises(ValueError, match="read-only"):
        store.find(A, (3,))[0] = 7


def test_later_changes_of_what_was_kept_do_not_show(store):
    spectrum = np.ones(3)
    store.keep(A, spectrum)
    spectrum[:] = 7
    np.testing.assert_array_equal(store.find(A, (3,)), 1.0)


# Damage


@given(place=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_a_file_with_a_single_bit_turned_gives_no_other_numbers(tmp_path_factory, place, bit):
    store = SpectrumStore(tmp_path_factory.mktemp("store"))
    store.keep(A, np.arange(20.0))
    (file,) = files(store.folder)
    content = bytearray(file.read_bytes())
    content[int(place * len(content))] ^= 1 << bit
    file.write_bytes(content)
    clear_memory()
    found = store.find(A, (20,))  # the bit may be in a date, which does not matter
    assert found is None or np.array_equal(found, np.arange(20.0))


def test_a_damaged_file_is_replaced(store):
    store.keep(A, np.ones(3))
    (file,) = files(store.folder)
    file.write_bytes(b"nonsense")
    clear_memory()
    store.keep(A, np.ones(3))
    clear_memory()
    np.testing.assert_array_equal(store.find(A, (3,)), 1.0)


# Size


def test_the_oldest_file_is_deleted_first(tmp_path):
    store = SpectrumStore(tmp_path, bytes_limit=20_000)
    for key in (B, A, C):
        store.keep(key, np.ones(1000))
        time.sleep(0.02)
    assert {file.stem for file in files(tmp_path)} == {A, C}


# What memory may be


@pytest.mark.parametrize("kind", [str, Path, partial(joblib.Memory, verbose=0), SpectrumStore])
def test_a_folder_is_a_folder_however_it_is_named(tmp_path, kind):
    open_store(tmp_path).keep(A, np.ones(3))
    clear_memory()
    assert open_store(kind(tmp_path)).find(A, (3,)) is not None


@pytest.mark.parametrize("memory", [None, joblib.Memory(None)])
def test_no_folder_is_no_memory(memory):
    assert open_store(memory) is None


def test_a_memory_that_is_no_folder_is_refused():
    class Elsewhere:
        def cache(self, function):
            return function

    with pytest.raises(TypeError, match=r"memory must be None, a folder.*got .*Elsewhere"):
        open_store(Elsewhere())


def test_a_folder_that_cannot_be_made_is_an_error_that_names_it(tmp_path):
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(ValueError, match=r"memory = .*file.* cannot be used.*Choose a folder"):
        open_store(tmp_path / "file")


# The estimator


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


def test_a_clone_finds_what_was_kept(calls, tmp_path):
    psd = OrderPSD(4, memory=tmp_path)
    X = over_angle(run())
    psd.fit_transform(X)
    clone(psd).fit_transform(X)
    assert len(calls) == 1


def test_a_store_with_a_limit_of_its_own_serves_as_memory(calls, tmp_path):
    X = over_angle(run())
    for _ in range(2):
        psd = clone(OrderPSD(4, memory=SpectrumStore(tmp_path, bytes_limit=10**6)))
        psd.fit_transform(X)
    assert len(calls) == 1


def test_padded_and_whole_segments_are_kept_apart(calls, tmp_path):
    X = over_angle(run())
    for short in ("raise", "pad"):
        OrderPSD(4, memory=tmp_path, short=short).fit_transform(X)
    assert len(calls) == 2


@pytest.mark.parametrize(
    "other",
    [
        run(0, velocity=np.full(4 * FS, 50.0)),
        run(0, velocity=None, angle=np.linspace(0, 200, 4 * FS)),
        Recording({"current": run(0).signals["current"]}, 501, velocity=run(0).velocity),
        Recording(
            {"current": run(0).signals["current"].astype(np.float32)}, FS, velocity=run(0).velocity
        ),
    ],
    ids=["velocity", "angle", "rate", "float32"],
)
def test_recordings_that_differ_in_one_thing_are_kept_apart(calls, tmp_path, other):
    OrderPSD(4, memory=tmp_path).fit_transform(over_angle(run(0)))
    table = OrderPSD(4, memory=tmp_path).fit_transform(over_angle(other))
    assert len(calls) == 2
    np.testing.assert_array_equal(table, OrderPSD(4).fit_transform(over_angle(other)))


ROWS = np.random.default_rng(0).standard_normal((3, 400))


@pytest.mark.parametrize(
    "X", [ROWS, ROWS.astype(np.float32), list(ROWS), [row[: 300 + i] for i, row in enumerate(ROWS)]]
)
@pytest.mark.parametrize("theta_s", [None, THETA_S])
def test_bare_rows_are_kept_too(calls, tmp_path, X, theta_s):
    psd = OrderPSD(4, theta_s=theta_s, memory=tmp_path)
    first = psd.fit_transform(X)
    np.testing.assert_array_equal(psd.fit_transform(X), first)
    assert len(calls) == 3
    np.testing.assert_array_equal(OrderPSD(4, theta_s=theta_s).fit_transform(X), first)


def test_a_row_that_was_changed_is_estimated_again(tmp_path):
    rows = ROWS.copy()
    psd = OrderPSD(4, theta_s=THETA_S, memory=tmp_path)
    psd.fit_transform(rows)
    rows[0] *= 2
    expected = OrderPSD(4, theta_s=THETA_S).fit_transform(rows)
    np.testing.assert_array_equal(psd.transform(rows), expected)


def test_changes_of_the_table_do_not_show_in_what_is_kept(tmp_path):
    psd = OrderPSD(4, memory=tmp_path)
    X = over_angle(run())
    expected = psd.fit_transform(X).copy()
    psd.transform(X)[:] = 0
    np.testing.assert_array_equal(psd.transform(X), expected)


def test_a_refused_recording_is_refused_each_time_and_the_others_are_kept(calls, tmp_path):
    X = over_angle(run(0), run(1, seconds=0.2))
    psd = OrderPSD(4, memory=tmp_path).fit(X)
    for expected in (2, 3):
        with pytest.raises(ValueError, match="recording 1: no stroke holds a segment"):
            psd.transform(X)
        assert len(calls) == expected


def test_no_resampled_signal_is_kept(tmp_path):
    X = over_angle(run(seconds=100))
    psd = OrderPSD(4, memory=tmp_path)
    table = psd.fit_transform(X)
    assert size(tmp_path) < table.nbytes + 500


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


@pytest.mark.parametrize(("n_jobs", "most"), [(1, 24), (2, 48)])
def test_a_search_estimates_each_spectrum_once_or_once_a_worker(calls, tmp_path, n_jobs, most):
    X = [run(seed) for seed in range(6)]
    with parallel_config("threading"):
        found = search(tmp_path, GRID, n_jobs=n_jobs).fit(X, Y)
    assert 6 * 2 * 2 <= len(calls) <= most
    plain = search(None, GRID).fit(X, Y)
    np.testing.assert_array_equal(
        found.cv_results_["mean_test_score"], plain.cv_results_["mean_test_score"]
    )


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


@pytest.mark.parametrize("n", [1, 2])
@pytest.mark.parametrize("n_jobs", ["two", [2], "2", 2.5, np.inf, True])
def test_jobs_that_are_no_whole_number_are_refused(n_jobs, n):
    with pytest.raises(TypeError, match=r"n_jobs must be None or a whole number, got .*-1 for one"):
        OrderPSD(4, n_jobs=n_jobs).fit_transform(over_angle(*(run(seed) for seed in range(n))))


def test_spectra_by_direction_are_found_again(tmp_path, monkeypatch):
    times = np.arange(int(FS * 12)) / FS
    X = over_angle(run(seconds=12, velocity=50 * np.sin(times)))
    psd = OrderPSD(4, memory=tmp_path, by_direction=True)
    expected = psd.fit_transform(X)
    assert psd.by_direction_

    def estimate(self, row):
        raise AssertionError("estimated again")

    monkeypatch.setattr(SegmentPlan, "spectra_of", estimate)
    np.testing.assert_array_equal(psd.transform(X), expected)
