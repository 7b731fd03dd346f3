"""Files as loggers and programs write them: times, invalid samples, names, stopped writers."""

import struct

import numpy as np
import pandas as pd
import pytest
import scipy.io.wavfile
from files.written import (
    every_format,
    ignored,
    library,
    write,
    write_mdf,
    write_segments,
    write_uff,
)

from emacm import Layout, open_recording
from emacm.__main__ import main
from emacm._statements import EmacmWarning

RNG = np.random.default_rng(4)
N = 6000
TIMES = np.arange(N) / 1000
TONE = np.sin(2 * np.pi * 36 * TIMES)  # order 3.6 at 600 rpm
SPEED = {"velocity": "600 rpm"}


def opened(path, **options):
    return open_recording(path, Layout(**SPEED | options))


def refused(path, message, **options):
    with pytest.raises((ValueError, TypeError), match=message) as caught:
        _ = opened(path, **options).fs
    assert "Copy it again" not in str(caught.value)


def inspected(path, capsys):
    assert main(["inspect", str(path), "--draft", str(path.with_suffix(".toml"))]) == 0
    return capsys.readouterr().out + path.with_suffix(".toml").read_text()


# Times of samples


@ignored
@every_format
@pytest.mark.parametrize("every", [3, 250])
def test_a_regular_gap_is_no_lower_rate(tmp_path, suffix, every):
    kept = np.arange(N) % every != every // 2
    path = write(tmp_path / f"a.{suffix}", {"vib": TONE[kept]}, TIMES[kept])
    refused(path, f"a gap of 0.002 s after sample {every // 2 - 1} .* {N // every} of 6000 sam")
    recording = open_recording(path, Layout(**SPEED), resample=True)
    with pytest.warns(EmacmWarning, match="channel 'vib' was resampled .* to 1000 Hz; samples"):
        assert recording.fs["vib"] == 1000
    inner = slice(100, len(recording.signals["vib"]) - 100)
    right = TONE[np.flatnonzero(kept)[0] :]
    np.testing.assert_allclose(recording.signals["vib"][inner], right[inner], atol=0.01)


SHUFFLED = np.sort(TIMES + 5e-5 * RNG.normal(size=N))
SET_CLOCK = TIMES + np.where(np.arange(N) < 2500, 0, 0.037)


@ignored
@every_format
@pytest.mark.parametrize(
    ("times", "message"),
    [
        (np.repeat(TIMES[::3], 3), "several samples share one time, as in packets: .* sample 0"),
        (np.insert(TIMES[:-1], 70, 0.07), "several samples share one time"),
        (SET_CLOCK, "a gap of 0.038 s after sample 2499 .*, or correct the clock"),
        (2 * TIMES - SET_CLOCK, "does not increase at sample 2500"),
        (np.delete(TIMES, [700, 701, 4000]), "a gap of 0.003 s after sample 699 .* 3 of 6000"),
        (TIMES + 3e-4 * RNG.normal(size=N).cumsum() / 9, "by jitter or drift"),
    ],
    ids=["packets", "double", "clock", "clock back", "gaps", "drift"],
)
def test_times_that_are_not_even_are_refused_with_what_they_are_and_where(
    tmp_path, suffix, times, message
):
    refused(write(tmp_path / f"a.{suffix}", {"vib": TONE[: len(times)]}, times), message)


@ignored
@every_format
def test_small_jitter_is_stated_and_resampled_on_request(tmp_path, suffix):
    values = np.sin(2 * np.pi * 90 * SHUFFLED)
    path = write(tmp_path / f"a.{suffix}", {"vib": values}, SHUFFLED)
    found = opened(path)
    with pytest.warns(EmacmWarning, match="jitter by 5.*% of a sampling interval .* 1000 Hz"):
        assert found.fs["vib"] == 1000
    even = opened(path, resample=True)
    with pytest.warns(EmacmWarning, match="channel 'vib' was resampled"):
        times = SHUFFLED[0] + np.arange(len(even.signals["vib"])) / 1000
    inner, right = slice(50, -50), np.sin(2 * np.pi * 90 * times)
    errors = [np.std((r.signals["vib"][: len(times)] - right)[inner]) for r in (found, even)]
    assert errors[0] > 0.015
    assert errors[1] < 0.002


