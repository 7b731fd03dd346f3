"""Facts about bad input of order spectra: what was expected, what came, where, what to do."""

import numpy as np
from bad_input import Case, T, V, check_refused, each, forward_only, over_angle, psd, run, spoilt

from emacm import OrderPSD


def later(X):
    return OrderPSD(2).fit(over_angle()).transform(X)


def by_direction(X, **options):
    return psd(over_angle(X), by_direction=True, **options)


def rows(X=None, **options):
    return OrderPSD(**({"revolutions": 2} | options)).fit(np.ones((2, 300)) if X is None else X)


VALUES = {
    "revolutions": ("number", [(0, V), (-1, V), (np.nan, V), ("2", T), (None, T)]),
    "n_per_segment": ("whole number", [(1.5, T), (0, V), (1, V), ("a", T)]),
    "overlap": ("at least 0 and below 1", [(1, V), (-0.1, V), (np.nan, V), ("half", T)]),
    "max_order": ("orders", [(-1, V)]),
    **dict.fromkeys(
        ("detrend", "scaling", "average", "short", "by_direction"), ("one of", [("best", V)])
    ),
}
WINDOWS = ["best", ("best", 3), "kaiser", ("kaiser", "x"), ("hann", 3), ()]
THREE = dict.fromkeys("abc", spoilt(0, 0))
CASES = [
    Case("a recording over time", lambda: psd([*over_angle(), run()]), T, "recording 2|over time"),
    Case("beside rows", lambda: psd([*over_angle(), np.ones(300)]), T, "OrderPSD|entry 2"),
    Case("a nan", lambda: rows([np.ones(300), spoilt(11, np.nan)]), V, "row 1|finite"),
    Case(
        "no reverse stroke by direction",
        lambda: by_direction([run(), forward_only()], revolutions=1),
        V,
        "recording 1 (unit='F7')|no reverse stroke",
    ),
    Case(
        "no reverse stroke to pad",
        lambda: by_direction([forward_only()], short="pad"),
        V,
        "recording 0 (unit='F7')|no reverse stroke",
    ),
    Case("too short", lambda: psd(revolutions=0.01), V, "revolutions = 0.01|32 samples per rev"),
    *(
        Case(f"{name}={value!r}", lambda n=name, v=value: psd(**{n: v}), error, f"{name}|{word}")
        for name, (word, values) in VALUES.items()
        for value, error in values
    ),
    *(
        Case(f"rows, {n!r}", lambda n=n: rows(n_per_segment=n), error, "n_per_segment|whole number")
        for n, error in VALUES["n_per_segment"][1]
    ),
    *(Case(f"window={w!r}", lambda w=w: psd(window=w), (V, T), "window", repr(w)) for w in WINDOWS),
    Case("window of 7", lambda: psd(window=np.ones(7)), V, "window|64 samples of a segment"),
    Case("a window with a nan", lambda: psd(window=np.full(64, np.nan)), V, "window|finite"),
    Case(
        "a padded window given as an array",
        lambda: psd(revolutions=5, window=np.ones(160), short="pad"),
        V,
        "recording 0|window by name",
    ),
    Case("theta_s of zero for rows", lambda: rows(theta_s=0), V, "theta_s|at least 1e-05"),
    Case("another theta_s", lambda: later(over_angle(theta_s=0.1)), V, "recording 0|theta_s = 0.1"),
    Case(
        "other channels", lambda: later(over_angle(channels=[*"ba"])), V, "recording 0|['b', 'a']"
    ),
    Case(
        "a channel more",
        lambda: later(over_angle([run(signals=THREE)])),
        V,
        "recording 0|a channel 'c'",
    ),
    Case("rows after recordings", lambda: later(np.ones((2, 300))), (V, T), "recordings|rows"),
    Case(
        "directions of a travel",
        lambda: psd(over_angle(direction="travel"), by_direction=True),
        V,
        "by_direction|'travel'",
    ),
    Case("directions of rows", lambda: rows(by_direction=True), V, "by_direction|plain rows"),
]


@each(CASES)
def test_bad_input_is_refused_with_what_where_and_what_to_do(case):
    check_refused(case)


def test_a_padded_spectrum_of_strokes_that_are_noise_at_rest_comes_to_an_end():
    speed = np.full(600, 3.0)
    speed[570:] = 1e-3 * np.random.default_rng(0).standard_normal(30)
    found = psd(over_angle([run(velocity=speed)]), short="pad")
    assert np.isfinite(found).all()
