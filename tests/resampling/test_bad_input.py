"""Facts about bad input of the resampler: what was expected, what came, where, what to do."""

import numpy as np
import pandas as pd
import pytest
from bad_input import THETA_S, Case, T, V, check_refused, each, forward_only, over_angle, run

from emacm import OrderResampler


def bare(n_channels=3):
    return np.random.default_rng(0).normal(size=(2, n_channels, 300)) + 30


def after_fit(X, **options):
    """Transform other recordings than those of fit."""
    return OrderResampler(THETA_S, **options).fit([run(0), run(1)]).transform(X)


def standing():
    return run(velocity=np.zeros(600), meta={"unit": "S1"})


ONE = [run()]
BARE = {"fs": 100, "reference": 0}
CASES = [
    *[
        Case(name, lambda X=X, options=options: OrderResampler(**options).fit(X), error, *words)
        for name, X, options, error, *words in [
            ("a single frame", pd.DataFrame({"a": [1.0]}), {}, T, "list of", "DataFrame"),
            ("two dimensions", np.ones((2, 5)), {}, V, "(n_recordings, n_channels", "(2, 5)"),
            ("numbers in the list", [run(), 5], {}, T, "recording 1", "a Recording", "5"),
            ("text in the list", ["a.csv"], {}, T, "recording 0", "use open_recording"),
            ("a recording over angle", over_angle(), {}, T, "recording 0", "must come first"),
            ("no rate", bare(), {"reference": 0}, V, "recording 0", "fs and reference"),
            ("no reference", bare(), {"fs": 100}, V, "recording 0", "fs and reference"),
            ("a reference beyond", bare(), {"fs": 100, "reference": 3}, V, "no channel 3"),
            ("unknown", bare(), {"fs": 100, "reference": "w"}, V, "no channel 'w'", "'x0'"),
            ("a list", bare(), {"fs": 100, "reference": ["x0"]}, V, "reference", "['x0']"),
            ("the shaft alone", bare(1), BARE, V, "recording 0", "at least one channel"),
            ("a nan", np.where(np.arange(300) == 9, np.nan, bare()), BARE, V, "sample 9"),
            ("one dimension", [np.ones(5)], BARE, V, "recording 0", "(n_channels, n_times)"),
            ("numbers for names", [pd.DataFrame(np.ones((50, 2)))], BARE, T, "channel names"),
            ("theta_s 0", ONE, {"theta_s": 0}, V, "theta_s", "at least 1e-05", "got 0"),
            ("theta_s nan", ONE, {"theta_s": np.nan}, V, "theta_s", "nan"),
            ("theta_s text", ONE, {"theta_s": "0.1"}, T, "theta_s", "'0.1'"),
            ("interpolation", ONE, {"interpolation": "best"}, V, "'linear', 'cubic'"),
            ("direction", ONE, {"direction": "best"}, V, "'strokes', 'forward'", "'best'"),
            ("antialias", ONE, {"antialias": "best"}, V, "antialias", "True, False"),
            ("reference_kind", ONE, {"reference_kind": "rpm"}, V, "'velocity', 'angle'"),
            ("negative min_speed", ONE, {"min_speed": -1}, V, "min_speed", "rad/s", "-1"),
            ("text for min_speed", ONE, {"min_speed": "1"}, T, "min_speed", "'1'"),
            ("no ratio", ONE, {"ratio": 0}, V, "ratio", "at least 1e-06"),
        ]
    ],
    *[
        Case(name, lambda X=X, options=options: after_fit(X, **options), V, *words)
        for name, X, options, *words in [
            ("a missing channel", [run(signals={"a": np.ones(600)})], {}, "recording 0", "'b'"),
            (
                "a channel too many",
                [run(), run(signals=dict.fromkeys("abc", np.ones(600)))],
                {},
                "recording 1",
                "a channel 'c'",
                "Set channels",
            ),
            ("a standing shaft", [run(), standing()], {}, "recording 1 (unit='S1')", "never"),
            ("a slow shaft", [run()], {"min_speed": 50}, "never turns", "min_speed = 50"),
            ("no reverse", [forward_only()], {"direction": "reverse"}, "never turns reverse"),
        ]
    ],
    Case("quality of a number", lambda: OrderResampler().quality([3]), T, "recording 0", "3"),
]


@each(CASES)
def test_bad_input_is_refused_with_what_where_and_what_to_do(case):
    check_refused(case)


@pytest.mark.parametrize("transform", [after_fit, OrderResampler().fit])
def test_the_first_broken_recording_is_the_one_named(transform):
    X = [run(), 5, "six"]
    with pytest.raises(TypeError, match=r"recording 1: .* got 5"):
        transform(X)