@pytest.mark.parametrize("kind", ["velocity", "angle", "wrapped", "tacho"])
def test_the_shaft_is_resampled_with_the_channels(tmp_path, kind):
    angle = 40 * SHUFFLED + np.sin(3 * SHUFFLED)
    shaft = {
        "velocity": 40 + 3 * np.cos(3 * SHUFFLED),
        "angle": angle,
        "wrapped": angle % (2 * np.pi),
        "tacho": (angle % (2 * np.pi) < 0.9).astype(float),
    }[kind]
    columns = {"vib": np.cos(4 * angle), "shaft": shaft}
    write(tmp_path / "a.csv", columns, SHUFFLED)
    key = "angle" if kind == "wrapped" else kind
    (tmp_path / "a.toml").write_text(f'{key} = "shaft"\nresample = true\n')
    recording = open_recording(tmp_path / "a.csv", Layout.from_toml(tmp_path / "a.toml"))
    with pytest.warns(EmacmWarning, match="channel 'vib' was resampled"):
        times = SHUFFLED[0] + np.arange(len(recording.velocity)) / 1000
    right = 40 + 3 * np.cos(3 * times)
    tolerance = 1.0 if kind == "tacho" else 0.05
    np.testing.assert_allclose(recording.velocity[400:-400], right[400:-400], atol=tolerance)


@pytest.mark.parametrize("digits", [3, 4, 6])
@pytest.mark.parametrize("fs", [25.6, 640, 1024, 1652, 12_800, 48_828.125])
def test_rounded_times_give_the_rate_and_its_uncertainty(tmp_path, fs, digits):
    times = np.round(3.7 + np.arange(50_000) / fs, digits)
    recording = opened(write(tmp_path / "a.npz", {"vib": np.zeros(50_000)}, times))
    if fs > 500 and 10.0**-digits / (50_000 / fs) > 1e-5:
        with pytest.warns(EmacmWarning, match=r"rounded to 0.0*1 s: the rate is .* within"):
            assert recording.fs["vib"] == pytest.approx(fs, rel=2e-4)
    else:
        assert recording.fs["vib"] == pytest.approx(fs, rel=1e-5)


@pytest.mark.parametrize(
    ("numbers", "fs", "tolerance"),
    [
        (lambda times: (100 + times).astype("f4"), 12_800, 1e-9),
        (lambda times: times.astype("f4"), 51_200, 1e-9),
        (lambda times: [float(f"{time:g}") for time in times], 25_600, 2e-5),
    ],
    ids=["single precision from 100 s", "single precision", "six digits"],
)
def test_times_of_few_digits_are_rounded_and_do_not_jitter(tmp_path, numbers, fs, tolerance):
    times = np.asarray(numbers(np.arange(round(1.8 * fs)) / fs))
    path = write(tmp_path / "a.npz", {"vib": np.zeros(len(times))}, times)
    assert opened(path).fs["vib"] == pytest.approx(fs, rel=tolerance)  # and no warning


