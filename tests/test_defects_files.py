"""Files as loggers and programs write them: times, invalid samples, names, stopped writers."""

import struct

import numpy as np
import pandas as pd
import pytest
import scipy.io.wavfile

from emacm import Layout, open_recording
from emacm.__main__ import main
from emacm._statements import EmacmWarning

RNG = np.random.default_rng(4)
N = 6000
TONE = np.sin(2 * np.pi * 36 * np.arange(N) / 1000)  # order 3.6 at 600 rpm
AT_600_RPM = Layout(velocity="600 rpm")
ignored = pytest.mark.filterwarnings("ignore")  # of the libraries, which leave files open


def library(name):
    reason = f"{name} cannot be imported (extra 'files' or 'mdf')"
    return pytest.importorskip(name, reason=reason, exc_type=ImportError)


def write_csv(path, times, values, name="time"):
    pd.DataFrame({name: times, "vib": values}).to_csv(path, index=False)


def write_parquet(path, times, values):
    library("pyarrow")
    pd.DataFrame({"time": times, "vib": values}).to_parquet(path)


def write_npz(path, times, values):
    np.savez(path, time=times, vib=values)


def write_hdf5(path, times, values):
    with library("h5py").File(path, "w") as file:
        file["time"], file["vib"] = times, values


def write_tdms(path, times, values):
    nptdms = library("nptdms")
    with nptdms.TdmsWriter(path) as writer:
        pairs = (("time", times), ("vib", values))
        writer.write_segment([nptdms.ChannelObject("a", name, each) for name, each in pairs])


def write_mdf(path, times, values, name="vib", **options):
    asammdf = library("asammdf")
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(values, times, name=name, **options)])
        file.save(path, overwrite=True)


def write_uff(path, times, values):
    try:
        write_uff_sets(path, [{"id1": "vib", "data": values, "x": times, "abscissa_spacing": 0}])
    except Exception:
        if len(times) % 4 == 0:
            raise
        pytest.skip("this version of pyuff cannot write the rest of a line of an uneven set")


def write_uff_sets(path, sets):
    file = library("pyuff").UFF(str(path))
    for number, one in enumerate(sets):
        file.write_sets(uff_set(**one), "overwrite" if number == 0 else "add")


def uff_set(**options):
    one = {"type": 58, "binary": 0, "func_type": 1, "rsp_node": 1, "rsp_dir": 1, "ref_node": 1}
    one |= {"ref_dir": 1, "abscissa_spacing": 1, "orddenom_spec_data_type": 0}
    one |= {"z_axis_spec_data_type": 0, "orddenom_axis_lab": "", "abscissa_spec_data_type": 17}
    return one | {"ordinate_axis_units_lab": "g"} | options


WRITERS = {
    "csv": write_csv,
    "parquet": write_parquet,
    "npz": write_npz,
    "h5": write_hdf5,
    "tdms": write_tdms,
    "mf4": write_mdf,
    "uff": write_uff,
}
every_format = pytest.mark.parametrize("suffix", WRITERS)


def refused(path, message, layout=AT_600_RPM):
    with pytest.raises((ValueError, TypeError), match=message) as caught:
        _ = open_recording(path, layout).fs
    assert "Copy it again" not in str(caught.value)


def order_of_peak(recording):
    """Return the order of the strongest line of a recording at 600 rpm."""
    (values,) = recording.signals.values()
    power = np.abs(np.fft.rfft(values - values.mean()))
    return power.argmax() * recording.fs["vib"] / len(values) / 10


# Times of samples


@ignored
@every_format
@pytest.mark.parametrize("every", [3, 10, 250])
def test_a_regular_gap_is_no_lower_rate(tmp_path, suffix, every):
    path, kept = tmp_path / f"a.{suffix}", np.arange(N) % every != every // 2
    WRITERS[suffix](path, np.arange(N)[kept] / 1000, TONE[kept])
    refused(path, f"a gap of 0.002 s after sample {every // 2 - 1} .*are missing .one of {every}.")
    recording = open_recording(path, AT_600_RPM, resample=True)
    with pytest.warns(
        EmacmWarning, match="channel 'vib' was resampled .* to 1000 Hz; samples left"
    ):
        assert recording.fs["vib"] == 1000
    assert order_of_peak(recording) == pytest.approx(3.6, abs=0.02)
    inner = slice(100, len(recording.signals["vib"]) - 100)
    first = np.flatnonzero(kept)[0]
    np.testing.assert_allclose(recording.signals["vib"][inner], TONE[first:][inner], atol=0.01)


