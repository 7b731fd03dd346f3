"""Limits of recordings and files, tested on both sides of each."""

import numpy as np
import pandas as pd
import pytest

from emacm import Layout, Recording, kurtogram, open_recording, spectral_kurtosis
from emacm.recordings.csv_files import text_table
from emacm.recordings.envelope import envelope
from emacm.recordings.file_columns import FileColumns
from emacm.recordings.inputs import described
from emacm.recordings.prewhitening import prewhitened
from emacm.recordings.readers import settled
from emacm.recordings.sample_times import _rounding, rate_of_times

ZEROS = np.zeros(40)


def angled(angle):
    return Recording({"b": np.zeros(len(angle))}, 100, angle=angle)


def of_ten(first):
    """An angle of ten samples, nearly all of whose range is one step."""
    return angled([*np.zeros(first), *np.full(10 - first, 9.0)])


def steps_of(step, total):
    return angled([*np.zeros(6), *np.linspace(step, total, 7)])


def indexed(off):
    """Samples of a clock, one of which is off by some sampling intervals."""
    times = np.arange(40) * 0.01
    times[17] += off * 0.01
    index = pd.Timestamp("2026-05-01") + pd.to_timedelta(times, unit="s")
    return Recording(pd.DataFrame({"b": ZEROS}, index=index), 100, velocity=3.0)


def lasting(n_shaft, rate):
    return Recording({"b": ZEROS}, 100, velocity=np.ones(n_shaft), shaft_fs=rate)


def cut(start, stop):
    """Ten seconds at 12 and 50 Hz."""
    signals = {"slow": np.arange(120.0), "fast": np.arange(500.0)}
    run = Recording(signals, {"slow": 12, "fast": 50}, velocity=3.0, shaft_fs=50)
    return run.cut(start, stop)


def jittering(off, place=30):
    times = np.arange(100) / 500
    times[place] += off / 500
    return rate_of_times(times, "t")


def late(off):
    return rate_of_times(np.r_[np.arange(50), np.arange(50, 100) + off] / 500, "t")


@pytest.mark.parametrize(
    ("make", "accepted", "refused", "words"),
    [
        (lambda x: angled([0.0, x]), 1e15, 1.1e15, r"got values up to 1.1e\+15, which no"),
        (
            lambda x: Recording({"b": [1, 2]}, 9, velocity=[x, 0]),
            1e9,
            1.1e9,
            r"got 1.1e\+09 at sample 0",
        ),
        (lambda n: angled([0, *[9.0] * n]), 8, 9, r"angle jumps by 9 after sample 0, .*\(9\)"),
        (lambda x: steps_of(x, 20.0), 10.0, 10.1, r"jumps by 10.1 after sample 5, .*\(20\)"),
        (indexed, 0.59, 0.61, "sample 17 is at 0.1761 s, expected was 0.17 s"),
        (indexed, -0.59, -0.61, "sample 17 is at 0.1639 s, expected was 0.17 s"),
        (
            lambda n: lasting(n, 100),
            41,
            42,
            "channel 'b' lasts 0.4 s and the shaft's velocity 0.42 s",
        ),
        (
            lambda n: lasting(n, 100),
            39,
            38,
            "the shaft's velocity lasts 0.38 s and channel 'b' 0.4 s",
        ),
        (
            lambda n: lasting(n, 25),
            11,
            12,
            "channel 'b' lasts 0.4 s and the shaft's velocity 0.48 s",
        ),
        (lambda n: lasting(n, 25), 9, 8, "the shaft's velocity lasts 0.32 s and channel 'b' 0.4 s"),
        (lambda x: cut(0, 10 * (1 + x)), 0.9e-9, 1.1e-9, "within the recording of 10 s"),
        (lambda x: cut(9 + x, None), 10 / 12, 10.01 / 12, "10 s there are 1 samples of .*'slow'"),
        (lambda x: cut(x, 1 / 6), 0, 1e-3, "there are 1 samples of channel 'slow' .12 Hz."),
        (jittering, 0.1, 0.12, "jitter: sample 30 is at 0.06024 s, .* at 500 Hz would be 0.06 s"),
        (jittering, -0.1, -0.12, "jitter: sample 30 is at 0.05976 s"),
        (
            late,
            0.05,
            0.52,
            r"gap of 0.00304 s after sample 49 \(0.098 s\), 1 in all; usual are 0.002 s",
        ),
        (late, 0.05, 0.48, "has jitter: sample"),
        (
            lambda n: kurtogram(np.random.default_rng(0).normal(size=4000), 9.0, levels=n),
            9,
            10,
            "levels must be a whole number .* at most 9, got 10",
        ),
        (
            lambda n: settled(FileColumns({f"x{i}": ZEROS for i in range(n)})),
            10_000,
            10_001,
            "it has 10001 columns; at most 10000 are read",
        ),
        (
            lambda n: text_table(["1" + ",2" * (n - 1)] * 2),
            10_000,
            10_001,
            "its rows have 10001 values; at most 10000 are read",
        ),
    ],
)
def test_what_is_beyond_a_limit_is_refused(make, accepted, refused, words):
    make(accepted)
    with pytest.raises(ValueError, match=words):
        make(refused)


