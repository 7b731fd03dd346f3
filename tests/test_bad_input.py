"""Facts about bad input: an error that says what was expected, what came, where, what to do."""

import subprocess
import sys
import warnings
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import sparse
from sklearn.model_selection import cross_validate
from sklearn.pipeline import make_pipeline

from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    OrderPSD,
    OrderResampler,
    Recording,
    expected_cost,
    neg_expected_cost,
)
from emacm.orders.columns import OrderTable, order_columns

THETA_S = 2 * np.pi / 32


def run(seed=0, n_times=600, *, signals=None, velocity=None, meta=None, **options):
    """Six seconds at 100 Hz: forth for 4 s at 6 rad/s, back for 2 s."""
    rng = np.random.default_rng(seed)
    if signals is None:
        signals = {"a": rng.normal(size=n_times), "b": rng.normal(size=n_times)}
    if velocity is None and "angle" not in options:
        velocity = np.where(np.arange(n_times) < 400, 6.0, -6.0)
    return Recording(signals, options.pop("fs", 100), velocity=velocity, meta=meta, **options)


def spoilt(index, value, n_times=600):
    """Noise with one value that is none."""
    noise = np.random.default_rng(0).normal(size=n_times)
    noise[index] = value
    return noise


def over_angle(X=None, **options):
    return OrderResampler(**({"theta_s": THETA_S} | options)).fit_transform(X or [run(0), run(1)])


def forward_only():
    return run(velocity=np.full(600, 6.0), meta={"unit": "F7"})


def spectra():
    return OrderPSD(2).fit_transform(over_angle())


def bare(n_channels=3):
    return np.random.default_rng(0).normal(size=(2, n_channels, 300)) + 30