SHUFFLED = np.sort(np.arange(N) / 1000 + 5e-5 * RNG.normal(size=N))
PACKETS = np.repeat(np.arange(0, N, 3) / 1000, 3)
SET_CLOCK = np.arange(N) / 1000 + np.where(np.arange(N) < 2500, 0, 0.037)
SET_BACK = np.arange(N) / 1000 - np.where(np.arange(N) < 2500, 0, 0.037)
RARE_GAPS = np.delete(np.arange(N), [700, 701, 4000]) / 1000


@ignored
@every_format
@pytest.mark.parametrize(
    ("times", "message"),
    [
        (PACKETS, "several samples share one time, as in packets: .* after sample 0"),
        (np.insert(np.arange(N - 1) / 1000, 70, 0.07), "several samples share one time"),
        (SET_CLOCK, "a gap of 0.038 s after sample 2499 .*, or correct the clock"),
        (SET_BACK, "does not increase at sample 2500"),
        (RARE_GAPS, "a gap of 0.003 s after sample 699 .* 3 of 6000 samples are missing"),
        (np.arange(N) / 1000 + 3e-4 * RNG.normal(size=N).cumsum() / 9, "by jitter or drift"),
    ],
    ids=["packets", "double", "clock", "clock back", "gaps", "drift"],
)
def test_times_that_are_not_even_are_refused_with_what_they_are_and_where(
    tmp_path, suffix, times, message
):
    path, values = tmp_path / f"a.{suffix}", TONE[: len(times)]
    WRITERS[suffix](path, times, values)
    refused(path, message)


