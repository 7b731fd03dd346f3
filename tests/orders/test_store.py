"""Facts about spectra that are kept: found again, never wrong, bounded, shared."""

import io
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import nullcontext
from functools import partial, wraps
from pathlib import Path

import joblib
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from joblib import Parallel, delayed, parallel_config
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline

import emacm._progress
from emacm import BinTransformer, CostSensitiveGaussianBayes, OrderPSD, OrderResampler, Recording
from emacm.orders import store as store_module
from emacm.orders.segment_plan import SegmentPlan
from emacm.orders.store import SpectrumStore, clear_memory, open_store, recalled
from emacm.orders.welch import segment_plan
from emacm.recordings.recent import Recent

PLAN = segment_plan(32.0)
A, B, C = ("a" * 64, "b" * 64, "c" * 64)
THETA_S = 2 * np.pi / 32
FS = 500
POSIX = pytest.mark.skipif(os.name != "posix", reason="needs signals and locks of POSIX")


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


def test_stores_of_different_folders_know_nothing_of_each_other(tmp_path):
    SpectrumStore(tmp_path / "one").keep(A, np.ones(3))
    assert SpectrumStore(tmp_path / "two").find(A, (3,)) is None


@pytest.mark.parametrize("layer", ["memory", "files"])
def test_nobody_can_write_to_what_is_found(store, layer):
    store.keep(A, np.ones(3))
    if layer == "files":
        clear_memory()
    with pytest.raises(ValueError, match="read-only"):
        store.find(A, (3,))[0] = 7
    with pytest.raises(ValueError, match="WRITEABLE"):
        store.find(A, (3,)).flags.writeable = True


def test_later_changes_of_what_was_kept_do_not_show(store):
    spectrum = np.ones(3)
    store.keep(A, spectrum)
    spectrum[:] = 7
    np.testing.assert_array_equal(store.find(A, (3,)), 1.0)


# Damage


@given(share=st.floats(0, 1, exclude_max=True))
def test_a_truncated_file_is_never_read(tmp_path_factory, share):
    store = SpectrumStore(tmp_path_factory.mktemp("store"))
    store.keep(A, np.arange(20.0))
    (file,) = files(store.folder)
    content = file.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    clear_memory()
    assert store.find(A, (20,)) is None