def test_a_step_of_less_than_half_a_turn_is_no_jump():
    assert np.ptp(steps_of(3.0, 5.0).angle) == 5  # 3 of 5 rad


@pytest.mark.parametrize(("off", "first"), [(0.9e-6, 24), (1.1e-6, 25)])
def test_a_part_begins_at_a_sample_that_rounding_missed(off, first):
    assert cut(2 + off / 12, None).signals["slow"][0] == first


@pytest.mark.parametrize(("off", "last"), [(0.9e-6, 174), (1.1e-6, 175)])
def test_a_part_ends_before_a_sample_that_rounding_missed(off, last):
    assert cut(0, 3.5 + off / 50).signals["fast"][-1] == last


def test_the_header_stands_in_the_first_200_lines(tmp_path):
    layout = Layout(fs=10, velocity=3)
    for n_lines, names in ((198, ("b", "c")), (199, None)):
        lines = [f"# key {i} = {i}" for i in range(n_lines)] + ["b,c", *["1,2"] * 9]
        (tmp_path / f"{n_lines}.csv").write_text("\n".join(lines))
        recording = open_recording(tmp_path / f"{n_lines}.csv", layout)
        if names:
            assert recording.channels == names
        else:
            with pytest.raises(ValueError, match="has no rows of numbers; it begins with 'key 0"):
                assert recording.channels


def test_a_message_lists_20_columns_and_200_characters_of_meta(tmp_path):
    for n_columns, ending in ((20, r"'c19'\]; it|'c19'\]\. W"), (21, r"'c19'\] and 1 more")):
        content = FileColumns({f"c{k}": ZEROS for k in range(n_columns)})
        with pytest.raises(ValueError, match=r"its columns are \['c0', 'c1', .*" + ending):
            content.find("z")
    for length, ending in ((196, "')"), (197, " ...)")):
        run = Recording({"b": [1, 2]}, 1, velocity=1.0, meta={"k": "x" * length})
        assert described(run, 3) == "recording 3 (k='" + "x" * length + ending


@pytest.mark.parametrize("fs", [0, -0.5])
@pytest.mark.parametrize(
    "make",
    [
        lambda fs: envelope(np.ones(500), fs, (100, 200)),
        lambda fs: kurtogram(np.ones(500), fs),
        lambda fs: spectral_kurtosis(np.ones(500), fs),
        lambda fs: prewhitened(np.ones(500), fs),
        lambda fs: Layout(fs=fs),
        lambda fs: Recording({"b": [1, 2]}, fs, velocity=3),
        lambda fs: Recording({"b": [1, 2]}, {"b": fs}, velocity=3),
        lambda fs: Recording({"b": [1, 2]}, 1, velocity=[3, 3], shaft_fs=fs),
        lambda fs: Recording({"b": [1, 2]}, 1, velocity=3, shaft_fs=fs),
        lambda fs: Layout(fs={"b": fs}),
    ],
)
def test_a_rate_is_above_0(make, fs):
    with pytest.raises(ValueError, match=f"fs.* must be a number of Hz, above 0, got {fs}"):
        make(fs)