@pytest.mark.parametrize(
    ("times", "fs", "message"),
    [
        (np.arange(N) / 500, 480, "not evenly spaced at 480 Hz: its mean rate is 500 Hz"),
        (np.round(np.arange(N) / 1024, 3), 1000, "at 1000 Hz: its mean rate is 1024 Hz. Correct"),
        (np.where(np.arange(N) == 30, np.nan, np.arange(N)), None, "got nan at sample 30"),
        (np.arange(N) // 1000, None, "rounded to 1 s, which leaves the sampling rate open"),
    ],
)
def test_times_that_contradict_the_layout_or_are_none_are_refused(tmp_path, times, fs, message):
    path = write(tmp_path / "a.npz", {"vib": TONE}, times)
    refused(path, message, fs=fs)
    assert opened(path, fs=500, time=False).channels == ("vib",)


def test_one_rate_or_missing_samples_is_for_the_layout_to_state(tmp_path):
    times = np.floor(np.arange(9000) / 0.9) / 1000  # 900 Hz in ms, or 1000 Hz with gaps
    path = write(tmp_path / "a.csv", {"vib": np.zeros(9000)}, times)
    refused(path, "state fs = 900 if only rounding makes steps longer")
    assert opened(path, fs=900).fs["vib"] == 900


@pytest.mark.parametrize("missing", [1, 20])
@pytest.mark.parametrize("fs", [640, 800, 1024, 1500, 2048])
def test_a_gap_between_times_that_are_rounded_is_named(tmp_path, fs, missing):
    times = np.delete(np.round(np.arange(9000) / fs, 3), np.arange(4000, 4000 + missing))
    path = write(tmp_path / "a.csv", {"vib": np.zeros(len(times))}, times)
    refused(path, rf"a gap of .* after sample (399\d|400\d) .* samples missing there: {missing}, ")


@ignored
@pytest.mark.parametrize("suffix", ["uff", "mf4"])
@pytest.mark.parametrize(("unit", "size"), [("d", 86_400), ("ms", 1e-3)])
def test_times_of_a_format_may_be_in_another_unit_too(tmp_path, suffix, unit, size, capsys):
    path = write(tmp_path / f"a.{suffix}", {"vib": TONE}, TIMES / size)
    refused(path, rf"in {unit} it is 1000.* = {{time = '{unit}'}}")
    assert opened(path, units={"time": unit}).fs["vib"] == 1000
    assert f'"time" = "{unit}"' in inspected(path, capsys)


@pytest.mark.parametrize(
    ("start", "unit", "word", "size"),
    [
        *((day, "d", "days", 86_400) for day in (0.0, 46354.5, 738_000.5)),
        (46354.5, "h", "hours", 3600),
        (0.0, "ms", "milliseconds", 1e-3),
        (738_000.5, "us", "microseconds", 1e-6),
    ],
)
def test_times_in_another_unit_are_refused_with_the_unit_that_fits(
    tmp_path, start, unit, word, size, capsys
):
    path = write(tmp_path / "a.csv", {"vib": TONE}, start + TIMES / size)
    refused(path, rf"in {unit} it is 1000.* Are these {word}.* = {{time = '{unit}'}}")
    assert opened(path, units={"time": unit}).fs["vib"] == 1000
    text = inspected(path, capsys)
    assert f"these look like {word}" in text
    assert f'"time" = "{unit}"' in text


def test_a_rate_below_the_speed_of_the_shaft_is_not_credible(tmp_path):
    path = write(tmp_path / "a.csv", {"vib": TONE}, np.arange(N) / 12.8)  # ms at 12.8 kHz
    refused(path, "in ms it is 12800 Hz", velocity="1500 rpm")
    assert opened(path, velocity="1500 rpm", units={"time": "s"}).fs["vib"] == 12.8


@pytest.mark.parametrize(
    ("name", "size"),
    [
        *(("time_us", 1e-6), ("t [us]", 1e-6), ("Time (ns)", 1e-9), ("time [d]", 86_400)),
        *(("time_ms", 1e-3), ("elapsed_seconds", 1), ("Time [s]", 1)),
    ],
)
def test_a_unit_in_the_name_of_the_times_is_used(tmp_path, name, size, capsys):
    fs = 1 if size == 1 else 1000  # which without the unit would be taken as 1000 Hz in ms
    path = tmp_path / "a.csv"
    pd.DataFrame({name: np.arange(N) / fs / size, "vib": TONE}).to_csv(path, index=False)
    assert dict(opened(path).fs) == {"vib": fs}
    assert "look" not in inspected(path, capsys)


def test_times_since_1970_state_the_start(tmp_path):
    for size, unit in ((1.0, "s"), (1e-3, "ms")):
        times = 1_709_632_800 / size + np.arange(N) * 0.01 / size
        path = write(tmp_path / "a.csv", {"vib": TONE}, times)
        if unit != "s":
            refused(path, "Are these milliseconds. State .*'ms'")
        recording = opened(path, units={"time": unit})
        assert recording.cut(0).start == pd.Timestamp("2024-03-05T10:00:00")


# Texts


def test_a_point_in_a_rate_beside_decimal_commas_is_no_decimal_point(tmp_path):
    rows = rows_of(lambda t, x: f"{x};1".replace(".", ","))
    (tmp_path / "a.csv").write_text(f"Abtastrate: 51.200 Hz\nvib;b\n{rows}")
    refused(tmp_path / "a.csv", "rate of 'vib' is not known")
    assert opened(tmp_path / "a.csv", fs=51200).fs["vib"] == 51200


def rows_of(row, longest=0.3):
    return "".join(row(k / 1000, f"{TONE[k]:.5f}") + "\n" for k in range(int(1000 * longest)))


def comma(number):
    return f"{number:.3f}".replace(".", ",")


@pytest.mark.parametrize(
    ("header", "row", "message"),
    [
        ("time,vib", lambda t, x: f"{comma(t)},{x}", "commas are both decimal and between values"),
        ("time,vib", lambda t, x: f"{t:.3f},{x.replace('.', ',')}", "commas are both decimal"),
        ("0,00,0", lambda t, x: f"{comma(t)},{x.replace('.', ',')}", "commas are both decimal"),
        ("time,vib", lambda t, x: f'"{comma(t)}",{x}', "'vib' has '0.00000' at sample 0, with a d"),
        ("time;vib", lambda t, x: f"{t:.3f};1,234", "'time' has '0.000' at sample 0, with a dec"),
        ("time,vib", lambda t, x: f"{t:.3f}", "line 2 has 1 values, but the header has 2 names"),
        ("time;vib;b", lambda t, x: f"{t:.3f};{x}", "the 2 columns: the rows have 2 values"),
        ("time,vib", lambda t, x: f"01/02/2026 08:00:{t:06.3f},{x}", "day and month are not known"),
    ],
)
def test_marks_that_do_not_fit_are_named_for_what_they_are(tmp_path, header, row, message):
    (tmp_path / "a.csv").write_text(f"{header}\n{rows_of(row)}")
    refused(tmp_path / "a.csv", message)


@pytest.mark.parametrize(
    ("header", "row", "layout"),
    [
        (
            "Temps (s);Vibration (g);Vitesse (tr/min)",
            lambda t, x: f"{comma(t)};{x.replace('.', ',')};{600 + t:.2f}".replace(".", ","),
            'velocity = "Vitesse"',
        ),
        (
            "Recorded,Sample,Accel (g),Speed (RPM)",
            lambda t, x: f"03/13/2026 12:59:{t:09.6f} PM,{1000 * t:.0f},{x},{600 + t:.2f}",
            'time = "Recorded"',
        ),
        (
            "Laufzeit [ms];Beschl [g];Tacho [V]",
            lambda t, x: f"{1000 * t:.0f};{x.replace('.', ',')};{5 * (t * 20 % 1 < 0.5)}",
            "tacho = {column",
        ),
    ],
)
def test_names_and_dates_of_other_countries_are_proposed(tmp_path, header, row, layout, capsys):
    (tmp_path / "a.csv").write_text(f"{header}\n{rows_of(row, 0.9)}", encoding="utf-8")
    text = inspected(tmp_path / "a.csv", capsys)
    assert layout in text
    assert "1000 Hz, found in the file" in text
    (tmp_path / "a.toml").write_text(text[text.index("# Layout") :].replace("# tacho", "tacho"))
    recording = open_recording(tmp_path / "a.csv", Layout.from_toml(tmp_path / "a.toml"))
    (channel,) = recording.channels
    np.testing.assert_allclose(recording.signals[channel], TONE[:900], atol=1e-5)


@pytest.mark.parametrize("name", ["time", None])
@pytest.mark.parametrize("index", [pd.to_timedelta, lambda t, unit: pd.to_datetime(t, unit=unit)])
def test_an_index_of_times_of_a_parquet_file_is_its_time(tmp_path, name, index):
    library("pyarrow")
    frame = pd.DataFrame({"vib": TONE}, index=index(np.arange(N), unit="ms"))
    frame.rename_axis(name).to_parquet(tmp_path / "a.parquet")
    recording = opened(tmp_path / "a.parquet")
    assert (recording.channels, recording.fs["vib"]) == (("vib",), 1000)


# Content that is silently wrong


def write_wav(path, values, dtype="i2"):
    scipy.io.wavfile.write(path, 1000, (values * np.iinfo(dtype).max).astype(dtype))
    return path


@pytest.mark.parametrize("dtype", ["i2", "i4"])
def test_an_integer_wav_file_needs_a_scale_for_its_unit(tmp_path, dtype, capsys):
    path, units = write_wav(tmp_path / "a.wav", TONE / 4, dtype), {"x0": "g"}
    with pytest.warns(EmacmWarning, match="full scale of this WAV file is taken as 1 g.*scale"):
        assert opened(path, units=units).duration == 6
    with pytest.warns(EmacmWarning, match="full scale of this WAV file is taken as 1 V"):
        found = opened(path, units={"x0": "V"}, scale="10 mV/g").signals["x0"]
    np.testing.assert_allclose(found, 25 * TONE, atol=0.01)
    for scale in (4, {"x0": 4.0}):
        recording = opened(path, units=units, scale=scale)
        np.testing.assert_allclose(recording.signals["x0"], TONE, atol=3e-4)
        assert recording.units["x0"] == "g"
    assert "# scale = 1.0  # FILL IN: full scale" in inspected(path, capsys)


def test_a_scale_replaces_the_unit_of_the_file_and_names_a_channel(tmp_path):
    path = write(tmp_path / "a.csv", {"vib": TONE, "b": TONE}, TIMES, units={"vib": "V"})
    recording = opened(path, scale={"vib": 10}, units={"vib": "g"})
    np.testing.assert_allclose(recording.signals["vib"], 10 * TONE)
    np.testing.assert_allclose(recording.signals["b"], TONE)
    assert dict(recording.units) == {"vib": "g"}
    refused(path, "scale names 'c', which is no", scale={"c": 1})
    with pytest.raises(TypeError, match="scale of 'vib' must be a number"):
        Layout(scale={"vib": "10"})


@ignored
def test_invalid_samples_of_an_mdf_file_are_refused_with_their_places(tmp_path, capsys):
    path, invalid = tmp_path / "a.mf4", (np.arange(N) >= 1000) & (np.arange(N) < 1500)
    held = {"samples": np.where(invalid, 1e6, TONE), "invalidation_bits": invalid}
    write_mdf(path, [signal("vib") | held, signal("b")])
    refused(path, "'vib' has 500 samples .* invalid, the first is sample 1000")
    assert opened(path, channels=["b"]).channels == ("b",)
    assert "Not used: 'vib', it has 500 samples" in inspected(path, capsys)


def signal(name, samples=TONE, times=TIMES):
    return {"samples": samples, "timestamps": times, "name": name}


def data_set(name, data=TONE, times=TIMES):
    return {"id1": name, "data": data, "x": times}


@pytest.mark.parametrize("code", [-9999.0, 12.0])
def test_attributes_of_packed_hdf5_data_sets_are_applied(tmp_path, code):
    path = tmp_path / "a.h5"
    stored = np.where(np.arange(N) == 77, code, np.round(TONE * 100) + 500)
    with library("h5py").File(path, "w") as file:
        for name, values in (("vib", stored.astype("i2")), ("b", stored[80:].astype("i2"))):
            file[name] = values
            file[name].attrs.update(_FillValue=np.int16(code), scale_factor=0.01, add_offset=-5.0)
    found = opened(path, fs=1000, channels=["b"]).signals["b"]
    np.testing.assert_allclose(found, TONE[80:], atol=0.006)
    refused(path, "'vib' must be finite, got nan at sample 77", fs=1000, channels=["vib"])


@pytest.mark.parametrize("stated", [{"valid_max": 8.0}, {"valid_range": [-8, 8]}, {}])
def test_stored_values_outside_of_the_valid_range_of_hdf5_are_no_samples(tmp_path, stated):
    stored = np.where(np.arange(N) == 77, 32767, np.round(TONE * 5)).astype("i2")
    with library("h5py").File(tmp_path / "a.h5", "w") as file:
        file["vib"] = stored
        file["vib"].attrs.update(stated, scale_factor=0.01)
    refused(tmp_path / "a.h5", "'vib' must be finite, got nan at sample 77", fs=1000)


def test_pulses_of_full_scale_are_no_codes(tmp_path):
    pulses = (TIMES * 10 % 1 < 0.3) * 32767
    path = write(tmp_path / "a.npz", {"vib": TONE, "tacho": pulses.astype("i2")}, fs=1000)
    recording = open_recording(path, Layout(tacho="tacho"))
    assert np.ptp(recording.angle) / (2 * np.pi) == pytest.approx(60, abs=0.05)


@pytest.mark.parametrize("clocks", [("time", "Timestamp"), ("a/time", "b/time")])
def test_another_clock_is_no_channel(tmp_path, clocks):
    path = tmp_path / "a.h5"
    with library("h5py").File(path, "w") as file:
        for name, values in zip((*clocks, "vib"), (2 * TIMES, TIMES, TONE), strict=True):
            file[name] = values
    recording = opened(path, time=clocks[1])
    assert (recording.channels, recording.fs["vib"]) == (("vib",), 1000)


BEYOND = (1e20, -1e30, 9.97e36, np.finfo("f4").max)


@pytest.mark.parametrize(
    "code",
    [-9999, -999, -99, -999.25, 32767, -32768, 8388607, 2.0**32 - 1, 99999, 9.91e37, *BEYOND],
)
@pytest.mark.parametrize("dtype", ["f8", "f4"])
def test_codes_for_missing_values_are_no_samples(tmp_path, code, dtype):
    usual = np.round(999 * TONE) / 4 if code > 0 else TONE
    values = np.where(np.arange(N) % 900 == 42, code, usual)
    values[100] = -9999 if code == 32767 else values[100]  # two codes in one channel
    path = write(tmp_path / "a.npz", {"vib": values.astype(dtype)}, fs=1000)
    code = np.array(code, dtype)
    refused(path, f"'vib' has . values of {code:g}, first at sample 42".replace("+", "."))
    clipped = np.clip(40_000 * TONE, -32768, 32767).astype("i2")  # full scale is no code
    path = write(tmp_path / "b.npz", {"vib": clipped}, fs=1000)
    assert opened(path).signals["vib"].max() == 32767


def test_a_code_among_values_that_are_larger_is_no_sample(tmp_path):
    speed = np.where(np.arange(N) % 900 == 42, -999, 1500 + 20 * TONE)
    path = write(tmp_path / "a.npz", {"vib": TONE, "load": speed}, fs=1000)
    refused(path, "'load' has 7 values of -999, first at sample 42")


@pytest.mark.filterwarnings("ignore:column '(valid|sample)'")
def test_a_column_of_states_is_no_channel_unless_it_is_listed(tmp_path, capsys):
    states = {"vib_quality": np.full(N, 192), "valid": TONE > 2, "sample": np.arange(N)}
    path = write(tmp_path / "a.npz", {"vib": TONE, "quality": TONE} | states, fs=1000)
    with pytest.warns(EmacmWarning, match="'vib_quality' is named like a status"):
        assert opened(path).channels == ("vib", "quality")  # and not the numbers of the samples
    assert opened(path, channels=["valid"]).channels == ("valid",)
    assert "Not used: 'vib_quality', it is named like a status" in inspected(path, capsys)


@ignored
def test_no_channel_is_lost_where_names_collide(tmp_path):
    write_mdf(tmp_path / "a.mf4", [signal("vib", factor * TONE) for factor in (1, 2, 3)])
    found = opened(tmp_path / "a.mf4")
    assert found.channels == ("vib.0", "vib.1", "vib.2")
    np.testing.assert_allclose(found.signals["vib.1"], 2 * TONE)
    write_uff(tmp_path / "a.uff", [data_set(name) for name in ("x1", "NONE", "x1", "b")])
    assert opened(tmp_path / "a.uff").channels == ("x1.0", "x1.1", "x1.2", "b")
    nptdms = library("nptdms")
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        pairs = (("left", "vib"), ("right", "vib"), ("left", "n"))
        rate = {"wf_increment": 0.001}
        writer.write_segment([nptdms.ChannelObject(*pair, TONE, rate) for pair in pairs])
    assert sorted(opened(tmp_path / "a.tdms").channels) == ["left/vib", "n", "right/vib"]
    path = write(tmp_path / "a.npz", {"v": np.ones((2, 9)), "v.0": np.ones(9)}, fs=10)
    refused(path, "two arrays would be the column 'v.0'. Rename one")
    with library("h5py").File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file["a.b"], file["a/b"] = np.ones(9), np.zeros(9)
    refused(tmp_path / "a.mat", "two arrays would be the column 'a.b'")


@ignored
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"abscissa_spec_data_type": 18}, "'spectrum' is no signal over time in s, but over freq"),
        ({"abscissa_spec_data_type": 20}, "over order"),
        ({"abscissa_spec_data_type": 12}, "over a quantity 12"),
        ({"abscissa_axis_units_lab": "Hz"}, "over Hz"),
        ({"abscissa_axis_units_lab": "ms"}, "over time in s, but over ms"),
        ({"abscissa_spec_data_type": 0, "func_type": 2}, "over another quantity .type of func"),
        ({"data": TONE * 1j, "func_type": 4}, "'spectrum' is complex|is no signal over time"),
    ],
)
def test_a_curve_over_frequency_is_no_time_signal(tmp_path, options, message, capsys):
    path = tmp_path / "a.uff"
    write_uff(path, [data_set("vib"), data_set("spectrum", times=np.arange(N) / 2) | options])
    refused(path, message)
    assert opened(path, channels=["vib"]).fs["vib"] == 1000
    assert "Not used: 'spectrum', it is" in inspected(path, capsys)


