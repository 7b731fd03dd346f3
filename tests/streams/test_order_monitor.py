"""Facts about a model applied to a stream: its readings are those of the finished recordings."""

from __future__ import annotations

import pickle
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from order_models import log, order_bins
from sklearn.naive_bayes import GaussianNB
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

import emacm.orders.segment_plan
import emacm.resampling.spreading
import emacm.streams.order_monitor
from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    EnvelopeDetector,
    OrderMonitor,
    OrderPSD,
    OrderResampler,
    Recording,
    RecordingStatistics,
    outside_training,
)
from emacm._kernels import using
from emacm.shaft.angle import angle_from_velocity
from emacm.streams.spectrum_stream import Settings

TURN = 2 * np.pi
THETA_S = TURN / 37


def ramp(t):
    return TURN * (2.5 + 1.7 * t)


def reversing(t):
    return TURN * 9 * np.sin(TURN * t / 3.3)


def resting(t):
    """Forth, rest, forth, back, rest, with noise below 0.3 rad/s."""
    speed = np.select([t < 1.3, t < 1.9, t < 3.1, t < 4.4], [60, 0, 45, -70], 0.0)
    return speed + np.random.default_rng(0).uniform(-0.3, 0.3, len(t))


def stopping(t):
    """Exactly at rest from time to time."""
    return np.where(np.sin(TURN * t / 1.7) > 0.4, 0.0, 50.0)


MOTIONS = {"ramp": ramp, "reversing": reversing, "resting": resting, "stopping": stopping}
# Order of names and rates differ, on purpose; 1300.5 Hz has no common multiple with the others.
RATES = {
    "one rate": ({"force": 2000.0, "axial": 2000.0}, 2000.0),
    "slow shaft": ({"force": 3000.0, "axial": 3000.0, "bent": 3000.0}, 300.0),
    "mixed": ({"force": 2600.0, "axial": 1300.5, "bent": 2600.0}, 1700.0),
}


def recorded(motion, rates, reference, seed=0, duration=6.0):
    fs, shaft_fs = rates
    rng = np.random.default_rng(seed)
    time = np.arange(int(duration * shaft_fs)) / shaft_fs
    velocity = MOTIONS[motion](time)
    angle = angle_from_velocity(velocity, shaft_fs)
    signals = {}
    for number, (name, rate) in enumerate(fs.items()):
        t = np.arange(int(duration * rate)) / rate
        tone = np.sin((3.3 + number) * np.interp(t, time, angle))
        drift = 50 * t + 400 if name == "axial" else number
        signals[name] = (1 + number) * rng.normal(size=len(t)) + tone + drift
    shaft = {"velocity": velocity} if reference == "velocity" else {"angle": angle}
    return Recording(signals, fs, shaft_fs=shaft_fs, **shaft)


def chain(*more, **resampling):
    resampler = OrderResampler(THETA_S, **resampling)
    return [resampler, *more, OrderPSD(3, max_order=12), BinTransformer(0.7, max_order=12)]


def model_of(recording, *, steps=None):
    """A classifier of two states, fitted on the recording and on changed ones."""
    steps = steps or chain()
    X = []
    for k in range(4):
        rng = np.random.default_rng(k)
        signals = {
            name: (1 + 0.5 * (k % 2)) * (s + rng.normal(size=len(s)))
            for name, s in recording.signals.items()
        }
        shaft = {recording.reference: getattr(recording, recording.reference)}
        X.append(Recording(signals, recording.fs, shaft_fs=recording.shaft_fs, **shaft))
    classifier = CostSensitiveGaussianBayes({("new", "worn"): 7}, covariance="diag")
    return make_pipeline(*steps, log(), StandardScaler(), classifier).fit(X, ["new", "worn"] * 2)


def monitor_of(model, recording, **options):
    limit = 1.3 * np.abs(recording.velocity).max()
    names = tuple(recording.channels)
    rates = {"fs": dict(recording.fs), "shaft_fs": recording.shaft_fs}
    return OrderMonitor(model, channels=names, max_speed=limit, **rates, **options)


def blocks(recording, times):
    """The signals and the shaft between successive times."""
    times = [0.0, *sorted(times), recording.duration + 1]
    shaft = getattr(recording, recording.reference)
    for start, stop in pairwise(times):

        def part(series, fs, start=start, stop=stop):
            return series[round(start * fs) : round(stop * fs)]

        signals = {n: part(s, recording.fs[n]) for n, s in recording.signals.items()}
        yield signals, {recording.reference: part(shaft, recording.shaft_fs)}


