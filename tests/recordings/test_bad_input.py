"""Facts about bad input of recordings: what was expected, what came, where, what to do."""

import numpy as np
import pandas as pd
from bad_input import Case, T, V, check_refused, each, run, spoilt

from emacm import Recording

CASES = [
    Case(
        "nan in a signal",
        lambda: run(signals={"a": spoilt(7, np.nan)}),
        V,
        "channel 'a'",
        "sample 7",
    ),
    Case(
        "infinity in the second channel",
        lambda: run(signals={"a": spoilt(0, 0), "b": spoilt(599, -np.inf)}),
        V,
        "channel 'b'",
        "sample 599",
    ),
    Case(
        "nan in a late block",
        lambda: Recording({"a": spoilt(1500000, np.nan, 1500001)}, 100, velocity=np.ones(1500001)),
        V,
        "channel 'a'",
        "sample 1500000",
    ),
    Case("nan in the velocity", lambda: run(velocity=spoilt(3, np.nan)), V, "velocity", "sample 3"),
    Case(
        "nan in a frame",
        lambda: run(signals=pd.DataFrame({"x": spoilt(5, np.nan)})),
        V,
        "channel 'x'",
        "sample 5",
    ),
    Case(
        "no shaft",
        lambda: Recording({"a": [1, 2]}, 100),
        V,
        "exactly one of angle and velocity",
        "neither",
    ),
    Case(
        "two shafts",
        lambda: Recording({"a": [1, 2]}, 1, angle=[1, 2], velocity=[1, 2]),
        V,
        "exactly one of angle and velocity",
        "both",
    ),
    Case("unequal durations", lambda: run(velocity=np.ones(700)), V, "durations", "channel 'a'"),
    Case("text for a signal", lambda: run(signals={"a": ["x", "y"]}), T, "channel 'a'", "numeric"),
    Case(
        "complex numbers", lambda: run(signals={"a": np.ones(600) * 1j}), T, "channel 'a'", "real"
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
    Case("paths below rest", lambda: run().paths(min_speed=-3), V, "min_speed", "at least 0"),
    Case(
        "a word among numbers",
        lambda: run(signals={"a": [1.0, "x", 2.0]}),
        T,
        "channel 'a'",
        "sample 1",
    ),
    Case(
        "a channel of two dimensions",
        lambda: run(signals={"a": np.ones((600, 2))}),
        V,
        "channel 'a'",
        "one-dimensional",
    ),
    Case(
        "a channel of one sample",
        lambda: run(signals={"a": [1.0]}),
        V,
        "channel 'a'",
        "at least 2 samples",
    ),
    Case("no channels", lambda: run(signals={}), V, "signals", "empty"),
    Case(
        "a bare array for signals", lambda: run(signals=np.ones((2, 600))), T, "signals", "mapping"
    ),
    Case(
        "a channel without a name",
        lambda: run(signals={"": np.ones(600)}),
        T,
        "channel names",
        "non-empty strings",
    ),
    Case(
        "columns of one name",
        lambda: run(signals=pd.DataFrame(np.ones((600, 2)), columns=["a", "a"])),
        V,
        "columns",
        "same name",
    ),
    Case("meta that is no mapping", lambda: run(meta=["A"]), T, "meta", "mapping"),
    Case("rates of too few channels", lambda: run(fs={"a": 100}), V, "fs", "each channel"),
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
    Case("shaft_fs of zero", lambda: run(shaft_fs=0), V, "shaft_fs", "Hz"),
    Case(
        "an unclear shaft rate",
        lambda: Recording(
            {"a": np.ones(10), "b": np.ones(20)}, {"a": 1, "b": 2}, velocity=np.ones(10)
        ),
        V,
        "shaft_fs",
        "must be given",
    ),
]


@each(CASES)
def test_bad_input_is_refused_with_what_where_and_what_to_do(case):
    check_refused(case)