@ignored
def test_wave_forms_over_other_quantities_are_no_time_signals(tmp_path):
    axes = {"wf_xunit_string": "Hz"}, {"wf_xname": "Frequency"}, {"wf_xname": "Revolutions"}
    for axis in axes:
        path = write_segments(tmp_path / "a.tdms", (TONE, {"wf_increment": 0.5} | axis))
        refused(path, f"'vib' is no signal over time in s, but over {next(iter(axis.values()))}")
    write_mdf(tmp_path / "a.mf4", [signal("vib") | {"master_metadata": ("angle", 2)}])
    refused(tmp_path / "a.mf4", "'vib' is no signal over time in s, but over 'angle'")


def later(seconds):
    start = np.datetime64("2026-11-01T08:00:00", "us") + np.timedelta64(round(seconds * 1e6), "us")
    return {"wf_increment": 0.001, "wf_start_time": start}


@pytest.mark.parametrize(
    ("second", "message"),
    [
        ({"wf_increment": 0.002}, "'vib' has segments with wf_increment = 0.001 and 0.002"),
        (later(3600), "segment that starts 3594 s after the end of the one before, at sample 6000"),
        (later(6.1), "segment that starts 0.1 s after the end"),
        (later(3), "segment that starts -3 s after the end"),
        (later(0) | {"wf_start_offset": 9.0}, "segment that starts 3 s after the end"),
        (later(6) | {"unit_string": "mV"}, "segments with unit_string = g and mV"),
    ],
)
def test_tdms_segments_that_differ_are_not_joined(tmp_path, second, message):
    path = tmp_path / "a.tdms"
    first = later(0) | {"unit_string": "g"}
    refused(write_segments(path, (TONE, first), (TONE, second), (TONE, later(0))), message)
    joined = opened(write_segments(path, (TONE, first), (TONE, later(6)), (TONE, {})))
    assert (joined.duration, joined.cut(0).start) == (18, pd.Timestamp("2026-11-01T08:00:00"))
    many = [(TONE[:60], later(0.06 * n)) for n in range(130)]
    many.append((TONE, later(7.8) | {"wf_increment": 2e-3}))
    refused(write_segments(path, *many), "wf_increment = ")