def readings_of(monitor, recording, times, restored=None):
    """Readings of a stream; after some blocks, named in `restored`, another monitor goes on."""
    readings = []
    after, another = restored or ((), None)
    for number, (signals, shaft) in enumerate(blocks(recording, times)):
        if number in after:
            monitor = another().restore(monitor.state())
        readings += monitor.push(signals, **shaft)
    return readings + monitor.flush()


@pytest.fixture(autouse=True)
def small_parts(monkeypatch):
    """Everything that happens after thousands of samples, after hundreds."""
    design = replace(emacm.resampling.spreading.DESIGN, part=700, mean_of=300)
    monkeypatch.setattr(emacm.resampling.spreading, "DESIGN", design)
    settings = partial(Settings, waiting=100)
    monkeypatch.setattr(emacm.streams.order_monitor, "Settings", settings)


def check(motion, rates, reference, times, restored_after=(), steps=None):
    recording = recorded(motion, RATES[rates], reference)
    model = model_of(recording, steps=steps)

    def make():
        return monitor_of(model, recording)

    (reading,) = readings_of(make(), recording, times, (restored_after, make))
    expected = model[:-1].transform([recording])
    np.testing.assert_allclose(reading.features, expected[0], rtol=1e-12, atol=1e-12)
    assert reading.decision == model.predict([recording])[0]
    assert reading.time == pytest.approx(recording.duration)
    assert reading.alarms == ()
    return reading


divisions = st.lists(st.floats(0, 6), max_size=25)


@pytest.mark.parametrize(("name", "rates"), [("numpy", "mixed"), *(("numba", r) for r in RATES)])
@settings(max_examples=6, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    motion=st.sampled_from(sorted(MOTIONS)),
    reference=st.sampled_from(["velocity", "angle"]),
    times=divisions,
    restored_after=st.sets(st.integers(0, 20), max_size=4),
)
def test_any_division_of_a_stream_has_the_features_of_the_recording(
    name, rates, motion, reference, times, restored_after
):
    pytest.importorskip(name)
    with using(name):
        min_speed = 0.35 if motion == "resting" else 0.0
        steps = chain(min_speed=min_speed)
        check(motion, rates, reference, times, restored_after, steps=steps)


@pytest.mark.parametrize(
    "options",
    [
        {"max_rest": 0.25},
        {"ratio": 13 / 35},
        {"ratio": 2.2, "direction": "forward"},
        {"direction": "reverse"},
    ],
)
def test_options_of_resampling_apply_to_a_stream(options):
    steps = chain(min_speed=0.35, **options)
    check("resting", "mixed", "velocity", np.arange(0, 6, 0.11), {7, 23}, steps=steps)


def test_directions_may_be_separate():
    steps = [OrderResampler(THETA_S), OrderPSD(2, by_direction=True, detrend=None)]
    reading = check("reversing", "mixed", "angle", np.arange(0, 6, 0.07), steps=steps)
    assert len(reading.features) % 6 == 0


def test_blocks_of_single_samples_and_rows_of_an_array_one_of_which_is_not_used():
    recording = recorded("reversing", RATES["one rate"], "velocity", duration=2.5)
    model = model_of(recording)
    names = ["spare", *recording.channels]
    monitor = OrderMonitor(model, fs=2000, channels=names, max_speed=70)
    rows = np.stack([np.full(5000, np.nan), *recording.signals.values()])
    for k in range(rows.shape[1]):
        assert monitor.push(rows[:, k : k + 1], velocity=recording.velocity[k : k + 1]) == []
    (reading,) = monitor.flush()
    expected = model[:-1].transform([recording])[0]
    np.testing.assert_allclose(reading.features, expected, rtol=1e-12, atol=1e-12)