def features(seed=0, n_recordings=20):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n_recordings, 3)), np.array(["healthy", "worn"] * (n_recordings // 2))


def classifier(**options):
    return CostSensitiveGaussianBayes(**options).fit(*features())


def after_fit(X, **options):
    """Transform other recordings than those of fit."""
    return OrderResampler(THETA_S, **options).fit([run(0), run(1)]).transform(X)


def psd_after_fit(X):
    return OrderPSD(2).fit(over_angle()).transform(X)


def standing():
    return run(velocity=np.zeros(600), meta={"unit": "S1"})


def long_rows():
    return [np.random.default_rng(0).normal(size=300) for _ in range(3)]


def one_broken():
    """The third of four recordings has no stroke long enough."""
    X = [run(seed, meta={"unit": seed}) for seed in range(4)]
    X[2] = run(2, velocity=np.where(np.arange(600) < 30, 6.0, 0.0), meta={"unit": "broken"})
    return X


class Case:
    """One kind of bad input and what its error must say."""

    def __init__(self, what, call, error, *words):
        self.what, self.call, self.error, self.words = what, call, error, words


V, T = ValueError, TypeError

RECORDINGS = [
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

RESAMPLER = [
    Case(
        "a single recording",
        lambda: OrderResampler().fit(run()),
        T,
        "list of recordings",
        "single one",
        "[recording]",
    ),
    Case(
        "a single frame",
        lambda: OrderResampler().fit(pd.DataFrame({"a": [1.0]})),
        T,
        "list of recordings",
        "DataFrame",
    ),
    Case("a mapping", lambda: OrderResampler().fit({"a": run()}), T, "list of recordings", "dict"),
    Case("text for X", lambda: OrderResampler().fit("runs"), T, "list of recordings", "'runs'"),
    Case("None for X", lambda: OrderResampler().fit(None), T, "list of recordings", "None"),
    Case("a number for X", lambda: OrderResampler().fit(5), T, "list of recordings", "5"),
    Case("no recording", lambda: OrderResampler().fit([]), V, "no recording", "at least one"),
    Case(
        "an array of two dimensions",
        lambda: OrderResampler().fit(np.ones((2, 5))),
        V,
        "(n_recordings, n_channels, n_times)",
        "(2, 5)",
    ),
    Case(
        "numbers in the list",
        lambda: OrderResampler().fit([run(), 5]),
        T,
        "recording 1",
        "expected a Recording",
        "5",
    ),
    Case(
        "text in the list",
        lambda: OrderResampler().fit(["a.csv"]),
        T,
        "recording 0",
        "expected a Recording",
        "'a.csv'",
        "read the channels from the file",
    ),
    Case(
        "something else with meta",
        lambda: OrderResampler().fit([SimpleNamespace(meta=5)]),
        T,
        "recording 0",
        "expected a Recording",
    ),
    Case(
        "a recording over angle already",
        lambda: OrderResampler().fit(over_angle()),
        T,
        "recording 0",
        "over the shaft angle already",
        "OrderResampler comes first",
    ),
    Case(
        "a bare array without a rate",
        lambda: OrderResampler(reference=0).fit(bare()),
        V,
        "recording 0",
        "bare ndarray",
        "how fast",
        "Recording",
        "fs and reference",
    ),
    Case(
        "a bare array without a reference",
        lambda: OrderResampler(fs=100).fit(bare()),
        V,
        "recording 0",
        "shaft",
        "fs and reference",
    ),
    Case(
        "a bare frame among recordings",
        lambda: OrderResampler().fit([run(), pd.DataFrame({"a": [1.0]})]),
        V,
        "recording 1",
        "bare DataFrame",
        "fs and reference",
    ),
    Case(
        "a reference beyond the channels",
        lambda: OrderResampler(fs=100, reference=3).fit(bare()),
        V,
        "recording 0",
        "no channel 3",
        "['x0', 'x1', 'x2']",
    ),
    Case(
        "an unknown reference",
        lambda: OrderResampler(fs=100, reference="speed").fit(bare()),
        V,
        "no channel 'speed'",
        "['x0', 'x1', 'x2']",
    ),
    Case(
        "a list for a reference",
        lambda: OrderResampler(fs=100, reference=["x0"]).fit(bare()),
        T,
        "reference",
        "name",
        "['x0']",
    ),
    Case(
        "a bool for a reference",
        lambda: OrderResampler(fs=100, reference=True).fit(bare()),
        T,
        "reference",
        "True",
    ),
    Case(
        "a bare array of the shaft alone",
        lambda: OrderResampler(fs=100, reference=0).fit(bare(1)),
        V,
        "recording 0",
        "at least one channel",
    ),
    Case(
        "a bare array with a nan",
        lambda: OrderResampler(fs=100, reference=1).fit(
            np.where(np.arange(300) == 9, np.nan, bare())
        ),
        V,
        "recording 0",
        "sample 9",
        "nan",
    ),
    Case(
        "bare arrays of one dimension",
        lambda: OrderResampler(fs=100, reference=0).fit([np.ones(5)]),
        V,
        "recording 0",
        "(n_channels, n_times)",
        "(5,)",
    ),
    Case(
        "a bare frame with two columns of one name",
        lambda: OrderResampler(fs=100, reference="w").fit(
            [pd.DataFrame(np.ones((50, 3)), columns=["a", "a", "w"])]
        ),
        V,
        "recording 0",
        "same name",
        "'a'",
    ),
    Case(
        "a bare frame with numbers for names",
        lambda: OrderResampler(fs=100, reference=0).fit([pd.DataFrame(np.ones((50, 2)))]),
        T,
        "recording 0",
        "channel names",
        "strings",
        "1",
    ),
    *[
        Case(
            f"theta_s={theta_s!r}",
            lambda theta_s=theta_s: OrderResampler(theta_s).fit([run()]),
            error,
            "theta_s",
            "number",
            "rad per sample",
            "above 0",
            came,
        )
        for theta_s, error, came in [
            (0, V, "got 0"),
            (-0.1, V, "-0.1"),
            (np.nan, V, "nan"),
            ("0.1", T, "'0.1'"),
            (None, T, "None"),
            (True, T, "True"),
        ]
    ],
    Case(
        "theta_s far too small to read",
        lambda: over_angle(theta_s=1e-12)[0].strokes[0].signals,
        V,
        "theta_s = 1e-12",
        "angle between samples",
        "2 * np.pi / 128",
    ),
    Case(
        "theta_s far too small for a spectrum",
        lambda: make_pipeline(OrderResampler(1e-12), OrderPSD(2)).fit_transform([run()]),
        V,
        "segment",
        "samples",
        "theta_s",
    ),
    *[
        Case(
            f"unknown {name}",
            lambda name=name: OrderResampler(**{name: "best"}).fit([run()]),
            V,
            name,
            "must be one of",
            choice,
            "'best'",
        )
        for name, choice in [
            ("interpolation", "'linear', 'cubic'"),
            ("direction", "'strokes', 'forward', 'reverse', 'travel'"),
            ("antialias", "True, False"),
            ("reference_kind", "'velocity', 'angle'"),
        ]
    ],
    Case(
        "a list for a direction",
        lambda: OrderResampler(direction=["forward"]).fit([run()]),
        V,
        "direction",
        "must be one of",
        "['forward']",
    ),
    Case(
        "negative min_speed",
        lambda: OrderResampler(min_speed=-1).fit([run()]),
        V,
        "min_speed",
        "rad/s",
        "at least 0",
        "-1",
    ),
    Case(
        "text for min_speed",
        lambda: OrderResampler(min_speed="1").fit([run()]),
        T,
        "min_speed",
        "number",
        "'1'",
    ),
    Case(
        "an unknown channel",
        lambda: OrderResampler(channels=["c"]).fit([run(meta={"unit": "A"})]),
        V,
        "recording 0 (unit='A')",
        "no channel 'c'",
        "['a', 'b']",
    ),
    Case(
        "a name for channels",
        lambda: OrderResampler(channels="a").fit([run()]),
        T,
        "channels",
        "list of names",
        "['a']",
    ),
    Case(
        "a number for channels",
        lambda: OrderResampler(channels=5).fit([run()]),
        T,
        "channels",
        "list of names",
        "5",
    ),
    Case(
        "lists for channels",
        lambda: OrderResampler(channels=[["a"]]).fit([run()]),
        T,
        "channels",
        "name",
        "['a']",
    ),
    Case(
        "no channels to keep", lambda: OrderResampler(channels=[]).fit([run()]), V, "channels", "[]"
    ),
    Case(
        "a channel kept twice",
        lambda: OrderResampler(channels=["a", "a"]).fit([run()]),
        V,
        "channels",
        "once",
        "['a', 'a']",
    ),
    Case(
        "a channel missing in one of many",
        lambda: OrderResampler().fit(
            [run(), run(), run(signals={"a": np.ones(600)}, meta={"unit": "B"})]
        ),
        V,
        "recording 2 (unit='B')",
        "no channel 'b'",
        "['a']",
        "['a', 'b']",
    ),
    Case(
        "a channel missing after fit",
        lambda: after_fit([run(signals={"a": np.ones(600)})]),
        V,
        "recording 0",
        "no channel 'b'",
        "['a', 'b']",
    ),
    Case(
        "a channel too many after fit",
        lambda: after_fit([run(), run(signals=dict.fromkeys("abc", np.ones(600)))]),
        V,
        "recording 1",
        "a channel 'c'",
        "['a', 'b']",
        "Set channels",
    ),
    Case(
        "a standing shaft",
        lambda: after_fit([run(), standing()]),
        V,
        "recording 1 (unit='S1')",
        "never turns",
        "min_speed",
        "Leave the recording out",
    ),
    Case(
        "a shaft slower than min_speed",
        lambda: after_fit([run()], min_speed=50),
        V,
        "recording 0",
        "never turns",
        "min_speed = 50",
        "-6",
        "6 rad/s",
    ),
    Case(
        "no reverse stroke",
        lambda: after_fit([forward_only()], direction="reverse"),
        V,
        "recording 0 (unit='F7')",
        "never turns reverse",
        "between 6 and 6 rad/s",
    ),
    Case(
        "quality of a number",
        lambda: OrderResampler().quality([3]),
        T,
        "recording 0",
        "expected a Recording",
        "3",
    ),
]


def psd(X=None, **options):
    return OrderPSD(**({"revolutions": 2} | options)).fit_transform(X or over_angle())


SPECTRA = [
    Case(
        "recordings over time",
        lambda: psd([run(meta={"unit": "A"})]),
        T,
        "recording 0 (unit='A')",
        "over time",
        "OrderResampler before OrderPSD",
    ),
    Case(
        "a recording over time among others",
        lambda: psd([*over_angle(), run()]),
        T,
        "recording 2",
        "over time",
    ),
    Case(
        "a single recording over time",
        lambda: OrderPSD().fit(run()),
        T,
        "list of recordings",
        "single one",
        "[recording]",
    ),
    Case(
        "a single recording over angle",
        lambda: OrderPSD().fit(over_angle()[0]),
        T,
        "list of recordings",
        "single one",
        "[recording]",
    ),
    Case(
        "recordings mixed with rows",
        lambda: psd([*over_angle(), np.ones(300)]),
        T,
        "OrderPSD",
        "entry 2",
        "ndarray",
    ),
    Case("no rows", lambda: OrderPSD(theta_s=0.1).fit([]), V, "no recording", "at least one"),
    Case("rows of text", lambda: OrderPSD(theta_s=0.1).fit([["a", "b"]]), T, "row 0", "numeric"),
    Case(
        "a nan in a row",
        lambda: OrderPSD(2, theta_s=0.1).fit([np.ones(300), spoilt(11, np.nan)]),
        V,
        "row 1",
        "finite",
        "sample 11",
    ),
    Case(
        "complex rows",
        lambda: OrderPSD(2, theta_s=0.1).fit([np.ones(300) * 1j]),
        T,
        "row 0",
        "real",
        "complex",
    ),
    Case(
        "too few revolutions",
        lambda: psd(revolutions=5),
        V,
        "recording 0",
        "no stroke holds a segment of 5 revolutions",
        "160 samples",
        "longest stroke holds",
        "Lower revolutions",
        "short='pad'",
    ),
    Case(
        "one recording too short among many",
        lambda: psd(over_angle(one_broken())),
        V,
        "recording 2 (unit='broken')",
        "2 revolutions",
        "holds 0.28",
        "short='pad'",
    ),
    Case(
        "no reverse stroke by direction",
        lambda: psd(over_angle([run(), forward_only()]), revolutions=1, by_direction=True),
        V,
        "recording 1 (unit='F7')",
        "no reverse stroke",
    ),
    Case(
        "no reverse stroke to pad",
        lambda: psd(over_angle([forward_only()]), by_direction=True, short="pad"),
        V,
        "recording 0 (unit='F7')",
        "no reverse stroke",
    ),
    Case(
        "too short a row",
        lambda: psd([np.ones(300), np.ones(20)], theta_s=0.1),
        V,
        "row 1",
        "segment of 2",
        "Lower revolutions",
    ),
    Case(
        "a shorter row than those of fit",
        lambda: OrderPSD(100).fit(np.ones((2, 300))).transform([np.ones(299), np.ones(10)]),
        V,
        "row 1",
        "100 samples",
    ),
    Case(
        "revolutions too short for a segment",
        lambda: psd(revolutions=0.01),
        V,
        "revolutions = 0.01",
        "32 samples per revolution",
        "at least 2",
        "Raise revolutions",
    ),
    Case(
        "revolutions too short for bare rows",
        lambda: OrderPSD(0.2).fit(np.ones((2, 50))),
        V,
        "revolutions",
        "at least 2",
        "0.2",
    ),
    Case(
        "revolutions beyond all memory",
        lambda: psd(revolutions=1e13),
        V,
        "revolutions",
        "1e+13",
        "samples",
    ),
    Case(
        "a segment beyond all memory",
        lambda: psd(n_per_segment=10**14),
        V,
        "n_per_segment",
        "segment",
        "samples",
    ),
    *[
        Case(
            f"revolutions={revolutions!r}",
            lambda r=revolutions: psd(revolutions=r),
            error,
            "revolutions",
            "number",
            "above 0",
            came,
        )
        for revolutions, error, came in [
            (0, V, "got 0"),
            (-1, V, "got -1"),
            (np.nan, V, "nan"),
            (np.inf, V, "inf"),
            ("2", T, "'2'"),
            (None, T, "None"),
        ]
    ],
    *[
        Case(
            f"n_per_segment={n!r}, {kind}",
            lambda n=n, X=X: OrderPSD(2, n_per_segment=n).fit(X()),
            error,
            "n_per_segment",
            "whole number",
            "at least 2",
            came,
        )
        for n, error, came in [
            (1.5, T, "1.5"),
            (0, V, "got 0"),
            (1, V, "got 1"),
            ("a", T, "'a'"),
            (True, T, "True"),
            (64.0, T, "64.0"),
        ]
        for kind, X in [("recordings", over_angle), ("rows", lambda: np.ones((2, 300)))]
    ],
    *[
        Case(
            f"overlap={overlap!r}",
            lambda overlap=overlap: psd(overlap=overlap),
            error,
            "overlap",
            "at least 0 and below 1",
            came,
        )
        for overlap, error, came in [
            (1, V, "got 1"),
            (-0.1, V, "-0.1"),
            (np.nan, V, "nan"),
            ("half", T, "'half'"),
        ]
    ],
    *[
        Case(
            f"unknown {name}",
            lambda name=name: psd(**{name: "best"}),
            V,
            name,
            "must be one of",
            choice,
            "'best'",
        )
        for name, choice in [
            ("detrend", "'constant', 'linear', None, False"),
            ("scaling", "'density', 'spectrum'"),
            ("average", "'mean', 'median'"),
            ("short", "'raise', 'pad'"),
            ("by_direction", "True, False"),
        ]
    ],
    *[
        Case(
            f"window={window!r}",
            lambda window=window: psd(window=window),
            (V, T),
            "window",
            repr(window),
            "scipy.signal.get_window",
        )
        for window in ["best", ("best", 3), "kaiser", ("kaiser",), ("kaiser", "x"), ("hann", 3), ()]
    ],
    Case("a window of nan", lambda: psd(window=("kaiser", np.nan)), V, "window", "finite"),
    Case(
        "a window of wrong length",
        lambda: psd(window=np.ones(7)),
        V,
        "window",
        "64 samples of a segment",
        "(7,)",
        "n_per_segment",
    ),
    Case("a window with a nan", lambda: psd(window=np.full(64, np.nan)), V, "window", "finite"),
    Case(
        "a window that adds up to nothing",
        lambda: psd(window=np.zeros(64)),
        V,
        "window",
        "sum to 0",
    ),
    Case("None for a window", lambda: psd(window=None), T, "window", "None"),
    Case(
        "a padded window given as an array",
        lambda: psd(revolutions=5, window=np.ones(160), short="pad"),
        V,
        "recording 0",
        "window by name",
    ),
    Case(
        "negative max_order",
        lambda: psd(max_order=-1),
        V,
        "max_order",
        "orders",
        "at least 0",
        "-1",
    ),
    Case("text for max_order", lambda: psd(max_order="5"), T, "max_order", "number", "'5'"),
    Case(
        "theta_s that contradicts the recordings",
        lambda: psd(theta_s=0.1),
        V,
        "theta_s = 0.1",
        "contradicts",
        "0.196",
        "Omit theta_s of OrderPSD",
    ),
    Case(
        "theta_s of zero for rows",
        lambda: OrderPSD(theta_s=0).fit(np.ones((2, 300))),
        V,
        "theta_s",
        "above 0",
        "got 0",
    ),
    Case(
        "theta_s far too small for rows",
        lambda: OrderPSD(2, theta_s=1e-12).fit(long_rows()),
        V,
        "segment",
        "samples",
        "theta_s",
    ),
    Case(
        "another theta_s than that of fit",
        lambda: psd_after_fit(over_angle(theta_s=0.1)),
        V,
        "recording 0",
        "theta_s = 0.1",
        "0.196",
        "Resample it alike, or fit again",
    ),
    Case(
        "two steps in one list",
        lambda: psd([*over_angle(), *over_angle(theta_s=0.1)]),
        V,
        "recording 2",
        "theta_s = 0.1",
        "0.196",
    ),
    Case(
        "other channels than those of fit",
        lambda: psd_after_fit(over_angle(channels=["b", "a"])),
        V,
        "recording 0",
        "['b', 'a']",
        "['a', 'b']",
    ),
    Case(
        "rows after a fit on recordings",
        lambda: psd_after_fit(np.ones((2, 300))),
        (V, T),
        "recordings",
        "rows",
    ),
    Case(
        "rows after a fit on recordings of one channel",
        lambda: OrderPSD(2).fit(over_angle(channels=["a"])).transform(np.ones((2, 300))),
        (V, T),
        "recordings",
        "rows",
    ),
    Case(
        "recordings after a fit on rows",
        lambda: OrderPSD(100).fit(np.ones((2, 300))).transform(over_angle()),
        (V, T),
        "recording 0",
        "rows",
    ),
    Case(
        "a nan in a table of rows",
        lambda: OrderPSD(2, theta_s=0.1).fit(np.stack([np.ones(600), spoilt(11, np.nan)])),
        V,
        "NaN",
        "row 1",
        "sample 11",
    ),
    Case(
        "directions of a travel",
        lambda: psd(over_angle(direction="travel"), by_direction=True),
        V,
        "by_direction",
        "'travel'",
        "direction='strokes'",
    ),
    Case(
        "directions of rows",
        lambda: OrderPSD(by_direction=True).fit(np.ones((2, 300))),
        V,
        "by_direction",
        "plain rows have no direction",
        "OrderResampler",
    ),
    Case("sparse rows", lambda: OrderPSD().fit(sparse.csr_array(np.eye(5))), T, "dense"),
    Case("rows of one sample", lambda: OrderPSD().fit(np.ones((5, 1))), V, "minimum of 2"),
    Case("a row instead of rows", lambda: OrderPSD(2, theta_s=0.1).fit(np.ones(300)), V, "2D"),
    Case("a table of three dimensions", lambda: OrderPSD().fit(np.ones((2, 3, 50))), V, "dim 3"),
    Case("spectra before fit", lambda: OrderPSD().transform(over_angle()), V, "not fitted"),
]


def bins(X=None, **options):
    return BinTransformer(**({"max_order": 8} | options)).fit_transform(
        spectra() if X is None else X
    )


BINS = [
    Case(
        "orders above the axis",
        lambda: bins(max_order=50),
        V,
        "16-17",
        "beyond the spectrum",
        "orders are 0 to 16",
        "Lower max_order",
        "theta_s",
    ),
    Case(
        "edges above the axis", lambda: bins(edges=[0, 5, 16.01]), V, "5-16.01", "0 to 16", "edges"
    ),
    Case(
        "edges below the axis",
        lambda: bins(pd.DataFrame(np.ones((2, 3)), columns=["a@1", "a@2", "a@3"]), edges=[0.5, 2]),
        V,
        "0.5-2",
        "1 to 3",
    ),
    *[
        Case(
            f"{name}={value!r}",
            lambda name=name, value=value: bins(**{name: value}),
            error,
            name,
            "number",
            "orders",
            "above 0",
            came,
        )
        for name in ("bin_size", "max_order")
        for value, error, came in [
            (0, V, "got 0"),
            (-1, V, "got -1"),
            (np.nan, V, "nan"),
            (np.inf, V, "inf"),
            ("1", T, "'1'"),
            (None, T, "None"),
            (True, T, "True"),
        ]
    ],
    Case(
        "tiny bins",
        lambda: bins(bin_size=1e-300),
        V,
        "bin_size = 1e-300",
        "bins up to order 8",
        "width of a bin",
    ),
    Case(
        "edges that are not sorted",
        lambda: bins(edges=[0, 5, 3]),
        V,
        "edges",
        "increase",
        "5 is followed by 3",
        "position 2",
        "Sort",
    ),
    Case("an edge twice", lambda: bins(edges=[0, 3, 3]), V, "edges", "3 is followed by 3"),
    Case(
        "edges that differ by rounding only",
        lambda: bins(edges=[0, 1, 1 + 1e-13, 2]),
        V,
        "edges",
        "increase",
    ),
    Case("a negative edge", lambda: bins(edges=[-1, 3]), V, "edges", "at least 0", "[-1.0, 3.0]"),
    Case("an edge that is no number", lambda: bins(edges=[0, np.nan]), V, "edges", "finite", "nan"),
    Case("one edge", lambda: bins(edges=[3]), V, "edges", "at least two", "[3]"),
    Case(
        "edges of two dimensions",
        lambda: bins(edges=[[0, 1], [1, 2]]),
        V,
        "edges",
        "at least two increasing orders",
    ),
    Case("text for edges", lambda: bins(edges=["a", "b"]), T, "edges", "numeric", "'a'"),
    Case("no bands", lambda: bins(edges={}), V, "edges", "at least one band"),
    Case(
        "a band upside down",
        lambda: bins(edges={"BPFI": (6, 5)}),
        V,
        "band 'BPFI'",
        "lower to a higher",
        "(6, 5)",
    ),
    Case(
        "a band of one number",
        lambda: bins(edges={"BPFI": 6}),
        T,
        "band 'BPFI'",
        "pair (low, high)",
        "6",
    ),
    Case(
        "a band with a number for a name",
        lambda: bins(edges={6: (5, 6)}),
        T,
        "bands",
        "named by strings",
        "6",
    ),
    Case("a negative band", lambda: bins(edges={"x": (-1, 6)}), V, "band 'x'", "at least 0", "-1"),
    Case(
        "a stop band that is not nested",
        lambda: bins(stop_bands=(5.6, 6.4)),
        T,
        "stop_bands",
        "pairs",
        "(5.6, 6.4)",
        "((low, high),)",
    ),
    Case(
        "a stop band upside down",
        lambda: bins(stop_bands=((6.4, 5.6),)),
        V,
        "stop band 0",
        "lower to a higher",
        "(6.4, 5.6)",
    ),
    Case(
        "a stop band of three numbers",
        lambda: bins(stop_bands=((1, 2), (1, 2, 3))),
        T,
        "stop band 1",
        "pair",
        "(1, 2, 3)",
    ),
    Case("text for stop bands", lambda: bins(stop_bands="5-6"), T, "stop_bands", "'5-6'"),
    Case("a number for stop bands", lambda: bins(stop_bands=5), T, "stop_bands", "5"),
    Case("None for stop bands", lambda: bins(stop_bands=None), T, "stop_bands", "None"),
    Case(
        "a negative stop band",
        lambda: bins(stop_bands=((-1, 2),)),
        V,
        "stop band 0",
        "at least 0",
        "-1",
    ),
    Case(
        "a stop band with a nan", lambda: bins(stop_bands=((1, np.nan),)), V, "stop band 0", "nan"
    ),
    Case(
        "all bins stopped",
        lambda: bins(stop_bands=((0, 8),)),
        V,
        "stop_bands",
        "(0.0, 8.0)",
        "Remove",
    ),
    Case(
        "a step that contradicts the axis",
        lambda: bins(order_step=0.25),
        V,
        "order_step = 0.25",
        "contradicts",
        "0.5",
        "Leave order_step out",
    ),
    Case(
        "a step of zero",
        lambda: bins(np.ones((2, 9)), order_step=0),
        V,
        "order_step",
        "above 0",
        "got 0",
    ),
    Case("text for a step", lambda: bins(np.ones((2, 9)), order_step="x"), T, "order_step", "'x'"),
    Case(
        "bins beyond a stated step",
        lambda: bins(np.ones((2, 9)), order_step=0.5),
        V,
        "beyond the spectrum",
        "0 to 4",
    ),
    Case("one column", lambda: bins(np.ones((3, 1))), V, "1 feature", "minimum of 2"),
    Case("sparse spectra", lambda: bins(sparse.csr_array(np.eye(9))), T, "dense"),
    Case(
        "a nan in the spectra",
        lambda: bins(
            pd.DataFrame(
                np.where(np.arange(9) == 3, [[1.0], [np.nan]], 1.0),
                columns=order_columns("a", range(9)),
            )
        ),
        V,
        "NaN",
        "recording 1",
        "'a@3'",
    ),
    Case("text in the spectra", lambda: bins([["a"] * 9]), V, "'a'"),
    Case(
        "order columns beside others",
        lambda: bins(pd.DataFrame(np.ones((2, 3)), columns=["load", "a@0", "a@1"])),
        V,
        "'a@0'",
        "'load'",
        "ColumnTransformer",
    ),
    Case(
        "columns out of order",
        lambda: bins(pd.DataFrame(np.ones((2, 3)), columns=["a@0", "a@2", "a@1"])),
        V,
        "increase",
        "'a@1' follows 'a@2'",
    ),
    Case(
        "another axis than that of fit",
        lambda: (
            BinTransformer(max_order=8)
            .fit(spectra())
            .transform(OrderTable(np.ones((1, 3)), order_columns(["a"], [0, 1, 2])))
        ),
        V,
        "another order axis",
        "66 columns 'a@0' to 'b@16'",
        "3 columns 'a@0' to 'a@2'",
        "Use the same theta_s",
    ),
    Case(
        "columns reordered after fit",
        lambda: (
            BinTransformer(max_order=8)
            .fit(pd.DataFrame(np.ones((1, 18)), columns=order_columns("ab", range(9))))
            .transform(pd.DataFrame(np.ones((1, 18)), columns=order_columns("ba", range(9))))
        ),
        V,
        "these columns in another order",
    ),
    Case(
        "too few columns after fit",
        lambda: BinTransformer(max_order=8).fit(np.ones((2, 9))).transform(np.ones((2, 8))),
        V,
        "8 features",
        "9 features",
    ),
    Case("bins before fit", lambda: BinTransformer().transform(np.ones((2, 9))), V, "not fitted"),
]

DECISIONS = [
    Case(
        "an unknown class in costs",
        lambda: classifier(cost={("healthy", "broken"): 3}),
        V,
        "cost",
        "'broken'",
        "unknown",
        "['healthy', 'worn']",
    ),
    Case(
        "an unknown class in a table",
        lambda: classifier(cost=pd.DataFrame(np.eye(2), ["a", "b"], ["healthy", "broken"])),
        V,
        "'broken'",
        "unknown",
    ),
    Case(
        "a cost that is not square",
        lambda: classifier(cost=np.ones((3, 2))),
        V,
        "cost",
        "square",
        "(2, 2)",
        "(3, 2)",
        "DataFrame",
    ),
    Case(
        "a cost with a nan",
        lambda: classifier(cost=[[0, np.nan], [1, 0]]),
        V,
        "cost[0, 1]",
        "deciding 'healthy' when 'worn' is true",
        "nan",
    ),
    Case(
        "text for a cost",
        lambda: classifier(cost=[["a", "b"], ["c", "d"]]),
        T,
        "cost[0, 0]",
        "number",
        "'a'",
    ),
    Case(
        "priors that do not add up",
        lambda: classifier(priors=[0.5, 0.4]),
        V,
        "priors",
        "add up to 1",
        "0.9",
    ),
    Case(
        "priors of an unknown class",
        lambda: classifier(priors={"healthy": 0.5, "x": 0.5}),
        V,
        "priors",
        "['x']",
        "['worn']",
    ),
    Case(
        "a negative prior",
        lambda: classifier(priors=[1.5, -0.5]),
        V,
        "prior of class 'worn'",
        "at least 0",
        "-0.5",
    ),
    Case(
        "an unknown covariance",
        lambda: classifier(covariance="round"),
        V,
        "covariance",
        "'full', 'tied', 'diag'",
        "'round'",
    ),
    Case(
        "shrinkage above one", lambda: classifier(shrinkage=2), V, "shrinkage", "at most 1", "got 2"
    ),
    Case(
        "unknown shrinkage",
        lambda: classifier(shrinkage="best"),
        V,
        "shrinkage",
        "'oas', 'auto'",
        "'best'",
    ),
    Case(
        "singular classes with a number",
        lambda: CostSensitiveGaussianBayes(shrinkage=0).fit(
            features()[0][:, [0, 0]], features()[1]
        ),
        V,
        "'healthy', 'worn'",
        "singular",
        "shrinkage=0",
        "oas",
    ),
    Case(
        "y of wrong length",
        lambda: CostSensitiveGaussianBayes().fit(features()[0], ["healthy"] * 3),
        V,
        "inconsistent numbers of samples",
        "[20, 3]",
    ),
    Case(
        "labels of wrong length for the pipeline",
        lambda: cross_validate(
            make_pipeline(OrderResampler(), OrderPSD(1), CostSensitiveGaussianBayes()),
            [run(0), run(1)],
            ["healthy"],
        ),
        V,
        "inconsistent numbers of samples",
        "[2, 1]",
    ),
    Case(
        "sparse features",
        lambda: CostSensitiveGaussianBayes().fit(sparse.csr_array(features()[0]), features()[1]),
        T,
        "dense",
    ),
    Case(
        "decisions before fit",
        lambda: CostSensitiveGaussianBayes().predict(np.ones((2, 3))),
        V,
        "not fitted",
    ),
    Case(
        "a cost of other labels",
        lambda: expected_cost(["a"], ["b"], cost=pd.DataFrame(np.ones((1, 1)), ["a"], ["a"])),
        V,
        "y_pred",
        "'b'",
        "position 0",
        "['a']",
    ),
    Case(
        "labels of unequal number",
        lambda: expected_cost(["a", "b"], ["a"]),
        V,
        "equally long",
        "2 and 1",
    ),
    Case("no labels", lambda: expected_cost([], []), V, "at least one label"),
    Case(
        "a score without a cost",
        lambda: neg_expected_cost(object(), [], []),
        T,
        "cost_",
        "make_scorer",
    ),
]

CASES = [*RECORDINGS, *RESAMPLER, *SPECTRA, *BINS, *DECISIONS]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.what)
def test_bad_input_is_refused_with_what_where_and_what_to_do(case):
    with pytest.raises(case.error) as caught:
        case.call()
    message = str(caught.value)
    assert not [word for word in case.words if word not in message], message


def test_no_kind_of_bad_input_is_listed_twice():
    names = [case.what for case in CASES]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("transform", [after_fit, OrderResampler().fit])
def test_the_first_broken_recording_is_the_one_named(transform):
    X = [run(), 5, "six"]
    with pytest.raises(TypeError, match=r"recording 1: .* got 5"):
        transform(X)


# What must come to an end. The time limit is no measurement: each takes a moment, or for ever.

ENDLESS = {
    "a table of strokes that are noise at rest": """
speed = np.full(2000, 30.0)
speed[1900:] = 1e-3 * rng.standard_normal(100)
run = Recording({"a": rng.normal(size=2000)}, 1000, velocity=speed)
result = OrderResampler(2 * np.pi / 64).fit_transform([run])[0].frame()
""",
    "a padded spectrum of strokes that are noise at rest": """
speed = np.full(2000, 3.0)
speed[1900:] = 1e-3 * rng.standard_normal(100)
run = Recording({"a": rng.normal(size=2000)}, 1000, velocity=speed)
over_angle = OrderResampler(2 * np.pi / 64).fit_transform([run])
result = OrderPSD(4, short="pad").fit_transform(over_angle)
""",
    "a huge theta_s": """
run = Recording({"a": rng.normal(size=500)}, 100, velocity=np.full(500, 6.0))
try:
    result = OrderResampler(1e300).fit_transform([run])[0].frame()
except ValueError as error:
    assert "theta_s" in str(error)
    result = 0
""",
    "bins far narrower than the lines": """
try:
    result = BinTransformer(2e-5, max_order=8).fit_transform(np.ones((2, 33)))
except ValueError as error:
    assert "bin_size" in str(error)
    result = 0
""",
}


@pytest.mark.parametrize("code", ENDLESS.values(), ids=ENDLESS.keys())
def test_it_comes_to_an_end(code):
    start = "import numpy as np\nfrom emacm import *\nrng = np.random.default_rng(0)\n"
    end = "\nassert np.isfinite(result).all().all()"
    done = subprocess.run(
        [sys.executable, "-c", start + code + end], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr


# Whatever comes in, there is a result without NaN, a ValueError or a TypeError.

NUMBERS = st.one_of(
    st.integers(-5, 50),
    # No sizes between what is quick and what is absurd.
    st.floats(-50, 50).map(lambda number: round(number, 3)),
    st.sampled_from([np.nan, np.inf, -np.inf, 1e300, 1e-300, 5e-324, 10**400, 2**63, 1e-12]),
)
ARRAYS = st.one_of(
    *(
        hnp.arrays(dtype, hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5))
        for dtype in (np.float32, np.int16, np.bool_, np.complex128, "U2", "M8[s]")
    ),
    hnp.arrays(float, hnp.array_shapes(max_side=5), elements=st.floats(-50, 50) | st.just(np.nan)),
    hnp.arrays(object, hnp.array_shapes(max_dims=2, max_side=3), elements=st.none() | NUMBERS),
)
LEAVES = st.one_of(
    st.none(),
    st.booleans(),
    NUMBERS,
    st.complex_numbers(),
    st.text(max_size=3),
    st.binary(max_size=3),
    st.sampled_from(["a", "b", "healthy", "worn", "hann", ("kaiser", 3), np.float64(2), object()]),
    ARRAYS,
    st.builds(lambda: run()),
    st.builds(lambda: over_angle()[0]),
    st.builds(lambda: pd.DataFrame({"a": [1.0, 2.0]})),
    st.builds(lambda: pd.Series([0.5, 0.5], ["healthy", "worn"])),
    st.builds(lambda: sparse.csr_array(np.eye(3))),
    st.builds(lambda: SimpleNamespace(meta=3, columns=5)),
    st.just(range(3)),
)
ANYTHING = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.tuples(inner, inner),
        st.dictionaries(st.sampled_from(["a", "b", "healthy", "worn", 0, ("a", "b")]), inner),
    ),
    max_leaves=6,
)
PLAUSIBLE = st.one_of(
    NUMBERS,
    st.lists(NUMBERS, max_size=4),
    st.lists(st.tuples(NUMBERS, NUMBERS), max_size=3),
    st.sampled_from(
        ["linear", "cubic", "forward", "reverse", "travel", "spectrum", "median", "pad", "flattop"]
    ),
    st.tuples(st.sampled_from(["kaiser", "tukey", "gaussian", "hann"]), NUMBERS),
    st.dictionaries(st.sampled_from(["BPFI", "a", "healthy", "worn"]), NUMBERS),
    st.dictionaries(st.sampled_from(["BPFI", "FTF"]), st.tuples(NUMBERS, NUMBERS)),
    hnp.arrays(float, (2, 2), elements=st.floats(-50, 50)),
    hnp.arrays(float, 64, elements=st.floats(-2, 2)),
    st.sampled_from(["oas", "auto", "tied", "diag", "uniform"]),
    st.lists(st.sampled_from("ab"), min_size=1, max_size=3),
)
VALUES = PLAUSIBLE | ANYTHING
FUZZ = settings(max_examples=60, suppress_health_check=list(HealthCheck))