@given(place=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_a_file_with_a_single_bit_turned_is_never_read(tmp_path_factory, place, bit):
    store = SpectrumStore(tmp_path_factory.mktemp("store"))
    store.keep(A, np.arange(20.0))
    (file,) = files(store.folder)
    content = bytearray(file.read_bytes())
    content[int(place * len(content))] ^= 1 << bit
    file.write_bytes(content)
    clear_memory()
    assert store.find(A, (20,)) is None


def test_a_file_under_the_name_of_another_spectrum_is_never_read(store):
    store.keep(A, np.ones(3))
    store.keep(B, np.zeros(3))
    one, other = sorted(files(store.folder))
    other.write_bytes(one.read_bytes())
    clear_memory()
    assert store.find(B, (3,)) is None


def forged(folder, key, array, **options):
    """Write a file with a valid checksum and any content."""
    body = io.BytesIO()
    np.save(body, array, **options)
    file = Path(folder, "emacm_spectra", key[:2], key)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(body.getvalue() + store_module._checksum(key, body.getvalue()))


@pytest.mark.parametrize(
    "content",
    [
        np.array([1.0, np.nan, 2.0]),
        np.array([1.0, np.inf, 2.0]),
        np.array([1.0, -1e-300, 2.0]),
        np.ones(4),
        np.ones((3, 1)),
        np.ones(3, np.float32),
        np.ones(3, complex),
        np.array(["a", "b", "c"]),
        np.array([{}, {}, {}], dtype=object),
        np.ones((2, 3)).T,
    ],
    ids=str,
)
def test_a_file_that_holds_no_such_spectrum_is_not_used(store, content):
    forged(store.folder, A, content)
    assert store.find(A, (3, 2) if content.ndim == 2 and content.shape[1] == 2 else (3,)) is None


def test_a_forged_file_is_estimated_again(tmp_path):
    X = over_angle(run())
    psd = OrderPSD(4, memory=tmp_path)
    expected = psd.fit_transform(X)
    (file,) = files(tmp_path)
    for content in (np.full((1, expected.size), np.nan), np.ones((1, 3)), np.ones((1, 1, 65))):
        forged(tmp_path, file.name, content)
        clear_memory()
        np.testing.assert_array_equal(psd.transform(X), expected)


@POSIX
def test_a_pipe_in_place_of_a_file_is_not_read(store):
    file = Path(store.folder, "emacm_spectra", "aa", A)
    file.parent.mkdir(parents=True)
    os.mkfifo(file)
    assert store.find(A, (3,)) is None


def test_a_damaged_file_is_replaced(store):
    store.keep(A, np.ones(3))
    (file,) = files(store.folder)
    file.write_bytes(b"nonsense")
    clear_memory()
    store.keep(A, np.ones(3))
    clear_memory()
    np.testing.assert_array_equal(store.find(A, (3,)), 1.0)


def test_a_full_disk_is_told_and_spectra_are_served_all_the_same(store, monkeypatch):
    def full(*args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    words = r"cannot be kept in .*No space left.*another folder"
    with pytest.warns(RuntimeWarning, match=words) as caught:
        store.keep(A, np.ones(3))
    assert [warning.filename for warning in caught] == [__file__]
    np.testing.assert_array_equal(store.find(A, (3,)), 1.0)
    assert not files(store.folder)


# Size


def test_the_files_never_pass_the_limit(tmp_path):
    limit = 50_000
    store = SpectrumStore(tmp_path, bytes_limit=limit)
    for number in range(100):
        store.keep(f"{number:064x}", np.ones(200))
        assert size(tmp_path) <= 1.05 * limit
    assert size(tmp_path) > 0.8 * limit


@pytest.mark.parametrize(("share", "left"), [(0.97, 21), (1.01, 18)])
def test_below_the_limit_all_files_are_kept_and_above_it_a_tenth_is_freed(share, left, tmp_path):
    keys = [f"{number:064x}" for number in range(21)]
    store = SpectrumStore(tmp_path, bytes_limit=10**6)
    for key in keys[:-1]:
        store.keep(key, np.ones(200))
    limit = round(size(tmp_path) * 21 / 20 / share)
    SpectrumStore(tmp_path, bytes_limit=limit).keep(keys[-1], np.ones(200))
    assert len(files(tmp_path)) == left


def test_the_oldest_file_is_deleted_first(tmp_path):
    store = SpectrumStore(tmp_path, bytes_limit=20_000)
    for key in (B, A, C):
        store.keep(key, np.ones(1000))
        time.sleep(0.02)
    assert {file.name for file in files(tmp_path)} == {A, C}


@POSIX
def test_files_of_others_are_never_deleted(tmp_path):
    store = SpectrumStore(tmp_path, bytes_limit=20_000).made()
    folder = tmp_path / "emacm_spectra"
    (tmp_path / "elsewhere").mkdir()
    (folder / "dd").symlink_to(tmp_path / "elsewhere")
    others = [
        folder / "notes.txt",
        folder / "aa" / "notes.txt",
        folder / "results" / A,
        folder / "bb" / A,  # not the subdirectory of this key
        folder / "aa" / f"{A[:-1]}g",
        tmp_path / "elsewhere" / ("d" * 64),
    ]
    for file in others:
        file.parent.mkdir(exist_ok=True)
        file.write_bytes(bytes(30_000))
        os.utime(file, (0, 0))
    (folder / "cc").mkdir()
    (folder / "cc" / C).symlink_to(others[0])
    store.keep(B, np.ones(1000))
    store.keep("b" * 63 + "0", np.ones(2000))
    assert all(file.exists() for file in others)
    assert (folder / "cc" / C).is_symlink()
    assert not (folder / "bb" / B).exists()


def test_a_spectrum_beyond_the_limit_is_not_written(tmp_path):
    store = SpectrumStore(tmp_path, bytes_limit=1000)
    store.keep(A, np.ones(200))
    assert not files(tmp_path)
    np.testing.assert_array_equal(store.find(A, (200,)), 1.0)


def test_stores_hold_256_mib_in_memory_and_1_gib_in_files(tmp_path):
    assert store_module.BYTES_IN_MEMORY == 256 * 1024**2
    assert SpectrumStore(tmp_path).bytes_limit == 1024**3


def test_memory_holds_no_more_than_its_limit_and_drops_the_oldest():
    recent = Recent(2 * 80)
    recent.put("a", np.ones(10), 80)
    recent.put("b", np.ones(10), 80)
    recent.put("c", np.ones(10), 80)
    assert [recent.get(key) is not None for key in "abc"] == [False, True, True]


def test_what_is_put_into_memory_twice_counts_once():
    recent = Recent(2 * 80)
    for _ in range(5):
        recent.put("a", np.ones(10), 80)
    recent.put("b", np.ones(10), 80)
    assert recent.get("a") is not None


def test_unfinished_files_are_deleted_as_others_are(tmp_path):
    store = SpectrumStore(tmp_path, bytes_limit=3000)
    unfinished = tmp_path / "emacm_spectra" / "aa" / f"{A}.0.part"
    unfinished.parent.mkdir(parents=True)
    unfinished.write_bytes(bytes(3000))
    os.utime(unfinished, (0, 0))
    store.keep(B, np.ones(3))
    assert not unfinished.exists()


# What memory may be


@pytest.mark.parametrize("kind", [str, Path, partial(joblib.Memory, verbose=0), SpectrumStore])
def test_a_folder_is_a_folder_however_it_is_named(tmp_path, kind):
    open_store(tmp_path).keep(A, np.ones(3))
    clear_memory()
    assert open_store(kind(tmp_path)).find(A, (3,)) is not None


@pytest.mark.parametrize("memory", [None, joblib.Memory(None)])
def test_no_folder_is_no_memory(memory):
    assert open_store(memory) is None


def test_what_is_no_memory_is_refused_in_the_words_of_scikit_learn():
    with pytest.raises(ValueError, match="'memory' should be None"):
        open_store(3)


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


def test_a_limit_must_be_a_whole_number(tmp_path):
    with pytest.raises(TypeError, match="bytes_limit must be a whole number"):
        SpectrumStore(tmp_path, bytes_limit=1.5)


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


@pytest.mark.parametrize("name", ["__version__", "NUMERICS"])
def test_another_version_of_package_or_numerics_estimates_again(calls, tmp_path, monkeypatch, name):
    X = over_angle(run())
    OrderPSD(4, memory=tmp_path).fit_transform(X)
    monkeypatch.setattr(store_module, name, "0.0.0")
    OrderPSD(4, memory=tmp_path).fit_transform(X)
    assert len(calls) == 2


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


def test_a_file_that_was_rewritten_is_estimated_again(tmp_path):
    file = tmp_path / "run.npy"
    psd = OrderPSD(4, memory=tmp_path)
    tables = []
    np.save(file, run(0).signals["current"])
    mapped = Recording({"current": np.load(file, mmap_mode="r")}, FS, velocity=run(0).velocity)
    for seed in range(3):
        np.save(file, run(seed).signals["current"])  # in place: the map shows it
        tables.append(psd.fit_transform(over_angle(mapped)))
        np.testing.assert_array_equal(tables[-1], OrderPSD(4).fit_transform(over_angle(run(seed))))


def test_a_file_that_is_written_while_it_is_read_is_not_kept(tmp_path, store):
    row = np.ones(4)

    def estimate(row):
        row[0] = 2.0
        return row.copy()

    recalled(estimate, [row], store.made(), PLAN, (4,))
    assert not files(store.folder)


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


def logged(row, log):
    """Estimate slowly, and write down that it was done."""
    with open(log, "a", encoding="utf-8") as file:
        file.write(f"{row[0]}\n")
    time.sleep(0.05)
    return 2 * row


def recall_logged(folder, log):
    rows = list(np.arange(24.0).reshape(12, 2))
    return recalled(partial(logged, log=log), rows, SpectrumStore(folder).made(), PLAN, (2,))


@pytest.mark.slow
@POSIX
@pytest.mark.parametrize("backend", ["loky", "threading"])
def test_workers_that_want_the_same_at_the_same_time_share_the_work(tmp_path, backend):
    log = tmp_path / "log"
    with parallel_config(backend):
        results = Parallel(n_jobs=3)(delayed(recall_logged)(tmp_path, log) for _ in range(3))
    assert 12 <= len(log.read_text().split()) <= 24  # without sharing: 36
    for result in results:
        np.testing.assert_array_equal(result, 2 * np.arange(24.0).reshape(12, 2))


@pytest.mark.slow
def test_what_worker_processes_estimate_is_found_by_all(calls, tmp_path):
    X = [run(seed) for seed in range(6)]
    with parallel_config("loky"):
        search(tmp_path, GRID, n_jobs=2, refit=False).fit(X, Y)
    search(tmp_path, GRID).fit(X, Y)
    assert not calls


@pytest.mark.slow
def test_inner_workers_keep_what_they_estimate(calls, tmp_path):
    X = over_angle(*(run(seed) for seed in range(4)))
    with parallel_config("loky"):
        table = OrderPSD(4, memory=tmp_path, n_jobs=2).fit_transform(X)
    np.testing.assert_array_equal(OrderPSD(4, memory=tmp_path).fit_transform(X), table)
    assert not calls


def keep_and_find(folder, seed):
    """Write and read at random in a small store, and return what was wrong."""
    store = SpectrumStore(folder, bytes_limit=20_000).made()
    rng = np.random.default_rng(seed)
    wrong = []
    for number in rng.integers(0, 60, 400):
        key = f"{number:064x}"
        clear_memory()
        found = store.find(key, (100,))
        if found is None:
            store.keep(key, np.full(100, float(number)))
        elif not np.array_equal(found, np.full(100, float(number))):
            wrong.append(number)
    return wrong


@pytest.mark.slow
def test_processes_may_write_read_and_delete_at_the_same_time(tmp_path):
    with parallel_config("loky"):
        wrong = Parallel(n_jobs=3)(delayed(keep_and_find)(tmp_path, seed) for seed in range(3))
    assert wrong == [[], [], []]
    assert size(tmp_path) <= 20_000 * (1 + 3 * 0.05)


# Killed processes


def killed_when_it_says_so(code, *args):
    """Run a program until its first line, and kill it."""
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])
    }
    with subprocess.Popen(
        [sys.executable, "-c", code, *map(str, args)],
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    ) as process:
        line = process.stdout.readline()
        process.send_signal(signal.SIGKILL)
        assert process.wait(timeout=60) == -signal.SIGKILL
    return line.strip()


