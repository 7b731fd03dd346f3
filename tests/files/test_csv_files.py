"""Text files as loggers write them: a preamble, units, decimal commas, several encodings."""

import numpy as np
import pytest

from emacm import Layout, open_recording

ROWS = "0,0;1,5;900\n0,5;-2,5;903,5\n1,0;4;907\n"
PREAMBLE = "Logger: XYZ 3000;;\nstarted;22.11.2026;\nsample rate;2;Hz\n\n"
DATED = (
    "2026-11-01T08:00:00.0,1.5,x,900,\r\n2026-11-01T08:00:00.5,-2.5,y,903.5,\r\n"
    "2026-11-01T08:00:01.0,4,z,907,\r\n"
)
HEADER = "Zeit [s];b [m/s²];n [1/min]\n"


def opened(tmp_path, text, layout=None, *, encoding="utf-8"):
    (tmp_path / "a.csv").write_bytes(text.encode(encoding))
    return open_recording(tmp_path / "a.csv", layout or Layout(channels=["b"], velocity="n"))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize(
    "text",
    [
        PREAMBLE + HEADER + ROWS,
        PREAMBLE + "Zeit;b;n\ns;m/s²;1/min\n" + ROWS,
        "maker;model;place\n" + PREAMBLE + "Zeit;b;n\n[s];[m/s²];(1/min)\n;;\n" + ROWS,
        "maker;model;place\nZeit;b;n\nseconds;m/s²;1/min\n" + ROWS,
        "maker;model;place\ntime;b [m/s²];n [rpm]\n" + ROWS,
        "".join(f"key {i} = {i}\n" for i in range(150)) + HEADER + ROWS,
        "time\tb\tn\n[s]\t[m/s²]\t[rpm]\n" + ROWS.replace(";", "\t"),
        "# bench 3\n# time b [m/s²] n [rpm]\n0 1.5 900\n0.5 -2.5 903.5\n1 4 907\n",
        f"time,b (m/s²),note,n (rpm),\r\n{DATED}",
        "b [m/s²];n [rpm];;;\r\n1,5;900;;;\r\n-2,5;903,5;;;\r\n4;907;;;\r\n",  # a spreadsheet
        "Logger: XYZ\nplace;left\nb [m/s²];n [rpm];;;\n1,5;900;;;\n-2,5;903,5;;;\n4;907;;;\n",
        "b [m/s²],n [rpm]\n1.5,900\n-2.5,903.5\n4,907\n,\n,\n",  # with rows that were deleted
        'b [m/s²],n [rpm]\n"1,5","900,0"\n"-2,5","903,5"\n"4,0","907,0"\n',
        '"b [m/s²]","n [rpm]"\n"1.5","900"\n"-2.5","903.5"\n"4","907"\n',
        "b [m/s²]|n [rpm]\n1.5|900\n-2.5|903.5\n4|907\n",
        "sep=;\nb [m/s²];n [rpm]\n1,5;900\n-2,5;903,5\n4;907\n",
        "b [m/s²],n [rpm]\r1.5,900\r-2.5,903.5\r4,907\r" + "\0" * 64,  # of a logger that lost power
    ],
)
def test_names_units_and_numbers_are_found_in_texts_of_many_programs(tmp_path, text, encoding):
    times = "eit" in text or "ime" in text
    layout = Layout(fs=None if times else 2, channels=["b"], velocity="n")
    recording = opened(tmp_path, text, layout, encoding=encoding)
    assert recording.signals["b"].tolist() == [1.5, -2.5, 4.0]
    assert (recording.fs["b"], dict(recording.units)) == (2.0, {"b": "m/s²"})
    np.testing.assert_allclose(recording.velocity * 30 / np.pi, [900, 903.5, 907], rtol=1e-14)


def test_a_point_stays_a_decimal_point_though_the_preamble_has_commas(tmp_path):
    text = "Jane Doe 3,4;;\ntime;b;n [rpm]\n0.0;1.5;900\n0.5;2.25;901.75\n"
    assert opened(tmp_path, text).signals["b"].tolist() == [1.5, 2.25]


def test_missing_values_in_the_first_row_do_not_make_it_a_header(tmp_path):
    text = "time,b,c,n [rpm]\n0,,x,900\n0.5,3,y,900\n1,4,z,900\n"
    layout = Layout(channels=["b"], velocity="n")
    with pytest.raises(ValueError, match=r"channel 'b'.* nan at sample 0"):
        assert opened(tmp_path, text, layout).duration
    numbered = opened(tmp_path, "1,2.5\nn/a,x\n3,4\n", Layout(fs=9, velocity=1, channels=["x1"]))
    with pytest.raises(TypeError, match="channel 'x1' must be numeric, got 'x' at sample 1"):
        assert numbered.duration


