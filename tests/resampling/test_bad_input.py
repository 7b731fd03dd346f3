"""Facts about bad input of the resampler: what was expected, what came, where, what to do."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from anything import ANYTHING, FUZZ, NUMBERS, VALUES, survive
from bad_input import (
    THETA_S,
    Case,
    T,
    V,
    check_it_ends,
    check_refused,
    each,
    forward_only,
    over_angle,
    run,
)
from hypothesis import given
from hypothesis import strategies as st
from sklearn.pipeline import make_pipeline

from emacm import OrderPSD, OrderResampler, Recording


def bare(n_channels=3):
    return np.random.default_rng(0).normal(size=(2, n_channels, 300)) + 30


def after_fit(X, **options):
    """Transform other recordings than those of fit."""
    return OrderResampler(THETA_S, **options).fit([run(0), run(1)]).transform(X)


def standing():
    return run(velocity=np.zeros(600), meta={"unit": "S1"})


CASES = [
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
        "use open_recording",
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
        "OrderResampler must come first",
    ),
    Case(
        "a bare array without a rate",
        lambda: OrderResampler(reference=0).fit(bare()),
        V,
        "recording 0",
        "bare ndarray",
        "neither a sampling rate",
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


@each(CASES)
def test_bad_input_is_refused_with_what_where_and_what_to_do(case):
    check_refused(case)


@pytest.mark.parametrize("transform", [after_fit, OrderResampler().fit])
def test_the_first_broken_recording_is_the_one_named(transform):
    X = [run(), 5, "six"]
    with pytest.raises(TypeError, match=r"recording 1: .* got 5"):
        transform(X)


ENDLESS = {
    "a table of strokes that are noise at rest": """
speed = np.full(2000, 30.0)
speed[1900:] = 1e-3 * rng.standard_normal(100)
run = Recording({"a": rng.normal(size=2000)}, 1000, velocity=speed)
result = OrderResampler(2 * np.pi / 64).fit_transform([run])[0].frame()
""",
    "a huge theta_s": """
run = Recording({"a": rng.normal(size=500)}, 100, velocity=np.full(500, 6.0))
try:
    result = OrderResampler(1e300).fit_transform([run])[0].frame()
except ValueError as error:
    assert "theta_s" in str(error)
    result = 0
""",
}


@pytest.mark.slow
@pytest.mark.parametrize("code", ENDLESS.values(), ids=ENDLESS.keys())
def test_it_comes_to_an_end(code):
    check_it_ends(code)


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
