"""Facts about bad input of order spectra: what was expected, what came, where, what to do."""

import numpy as np
from bad_input import Case, T, V, check_refused, each, forward_only, over_angle, psd, run, spoilt

from emacm import OrderPSD


def psd_after_fit(X):
    return OrderPSD(2).fit(over_angle()).transform(X)


CASES = [
    Case(
        "a recording over time among others",
        lambda: psd([*over_angle(), run()]),
        T,
        "recording 2|over time",
    ),
    Case(
        "recordings mixed with rows",
        lambda: psd([*over_angle(), np.ones(300)]),
        T,
        "OrderPSD|entry 2",
    ),
    Case(
        "a nan in a row",
        lambda: OrderPSD(2, theta_s=0.1).fit([np.ones(300), spoilt(11, np.nan)]),
        V,
        "row 1|finite",
    ),
    Case(
        "no reverse stroke by direction",
        lambda: psd(over_angle([run(), forward_only()]), revolutions=1, by_direction=True),
        V,
        "recording 1 (unit='F7')|no reverse stroke",
    ),
    Case(
        "no reverse stroke to pad",
        lambda: psd(over_angle([forward_only()]), by_direction=True, short="pad"),
        V,
        "recording 0 (unit='F7')|no reverse stroke",
    ),
    Case(
        "revolutions too short for a segment",
        lambda: psd(revolutions=0.01),
        V,
        "revolutions = 0.01|32 samples per revolution",
    ),
    *[
        Case(
            f"revolutions={revolutions!r}",
            lambda r=revolutions: psd(revolutions=r),
            error,
            "revolutions|number",
        )
        for revolutions, error in [(0, V), (-1, V), (np.nan, V), ("2", T), (None, T)]
    ],
    *[
        Case(
            f"n_per_segment={n!r}, {kind}",
            lambda n=n, X=X: OrderPSD(2, n_per_segment=n).fit(X()),
            error,
            "n_per_segment|whole number",
        )
        for n, error in [(1.5, T), (0, V), (1, V), ("a", T)]
        for kind, X in [("recordings", over_angle), ("rows", lambda: np.ones((2, 300)))]
    ],
    *[
        Case(
            f"overlap={overlap!r}",
            lambda overlap=overlap: psd(overlap=overlap),
            error,
            "overlap|at least 0 and below 1",
        )
        for overlap, error in [(1, V), (-0.1, V), (np.nan, V), ("half", T)]
    ],
    *[
        Case(f"unknown {name}", lambda name=name: psd(**{name: "best"}), V, name, "must be one of")
        for name in ("detrend", "scaling", "average", "short", "by_direction")
    ],
    *[
        Case(
            f"window={window!r}",
            lambda window=window: psd(window=window),
            (V, T),
            "window",
            repr(window),
        )
        for window in ["best", ("best", 3), "kaiser", ("kaiser", "x"), ("hann", 3), ()]
    ],
    Case(
        "a window of wrong length",
        lambda: psd(window=np.ones(7)),
        V,
        "window|64 samples of a segment",
    ),
    Case("a window with a nan", lambda: psd(window=np.full(64, np.nan)), V, "window|finite"),
    Case(
        "a padded window given as an array",
        lambda: psd(revolutions=5, window=np.ones(160), short="pad"),
        V,
        "recording 0|window by name",
    ),
    Case("negative max_order", lambda: psd(max_order=-1), V, "max_order|orders"),
    Case(
        "theta_s of zero for rows",
        lambda: OrderPSD(theta_s=0).fit(np.ones((2, 300))),
        V,
        "theta_s|at least 1e-05",
    ),
    Case(
        "another theta_s than that of fit",
        lambda: psd_after_fit(over_angle(theta_s=0.1)),
        V,
        "recording 0|theta_s = 0.1",
    ),
    Case(
        "other channels than those of fit",
        lambda: psd_after_fit(over_angle(channels=["b", "a"])),
        V,
        "recording 0|['b', 'a']",
    ),
    Case(
        "a channel too many after fit of a spectrum",
        lambda: psd_after_fit(over_angle([run(signals=dict.fromkeys("abc", spoilt(0, 0)))])),
        V,
        "recording 0|a channel 'c'",
    ),
    Case(
        "rows after a fit on recordings",
        lambda: psd_after_fit(np.ones((2, 300))),
        (V, T),
        "recordings|rows",
    ),
    Case(
        "directions of a travel",
        lambda: psd(over_angle(direction="travel"), by_direction=True),
        V,
        "by_direction|'travel'",
    ),
    Case(
        "directions of rows",
        lambda: OrderPSD(by_direction=True).fit(np.ones((2, 300))),
        V,
        "by_direction|plain rows have no direction",
    ),
]


@each(CASES)
def test_bad_input_is_refused_with_what_where_and_what_to_do(case):
    check_refused(case)


def test_a_padded_spectrum_of_strokes_that_are_noise_at_rest_comes_to_an_end():
    speed = np.full(600, 3.0)
    speed[570:] = 1e-3 * np.random.default_rng(0).standard_normal(30)
    found = psd(over_angle([run(velocity=speed)]), short="pad")
    assert np.isfinite(found).all()