@pytest.mark.slow
@POSIX
def test_a_search_that_was_killed_goes_on_where_it_was(calls, tmp_path):
    program = """
import sys, time
from test_store import over_angle, run
from emacm import OrderPSD
from emacm.orders.segment_plan import SegmentPlan
original, done = SegmentPlan.spectra_of, []
def slow(plan, row):
    if len(done) == 3:
        print("killed now", flush=True)
        time.sleep(60)
    done.append(row)
    return original(plan, row)
SegmentPlan.spectra_of = slow
OrderPSD(4, memory=sys.argv[1]).fit_transform(over_angle(*(run(seed) for seed in range(8))))
"""
    assert killed_when_it_says_so(program, tmp_path) == "killed now"
    X = over_angle(*(run(seed) for seed in range(8)))
    table = OrderPSD(4, memory=tmp_path).fit_transform(X)
    assert len(calls) == 5
    np.testing.assert_array_equal(table, OrderPSD(4).fit_transform(X))


@pytest.mark.slow
@POSIX
def test_what_a_killed_process_wrote_by_half_is_never_read(tmp_path):
    program = """
import sys, time
from pathlib import Path
import numpy as np
from emacm.recordings.recent import Recent
from emacm.orders.segment_plan import SegmentPlan
from emacm.orders.store import SpectrumStore
def half(self, content):
    with open(self, "wb") as file:
        file.write(content[: len(content) // 2])
        file.flush()
        print("killed now", flush=True)
        time.sleep(60)
Path.write_bytes = half
SpectrumStore(sys.argv[1]).keep("a" * 64, np.ones(100_000))
"""
    assert killed_when_it_says_so(program, tmp_path) == "killed now"
    (left,) = files(tmp_path)
    assert left.stat().st_size > 100_000
    store = SpectrumStore(tmp_path)
    assert store.find(A, (3,)) is None
    store.keep(A, np.ones(3))
    clear_memory()
    np.testing.assert_array_equal(store.find(A, (3,)), 1.0)


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