@pytest.mark.parametrize(
    ("line", "rate"),
    [
        ("Sample rate: 2000 Hz", 2000),
        ("# fs = 2.5 [kHz]", 2500),
        ("Sampling Rate;44100", 44_100),
        ("Abtastrate\t2000\tHz\t", 2000),
        ("Sample rate: 2000 rpm", None),
        ("fs: 22.11.2026", None),
    ],
)
def test_a_rate_in_the_preamble_is_that_of_the_columns(tmp_path, line, rate):
    recording = opened(tmp_path, f"{line}\nb;c\n1;2\n3;4\n", Layout(velocity="1500 rpm"))
    if rate is None:
        with pytest.raises(ValueError, match="sampling rate of 'b' is not known"):
            assert recording.duration
    else:
        assert dict(recording.fs) == {"b": rate, "c": rate}


def test_a_column_with_a_unit_of_speed_is_no_channel_unless_it_is_listed(tmp_path):
    with pytest.raises(ValueError, match=r"column 'out' is named like the motion .*= \['b'\]"):
        assert opened(tmp_path, "b,out [r/min]\n1,900\n2,901\n", Layout(fs=9, velocity=3)).duration
    layout = Layout(fs=9, velocity=3, channels=["out", "b"])
    recording = opened(tmp_path, "b,out [r/min]\n1,900\n2,901\n", layout)
    assert recording.signals["out"].tolist() == [900, 901]


NAMES = Layout(fs=2, velocity=3)
BLANK = "b,c,,,\n" + "1,2,,,\n" * 300  # more rows than are looked at for blank columns


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("b,c\n1,2\n3,4,5\n6,7\n8,9\n", "the 2 columns: Expected 2 fields in line 3, saw 3. Corr"),
        ("# a\n\nb,c\n1,2\n\n3,4,\n5,6\n8,9\n", "Expected 2 fields in line 6, saw 3"),
        ('b,c\n1,2\n3,"4\n5,6\n', "EOF inside string"),
        ("time,b\n0,1,900\n1,2,900\n", r"header \['time', 'b'\] does not name the 3 columns"),
        ("b,c,b\n0,1,900\n1,2,900\n", r"must have different names, got \['b', 'c', 'b'\]"),
        ("b;c\ng;A\n", "has no rows of numbers"),
        (f"{BLANK}3,4,,5,\n", "sample 300 has 5.0 in a column without a name"),
        ("b,c,\n1,2,\n3,4,\n6,7,8\n9,1,\n", "sample 2 has 8.0 in a column without a"),
        ("\tc\n1\t2\n3\t4\n", r"header \['', 'c'\] does not name the 2 columns"),
        ("1;2\n", "channel 'x0' must hold at least 2 samples"),
        ("b,c\n1,2,5\n3,4\n6,7\n8,9\n", "line 2 has 3 values, but the header has 2 names"),
        ("b,c\n1.5,900\n,\n4,907\n", "nan at sample 1"),
        ("time,b\n0,1\n0.5,2\nMean,3\n", "time column 'time' has 'Mean' at sample 2, not a time"),
        ("b,c,d\n1,,3\n4,,6\n", "'c' must be finite, got nan at sample 0. Cut the recording"),
    ],
)
def test_rows_that_do_not_fit_the_header_are_refused(tmp_path, text, message):
    with pytest.raises((TypeError, ValueError), match=message):
        assert opened(tmp_path, text, NAMES).duration


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        ("# x, y, z\n1,2\n3,4\n", {"x0": [1, 3], "x1": [2, 4]}),  # wider than the rows
        ("# x, y, z\n1,2\n", None),  # a single row
        ("# 1, 2\nb,c\n3,4\n5,6\n", {"b": [3, 5], "c": [4, 6]}),  # numbers in a comment
        ("b,c,\n3,4,\n5,6\n", {"b": [3, 5], "c": [4, 6]}),  # a blank column of one row only
        (f"{BLANK}3,4,,note,\n", {"b": [1] * 300 + [3], "c": [2] * 300 + [4]}),
    ],
)
def test_comments_and_blank_columns_are_no_data(tmp_path, text, columns):
    recording = opened(tmp_path, text, NAMES)
    if columns is None:
        with pytest.raises(ValueError, match="channel 'x0' must hold at least 2 samples"):
            assert recording.channels
    else:
        assert {name: values.tolist() for name, values in recording.signals.items()} == columns


def test_what_is_no_text_is_named(tmp_path):
    with pytest.raises(ValueError, match="it contains bytes 0: it is binary, or UTF-16 without"):
        assert opened(tmp_path, "b,c\n1,2\n", NAMES, encoding="utf-16-le").duration
