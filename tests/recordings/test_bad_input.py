"""Facts about bad input of recordings: what was expected, what came, where, what to do."""

import numpy as np
import pandas as pd
from bad_input import Case, T, V, check_refused, each, run, spoilt

from emacm import Recording

TWICE = pd.DataFrame(np.ones((600, 2)), columns=["a", "a"])
LONG = spoilt(1_500_000, np.nan, 1_500_001)

CASES = [
    Case("nan in a signal", lambda: run(signals={"a": spoilt(7, np.nan)}), V, "'a'", "sample 7"),
    Case("nan in a late block", lambda: run(signals={"a": LONG}), V, "'a'", "sample 1500000"),
    Case("nan in the velocity", lambda: run(velocity=spoilt(3, np.nan)), V, "velocity", "sample 3"),
    Case("no shaft", lambda: Recording({"a": [1, 2]}, 100), V, "exactly one of angle", "neither"),
    Case("two shafts", lambda: run(angle=[1, 2], velocity=[1, 2]), V, "exactly one", "both"),
    Case("unequal durations", lambda: run(velocity=np.ones(602)), V, "durations", "channel 'a'"),
    Case("complex numbers", lambda: run(signals={"a": np.ones(600) * 1j}), T, "'a'", "real"),
    Case("paths below rest", lambda: run().paths(min_speed=-3), V, "min_speed", "at least 0"),
    Case("a word for a speed", lambda: run().strokes("slow"), T, "min_speed", "rad/s", "'slow'"),
    Case("a word", lambda: run(signals={"a": [1.0, "x", 2.0]}), T, "'a'", "numeric", "sample 1"),
    Case("two dimensions", lambda: run(signals={"a": np.ones((6, 2))}), V, "'a'", "one-dimension"),
    Case("one sample", lambda: run(signals={"a": [1.0]}), V, "'a'", "at least 2 samples"),
    Case("no channels", lambda: run(signals={}), V, "signals", "empty"),
    Case("a bare array", lambda: run(signals=np.ones((2, 600))), T, "signals", "mapping"),
    Case("no name", lambda: run(signals={"": np.ones(600)}), T, "channel names", "non-empty"),
    Case("columns of one name", lambda: run(signals=TWICE), V, "columns", "same name"),
    Case("meta that is no mapping", lambda: run(meta=["A"]), T, "meta", "mapping"),
    Case("rates of too few channels", lambda: run(fs={"a": 100}), V, "fs", "each of"),
    Case("a rate of 0", lambda: run(fs=0), V, "fs", "number", "Hz", "above 0", "got 0"),
    Case("an infinite rate", lambda: run(fs=np.inf), V, "fs", "number", "Hz", "inf"),
    Case("a rate in words", lambda: run(fs="100"), T, "fs", "number", "Hz", "'100'"),
    Case("shaft_fs of zero", lambda: run(shaft_fs=0), V, "shaft_fs", "Hz"),
    Case("an unclear shaft rate", lambda: run(fs={"a": 1, "b": 2}), V, "shaft_fs", "must be given"),
]


@each(CASES)
def test_bad_input_is_refused_with_what_where_and_what_to_do(case):
    check_refused(case)