def test_what_was_kept_counts_as_done(capfd, tmp_path):
    pytest.importorskip("tqdm")
    X = over_angle(*(run(seed) for seed in range(3)))
    psd = OrderPSD(4, memory=tmp_path, verbose=True)
    psd.fit_transform(X[:2])
    capfd.readouterr()
    psd.fit_transform(X)
    assert "2/3" in capfd.readouterr().err.split("\r")[1]


def test_without_tqdm_joblib_reports(capfd, monkeypatch):
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    OrderPSD(4, verbose=10).fit_transform(over_angle(run(0), run(1)))
    out, err = capfd.readouterr()
    assert not out
    assert "[Parallel(n_jobs=1)]: Done" in err


def test_a_backend_that_returns_all_at_once_is_reported_by_joblib(capfd):
    pytest.importorskip("tqdm")
    X, psd = over_angle(run(0), run(1)), OrderPSD(4, verbose=10, n_jobs=2)
    expected = OrderPSD(4).fit_transform(X)
    with parallel_config(backend="multiprocessing"):
        np.testing.assert_array_equal(psd.fit_transform(X), expected)
    assert "[Parallel(n_jobs=2)]: Done" in capfd.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["loky", "threading", "sequential"])
def test_progress_is_shown_under_any_backend(capfd, backend):
    pytest.importorskip("tqdm")
    X = over_angle(run(0), run(1))
    with parallel_config(backend=backend, n_jobs=2):
        found = OrderPSD(4, verbose=True).fit_transform(X)
    np.testing.assert_array_equal(found, OrderPSD(4).fit_transform(X))
    assert "2/2" in capfd.readouterr().err


