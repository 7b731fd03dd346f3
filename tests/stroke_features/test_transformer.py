"""Facts about the named columns of strokes inside scikit-learn, and about what they refuse."""

import numpy as np
import pytest
from sklearn.base import clone

from emacm import OrderResampler, Recording, RecordingStatistics, ShaftHarmonics, StrokeProfile

TURN = 2 * np.pi
THETA_S = TURN / 32
KINDS = [
    RecordingStatistics(),
    StrokeProfile(5),
    ShaftHarmonics((1, 2.5)),
    ShaftHarmonics((1,), phase=None, n_sections=2),
    ShaftHarmonics((1, 2), phase="relative", n_sections=2),
]
kinds = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: str(kind))


def run(seed, worn=False, seconds=4, velocity=None):
    """A drive that goes forth, stands, and comes back; a worn one has more of order 1."""
    rng = np.random.default_rng(seed)
    times = np.arange(int(500 * seconds)) / 500
    if velocity is None:
        velocity = 50 * np.clip(3 * np.sin(TURN * times / seconds), -1, 1)
        velocity[np.abs(velocity) < 20] = 0
    angle = np.cumsum(velocity) / 500 + 0.3
    current = 3 + np.sign(velocity) + (2 if worn else 1) * np.cos(angle - 1)
    return Recording(
        {
            "current": current + 0.1 * rng.standard_normal(len(times)),
            "position": 0.01 * angle[::2] + 0.1 * rng.standard_normal(len(angle[::2])),
        },
        {"current": 500, "position": 250},
        angle=angle,
        shaft_fs=500,
        meta={"unit": seed},
    )


FLEET = [run(seed, worn=seed % 2 == 1, seconds=4 + seed % 3) for seed in range(6)]


def over_angle(recordings, **options):
    return OrderResampler(THETA_S, **options).fit_transform(recordings)


def forward_only():
    return run(99, velocity=np.full(2000, 30.0))


@pytest.mark.parametrize(
    ("features", "error", "message"),
    [
        (RecordingStatistics(("median",)), ValueError, "statistic must be one of .*; got 'median'"),
        (RecordingStatistics(()), ValueError, "statistics must contain each name once"),
        (RecordingStatistics("rms"), TypeError, "statistics must be a list of names, got 'rms'"),
        (RecordingStatistics({"rms"}), TypeError, "statistics must be a list"),  # it has no order
        (RecordingStatistics(None), TypeError, "statistics must be a list of names, got None"),
        (StrokeProfile(0), ValueError, "n_coefficients must be a whole number of at least 1"),
        (StrokeProfile(2.5), TypeError, "n_coefficients must be a whole number"),
        (StrokeProfile(10**9), ValueError, "at most 10000, got 1000000000"),
        (ShaftHarmonics(n_sections=10**7), ValueError, "n_sections .* at most 10000"),
        (ShaftHarmonics(1), TypeError, "orders must be a list of numbers"),
        (ShaftHarmonics("12"), TypeError, "orders must be a list of numbers"),
        (ShaftHarmonics([]), ValueError, "each order once"),
        (ShaftHarmonics([1, 1.0]), ValueError, "each order once"),
        (ShaftHarmonics((1, -1)), ValueError, "an order must be a number above 0, got -1"),
        (ShaftHarmonics(phase="yes"), ValueError, "phase must be one of 'absolute', 'relative', N"),
        (ShaftHarmonics(phase=True), ValueError, "phase must be one of"),
        (ShaftHarmonics(n_sections=0), ValueError, "n_sections must be a whole number of at least"),
    ],
)
def test_wrong_parameters_of_one_kind_are_refused(features, error, message):
    with pytest.raises(error, match=message):
        features.fit(FLEET)


@kinds
def test_pandas_output_has_the_names_and_the_same_numbers(kind):
    frame = clone(kind).set_output(transform="pandas").fit_transform(FLEET)
    assert list(frame.columns) == list(clone(kind).fit(FLEET).get_feature_names_out())
    assert frame.columns.is_unique
    np.testing.assert_array_equal(frame.to_numpy(), clone(kind).fit_transform(FLEET))


@kinds
@pytest.mark.parametrize("resampled", [False, True])
def test_each_column_contains_the_channel_and_the_direction_of_its_name(kind, resampled):
    X = over_angle(FLEET, min_speed=10) if resampled else FLEET
    both = clone(kind).set_params(channels=["position", "current"])
    both.set_output(transform="pandas")
    table = both.fit_transform(X)
    for channel in ("current", "position"):
        own = clone(both).set_params(channels=[channel]).fit_transform(X)
        np.testing.assert_array_equal(table[own.columns], own)
    assert table.columns[0].startswith("position")
    if kind.get_params().get("phase") == "relative":
        return  # reverse strokes alone have another reference
    # A reversed shaft: what was forward is reverse.
    backwards = [
        Recording(x.signals, x.fs, angle=-np.asarray(x.angle), shaft_fs=500, meta=x.meta)
        for x in FLEET
    ]
    backwards = over_angle(backwards, min_speed=10) if resampled else backwards
    turned = clone(both).fit_transform(backwards)
    absolute = kind.get_params().get("phase") == "absolute"
    for name in table:
        other = name.translate(str.maketrans("+-", "-+"))
        sign = -1 if absolute and ":sin" in name else 1
        np.testing.assert_allclose(turned[other], sign * table[name], rtol=1e-6, atol=1e-6)


