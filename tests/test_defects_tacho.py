"""Facts about tachometers of workshops: uneven marks, missing and double pulses, noise, drift."""

import inspect
import warnings

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from emacm import (
    Bearing,
    Layout,
    OrderResampler,
    Recording,
    angle_from_pulses,
    angle_from_tacho,
    find_faults,
    open_recording,
)
from emacm._statements import EmacmWarning

SECONDS, MEAN = 4.0, 15.0  # duration [s], mean speed [revolutions/s]
TIME = np.linspace(0, SECONDS, 40_001)
SHARE = TIME / SECONDS
TURNS = {  # revolutions over time
    "constant": MEAN * TIME,
    "ramp": MEAN * TIME * (0.5 + SHARE / 2),
    "from rest": MEAN * TIME * SHARE,
    "to rest": MEAN * TIME * (2 - SHARE),
    "wavering": MEAN * (TIME + 0.1 - 0.1 * np.cos(np.pi * TIME)),
}
fast_motions = pytest.mark.parametrize("motion", ["ramp", "from rest", "to rest"])
WHEELS = {
    "even": [1] * 60,
    **{
        f"{n} marks, one {w}": [1] * (n - 1) + [w]
        for n, w in ((4, 0.5), (4, 1.6), (8, 0.5), (40, 1.6), (60, 0.5))
    },
    "two marks": [0.4, 0.6],
    "12 marks, two uneven": [1, 1, 1, 0.7, 1, 1, 1, 1, 1, 1.5, 1, 1],
    "8 marks by hand": [1, 1.2, 0.8, 1.1, 0.7, 1.3, 0.9, 1.05],
    "gap of two": [1] * 57 + [3],
}


def pulses_of(widths, motion, start=0.3):
    """Return when marks of these widths pass a sensor [s]."""
    marks = np.cumsum([0, *widths[:-1]]) / np.sum(widths)
    places = (np.arange(100)[:, np.newaxis] + marks).ravel() - start
    inside = (places > 0) & (places < TURNS[motion][-1] - 1e-6)
    return np.interp(places[inside], TURNS[motion], TIME)


@pytest.fixture(autouse=True)
def _repairs_are_stated():
    """Repairs are meant here; the tests of statements catch them themselves."""
    warnings.filterwarnings("ignore", "(?s).* were repaired", EmacmWarning)


def error_of(pulses, n_marks, motion):
    """Return the largest error of the angle between the first and the last pulse [revolutions]."""
    found = angle_from_pulses(pulses, 10_000, len(TIME), pulses_per_rev=n_marks)
    error = found.angle / (2 * np.pi) - TURNS[motion]
    return np.ptp(error[slice(*np.searchsorted(TIME, pulses[[0, -1]]))])


def raw(widths, motion, *, noise=0.0, fs=20_000, duty=0.3):
    """Return the signal of square pulses, and the revolutions that the shaft made."""
    edges = np.cumsum([0, *widths]) / np.sum(widths)
    turns = np.interp(np.arange(int(SECONDS * fs)) / fs, TIME, TURNS[motion]) + 0.13
    mark = np.searchsorted(edges, turns % 1, side="right") - 1
    signal = (turns % 1 - edges[mark] < duty * np.diff(edges).min()) * 1.0
    return signal + np.random.default_rng(0).normal(0, noise, len(signal)), turns[-1] - turns[0]


@pytest.mark.parametrize("motion", ["ramp", "from rest", "to rest", "wavering"])
@pytest.mark.parametrize("wheel", WHEELS)
def test_uneven_marks_are_neither_missing_nor_double_pulses(wheel, motion):
    widths = WHEELS[wheel]
    pulses = pulses_of(widths, motion)
    # At the start from rest a revolution with few marks has no other to be compared with.
    limit = 0.1 if len(widths) < 9 else 0.02
    assert error_of(pulses, len(widths), motion) < limit


def test_the_gap_of_a_wheel_with_its_nominal_number_is_filled_and_no_fault():
    pulses = pulses_of(WHEELS["gap of two"], "ramp")
    found = angle_from_pulses(pulses, 10_000, len(TIME), pulses_per_rev=60)
    n_turns = int(TURNS["ramp"][-1])
    assert (len(found.missing), len(found.double), found.statements) == (2 * n_turns, 0, ())