def test_a_wrapped_angle_is_continued_over_the_blocks():
    recording = recorded("reversing", RATES["one rate"], "angle")
    wrapped = Recording(recording.signals, 2000.0, angle=np.mod(recording.angle, TURN))
    model = model_of(recording)
    monitor = monitor_of(model, recording, wrapped=True)
    for part in np.array_split(np.arange(len(wrapped.angle)), 31):
        signals = {name: s[part] for name, s in recording.signals.items()}
        monitor.push(signals, angle=np.mod(recording.angle, TURN)[part])
    (reading,) = monitor.flush()
    expected = model[:-1].transform([wrapped])[0]
    np.testing.assert_allclose(reading.features, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("rates", "reference"),
    [("one rate", "angle"), ("slow shaft", "velocity"), ("mixed", "velocity"), ("mixed", "angle")],
)
@pytest.mark.parametrize(("every", "unit"), [(1.1, "s"), (7.5, "revolutions")])
def test_each_interval_has_the_features_of_this_part_of_the_recording(
    rates, every, unit, reference
):
    recording = recorded("ramp", RATES[rates], reference)
    model = model_of(recording)

    def make():
        return monitor_of(model, recording, every=every, unit=unit)

    times = np.random.default_rng(5).uniform(0, 6, 40)
    readings = readings_of(make(), recording, times, ({11, 30}, make))
    assert len(readings) > 4
    for reading in readings:
        assert reading.complete == (reading is not readings[-1])
        if reading.features is None:
            stated = "".join(reading.alarms)
            assert ("no stroke holds a segment of 3 revolutions" in stated) == reading.complete
            continue
        part = recording.cut(reading.start, reading.time)
        expected = model[:-1].transform([part])[0]
        np.testing.assert_allclose(reading.features, expected, rtol=1e-12, atol=1e-12)
    if unit == "revolutions":
        turned = np.interp(
            [r.time for r in readings[:-1]],
            np.arange(1, len(recording.angle) + 1) / recording.shaft_fs,
            (recording.angle - recording.angle[0]) / TURN,
        )
        step = np.abs(recording.velocity).max() / recording.shaft_fs / TURN
        np.testing.assert_allclose(np.diff(turned), every, atol=2 * step)
    else:
        assert readings[2].start == pytest.approx(2.2)


def test_what_is_held_does_not_grow():
    fs = 2000.0
    rng = np.random.default_rng(0)
    speed = np.full(400, 40.0)
    recording = recorded("ramp", RATES["one rate"], "velocity")
    monitor = monitor_of(model_of(recording), recording)
    sizes = []
    for _ in range(200):
        signals = {"force": rng.normal(size=400), "axial": rng.normal(size=400)}
        monitor.push(signals, velocity=speed)
        sizes.append(len(monitor.state()))
    assert max(sizes[100:]) < 1.01 * max(sizes[:100])
    assert monitor.time == pytest.approx(200 * 400 / fs)


# Readings


def test_a_reading_states_posterior_risk_typicality_and_the_unknown_state():
    recording = recorded("ramp", RATES["mixed"], "velocity")
    model = model_of(recording)
    features = np.asarray(model[:-1].transform([recording]))
    some = features + np.random.default_rng(0).normal(size=(40, features.shape[1]))
    model[-1].set_params(unknown="else").fit(some, ["new", "worn"] * 20, groups=np.arange(40))
    (reading,) = readings_of(monitor_of(model, recording), recording, [1.0])
    posterior, risk = model[-1].predict_proba(features)[0], model[-1].risk(features)[0]
    assert reading.posterior == pytest.approx(dict(zip(["new", "worn"], posterior, strict=True)))
    assert reading.unknown_proba == pytest.approx(model[-1].unknown_proba(features)[0])
    assert list(reading.risk.values()) == pytest.approx(risk)
    assert reading.expected_cost == pytest.approx(risk.min())
    assert reading.typicality == pytest.approx(model[-1].typicality(features)[0])


def test_an_interval_at_rest_gives_an_alarm_and_no_decision():
    recording = recorded("ramp", RATES["one rate"], "velocity")
    monitor = monitor_of(model_of(recording), recording, every=0.5, unit="s")
    still = {"force": np.ones(1000), "axial": np.zeros(1000)}
    (reading,) = monitor.push(still, velocity=np.zeros(1000))
    assert (reading.start, reading.time) == (0.0, 0.5)
    assert reading.features is None
    assert reading.decision is None
    assert "holds a segment" in reading.alarms[0]


def test_a_new_spectral_line_gives_an_alarm():
    rng, t = np.random.default_rng(4), np.arange(8000) / 2000

    def recording(amplitude=0.0):
        wave = np.sin(4 * TURN * 10 * t) + amplitude * np.sin(4.6 * TURN * 10 * t)
        return Recording({"force": wave + 0.1 * rng.normal(size=8000)}, 2000, velocity=TURN * 10)

    X, y = [recording() for _ in range(12)], ["a", "b"] * 6
    model = order_bins(GaussianNB(), samples=37, bin_size=2).fit(X, y)
    for amplitude, expected in ((0.0, ""), (0.3, "line at order 4.5 of 'force', ")):
        new = recording(amplitude)
        (reading,) = readings_of(monitor_of(model, new), new, [2.0])
        assert bool(reading.alarms) == bool(expected)
        assert expected in "".join(reading.alarms)