@ignored
@every_format
def test_small_jitter_is_stated_and_resampled_on_request(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    WRITERS[suffix](path, SHUFFLED, np.sin(2 * np.pi * 90 * SHUFFLED))
    found = open_recording(path, AT_600_RPM)
    with pytest.warns(EmacmWarning, match="jitter by 5.*% of a sampling interval .* 1000 Hz"):
        assert found.fs["vib"] == 1000
    even = open_recording(path, Layout(velocity="600 rpm", resample=True))
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
    columns = {"time": SHUFFLED, "vib": np.cos(4 * angle), "shaft": shaft}
    pd.DataFrame(columns).to_csv(tmp_path / "a.csv", index=False)
    key = "angle" if kind == "wrapped" else kind
    (tmp_path / "a.toml").write_text(f'{key} = "shaft"\nresample = true\n')
    recording = open_recording(tmp_path / "a.csv", Layout.from_toml(tmp_path / "a.toml"))
    with pytest.warns(EmacmWarning, match="channel 'vib' was resampled"):
        times = SHUFFLED[0] + np.arange(len(recording.velocity)) / 1000
    right = 40 + 3 * np.cos(3 * times)
    tolerance = 1.0 if kind == "tacho" else 0.05
    np.testing.assert_allclose(recording.velocity[400:-400], right[400:-400], atol=tolerance)


@pytest.mark.parametrize("digits", [3, 4, 6, 12])
@pytest.mark.parametrize("fs", [25.6, 512, 640, 700, 1024, 1652, 2048, 12_800, 48_828.125])
def test_rounded_times_give_the_rate_and_its_uncertainty(tmp_path, fs, digits):
    times = np.round(3.7 + np.arange(50_000) / fs, digits)
    write_csv(tmp_path / "a.csv", times, np.zeros(50_000))
    recording = open_recording(tmp_path / "a.csv", AT_600_RPM)
    if fs > 500 and 10.0**-digits / (50_000 / fs) > 1e-5:
        with pytest.warns(EmacmWarning, match=r"rounded to 0.0*1 s: the rate is .* within"):
            assert recording.fs["vib"] == pytest.approx(fs, rel=2e-4)
    else:
        assert recording.fs["vib"] == pytest.approx(fs, rel=1e-5)


@pytest.mark.parametrize(
    ("times", "fs", "message"),
    [
        (np.arange(N) / 500, 480, "not evenly spaced at 480 Hz: its mean rate is 500 Hz"),
        (np.arange(N)[::-1] / 500, None, "does not increase at sample 1"),
        (np.where(np.arange(N) == 30, np.nan, np.arange(N)), None, "got nan at sample 30"),
    ],
)
def test_times_that_contradict_the_layout_or_are_none_are_refused(tmp_path, times, fs, message):
    write_npz(tmp_path / "a.npz", times, TONE)
    refused(tmp_path / "a.npz", message, Layout(fs=fs, velocity="600 rpm"))
    ignoring = Layout(fs=500, velocity="600 rpm", time=False)
    assert open_recording(tmp_path / "a.npz", ignoring).channels == ("vib",)


def test_one_rate_or_missing_samples_is_for_the_layout_to_state(tmp_path):
    times = np.floor(np.arange(9000) / 0.9) / 1000  # 900 Hz in ms, or 1000 Hz with gaps
    write_csv(tmp_path / "a.csv", times, np.zeros(9000))
    refused(tmp_path / "a.csv", "state fs = 900 if only rounding makes steps longer")
    stated = open_recording(tmp_path / "a.csv", Layout(velocity="600 rpm", fs=900))
    assert stated.fs["vib"] == 900


@pytest.mark.parametrize("start", [0.0, 46354.5, 738_000.5])
@pytest.mark.parametrize("unit", ["d", "h", "ms", "us"])
def test_times_in_another_unit_are_refused_with_the_unit_that_fits(tmp_path, start, unit, capsys):
    units = {"d": ("days", 86_400), "h": ("hours", 3600), "ms": ("milliseconds", 1e-3)}
    word, size = (units | {"us": ("microseconds", 1e-6)})[unit]
    write_csv(tmp_path / "a.csv", start + np.arange(N) / 1000 / size, TONE)
    refused(
        tmp_path / "a.csv",
        rf"in {unit} it is 1000.* Are these {word}.* = {{time = '{unit}'}}",
    )
    layout = Layout(velocity="600 rpm", units={"time": unit})
    assert open_recording(tmp_path / "a.csv", layout).fs["vib"] == 1000
    assert main(["inspect", str(tmp_path / "a.csv"), "--draft", str(tmp_path / "a.toml")]) == 0
    assert f'"time" = "{unit}"' in (tmp_path / "a.toml").read_text()
    assert f"these look like {word}" in capsys.readouterr().out


def test_a_rate_below_the_speed_of_the_shaft_is_not_credible(tmp_path):
    write_csv(tmp_path / "a.csv", np.arange(N) / 12.8, TONE)  # ms at 12.8 kHz
    refused(tmp_path / "a.csv", "in ms it is 12800 Hz", Layout(velocity="1500 rpm"))
    layout = Layout(velocity="1500 rpm", units={"time": "s"})
    assert open_recording(tmp_path / "a.csv", layout).fs["vib"] == 12.8


@pytest.mark.parametrize("name", ["time_us", "t [us]", "Time (ns)", "time [d]", "time_ms"])
def test_a_unit_in_the_name_of_the_times_is_used(tmp_path, name):
    size = next(
        s for u, s in (("us", 1e-6), ("ns", 1e-9), ("[d", 86_400), ("ms", 1e-3)) if u in name
    )
    write_csv(tmp_path / "a.csv", np.arange(N) / 1000 / size, TONE, name)
    recording = open_recording(tmp_path / "a.csv", AT_600_RPM)
    assert dict(recording.fs) == {"vib": 1000}


def test_times_since_1970_state_the_start(tmp_path):
    for size, unit in ((1.0, "s"), (1e-3, "ms")):
        write_csv(tmp_path / "a.csv", 1_709_632_800 / size + np.arange(N) * 0.01 / size, TONE)
        if unit != "s":
            refused(tmp_path / "a.csv", "Are these milliseconds. State .*'ms'")
        recording = open_recording(tmp_path / "a.csv", Layout(velocity=1, units={"time": unit}))
        assert recording.cut(0).start == pd.Timestamp("2024-03-05T10:00:00")


# Texts


def rows_of(row):
    return "".join(row(k / 1000, f"{TONE[k]:.5f}") + "\n" for k in range(300))


def comma(number):
    return f"{number:.3f}".replace(".", ",")


@pytest.mark.parametrize(
    ("header", "row", "message"),
    [
        ("time,vib", lambda t, x: f"{comma(t)},{x}", "commas are both decimal and between values"),
        ("time,vib", lambda t, x: f"{comma(t)},{x.replace('.', ',')}", "commas are both decimal"),
        ("time,vib", lambda t, x: f"{t:.3f},{x.replace('.', ',')}", "commas are both decimal"),
        ("0,00,0", lambda t, x: f"{comma(t)},{x.replace('.', ',')}", "commas are both decimal"),
        (
            "time,vib",
            lambda t, x: f'"{comma(t)}",{x}',
            "'vib' has '0.00000' at sample 0, with a dec",
        ),
        (
            "time;vib",
            lambda t, x: f"{t:.3f};1,234",
            "'time' has '0.000' at sample 0, with a decimal",
        ),
        ("time,vib", lambda t, x: f"{t:.3f}", "rows have one value, as line 2 .* 'time,vib' has"),
        (
            "time;vib;b",
            lambda t, x: f"{t:.3f};{x}",
            "not name the 2 columns: the rows have 2 values",
        ),
        ("time,vib", lambda t, x: f"01/02/2026 08:00:{t:06.3f},{x}", "day and month are not known"),
    ],
)
def test_marks_that_do_not_fit_are_named_for_what_they_are(tmp_path, header, row, message):
    (tmp_path / "a.csv").write_text(f"{header}\n{rows_of(row)}")
    refused(tmp_path / "a.csv", message)


@pytest.mark.parametrize(
    "date",
    [
        lambda t: f"2026-10-25  02:59:{59.5 + t:06.3f}",
        lambda t: f"25.10.2026   02:59:{59.5 + t:06.3f}",
        lambda t: str(pd.Timestamp("2026-10-25T00:59:59.85Z") + pd.Timedelta(f"{t}s")),
        lambda t: (
            f"2026-10-25T02:59:{59.85 + t:06.3f}+02:00"
            if t < 0.15
            else f"2026-10-25T02:00:{t - 0.15:06.3f}+01:00"
        ),
    ],
    ids=["blanks", "day first", "UTC", "end of summer time"],
)
def test_dates_with_blanks_and_changing_offsets_are_read(tmp_path, date):
    (tmp_path / "a.csv").write_text(f"time,vib\n{rows_of(lambda t, x: f'{date(t)},{x}')}")
    recording = open_recording(tmp_path / "a.csv", AT_600_RPM)
    assert recording.fs["vib"] == 1000
    assert recording.cut(0).start.date().isoformat() == "2026-10-25"


@pytest.mark.parametrize("name", ["time", None])
@pytest.mark.parametrize("index", [pd.to_timedelta, lambda t, unit: pd.to_datetime(t, unit=unit)])
def test_an_index_of_times_of_a_parquet_file_is_its_time(tmp_path, name, index):
    library("pyarrow")
    frame = pd.DataFrame({"vib": TONE}, index=index(np.arange(N), unit="ms"))
    frame.rename_axis(name).to_parquet(tmp_path / "a.parquet")
    recording = open_recording(tmp_path / "a.parquet", AT_600_RPM)
    assert (recording.channels, recording.fs["vib"]) == (("vib",), 1000)


# Content that is silently wrong


def write_wav(path, values, dtype="i2"):
    scale = {"i2": 2**15 - 1, "i4": 2**31 - 1}.get(dtype, 1)
    scipy.io.wavfile.write(path, 1000, (values * scale).astype(dtype))


@pytest.mark.parametrize("dtype", ["i2", "i4"])
def test_an_integer_wav_file_needs_a_scale_for_its_unit(tmp_path, dtype):
    write_wav(tmp_path / "a.wav", TONE / 4, dtype)
    layout = Layout(velocity="600 rpm", units={"x0": "g"})
    with pytest.warns(EmacmWarning, match="full scale of this WAV file is taken as 1 .*scale"):
        assert open_recording(tmp_path / "a.wav", layout).duration == 6
    for scale in (4, {"x0": 4.0}):
        layout = Layout(velocity="600 rpm", units={"x0": "g"}, scale=scale)
        recording = open_recording(tmp_path / "a.wav", layout)
        np.testing.assert_allclose(recording.signals["x0"], TONE, atol=3e-4)
        assert recording.units["x0"] == "g"
    main(["inspect", str(tmp_path / "a.wav"), "--draft", str(tmp_path / "a.toml")])
    assert "# scale = 1.0  # FILL IN: full scale" in (tmp_path / "a.toml").read_text()


def test_a_scale_replaces_the_unit_of_the_file_and_names_a_channel(tmp_path):
    (tmp_path / "a.csv").write_text("vib [V],b\n" + "1,2\n" * 9)
    options = {"fs": 10, "velocity": 3, "units": {"vib": "g"}}
    recording = open_recording(tmp_path / "a.csv", Layout(scale={"vib": 10}, **options))
    assert recording.signals["vib"][0] == 10
    assert dict(recording.units) == {"vib": "g"}
    assert recording.signals["b"][0] == 2
    refused(tmp_path / "a.csv", "scale names 'c', which is no", Layout(scale={"c": 1}, **options))
    with pytest.raises(TypeError, match="scale must be a number"):
        Layout(scale={"vib": "10"})


@ignored
def test_invalid_samples_of_an_mdf_file_are_refused_with_their_places(tmp_path, capsys):
    invalid = (np.arange(N) >= 1000) & (np.arange(N) < 1500)
    asammdf = library("asammdf")
    with asammdf.MDF(version="4.10") as file:
        times, held = np.arange(N) / 1000, np.where(invalid, 1e6, TONE)
        vib = asammdf.Signal(held, times, name="vib", invalidation_bits=invalid)
        file.append([vib, asammdf.Signal(TONE, times, name="b")])
        file.save(tmp_path / "a.mf4")
    refused(tmp_path / "a.mf4", "'vib' has 500 samples .* invalid, the first is sample 1000")
    others = open_recording(tmp_path / "a.mf4", Layout(velocity="600 rpm", channels=["b"]))
    assert others.channels == ("b",)
    assert main(["inspect", str(tmp_path / "a.mf4")]) == 0
    assert "Not used: 'vib', it has 500 samples" in capsys.readouterr().out


@pytest.mark.parametrize("code", [-9999.0, 12.0])
def test_attributes_of_packed_hdf5_data_sets_are_applied(tmp_path, code):
    h5py = library("h5py")
    stored = np.where(np.arange(N) == 77, code, np.round(TONE * 100) + 500)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, values in (("vib", stored.astype("i2")), ("b", stored[80:].astype("i2"))):
            file[name] = values
            file[name].attrs.update(_FillValue=np.int16(code), scale_factor=0.01, add_offset=-5.0)
    layout = Layout(fs=1000, velocity="600 rpm", channels=["b"])
    found = open_recording(tmp_path / "a.h5", layout).signals["b"]
    np.testing.assert_allclose(found, TONE[80:], atol=0.006)
    layout = Layout(fs=1000, velocity="600 rpm", channels=["vib"])
    refused(tmp_path / "a.h5", "'vib' has 1 samples .* missing .*, the first is sample 77", layout)


@pytest.mark.parametrize("code", [-9999, -999, 32767, -32768, 99999, 9.91e37])
def test_codes_for_missing_values_are_no_samples(tmp_path, code):
    np.savez(tmp_path / "a.npz", vib=np.where(np.arange(N) % 900 == 42, code, TONE), fs=1000)
    refused(
        tmp_path / "a.npz", f"'vib' has 7 values of {code:g}, first at sample 42".replace("+", ".")
    )
    clipped = np.clip(40_000 * TONE, -32768, 32767).astype("i2")  # full scale is no code
    np.savez(tmp_path / "a.npz", vib=clipped, fs=1000)
    assert open_recording(tmp_path / "a.npz", AT_600_RPM).signals["vib"].max() == 32767


@ignored
def test_no_channel_is_lost_where_names_collide(tmp_path):
    asammdf = library("asammdf")
    with asammdf.MDF(version="4.10") as file:
        for factor in (1, 2, 3):
            file.append([asammdf.Signal(factor * TONE, np.arange(N) / 1000, name="vib")])
        file.save(tmp_path / "a.mf4")
    ids = ("x1", "NONE", "x1", "b")
    sets = [{"id1": name, "data": TONE, "x": np.arange(N) / 1000} for name in ids]
    write_uff_sets(tmp_path / "a.uff", sets)
    found = open_recording(tmp_path / "a.mf4", AT_600_RPM)
    assert found.channels == ("vib.0", "vib.1", "vib.2")
    np.testing.assert_allclose(found.signals["vib.1"], 2 * TONE)
    assert open_recording(tmp_path / "a.uff", AT_600_RPM).channels == ("x1.0", "x1.1", "x1.2", "b")
    nptdms = library("nptdms")
    pairs = (("left", "vib"), ("right", "vib"), ("left", "n"))
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        rate = {"wf_increment": 0.001}
        writer.write_segment([nptdms.ChannelObject(*pair, TONE, rate) for pair in pairs])
    found = open_recording(tmp_path / "a.tdms", AT_600_RPM)
    assert sorted(found.channels) == ["left/vib", "n", "right/vib"]
    np.savez(tmp_path / "a.npz", **{"v": np.ones((2, 9)), "v.0": np.ones(9)}, fs=10)
    refused(tmp_path / "a.npz", "two arrays would be the column 'v.0'. Rename one")
    with library("h5py").File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file["a.b"], file["a/b"] = np.ones(9), np.zeros(9)
    refused(tmp_path / "a.mat", "two arrays would be the column 'a.b'")


@ignored
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"abscissa_spec_data_type": 18}, "'spectrum' is no signal over time, but over frequency"),
        ({"abscissa_spec_data_type": 20}, "over order"),
        ({"abscissa_spec_data_type": 0, "func_type": 2}, "over another quantity .type of func"),
        ({"data": TONE * 1j, "func_type": 4}, "'spectrum' is complex|is no signal over time"),
    ],
)
def test_a_curve_over_frequency_is_no_time_signal(tmp_path, options, message, capsys):
    spectrum = {"id1": "spectrum", "data": TONE, "x": np.arange(N) / 2} | options
    sets = [{"id1": "vib", "data": TONE, "x": np.arange(N) / 1000}, spectrum]
    write_uff_sets(tmp_path / "a.uff", sets)
    refused(tmp_path / "a.uff", message)
    layout = Layout(velocity="600 rpm", channels=["vib"])
    assert open_recording(tmp_path / "a.uff", layout).fs["vib"] == 1000
    assert main(["inspect", str(tmp_path / "a.uff")]) == 0
    assert "Not used: 'spectrum', it is" in capsys.readouterr().out


