"""Facts about bad input of recordings: what was expected, what came, where, what to do."""

import numpy as np
import pandas as pd
from anything import ANYTHING, FUZZ, survive
from bad_input import Case, T, V, check_refused, each, run, spoilt
from hypothesis import given
from hypothesis import strategies as st

from emacm import Recording

CASES = [
    Case(
        "nan in a signal",
        lambda: run(signals={"a": spoilt(7, np.nan)}),
        V,
        "channel 'a'",
        "finite",
        "nan",
        "sample 7",
        "Cut",
    ),
    Case(
        "infinity in the second channel",
        lambda: run(signals={"a": spoilt(0, 0), "b": spoilt(599, -np.inf)}),
        V,
        "channel 'b'",
        "finite",
        "-inf",
        "sample 599",
    ),
    Case(
        "nan in a late block",
        lambda: Recording(
            {"a": spoilt(1_500_000, np.nan, 1_500_001)}, 100, velocity=np.ones(1_500_001)
        ),
        V,
        "channel 'a'",
        "sample 1500000",
    ),
    Case(
        "nan in the velocity",
        lambda: run(velocity=spoilt(3, np.nan)),
        V,
        "velocity",
        "finite",
        "nan",
        "sample 3",
    ),
    Case(
        "infinity in the angle",
        lambda: run(angle=spoilt(4, np.inf)),
        V,
        "angle",
        "finite",
        "inf",
        "sample 4",
    ),
    Case(
        "nan in a frame",
        lambda: run(signals=pd.DataFrame({"x": spoilt(5, np.nan)})),
        V,
        "channel 'x'",
        "nan",
        "sample 5",
    ),
    Case(
        "no shaft",
        lambda: Recording({"a": [1, 2]}, 100),
        V,
        "exactly one of angle and velocity",
        "neither",
        "emacm.shaft",
    ),
    Case(
        "two shafts",
        lambda: Recording({"a": [1, 2]}, 1, angle=[1, 2], velocity=[1, 2]),
        V,
        "exactly one of angle and velocity",
        "both",
    ),
    Case(
        "unequal durations",
        lambda: run(velocity=np.ones(700)),
        V,
        "durations",
        "channel 'a'",
        "6 s",
        "velocity",
        "7 s",
        "Check fs and shaft_fs",
    ),
    Case(
        "unequal channels",
        lambda: run(signals={"a": np.ones(600), "b": np.ones(500)}),
        V,
        "durations",
        "channel 'b'",
        "5 s",
        "6 s",
        "cut",
    ),
    Case(
        "text for a signal",
        lambda: run(signals={"a": ["x", "y"]}),
        T,
        "channel 'a'",
        "numeric",
        "'x'",
    ),
    Case(
        "complex numbers",
        lambda: run(signals={"a": np.ones(600) * 1j}),
        T,
        "channel 'a'",
        "real",
        "complex",
        "two channels",
    ),
    Case(
        "dates",
        lambda: run(signals={"a": np.zeros(600, "M8[s]")}),
        T,
        "channel 'a'",
        "numeric",
        "datetime64",
    ),
    Case(
        "a missing number as None",
        lambda: run(signals={"a": [1.0, None, 2.0]}),
        T,
        "channel 'a'",
        "numeric",
        "None",
        "sample 1",
    ),
    Case(
        "numbers as objects",
        lambda: run(signals={"a": np.full(600, 1.5, object)}),
        T,
        "channel 'a'",
        "numeric",
        "objects",
        ".astype(float)",
    ),
    *[
        Case(
            f"strokes above a speed of {speed!r}",
            lambda speed=speed: run().strokes(speed),
            error,
            "min_speed",
            "rad/s, at least 0",
            repr(speed),
        )
        for speed, error in [(np.nan, V), (-2, V), ("slow", T)]
    ],
    Case("paths below rest", lambda: run().paths(min_speed=-3), V, "min_speed", "at least 0", "-3"),
    Case(
        "a word among numbers",
        lambda: run(signals={"a": [1.0, "x", 2.0]}),
        T,
        "channel 'a'",
        "numeric",
        "'x'",
        "sample 1",
    ),
    Case(
        "a channel of two dimensions",
        lambda: run(signals={"a": np.ones((600, 2))}),
        V,
        "channel 'a'",
        "one-dimensional",
        "(600, 2)",
    ),
    Case(
        "a ragged channel",
        lambda: run(signals={"a": [[1], [1, 2]]}),
        V,
        "channel 'a'",
        "rectangular",
    ),
    Case(
        "a scalar channel",
        lambda: run(signals={"a": 5.0}),
        V,
        "channel 'a'",
        "one-dimensional",
        "()",
    ),
    Case(
        "an empty channel",
        lambda: run(signals={"a": []}),
        V,
        "channel 'a'",
        "at least 2 samples",
        "got 0",
    ),
    Case(
        "a channel of one sample",
        lambda: run(signals={"a": [1.0]}),
        V,
        "channel 'a'",
        "at least 2 samples",
        "got 1",
    ),
    Case("no channels", lambda: run(signals={}), V, "signals", "empty", "at least one channel"),
    Case(
        "a bare array for signals",
        lambda: run(signals=np.ones((2, 600))),
        T,
        "signals",
        "mapping",
        "DataFrame",
        "ndarray",
    ),
    Case(
        "a channel named by a number",
        lambda: run(signals={3: np.ones(600)}),
        T,
        "channel names",
        "strings",
        "3",
    ),
    Case(
        "a channel without a name",
        lambda: run(signals={"": np.ones(600)}),
        T,
        "channel names",
        "non-empty strings",
        "''",
    ),
    Case(
        "columns of one name",
        lambda: run(signals=pd.DataFrame(np.ones((600, 2)), columns=["a", "a"])),
        V,
        "columns",
        "same name",
        "'a'",
        "Rename",
    ),
    Case(
        "meta that is no mapping",
        lambda: run(meta=["A"]),
        T,
        "meta",
        "mapping",
        "{'unit': 'A'}",
        "['A']",
    ),
    Case(
        "rates of too few channels",
        lambda: run(fs={"a": 100}),
        V,
        "fs",
        "each channel",
        "['a', 'b']",
        "['a']",
    ),
    Case(
        "rates of too many channels",
        lambda: run(fs={"a": 100, "b": 100, "c": 1}),
        V,
        "fs",
        "each channel",
        "['a', 'b']",
        "'c'",
    ),
    Case(
        "a rate of zero for one channel",
        lambda: run(fs={"a": 100, "b": 0}),
        V,
        "fs of channel 'b'",
        "above 0",
        "Hz",
        "got 0",
    ),
    Case("a huge whole number for a rate", lambda: run(fs=10**400), V, "fs", "Hz", "number"),
    *[
        Case(f"fs={fs!r}", lambda fs=fs: run(fs=fs), error, "fs", "number", "Hz", "above 0", came)
        for fs, error, came in [
            (0, V, "got 0"),
            (-5, V, "got -5"),
            (np.nan, V, "nan"),
            (np.inf, V, "inf"),
            (True, T, "True"),
            ("100", T, "'100'"),
            (None, T, "None"),
            ([100], T, "[100]"),
            (100 + 0j, T, "100+0j"),
        ]
    ],
    Case("shaft_fs of zero", lambda: run(shaft_fs=0), V, "shaft_fs", "Hz", "above 0", "got 0"),
    Case("shaft_fs as text", lambda: run(shaft_fs="x"), T, "shaft_fs", "number", "'x'"),
    Case(
        "an unclear shaft rate",
        lambda: Recording(
            {"a": np.ones(10), "b": np.ones(20)}, {"a": 1, "b": 2}, velocity=np.ones(10)
        ),
        V,
        "shaft_fs",
        "must be given",
        "{'a': 1.0, 'b': 2.0}",
    ),
]


@each(CASES)
def test_bad_input_is_refused_with_what_where_and_what_to_do(case):
    check_refused(case)


@FUZZ
@given(ANYTHING, st.one_of(st.just(100), ANYTHING), ANYTHING, st.booleans())
def test_a_recording_of_anything_is_made_or_refused(signals, fs, shaft, as_angle):
    name = "angle" if as_angle else "velocity"

    def call():
        made = Recording(signals, fs, **{name: shaft})
        assert repr(made)
        return np.concatenate([made.angle, *made.signals.values()])

    assert not np.isnan(survive(call)).any()


@FUZZ
@given(ANYTHING, ANYTHING)
def test_a_channel_of_anything_is_kept_or_refused(channel, meta):
    def call():
        made = Recording({"a": channel}, 100, velocity=channel, meta=meta)
        assert repr(made)
        return made.signals["a"]

    assert not np.isnan(survive(call)).any()