def survive(call):
    """Return the numbers of a result; none if the input is refused as it should be."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            result = call()
        except (ValueError, TypeError):
            return np.zeros(0)
    return np.asarray(result, dtype=float)


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


@FUZZ
@given(st.lists(NUMBERS, max_size=12), st.lists(NUMBERS, max_size=12), NUMBERS, st.booleans())
def test_a_run_of_any_numbers_has_a_spectrum_or_is_refused(signal, shaft, fs, as_angle):
    name = "angle" if as_angle else "velocity"

    def call():
        made = Recording({"a": signal}, fs, **{name: shaft})
        return psd(over_angle([made]), revolutions=0.1, short="pad")

    assert not np.isnan(survive(call)).any()


@FUZZ
@given(st.lists(NUMBERS, min_size=2, max_size=12), NUMBERS, st.booleans())
def test_the_quality_of_any_motion_is_told_in_numbers(shaft, fs, as_angle):
    name = "angle" if as_angle else "velocity"

    def call():
        made = Recording({"a": np.zeros(len(shaft))}, fs, **{name: shaft})
        return OrderResampler().quality([made]).drop(columns="warnings")

    assert not np.isnan(survive(call)).any()


@FUZZ
@given(ANYTHING, st.one_of(st.none(), ANYTHING))
def test_anything_is_resampled_or_refused(X, reference):
    def call():
        resampler = OrderResampler(THETA_S, fs=100, reference=reference)
        recordings = resampler.fit_transform(X)
        return np.concatenate([s.signals.ravel() for r in recordings for s in r.strokes] or [[]])

    assert not np.isnan(survive(call)).any()


@FUZZ
@given(
    st.sampled_from(sorted(OrderResampler().get_params().keys() - {"n_jobs"})),
    VALUES,
)
def test_any_option_of_the_resampler_is_taken_or_refused(name, value):
    def call():
        resampler = OrderResampler(**({"theta_s": THETA_S} | {name: value}))
        recordings = resampler.fit_transform([run()])
        return np.concatenate([s.signals.ravel() for r in recordings for s in r.strokes] or [[]])

    assert not np.isnan(survive(call)).any()


@FUZZ
@given(ANYTHING, st.sampled_from([None, THETA_S]))
def test_a_spectrum_of_anything_is_estimated_or_refused(X, theta_s):
    assert not np.isnan(survive(lambda: OrderPSD(2, theta_s=theta_s).fit_transform(X))).any()


@FUZZ
@given(
    st.sampled_from(sorted(OrderPSD().get_params().keys() - {"n_jobs", "verbose", "memory"})),
    VALUES,
    st.sampled_from(["raise", "pad"]),
)
def test_any_option_of_the_spectrum_is_taken_or_refused(name, value, short):
    X = over_angle([run()])
    options = {"revolutions": 2, "short": short} | {name: value}
    assert not np.isnan(survive(lambda: OrderPSD(**options).fit_transform(X))).any()


@FUZZ
@given(ANYTHING)
def test_bins_of_anything_are_made_or_refused(X):
    assert not np.isnan(survive(lambda: BinTransformer(max_order=8).fit_transform(X))).any()


@FUZZ
@given(st.sampled_from(sorted(BinTransformer().get_params())), VALUES)
def test_any_option_of_the_bins_is_taken_or_refused(name, value):
    table = OrderTable(np.ones((2, 33)), order_columns(["a"], np.arange(33) / 2))
    options = {"max_order": 8} | {name: value}
    result = survive(lambda: BinTransformer(**options).fit_transform(table))
    assert not np.isnan(result).any()


@FUZZ
@given(st.lists(st.tuples(NUMBERS, NUMBERS), max_size=3), st.lists(NUMBERS, max_size=4))
def test_any_bands_and_edges_make_bins_that_are_not_negative_or_are_refused(stop_bands, edges):
    table = OrderTable(np.ones((2, 33)), order_columns(["a"], np.arange(33) / 2))
    bins_of = BinTransformer(edges=edges, stop_bands=stop_bands)
    assert (survive(lambda: bins_of.fit_transform(table)) >= 0).all()


@FUZZ
@given(st.sampled_from(sorted(CostSensitiveGaussianBayes().get_params())), VALUES)
def test_any_option_of_the_classifier_is_taken_or_refused(name, value):
    result = survive(lambda: classifier(**{name: value}).risk(features(1)[0]))
    assert not np.isnan(result).any()


@FUZZ
@given(
    st.dictionaries(
        st.tuples(*[st.sampled_from(["healthy", "worn", "inspect", 0, None])] * 2),
        NUMBERS,
        max_size=4,
    )
)
def test_any_mapping_of_costs_is_taken_or_refused(cost):
    result = survive(lambda: classifier(cost=cost).risk(features(1)[0]))
    assert not np.isnan(result).any()


@FUZZ
@given(st.lists(NUMBERS, max_size=4), st.lists(NUMBERS, max_size=4))
def test_any_numbers_for_priors_and_costs_are_taken_or_refused(priors, cost):
    result = survive(lambda: classifier(priors=priors).risk(features(1)[0]))
    assert not np.isnan(result).any()
    square = [cost[:2], cost[2:]]
    result = survive(lambda: classifier(cost=square).risk(features(1)[0]))
    assert not np.isnan(result).any()


@FUZZ
@given(ANYTHING, ANYTHING, ANYTHING)
def test_the_cost_of_any_decisions_is_a_number_or_refused(truth, decision, cost):
    assert not np.isnan(survive(lambda: expected_cost(truth, decision, cost=cost))).any()