def test_a_uff_data_set_has_as_many_samples_as_it_states(tmp_path):
    write_uff(tmp_path / "a.uff", [data_set("vib", TONE[:2001], TIMES[:2001])])
    lines = (tmp_path / "a.uff").read_text().splitlines(keepends=True)
    lines[-2] = lines[-2].rstrip("\n") + f"{0:20.11e}\n"
    (tmp_path / "a.uff").write_text("".join(lines))
    np.testing.assert_allclose(opened(tmp_path / "a.uff").signals["vib"], TONE[:2001], atol=1e-6)


# Channels that are not asked for, and files whose writer was stopped


@ignored
@pytest.mark.parametrize("suffix", ["uff", "mf4"])
def test_a_channel_that_is_not_asked_for_is_not_judged(tmp_path, suffix, capsys):
    path = tmp_path / f"a.{suffix}"
    if suffix == "uff":
        write_uff(path, [data_set("vib"), data_set("slow", times=SET_CLOCK)], abscissa_spacing=0)
    else:
        write_mdf(path, [signal("vib"), signal("slow", times=SET_CLOCK)])
    refused(path, "'slow' is not evenly spaced, with a gap of 0.038 s after sample 2499")
    assert opened(path, channels=["vib"]).fs["vib"] == 1000
    assert opened(path, fs=1000, time=False).channels == ("vib", "slow")
    assert "Not used: 'slow', it cannot be used: " in inspected(path, capsys)