# Errors


@pytest.fixture(scope="module")
def fitted():
    recording = recorded("ramp", RATES["one rate"], "velocity")
    return model_of(recording), recording


def block(value=0.0, n=100):
    return {"force": np.full(n, value), "axial": np.arange(n) * 0.1}


def test_invalid_samples_are_refused_with_their_time_and_nothing_is_taken(fitted):
    model, recording = fitted
    monitor = monitor_of(model, recording)
    monitor.push(block(), velocity=np.full(100, 20.0), time=3.5)
    bad = block()
    bad["axial"][40] = np.nan
    message = r"at 3\.55\d* s: channel 'axial' .* nan at sample 40.* repair .*or flush\(\)"
    with pytest.raises(ValueError, match=message):
        monitor.push(bad, velocity=np.full(100, 20.0))
    fast = np.full(100, 20.0)
    fast[7] = -900.0
    with pytest.raises(ValueError, match=r"900 rad/s at 3\.553500 s, above max_speed = .*Raise"):
        monitor.push(block(), velocity=fast)
    with pytest.raises(ValueError, match=r"goes on at 3\.55 s, .* begins at 3\.8 s.*flush"):
        monitor.push(block(), velocity=np.full(100, 20.0), time=3.8)
    with pytest.raises(ValueError, match="began with velocity, got angle"):
        monitor.push(block(), angle=np.arange(100.0))
    with pytest.raises(ValueError, match="exactly one of velocity and angle"):
        monitor.push(block())
    with pytest.raises(ValueError, match="must have equally many samples"):
        monitor.push({"force": np.zeros(3), "axial": np.zeros(4)}, velocity=np.zeros(3))
    with pytest.raises(ValueError, match="the block has no channel 'force'"):
        monitor.push({"axial": np.zeros(3)}, velocity=np.zeros(3))
    for rows in (np.zeros((3, 5)), np.zeros(5), None):
        with pytest.raises(ValueError, match=r"a row for each of the channels .* got \d rows"):
            (monitor_of(model, recording) if rows is None else monitor).push(
                rows, velocity=np.zeros(5)
            )
    assert monitor.time == pytest.approx(3.55)


def test_short_blocks_are_checked_together_and_count_before(fitted):
    model, recording = fitted
    monitor, signals, speed = monitor_of(model, recording), np.ones((2, 2)), np.full(2, 20.0)
    for k in range(60):
        monitor.push(signals, velocity=speed)
        assert monitor.time == pytest.approx((k + 1) / 1000)
    monitor.push(signals * np.nan, velocity=speed)
    with pytest.raises(ValueError, match=r"at 0\.051\d* s: .*nan at sample 18\..* of short ones"):
        monitor.push(block(), velocity=np.full(100, 20.0))
    assert monitor.time == pytest.approx(0.051)


def test_an_angle_that_jumps_is_refused_also_between_blocks(fitted):
    model, recording = fitted
    monitor = monitor_of(model, recording)
    monitor.push(block(), angle=0.01 * np.arange(100))
    with pytest.raises(ValueError, match=r"at 0\.050000 s.*wrapped=True"):
        monitor.push(block(), angle=0.01 * np.arange(100) + 3)


def test_after_a_gap_the_next_samples_begin_another_recording(fitted):
    model, recording = fitted
    monitor = monitor_of(model, recording)
    first = readings_of(monitor, recording, [2.0])
    for signals, shaft in blocks(recording, [1.0]):
        monitor.push(signals, **shaft, time=None if monitor.time > 100 else 100.0)
    (again,) = monitor.flush()
    np.testing.assert_allclose(again.features, first[0].features, rtol=1e-12)
    assert (again.start, again.time) == pytest.approx((100.0, 106.0))