def test_a_speed_that_varies_within_each_revolution_is_no_unevenness():
    turns = np.arange(90 * 600) / 600
    speed = MEAN * (1 + 0.1 * np.sin(2 * np.pi * turns))
    time = cumulative_trapezoid(1 / speed, turns, initial=0)
    found = angle_from_pulses(time[::10], 10_000, int(time[-10] * 10_000), pulses_per_rev=60)
    true = np.interp(np.arange(len(found.angle)) / 10_000, time, turns)
    assert np.abs(found.angle / (2 * np.pi) - true).max() < 1e-4


def test_noise_that_makes_many_double_pulses_is_refused():
    with pytest.raises(ValueError, match="number of turns is not known"):
        angle_from_tacho(raw([1], "constant", noise=0.3)[0], 20_000)


def test_pulses_that_jitter_by_a_tenth_of_an_interval_are_stated():
    jitter = np.random.default_rng(0).uniform(-0.1, 0.1, 400)
    with pytest.warns(EmacmWarning, match="scatter"):
        angle_from_pulses(np.arange(1, 401) + jitter, 10, 4000, pulses_per_rev=8)


def test_pulses_shorter_than_a_sample_are_stated():
    signal, _ = raw([1] * 8, "constant", fs=1000, duty=0.112)
    with pytest.warns(EmacmWarning) as caught:
        angle_from_tacho(signal, 1000, pulses_per_rev=8)
    assert caught[0].message.statement.kind == "short pulses"