def tdms_segments(path, *segments):
    """Write segments of samples with properties; return the path."""
    nptdms = library("nptdms")
    with nptdms.TdmsWriter(path) as writer:
        for values, properties in segments:
            writer.write_segment([nptdms.ChannelObject("a", "vib", values, properties)])
    return path


@ignored
def test_wave_forms_over_other_quantities_are_no_time_signals(tmp_path):
    for axis in ({"wf_xunit_string": "Hz"}, {"wf_xname": "Frequency"}):
        path = tdms_segments(tmp_path / "a.tdms", (TONE, {"wf_increment": 0.5} | axis))
        refused(path, f"'vib' is no signal over time, but over {next(iter(axis.values()))}")
    write_mdf(tmp_path / "a.mf4", np.arange(N) / 1000, TONE, master_metadata=("angle", 2))
    refused(tmp_path / "a.mf4", "'vib' is no signal over time, but over 'angle'")


START = np.datetime64("2026-11-01T08:00:00", "us")


def later(seconds):
    return {
        "wf_increment": 0.001,
        "wf_start_time": START + np.timedelta64(int(seconds * 1e6), "us"),
    }


@pytest.mark.parametrize(
    ("second", "message"),
    [
        ({"wf_increment": 0.002}, "'vib' has segments with rates of 1000 and 500 Hz"),
        (later(3600), "segment that starts 3594 s after the end of the one before, at sample 6000"),
        (later(6.1), "segment that starts 0.1 s after the end"),
        (later(3), "segment that starts -3 s after the end"),
    ],
)
def test_tdms_segments_that_differ_are_not_joined(tmp_path, second, message):
    path = tdms_segments(tmp_path / "a.tdms", (TONE, later(0)), (TONE, second), (TONE, later(0)))
    refused(path, message)
    joined = tdms_segments(tmp_path / "b.tdms", (TONE, later(0)), (TONE, later(6)), (TONE, {}))
    assert open_recording(joined, AT_600_RPM).duration == 18