def test_a_shaft_that_turns_back_far_at_rest_is_refused_with_the_remedy(fitted):
    _, recording = fitted
    model = model_of(recording, steps=chain(min_speed=1.0))
    monitor = monitor_of(model, recording)
    speed = np.concatenate([np.full(1000, 30.0), np.full(2000, -0.5), np.full(1000, 30.0)])
    signals = {"force": np.zeros(4000), "axial": np.ones(4000)}
    with pytest.raises(ValueError, match=r"turned back by 0\.5 rad.*Raise min_speed or"):
        monitor.push(signals, velocity=speed)
    monitor.reset()
    assert monitor.push(signals, velocity=np.full(4000, 30.0)) == []


def test_a_channel_that_stops_is_refused_at_the_end(fitted):
    model, recording = fitted
    monitor = monitor_of(model, recording)
    monitor.push(block(), velocity=np.full(150, 20.0))
    with pytest.raises(ValueError, match="durations must agree within one sample"):
        monitor.flush()


def test_a_state_that_is_damaged_or_of_another_model_is_refused(fitted):
    model, recording = fitted
    monitor = monitor_of(model, recording)
    monitor.push(block(), velocity=np.full(100, 20.0))
    state = monitor.state()
    same = pickle.loads(pickle.dumps(model))
    assert monitor_of(same, recording).restore(state).time == pytest.approx(0.05)
    same.set_params(costsensitivegaussianbayes__cost={("new", "worn"): 8})
    refitted = model_of(recorded("ramp", RATES["one rate"], "velocity", seed=1))
    for changed, options in ((refitted, {}), (same, {}), (model, {"every": 3})):
        with pytest.raises(ValueError, match=r"belongs to another model.* Take the model"):
            monitor_of(changed, recording, **options).restore(state)
    with pytest.raises(ValueError, match="no state of OrderMonitor"):
        monitor.restore(state[:-40])


def test_a_reading_states_what_is_outside_the_training(fitted):
    model, recording = fitted
    loud = {name: 30 * samples for name, samples in recording.signals.items()}
    loud["axial"] = recording.signals["axial"]
    for signals in (loud, recording.signals):
        changed = Recording(signals, recording.fs, velocity=recording.velocity).cut(0, 4)
        expected = outside_training(model, [changed])[0]
        (reading,) = readings_of(monitor_of(model, recording), changed, [0.3, 2.0])
        assert [*map(str, reading.outside_training)] == [*map(str, expected)]
        alarmed = any("dB above training" in alarm for alarm in reading.alarms)
        assert alarmed == (signals is loud)
        assert "length" in {statement.kind for statement in expected}


def test_speeds_of_all_strokes_are_compared_with_the_training():
    recording = recorded("resting", RATES["mixed"], "angle")
    model = model_of(recording, steps=chain(min_speed=0.35))
    angle = 1.25 * recording.angle
    fast = Recording(recording.signals, recording.fs, angle=angle, shaft_fs=recording.shaft_fs)
    (reading,) = readings_of(monitor_of(model, fast), fast, np.arange(0, 6, 0.4))
    expected = outside_training(model, [fast])[0]
    assert [*map(str, reading.outside_training)] == [*map(str, expected)]
    assert reading.outside_training[0].kind == "speed"


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        ([EnvelopeDetector((300, 700), channels=["force"]), *chain()], "first step.*Envelope"),
        ([OrderResampler(), RecordingStatistics()], "second step.*OrderPSD, got RecordingStat"),
        (chain(antialias=False), "antialias=False"),
        (chain(direction="travel"), "direction='travel'"),
        ([OrderResampler(), OrderPSD(3, average="median")], "average='median'"),
        ([OrderResampler(), OrderPSD(3, short="pad")], "short='pad'"),
    ],
)
def test_models_that_need_whole_recordings_are_refused_with_the_reason(fitted, steps, message):
    _, recording = fitted
    X = [recording, recording]
    model = make_pipeline(*steps).fit(X)
    with pytest.raises(ValueError, match=message):
        monitor_of(model, recording)


def test_other_models_and_other_channels_are_refused(fitted):
    model, recording = fitted
    with pytest.raises(TypeError, match="must be a pipeline"):
        monitor_of(CostSensitiveGaussianBayes(), recording)
    with pytest.raises(ValueError, match="the stream has no channel 'axial'"):
        OrderMonitor(model, fs=2000, channels=["force"], max_speed=90)
    with pytest.raises(ValueError, match=r"unit must be"):
        monitor_of(model, recording, unit="rev")
    with pytest.raises(ValueError, match=r"every must be .*above 0, got -2"):
        monitor_of(model, recording, every=-2)