def refused(*_, **__):
    raise AssertionError("workers were asked for")


@pytest.mark.parametrize("backend", ["threading", "loky"])
def test_for_one_recording_no_workers_are_asked(monkeypatch, backend):
    X, psd = over_angle(run(0)), OrderPSD(4, n_jobs=2)
    expected = psd.fit_transform(X)
    monkeypatch.setattr(emacm._progress, "Parallel", refused)
    monkeypatch.setattr(emacm._progress, "ThreadPoolExecutor", refused)
    with parallel_config(backend=backend):
        np.testing.assert_array_equal(psd.fit_transform(X), expected)


@pytest.mark.parametrize(("n_jobs", "limit", "most"), [(None, None, 1), (2, None, 2), (None, 3, 3)])
def test_as_many_recordings_are_processed_in_parallel_as_n_jobs(n_jobs, limit, most):
    together, lock = [0, 0], threading.Lock()

    def task(_):
        with lock:
            together[0] += 1
            together[1] = max(together)
        time.sleep(0.05)
        with lock:
            together[0] -= 1
        return threading.get_ident()

    with parallel_config(backend="threading", n_jobs=limit) if limit else nullcontext():
        threads = emacm._progress.run(task, range(9), n_jobs=n_jobs)
    assert together[1] == most
    assert (set(threads) == {threading.get_ident()}) == (most == 1)


@pytest.mark.parametrize("n", [1, 2])
@pytest.mark.parametrize("n_jobs", ["two", [2], "2", 2.5, np.inf, True])
def test_jobs_that_are_no_whole_number_are_refused(n_jobs, n):
    with pytest.raises(TypeError, match=r"n_jobs must be None or a whole number, got .*-1 for one"):
        OrderPSD(4, n_jobs=n_jobs).fit_transform(over_angle(*(run(seed) for seed in range(n))))


def test_what_fails_in_a_thread_ends_the_rest():
    done = []

    def task(k):
        time.sleep(0.01)
        done.append(k)
        if k == 2:
            raise ValueError("number 2 cannot be done")

    with pytest.raises(ValueError, match="number 2"):
        emacm._progress.run(task, range(200), n_jobs=2)
    assert len(done) < 20


@pytest.mark.parametrize("n", [1, 2])
def test_no_jobs_at_all_are_refused_for_any_number_of_recordings(n):
    with pytest.raises(ValueError, match=r"n_jobs must not be 0.*-1 for one"):
        OrderPSD(4, n_jobs=0).fit_transform(over_angle(*(run(seed) for seed in range(n))))


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


@pytest.mark.parametrize(
    ("values", "version"),
    [
        (np.ones(3), (2, 0)),
        (np.ones(3, np.float32), (1, 0)),
        (np.asfortranarray(np.ones((2, 3))), (1, 0)),
        (np.array([1.0, np.nan]), (1, 0)),
        (np.array([1.0, np.inf]), (1, 0)),
        (np.array([1.0, -1e-300]), (1, 0)),
    ],
)
def test_only_a_power_spectrum_is_read_from_a_file(values, version):
    def body(array, version):
        file = io.BytesIO()
        np.lib.format.write_array(file, array, version)
        return file.getvalue()

    with pytest.raises(ValueError, match="not a "):
        store_module._decoded(body(values, version))
    kept = np.array([[0.0, 1, 2], [3, 4, 1e300]])
    found = store_module._decoded(body(kept, (1, 0)))
    np.testing.assert_array_equal(found, kept)
    assert not found.flags.writeable