def test_a_uff_data_set_has_as_many_samples_as_it_states(tmp_path):
    stated = {"id1": "vib", "data": TONE[:2001], "x": np.arange(2001) / 1000}
    library("pyuff")
    write_uff_sets(tmp_path / "a.uff", [stated])
    lines = (tmp_path / "a.uff").read_text().splitlines(keepends=True)
    lines[-2] = lines[-2].rstrip("\n") + f"{0:20.11e}\n"
    (tmp_path / "a.uff").write_text("".join(lines))
    found = open_recording(tmp_path / "a.uff", AT_600_RPM)
    np.testing.assert_allclose(found.signals["vib"], TONE[:2001], atol=1e-6)


# Channels that are not asked for, and files whose writer was stopped


@ignored
@pytest.mark.parametrize("suffix", ["uff", "mf4"])
def test_a_channel_that_is_not_asked_for_is_not_judged(tmp_path, suffix, capsys):
    path = tmp_path / f"a.{suffix}"
    if suffix == "uff":
        uneven = {"id1": "slow", "data": TONE, "x": SET_CLOCK, "abscissa_spacing": 0}
        write_uff_sets(path, [{"id1": "vib", "data": TONE, "x": np.arange(N) / 1000}, uneven])
    else:
        asammdf = library("asammdf")
        with asammdf.MDF(version="4.10") as file:
            file.append([asammdf.Signal(TONE, np.arange(N) / 1000, name="vib")])
            file.append([asammdf.Signal(TONE, SET_CLOCK, name="slow")])
            file.save(path)
    refused(path, "'slow' is not evenly spaced, with a gap of 0.038 s after sample 2499")
    layout = Layout(velocity="600 rpm", channels=["vib"])
    assert open_recording(path, layout).fs["vib"] == 1000
    assert open_recording(path, Layout(velocity="600 rpm", fs=1000, time=False)).channels
    assert main(["inspect", str(path)]) == 0
    assert "Not used: 'slow', it cannot be used: " in capsys.readouterr().out