def test_repairs_of_a_tachometer_in_a_file_are_in_its_quality(tmp_path):
    rng = np.random.default_rng(0)
    signal, turns = raw([1] * 8, "ramp", fs=5000)
    starts = np.flatnonzero(np.diff(signal) > 0)
    for start in rng.choice(starts[5:-5], len(starts) // 20, replace=False):
        signal[start - 5 : start + 40] = 0
    np.savez(tmp_path / "a.npz", vibration=rng.normal(size=len(signal)), tacho=signal, fs=5000.0)
    layout = Layout(tacho={"column": "tacho", "pulses_per_rev": 8, "edge": "falling"})
    recording = open_recording(tmp_path / "a.npz", layout)
    assert abs(np.ptp(recording.angle) / (2 * np.pi) - turns) < 0.05
    for part in (recording, recording.cut(0, 4).select(["vibration"])):
        assert "missing and 0 double pulses" in str(OrderResampler().quality([part])["warnings"][0])


def test_a_layout_knows_the_options_of_angle_from_tacho_and_no_other():
    known = inspect.signature(angle_from_tacho).parameters
    for name in [*known][2:]:
        Layout(tacho={"column": "a", name: 1})
    with pytest.raises(TypeError, match=r"tacho must be .* 'pulses_per_rev', .* 'edge'"):
        Layout(tacho={"column": "a", "repair": False})


def test_uneven_marks_change_no_diagnosis():
    fs, rng, bearing = 10_000, np.random.default_rng(0), Bearing(9, 7.94, 39.04)
    signal, _ = raw([1, 1, 1, 1.6], "constant", fs=fs)
    vibration = 0.1 * rng.normal(size=len(signal))
    tail = np.arange(100) / fs
    ringing = np.exp(-900 * tail) * np.sin(2 * np.pi * 3000 * tail)
    period = 1 / (9 / 2 * (1 + 7.94 / 39.04) * MEAN)  # of the inner ring
    for hit in np.arange(0, SECONDS - 0.02, period):
        first = int(hit * fs)
        vibration[first : first + 100] += (1 + 0.5 * np.cos(2 * np.pi * MEAN * hit)) * ringing
    angle = angle_from_tacho(signal, fs, pulses_per_rev=4).angle
    found = find_faults([Recording({"vibration": vibration}, fs, angle=angle)], bearing)
    assert found["named"].tolist() == ["BPFI"]


@fast_motions
@pytest.mark.parametrize("wheel", ["40 marks, one 1.6", "8 marks, one 0.5"])
def test_five_percent_of_pulses_missing_at_random_are_put_back(wheel, motion):
    pulses, n_marks = pulses_of(WHEELS[wheel], motion), len(WHEELS[wheel])
    is_kept = np.random.default_rng(0).random(len(pulses)) > 0.05
    is_kept[[0, -1]] = True
    assert error_of(pulses[is_kept], n_marks, motion) < 0.5 / n_marks


@pytest.mark.parametrize("n_lost", [1, 3, 5])
@pytest.mark.parametrize("n_marks", [1, 60])
def test_neighbouring_missing_pulses_are_put_back(n_marks, n_lost):
    for seed in range(6):
        rng = np.random.default_rng(seed)
        pulses = pulses_of([1] * n_marks, "ramp")
        lost = rng.integers(12, len(pulses) - 22) + rng.choice(9, n_lost, replace=False)
        assert error_of(np.delete(pulses, lost), n_marks, "ramp") < 0.5 / n_marks


@fast_motions
@pytest.mark.parametrize("wheel", ["4 marks, one 1.6", "60 marks, one 0.5"])
def test_double_pulses_between_uneven_marks_are_taken_out(wheel, motion):
    pulses, n_marks = pulses_of(WHEELS[wheel], motion), len(WHEELS[wheel])
    rng = np.random.default_rng(0)
    after = rng.choice(np.arange(20, len(pulses) - 20, 7), len(pulses) // 60, replace=False)
    stray = pulses[after] + rng.uniform(0.1, 0.9, len(after)) * np.diff(pulses)[after]
    assert error_of(np.sort(np.append(pulses, stray)), n_marks, motion) < 0.5 / n_marks


@pytest.mark.parametrize("motion", ["constant", "ramp"])
def test_a_level_that_drifts_is_taken_out_and_named(motion):
    signal, turns = raw([1] * 8, motion, noise=0.02)
    drift = 3 * np.sin(2 * np.pi * np.arange(len(signal)) / len(signal))
    with pytest.warns(EmacmWarning, match="drifts"):
        found = angle_from_tacho(signal + drift, 20_000, pulses_per_rev=8)
    assert abs(np.ptp(found.angle) / (2 * np.pi) - turns) < 0.05


@pytest.mark.parametrize(
    ("n_marks", "level"),
    [
        (1, 1.5 * np.sin(2 * np.pi * 0.8 * TIME)),
        (8, 5 * np.sin(2 * np.pi * 0.8 * TIME)),
        (1, 3 * (TIME > 1.8)),
        (8, -1 * ((TIME > 2.1) & (TIME < 2.3))),
    ],
    ids=["drift", "large drift", "jump", "two jumps"],
)
def test_a_level_that_drifts_or_jumps_by_more_than_the_pulses_is_named(n_marks, level):
    signal, _ = raw([1] * n_marks, "constant", noise=0.01, fs=10_000)
    with pytest.raises(ValueError, match=r"drifts or jumps by .* high-pass"):
        angle_from_tacho(signal + level[:-1], 10_000, pulses_per_rev=n_marks)


@pytest.mark.parametrize("n_marks", [1, 8])
def test_the_tone_of_a_converter_beside_the_pulses_is_no_drift(n_marks):
    signal, turns = raw([1] * n_marks, "constant", noise=0.01, fs=10_000)
    tone = 0.2 * np.sin(2 * np.pi * 1000 * TIME[:-1])
    found = angle_from_tacho(signal + tone, 10_000, pulses_per_rev=n_marks)
    assert abs(np.ptp(found.angle) / (2 * np.pi) - turns) < 0.05


@pytest.mark.parametrize("period", [1.5, 2])
@pytest.mark.parametrize("n_marks", [2, 3, 4, 8, 60])
def test_a_shaft_that_may_reverse_between_pulses_is_stated(n_marks, period):
    turns = 8 * (1 - np.cos(2 * np.pi * TIME / period))  # to and fro
    passed = np.flatnonzero(np.diff(np.floor(turns * n_marks - 0.3)))
    with pytest.warns(EmacmWarning, match="pulses do not show the direction") as caught:
        angle_from_pulses(TIME[passed + 1], 10_000, len(TIME), pulses_per_rev=n_marks)
    stated = [warning.message.statement for warning in caught]
    assert ("reversal", True) in [(one.kind, one.severe) for one in stated]


@pytest.mark.parametrize("start", [0.05, 0.35, 0.65, 0.95])
@pytest.mark.parametrize("fall", [0.35, 0.4, 0.45])
def test_the_turns_of_a_speed_that_falls_suddenly_are_right_or_not_known(fall, start):
    time = np.linspace(0, 6, 60_001)
    speed = np.interp(time, [0, 3, 3.03], [15, 15, 15 * fall])
    turns = cumulative_trapezoid(speed, time, initial=0)
    pulses = np.interp(np.arange(start, turns[-1]), turns, time)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = angle_from_pulses(pulses, 10_000, len(time)).angle / (2 * np.pi)
    error = np.ptp((found - turns)[slice(*np.searchsorted(time, pulses[[0, -1]]))])
    assert error < 0.5 or any(warned.message.statement.severe for warned in caught)
