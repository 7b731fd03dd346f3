"""Facts about signals that are kept for several readers: once, bit-equal, bounded, never shared."""

import pickle

import joblib
import numpy as np
import pytest
from sklearn.base import clone
from sklearn.pipeline import make_pipeline, make_union

import emacm.resampling.angle_recording
from emacm import (
    OrderCrossSpectrum,
    OrderPSD,
    OrderResampler,
    Recording,
    RecordingStatistics,
    StrokeProfile,
    actuator_recipe,
)
from emacm.resampling.order_resampler import SignalCache

FS = {"torque": 900.0, "current": 600.0, "force": 600.0}
LENGTHS = (6.5, -6.5, 5.3, -2.2)  # revolutions of the strokes


def run(seed, **options):
    """Four strokes to and fro with rests in between; three channels of two rates."""
    rng = np.random.default_rng(seed)
    speeds = []
    for revolutions in LENGTHS:
        peak = np.pi**2 * revolutions / 2
        speeds += [peak * np.sin(np.pi * np.arange(1200) / 1200), np.zeros(90)]
    velocity = np.concatenate(speeds)
    times = np.arange(len(velocity)) / 600
    signals = {
        name: rng.normal(size=round(times[-1] * fs) + 1).astype(options.get("dtype", float))
        for name, fs in FS.items()
    }
    return Recording(signals, FS, velocity=velocity, shaft_fs=600, meta={"load": 20 + seed})


def one_rate(seed):
    whole = run(seed)
    signals = {name: whole.signals[name] for name in ("force", "current")}
    return Recording(signals, 600, velocity=whole.velocity, meta=whole.meta)


def features():
    return make_union(
        OrderPSD(3, by_direction=True),
        OrderCrossSpectrum(3, pairs=[("current", "torque")], kind=("response", "coherence")),
        RecordingStatistics(("mean", "std", "slope")),
        StrokeProfile(5),
    )


@pytest.fixture
def count(monkeypatch):
    """Number of channels of each resampling of a stroke."""
    calls = []

    def counting(original):
        def counted(rows, *args):
            calls.append(len(rows))
            yield from original(rows, *args)

        return counted

    for name in ("spread_rows", "interpolated"):
        original = getattr(emacm.resampling.angle_recording, name)
        monkeypatch.setattr(emacm.resampling.angle_recording, name, counting(original))
    return calls


@pytest.fixture
def found(monkeypatch):
    """How often strokes were searched for."""
    calls = []
    original = emacm.recordings.recording.find_strokes

    def counted(*args):
        calls.append(args[1])
        return original(*args)

    monkeypatch.setattr(emacm.recordings.recording, "find_strokes", counted)
    return calls


def test_the_actuator_recipe_finds_strokes_once_and_resamples_each_once(count, found):
    X = [one_rate(seed) for seed in range(6)]
    model = actuator_recipe(max_order=6)[:-1].fit(X, list("ababab"))
    del count[:], found[:]
    model.transform([one_rate(7), one_rate(8)])
    assert count == [2] * 2 * len(LENGTHS)
    assert found == [0.0] * 2


@pytest.mark.parametrize("options", [{}, {"antialias": False}, {"direction": "forward"}])
@pytest.mark.parametrize("dtype", [float, np.float32])
def test_what_is_kept_changes_no_bit(options, dtype):
    X = [run(seed, dtype=dtype) for seed in range(3)]
    resampler = OrderResampler(2 * np.pi / 37, **options)
    union = make_union(OrderPSD(3), *[s for _, s in features().transformer_list[1:2]])
    plain = make_pipeline(resampler, union).fit_transform(X)
    kept = make_pipeline(resampler, SignalCache(), clone(union)).fit_transform(X)
    np.testing.assert_array_equal(kept, plain)


def test_no_more_is_kept_than_the_share_of_a_recording(count):
    over_angle = OrderResampler().fit_transform([one_rate(0), one_rate(1)])
    sizes = [stroke.signals.nbytes for stroke in over_angle[0].strokes]
    del count[:]
    row, _ = SignalCache(2 * (sizes[0] + sizes[1] + 1000)).fit_transform(over_angle)
    for _ in range(3):
        for stroke in row.strokes:
            assert stroke.signals.any()
    # The first two strokes fit, the third does not, the short last one does not either.
    assert row.kept is not None
    assert sum(b.nbytes for blocks in row.kept._blocks.values() for b in blocks) <= sum(sizes[:2])
    assert count == [2] * (4 + 2 + 2)


def test_kept_signals_are_no_part_of_equality_pickle_or_joblib_hash():
    (plain,) = OrderResampler().fit_transform([run(0)])
    (row,) = SignalCache().fit_transform([plain])
    before = joblib.hash(row), len(pickle.dumps(row))
    assert row.strokes[0].signals.any()
    assert row == plain
    assert (joblib.hash(row), len(pickle.dumps(row))) == before
    assert joblib.hash(row) == joblib.hash(plain)
    again = pickle.loads(pickle.dumps(row))
    assert again == row
    assert again.kept is None
    assert OrderResampler().fit_transform([row.measured])[0].kept is None
    np.testing.assert_array_equal(again.strokes[0].signals, row.strokes[0].signals)


@pytest.mark.parametrize("max_bytes", [-1, 2.5, "all", None])
def test_a_size_that_is_no_number_of_bytes_is_refused(max_bytes):
    over_angle = OrderResampler().fit_transform([run(0)])
    with pytest.raises((TypeError, ValueError), match="max_bytes must be a whole number"):
        SignalCache(max_bytes).fit(over_angle)


def test_only_recordings_over_the_angle_with_the_channels_of_fit_are_taken():
    with pytest.raises(TypeError, match="over time; put an OrderResampler before SignalCache"):
        SignalCache().fit([run(0)])
    cache = SignalCache().fit(OrderResampler().fit_transform([run(0)]))
    assert list(cache.get_feature_names_out()) == ["torque", "current", "force"]
    with pytest.raises(ValueError, match=r"recording 0 .*has no channel 'torque'"):
        cache.transform(OrderResampler().fit_transform([one_rate(0)]))