def test_an_unfinished_tdms_file_is_read_as_far_as_it_was_written(tmp_path):
    path = tdms_segments(tmp_path / "a.tdms", (TONE, later(0)), (TONE, later(0)))
    stored = bytearray(path.read_bytes())
    last = stored.rfind(b"TDSm")
    stored[last + 12 : last + 20] = b"\xff" * 8
    path.write_bytes(stored)
    with pytest.warns(EmacmWarning, match="its last segment was not finished"):
        assert open_recording(path, AT_600_RPM).duration == 12


@pytest.mark.parametrize("length", [0, 0xFFFFFFFF])
@pytest.mark.parametrize("rest", [b"", b"\x01"])
def test_a_streamed_wav_file_is_read_to_its_end(tmp_path, length, rest):
    write_wav(tmp_path / "a.wav", TONE)
    stored = bytearray((tmp_path / "a.wav").read_bytes())
    stored[4:8] = stored[40:44] = struct.pack("<I", length)
    (tmp_path / "a.wav").write_bytes(stored + rest)
    with pytest.warns(EmacmWarning, match="a.wav: it does not state its length"):
        assert len(open_recording(tmp_path / "a.wav", AT_600_RPM).signals["x0"]) == N


@ignored
def test_a_uff_file_that_is_cut_is_read_up_to_the_cut(tmp_path):
    sets = [{"id1": name, "data": TONE, "x": np.arange(N) / 1000} for name in "ab"]
    write_uff_sets(tmp_path / "a.uff", sets)
    text = (tmp_path / "a.uff").read_text()
    (tmp_path / "a.uff").write_text(text[: len(text) * 3 // 4])
    with pytest.warns(EmacmWarning, match="it ends within its data set 2"):
        assert open_recording(tmp_path / "a.uff", AT_600_RPM).channels == ("a",)
    (tmp_path / "a.uff").write_text(text[: len(text) // 4])
    refused(tmp_path / "a.uff", "it ends within its first data set")


def test_parts_in_toml_name_what_is_missing_and_numbers_that_can_be_written(tmp_path, capsys):
    np.savez(tmp_path / "a.npz", vib=TONE, fs=1000)
    bearing = "[[Bearing]]\nn_balls = 9\nball_diameter = 8\npitch_diameter = 39\n"
    for text, message in (
        ("[[Gear]]\nteeth = 20\n", "Gear: 'mating_teeth' is missing; needed are"),
        (f"{bearing}contact_angle = 15\n", "If it is in degrees, write 0.261799"),
    ):
        (tmp_path / "parts.toml").write_text(text)
        options = ["--parts", str(tmp_path / "parts.toml"), "--speed", "600"]
        assert main(["find", str(tmp_path / "a.npz"), *options]) == 2
        assert message in capsys.readouterr().err
    refused(tmp_path / "a.npz", "or a constant speed such as '1500 rpm'", Layout())