def test_an_unfinished_tdms_file_is_read_as_far_as_it_was_written(tmp_path):
    path = write_segments(tmp_path / "a.tdms", (TONE, later(0)), (TONE, later(0)))
    stored = bytearray(path.read_bytes())
    last = stored.rfind(b"TDSm")
    stored[last + 12 : last + 20] = b"\xff" * 8
    path.write_bytes(stored)
    with pytest.warns(EmacmWarning, match="its last segment was not finished"):
        assert opened(path).duration == 12


@pytest.mark.parametrize("length", [0, 0xFFFFFFFF])
@pytest.mark.parametrize("rest", [b"", b"\x01"])
@pytest.mark.parametrize("is_file_length_known", [False, True])
def test_a_streamed_wav_file_is_read_to_its_end(tmp_path, length, rest, is_file_length_known):
    path = write_wav(tmp_path / "a.wav", TONE)
    stored = bytearray(path.read_bytes())
    stored[40:44] = struct.pack("<I", length)
    stored[4:8] = stored[4:8] if is_file_length_known else stored[40:44]
    path.write_bytes(stored + rest)
    with pytest.warns(EmacmWarning, match="a.wav: it does not state its length"):
        assert len(opened(path).signals["x0"]) == N


@ignored
def test_a_uff_file_that_is_cut_is_read_up_to_the_cut(tmp_path):
    path = tmp_path / "a.uff"
    write_uff(path, [data_set("a"), data_set("b")])
    text = path.read_text()
    path.write_text(text[: len(text) * 3 // 4])
    with pytest.warns(EmacmWarning, match="it ends within its data set 2"):
        assert opened(path).channels == ("a",)
    path.write_text(text[: len(text) // 4])
    refused(path, "it ends within its first data set")


def test_parts_in_toml_name_what_is_missing(tmp_path, capsys):
    np.savez(tmp_path / "a.npz", vib=TONE, fs=1000)
    (tmp_path / "parts.toml").write_text("[[Gear]]\nteeth = 20\n")
    options = ["--parts", str(tmp_path / "parts.toml"), "--speed", "600"]
    assert main(["find", str(tmp_path / "a.npz"), *options]) == 2
    assert "Gear: 'mating_teeth' is missing; needed are" in capsys.readouterr().err
    message = "or a constant speed such as '1500 rpm'"
    refused(tmp_path / "a.npz", message, velocity=None)