def test_what_was_read_from_a_file_is_kept_in_memory(tmp_path, store):
    store.keep(A, np.full((1, 3), 2.5))
    clear_memory()
    assert store.find(A, (1, 3)).tolist() == [[2.5] * 3]
    for file in files(tmp_path):
        file.unlink()
    assert store.find(A, (1, 3)).tolist() == [[2.5] * 3]
    assert store.find(A, (3, 1)) is None
    clear_memory()
    assert store.find(A, (1, 3)) is None


def test_of_a_spectrum_that_is_larger_than_the_limit_nothing_is_written_or_deleted(tmp_path):
    store = SpectrumStore(tmp_path, bytes_limit=1000)
    store.keep(A, np.ones(50))
    before = [(file, file.stat().st_mtime_ns) for file in files(tmp_path)]
    store.keep(B, np.ones(200))
    assert [(file, file.stat().st_mtime_ns) for file in files(tmp_path)] == before


def test_a_spectrum_may_just_fill_the_limit_with_its_checksum(tmp_path):
    SpectrumStore(tmp_path / "one").keep(A, np.ones(50))
    full = size(tmp_path / "one")
    SpectrumStore(tmp_path / "two", bytes_limit=full).keep(A, np.ones(50))
    assert size(tmp_path / "two") == full
    small = SpectrumStore(tmp_path / "three", bytes_limit=full - 1)
    small.keep(B, np.ones(2))
    small.keep(A, np.ones(50))  # is not written, and nothing is deleted for it
    assert [file.name for file in files(tmp_path / "three")] == [B]


def test_a_file_that_another_process_has_deleted_counts_as_deleted(store, monkeypatch):
    store.keep(A, np.ones(50))
    store.keep(B, np.ones(50))
    original = Path.lstat

    def deleted_meanwhile(path):
        status = original(path)
        if path.name in (A, B):
            path.unlink()
        return status

    store.bytes_limit = 10
    with monkeypatch.context() as patch:
        patch.setattr(Path, "lstat", deleted_meanwhile)
        store._make_room()
    assert not files(store.folder)


def test_what_another_process_has_estimated_meanwhile_is_not_estimated_again(store):
    store.keep(A, np.ones((1, 3)))
    found = store_module._recall(
        None,
        estimate=lambda row: pytest.fail("estimated"),
        store=store,
        key_of=lambda row: A,
        shape=(1, 3),
    )
    assert found.tolist() == [[1, 1, 1]]


def test_rows_are_estimated_with_the_options_of_the_caller(store, monkeypatch):
    asked = {}

    def run_of(function, rows, **options):
        asked.update(options, names=[name() for name in options["names"]])
        return [function(row) for row in rows]

    monkeypatch.setattr(store_module, "run", run_of)
    rows = [np.full(3, k) for k in (1.0, 2.0, 1.0, 3.0)]
    names = [lambda k=k: f"row {k}" for k in range(4)]

    def square(row):
        return row[:1, np.newaxis] ** 2

    recalled(square, rows[1:2], store, PLAN, (1, 1), names=names)
    found = recalled(square, rows, store, PLAN, (1, 1), names=names, n_jobs=3, verbose=2)
    assert np.ravel(found).tolist() == [1, 4, 1, 9]
    assert asked == {"names": ["row 0", "row 3"], "n_jobs": 3, "verbose": 2, "done": 1}


def test_files_that_just_fill_the_limit_are_kept(tmp_path):
    store = SpectrumStore(tmp_path, bytes_limit=10**9)
    for key in (A, B, C):
        store.keep(key, np.ones(30))
    exact = SpectrumStore(tmp_path, bytes_limit=size(tmp_path))
    exact._make_room()
    assert len(files(tmp_path)) == 3
    SpectrumStore(tmp_path, bytes_limit=size(tmp_path) - 1)._make_room()
    assert len(files(tmp_path)) == 2


def test_a_spectrum_without_lines_is_kept(store):
    store.keep(A, np.empty((2, 0)))
    clear_memory()
    assert store.find(A, (2, 0)).shape == (2, 0)
