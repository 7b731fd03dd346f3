"""Layouts: what they find in a file, and what they refuse with which remedy."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from emacm import Layout, Recording, open_recording
from emacm.recordings.names import unit_ratio

RNG = np.random.default_rng(1)
N = 600
VIBRATION = RNG.normal(size=N)
ANGLE = np.cumsum(0.31 + 0.02 * np.sin(np.arange(N) / 40))


def opened(tmp_path, layout, name="A_1.npz", **columns):
    np.savez(tmp_path / name, **columns)
    return open_recording(tmp_path / name, layout)


# The shaft


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("rpm", 30 / np.pi), ("rev/s", 1 / (2 * np.pi)), ("deg/s", 180 / np.pi), ("rad/s", 1)],
)
def test_a_speed_is_converted_to_rad_per_s(tmp_path, unit, factor):
    speed = 40 + RNG.normal(size=N)
    layout = Layout(fs=500, velocity="n", units={"n": unit})
    recording = opened(tmp_path, layout, b=VIBRATION, n=speed * factor)
    np.testing.assert_allclose(recording.velocity, speed, rtol=1e-13)
    assert recording.channels == ("b",)


@pytest.mark.parametrize(
    "layout",
    [
        Layout(fs=500, velocity="1797 rpm"),
        Layout(fs=500, velocity=1797, units={"velocity": "rpm"}),
        Layout(fs=500, velocity="speed", units=["speed [rpm]"], channels=["b"]),
        Layout(fs=500, velocity="speed [rpm]"),
    ],
)
def test_a_constant_speed_is_a_number_with_its_unit(tmp_path, layout):
    columns = {"b": VIBRATION} | ({"speed": 1797} if "speed" in str(layout.velocity) else {})
    recording = opened(tmp_path, layout, **columns)
    np.testing.assert_allclose(recording.velocity, 1797 * np.pi / 30, rtol=1e-15)
    assert len(recording.velocity) == N


def test_alternatives_are_the_first_name_that_a_file_has(tmp_path):
    names = {"channels": ["vibration [g]|x0"], "time": "clock [ms]|t"}
    layout = Layout(velocity="speed|1500 rpm", units={"speed": "rev/s"}, **names)
    times, speed = np.arange(N) / 500, 3 + RNG.normal(size=N) / 9
    columns = {"x0": -VIBRATION, "vibration": VIBRATION, "speed": speed}
    first = opened(tmp_path, layout, "a.npz", t=times, **columns)
    np.testing.assert_array_equal(first.signals["vibration"], VIBRATION)
    np.testing.assert_allclose(first.velocity, 2 * np.pi * speed, rtol=1e-13)
    second = opened(tmp_path, layout, "b.npz", x1=VIBRATION, x0=-VIBRATION, clock=1000 * times)
    np.testing.assert_array_equal(second.signals["vibration"], -VIBRATION)
    np.testing.assert_allclose(second.velocity, 50 * np.pi, rtol=1e-13)
    assert first.fs["vibration"] == second.fs["vibration"] == 500


@pytest.mark.parametrize(
    ("one", "other", "ratio"),
    [("m/s2", "m/s²", 1), (" m / s**2", "m/s^2", 1), ("m/s", "m/s2", None), ("mPa", "MPa", None)],
)
def test_units_are_the_same_apart_from_spaces_and_exponents(one, other, ratio):
    assert unit_ratio(one, other) == ratio


@pytest.mark.parametrize(("unit", "period"), [("rad", 2 * np.pi), ("deg", 360), ("rev", 1)])
@pytest.mark.parametrize("wrapped", [False, True])
def test_an_angle_may_be_wrapped_and_in_any_unit(tmp_path, unit, period, wrapped):
    angle = ANGLE / (2 * np.pi) * period
    angle = angle % period if wrapped else angle
    layout = Layout(fs=500, angle="theta", units={"theta": unit})
    recording = opened(tmp_path, layout, b=VIBRATION, theta=angle)
    np.testing.assert_allclose(recording.angle - recording.angle[0], ANGLE - ANGLE[0], atol=1e-9)


@pytest.mark.parametrize(
    ("options", "columns", "message"),
    [
        ({}, {"rpm": ANGLE}, r"no shaft reference\. Set velocity = 'rpm \[rpm\]'"),
        ({}, {"c": ANGLE}, r"no shaft reference\. Set velocity = 'speed \[rpm\]'"),
        ({"velocity": 3}, {"rpm": ANGLE}, r"column 'rpm' is named like .*channels = \['b'"),
        ({"velocity": "rpm"}, {"rpm": ANGLE}, r"the unit of 'rpm' is not stated"),
        ({"velocity": "n"}, {"c": ANGLE}, r"no column 'n'; .* may give several names: 'n\|b'"),
        ({"velocity": "n|m"}, {"c": ANGLE}, r"no column 'n\|m'"),
        ({"angle": "deg"}, {"deg": ANGLE}, r"than rad\. State it .* \[units\]: 'deg' = 'deg'"),
        ({"velocity": "3 knots"}, {}, "known are 'rad/s', 'rpm', 'rev/s', 'deg/s'"),
        ({"velocity": "n*"}, {"n1": ANGLE, "n2": ANGLE}, "matches several columns"),
        ({"velocity": "n [Hz]"}, {"n [rpm]": ANGLE}, "unit 'hz' for 'n', but the file"),
        ({"velocity": 3, "fs": None}, {}, "the sampling rate of 'b' is not known.*Set fs, or time"),
        ({"velocity": 3}, {"b0": 7}, r"contains no signal, only \['b0'\]"),
        ({"velocity": 3}, {"fs": 10}, "states fs = 9 Hz for 'b', but the file 10 Hz"),
        ({"velocity": 3, "units": {"b": "g"}}, {"b [m/s²]": ANGLE}, "unit 'g' for 'b', but"),
        ({"velocity": 3, "units": {"nn": "g"}}, {}, r"units names 'nn', which is no column"),
        ({"velocity": 3}, {"c": ANGLE[:7]}, "durations must agree"),
    ],
)
def test_what_is_missing_or_contradicts_is_refused_with_a_remedy(
    tmp_path, options, columns, message
):
    first = {} if any(name.startswith("b") for name in columns) else {"b": VIBRATION}
    recording = opened(tmp_path, Layout(**{"fs": 9} | options), **first, **columns)
    with pytest.raises(ValueError, match=rf"A_1.npz: .*{message}"):
        assert recording.duration


# Meta


@pytest.mark.parametrize(
    ("pattern", "meta"),
    [
        ("{unit}_{run:d}.npz", {"unit": "A", "run": 1}),
        ("{u}.npz", {"u": "A_1"}),
        ("{unit}_{run}", {"unit": "A", "run": "1"}),
        ("{unit}_{load:g}", {"unit": "A", "load": 1.0}),
        ("{folder}/{unit}_{run:d}", {"folder": "bench", "unit": "A", "run": 1}),
    ],
)
def test_the_name_of_a_file_gives_its_meta(tmp_path, pattern, meta):
    (tmp_path / "bench").mkdir()
    layout = Layout(fs=3, velocity=3, meta=pattern)
    assert opened(tmp_path / "bench", layout, b=VIBRATION).meta == meta


@pytest.mark.parametrize(
    "meta",
    [
        pd.DataFrame({"file": ["A_1.npz", "A_2.npz"], "load": [3, 4]}),
        pd.DataFrame({"load": [3]}, index=["A_1"]),
        {"A_1.npz": {"load": 3}},
        {Path("A_1.npz"): {"load": 3}, "A_2.npz": {}},
    ],
)
def test_a_table_gives_the_meta(tmp_path, meta):
    assert opened(tmp_path, Layout(fs=3, velocity=3, meta=meta), b=VIBRATION).meta == {"load": 3}


@pytest.mark.parametrize("meta", ["{unit}-{run}", {"B.npz": {}}])
def test_labels_of_a_file_that_its_name_does_not_state_are_missing(tmp_path, meta):
    assert opened(tmp_path, Layout(fs=3, velocity=3, meta=meta), b=VIBRATION).meta == {}


def test_a_name_that_matches_in_two_ways_is_refused(tmp_path):
    layout = Layout(fs=3, velocity=3, meta="{unit}_{state}_{run}")
    message = "in several ways: {'unit': 'A_inner', .* and {'unit': 'A', 'state': 'inner', "
    with pytest.raises(ValueError, match=message):
        opened(tmp_path, layout, "A_inner_race_3.npz", b=VIBRATION)


def test_texts_of_a_table_of_meta_stay_as_they_are(tmp_path):
    names = [f"{n}.csv" for n in "abc"]
    rows = (names, ["001", "1", "2"], ["None", "worn", "worn"], [1, 2, 3])
    table = pd.DataFrame(dict(zip(("file", "unit", "state", "run"), rows, strict=True)))
    table.to_csv(tmp_path / "meta.csv", index=False)
    layout = Layout(meta=str(tmp_path / "meta.csv"))
    metas = [layout.meta_of(name) for name in names[:2]]
    assert metas[0] == {"unit": "001", "state": "None", "run": 1}
    assert metas[1]["unit"] == "1"


def test_a_table_of_meta_may_have_semicolons_but_must_name_the_files(tmp_path):
    (tmp_path / "meta.csv").write_text("file;unit\na.csv;001\n", encoding="utf-8-sig")
    assert Layout(velocity=1.0, meta=str(tmp_path / "meta.csv")).meta_of("a.csv") == {"unit": "001"}
    (tmp_path / "meta.csv").write_text("name,unit\na.csv,001\n")
    with pytest.raises(ValueError, match=r"meta.csv' has no column 'file', only \['name"):
        Layout(velocity=1.0, meta=str(tmp_path / "meta.csv"))


# The layout itself


def test_a_layout_is_read_from_toml(tmp_path):
    (tmp_path / "layout.toml").write_text(
        'fs = 500\nchannels = ["b"]\nvelocity = "speed"\nmeta = "table.csv"\n'
        '[units]\nspeed = "rpm"\nb = "g"\n'
    )
    (tmp_path / "table.csv").write_text("file,unit,load\nA_1.npz,A,20\n")
    layout = Layout.from_toml(tmp_path / "layout.toml")
    recording = opened(tmp_path, layout, b=VIBRATION, speed=np.full(N, 900.0))
    speed = np.full(N, 900.0) * (np.pi / 30)
    expected = Recording({"b": VIBRATION}, 500, velocity=speed, units={"b": "g"})
    assert recording.digest == expected.digest
    assert recording.meta == {"unit": "A", "load": 20}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("fs = ", "not valid TOML"),
        ("rate = 3", "'rate' is not an option of a layout; these are"),
        ("fs = -3", "fs must be a number of Hz, above 0"),
    ],
)
def test_a_bad_file_of_a_layout_is_refused(tmp_path, text, message):
    (tmp_path / "layout.toml").write_text(text)
    with pytest.raises(ValueError, match=message):
        Layout.from_toml(tmp_path / "layout.toml")
    with pytest.raises(FileNotFoundError, match="none"):
        Layout.from_toml(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"velocity": 3, "angle": "a"}, ValueError, "one shaft reference, got velocity and angle"),
        ({"fs": {"b": [1]}}, TypeError, "fs of 'b' must be a number"),
        ({"channels": "b"}, TypeError, "channels must be a list of names"),
        ({"channels": {"b": 3}}, TypeError, "channels must be names, or map names"),
        ({"velocity": [3]}, TypeError, "velocity must be a number, the name of a column"),
        ({"tacho": {"column": "a", "fs": 9}}, TypeError, "tacho must be the name of a column"),
        ({"velocity": {"file": "a.csv"}}, TypeError, "'file' and 'column' of a second file"),
        ({"tacho": {"pulses_per_rev": 3}}, TypeError, "tacho must be .* a mapping with 'column'"),
        ({"units": {"b": 3}}, TypeError, "units must map names to units"),
        ({"meta": "unit"}, ValueError, "meta must be a pattern .* got 'unit'"),
        ({"meta": "{unit}_{unit}"}, ValueError, "each field once"),
        ({"meta": {"a": {}, "b": 3}}, TypeError, "a mapping from file names to mappings"),
        ({"meta": "none.csv"}, FileNotFoundError, "none.csv"),
        ({"meta": pd.DataFrame({"file": [*"baab"]})}, ValueError, "several rows for 'a'"),
    ],
)
def test_an_invalid_layout_is_refused(options, error, message):
    with pytest.raises(error, match=message):
        Layout(**options)


def test_the_most_specific_name_in_a_table_of_meta_is_taken():
    rows = {"A_1": {"load": 1}, "bench/A_1": {"load": 2}, "old/bench/A_1.npz": {"load": 3}}
    layout = Layout(meta=rows)
    found = [layout.meta_of(f"{folder}A_1.npz") for folder in ("", "x/", "bench/", "old/bench/")]
    assert [meta["load"] for meta in found] == [1, 1, 2, 3]
    assert layout.meta_of("/data/old/bench/A_1.npz") == {"load": 3}


@pytest.mark.parametrize(
    ("pattern", "name"),
    [
        ("{unit}_{state}_{run:d}.csv", "A7_03.csv"),
        ("{state}/{unit}_{run:d}", "A7_03.csv"),
        ("{unit}_{run:d}_{state}.csv", "A7_03.csv"),
    ],
)
def test_new_files_have_no_state_in_their_name_but_their_unit(pattern, name):
    assert Layout(meta=pattern).meta_of(name) == {"unit": "A7", "run": 3}
    assert Layout(meta=pattern).meta_of("notes.csv") == {}