@kinds
def test_a_recording_does_not_depend_on_the_others(kind):
    fitted = clone(kind).fit(FLEET[:2])
    np.testing.assert_array_equal(fitted.transform([FLEET[5]])[0], fitted.transform(FLEET)[5])


@kinds
def test_over_time_and_over_the_angle_the_numbers_agree_but_for_the_weight_of_samples(kind):
    # At constant speed a sample a time and a sample an angle are the same but for the ends.
    velocity = np.repeat([0.0, 40.0, 0.0, -40.0, 0.0], 1000)
    angle = np.cumsum(velocity) / 500
    smooth = Recording({"current": np.cos(angle) + 0.01 * angle}, 500, angle=angle)
    table = clone(kind).set_output(transform="pandas").fit_transform([smooth])
    resampled = clone(kind).set_output(transform="pandas").fit_transform(over_angle([smooth]))
    assert list(resampled.columns) == list(table.columns)
    np.testing.assert_allclose(resampled, table, rtol=0.02, atol=0.02)


@kinds
def test_a_recording_without_a_stroke_of_one_direction_is_named(kind):
    with pytest.raises(
        ValueError, match=r"recording 1 \(unit=99\): it has no reverse stroke .*by_direction=False"
    ):
        clone(kind).fit(FLEET).transform([FLEET[0], forward_only()])


@kinds
def test_without_directions_a_recording_of_one_direction_has_all_columns(kind):
    fitted = clone(kind).set_params(by_direction=False).fit(FLEET)
    assert np.isfinite(fitted.transform([forward_only()])).all()
    channels = {name.partition(":")[0] for name in fitted.get_feature_names_out()}
    assert channels == {"current", "position"}  # without a sign


@pytest.mark.parametrize(
    ("parameters", "error", "message"),
    [
        ({"by_direction": "yes"}, ValueError, "by_direction must be one of True, False"),
        ({"min_revolutions": -1}, ValueError, "min_revolutions must be a number at least 0"),
        ({"min_speed": -1}, ValueError, "min_speed must be a number of rad/s, at least 0"),
    ],
)
@kinds
def test_wrong_parameters_are_refused(kind, parameters, error, message):
    with pytest.raises(error, match=message):
        clone(kind).set_params(**parameters).fit(FLEET)


@kinds
def test_recordings_of_another_kind_than_in_fit_are_refused(kind):
    with pytest.raises(ValueError, match=r"over the shaft angle, but .* fitted on .* over time"):
        clone(kind).fit(FLEET).transform(over_angle(FLEET))
    with pytest.raises(ValueError, match=r"over time, but .* fitted on .* over the shaft angle"):
        clone(kind).fit(over_angle(FLEET)).transform(FLEET)


@kinds
def test_strokes_over_the_angle_keep_the_min_speed_they_were_found_with(kind):
    resampled = over_angle(FLEET, min_speed=10)
    agreeing = clone(kind).set_params(min_speed=10).fit_transform(resampled)
    np.testing.assert_array_equal(agreeing, clone(kind).fit_transform(resampled))
    with pytest.raises(ValueError, match="min_speed = 5 contradicts OrderResampler"):
        clone(kind).set_params(min_speed=5).fit(resampled)


@kinds
def test_strokes_shorter_than_min_revolutions_are_passed_over(kind):
    # At rest the shaft jitters by a hundredth of a revolution.
    jitter = 0.06 * np.random.default_rng(3).uniform(-1, 1, 300)
    velocity = np.repeat([0.0, 40.0, 0.0, -40.0, 0.0], [300, 1000, 300, 1000, 300])
    angle = np.cumsum(velocity) / 500
    rest, noisy = np.flatnonzero(velocity == 0).reshape(3, 300), angle.copy()
    noisy[rest] += jitter
    signal = 2 + np.cos(angle) + 0.1 * np.sin(np.arange(len(angle)))
    calm, jittery = (Recording({"current": signal}, 500, angle=way) for way in (angle, noisy))
    long = clone(kind).set_params(min_revolutions=1, min_speed=20)
    expected = clone(kind).set_params(min_speed=20).fit_transform([calm])
    np.testing.assert_allclose(long.fit_transform([jittery]), expected, rtol=0.05, atol=0.02)
    seen = over_angle([jittery], min_speed=20)
    assert len(seen[0].strokes) > 2
    resampled = long.set_params(min_speed=0).fit_transform(seen)
    np.testing.assert_allclose(resampled, expected, rtol=0.05, atol=0.05)
    with pytest.raises(ValueError, match=r"no forward stroke of two samples and 30 revolutions"):
        long.set_params(min_revolutions=30, by_direction=True).fit_transform(seen)


@kinds
@pytest.mark.parametrize("resampled", [False, True])
def test_directions_are_separated_where_there_are_both(kind, resampled):
    both, one = ([FLEET[0]], [forward_only()])
    if resampled:
        both, one = over_angle(both), over_angle(one)
    separate = clone(kind).set_params(by_direction="auto").fit(both)
    assert separate.by_direction_
    together = clone(kind).set_params(by_direction="auto").fit(one)
    assert not together.by_direction_
    expected = clone(kind).set_params(by_direction=False).fit_transform(one)
    np.testing.assert_array_equal(together.transform(one), expected)