@pytest.mark.parametrize(
    ("start", "stop", "message"),
    [
        (-0.5, None, "start must be a number of s, at least 0, got -0.5"),
        (0, 0, "stop must be a number of s, above 0, got 0"),
        (0, -0.5, "stop must be a number of s, above 0, got -0.5"),
        (2, 2, "in this order and within the recording of 10 s, got 2 and 2"),
    ],
)
def test_times_of_a_part_are_in_order(start, stop, message):
    with pytest.raises(ValueError, match=message):
        cut(start, stop)


@pytest.mark.parametrize("fs", [7.0, 30.0])
def test_times_that_are_no_multiples_of_a_decimal_are_not_taken_as_rounded(fs):
    times = np.arange(1000) / fs
    times[40] += 0.1 / fs - 5e-7
    assert rate_of_times(times, "t") == pytest.approx(fs)
    times[40] += 1e-6
    with pytest.raises(ValueError, match="jitter: sample 40 is at"):
        rate_of_times(times, "t")


def test_the_first_time_beyond_jitter_and_rounding_is_named():
    times = np.round(np.arange(100) / 500, 5)
    times[5] += 0.00001  # to which times are rounded
    times[20] += 0.0002  # a tenth of an interval
    times[33] += 0.0003
    with pytest.raises(ValueError, match=r"jitter: sample 33 is at 0.0663 s, .* be 0.066 s"):
        rate_of_times(times, "t")


def test_a_rounded_time_of_nearly_equal_steps_gives_the_round_rate():
    assert rate_of_times(np.round(np.arange(3000) / 999, 6), "t") == 999


@pytest.mark.parametrize(("n_samples", "message"), [(512, None), (511, "fewer than 8 segments")])
def test_spectral_kurtosis_needs_8_segments_of_8_samples(n_samples, message):
    signal = np.random.default_rng(0).standard_normal(n_samples)
    if message is None:
        assert len(spectral_kurtosis(signal, 0.25, n_per_segment=64)[0]) == 31
    else:
        with pytest.raises(ValueError, match=message):
            spectral_kurtosis(signal, 0.25, n_per_segment=64)
    with pytest.raises(ValueError, match="n_per_segment must be a whole number of at least 8"):
        spectral_kurtosis(signal, 0.25, n_per_segment=7)


def test_a_rate_may_be_below_one_hertz():
    signal = np.random.default_rng(0).standard_normal(900)
    assert kurtogram(signal, 0.25).band == pytest.approx(
        np.divide(kurtogram(signal, 1000.0).band, 4000)
    )
    slow = envelope(signal, 0.25, (0.03, 0.06))
    np.testing.assert_allclose(slow, envelope(signal, 1000.0, (120, 240)), rtol=1e-9)
    assert Recording({"b": signal}, 0.25, velocity=0.001, shaft_fs=0.25).duration == 3600


def test_of_several_gaps_the_first_is_named_beside_the_usual_interval():
    times = np.r_[np.arange(20), np.arange(120, 140), np.arange(900, 940)] / 500
    message = r"gap of 0.202 s after sample 19 \(0.038 s\), 2 in all; usual are 0.002 s"
    with pytest.raises(ValueError, match=message):
        rate_of_times(times, "t")


def test_a_file_without_columns_has_none_to_suggest():
    with pytest.raises(ValueError, match=r"it has no column 'z'; its columns are \[\]\. .*: 'z'\."):
        FileColumns({}).find("z")


@pytest.mark.parametrize(("share", "decimal"), [(0.89, 1e-6), (0.91, 1e-5)])
def test_times_are_rounded_to_a_decimal_that_the_smallest_step_reaches(share, decimal):
    steps = np.full(2000, 1e-4)
    steps[1500] = share * 1e-5  # after the samples whose last digit is looked for
    assert _rounding(np.r_[0, np.cumsum(steps)], steps) == pytest.approx(decimal)
