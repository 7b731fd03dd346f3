"""Facts about synchronous averages and gear indicators: what stays, what goes, known values."""

import numpy as np
import pytest

from emacm import GearIndicators, OrderResampler, Recording, SynchronousAverage
from emacm.stroke_features.gears import phase_modulation, residual_signal
from emacm.stroke_features.statistics import normalized_moment

TURN = 2 * np.pi
FS = 8000
N = 128
TEETH = 13
INDICATORS = ["FM0", "FM4", "M6A", "sidebands", "NA4", "NB4"]


def gearbox(seed=0, missing=0.0, turns=60, ratio=1.0, reverse=False, **names):
    """A gear of 13 teeth; the mesh loses a share of its amplitude at one tooth of 13."""
    rng = np.random.default_rng(seed)
    n_times = turns * 400
    times = np.arange(n_times) / FS
    angle = TURN * (turns - 0.3) * (times / times[-1] + 0.01 * np.sin(TURN * times / times[-1]))
    if reverse:
        angle = angle[-1] - angle
    of_gear = ratio * angle
    place = np.mod(of_gear, TURN) * TEETH / TURN  # in teeth
    mesh = np.cos(TEETH * of_gear) * (1 - missing * ((place >= 4) & (place < 5)))
    case = mesh + 0.3 * np.cos(2 * TEETH * of_gear + 1) + 0.05 * rng.normal(size=n_times)
    motor = 0.5 * np.cos(6.3 * of_gear)
    return Recording({"motor": motor, "case": case}, FS, angle=angle, **names)


def over_angle(*recordings, **options):
    return OrderResampler(TURN / N, **options).fit_transform(list(recordings))


def indicators(recordings, teeth=TEETH, fitted_on=None, **options):
    gears = GearIndicators(teeth, by_direction=False, **options).set_output(transform="pandas")
    return gears.fit(recordings if fitted_on is None else fitted_on).transform(recordings)


def test_fm4_of_a_gaussian_signal_is_3_and_m6a_15():
    noise = np.random.default_rng(0).normal(2.0, 5.0, size=1_000_000)
    assert normalized_moment(noise, 4) == pytest.approx(3, rel=0.01)
    assert normalized_moment(noise, 6) == pytest.approx(15, rel=0.05)


def test_one_missing_tooth_raises_fm4_and_more_for_m6a():
    healthy, broken = over_angle(gearbox(1), gearbox(2, missing=0.8))
    found = indicators([healthy, broken], fitted_on=[healthy])
    assert found["case:FM4"][0] < 4.5
    assert found["case:FM4"][1] > 7
    assert found["case:M6A"][1] / found["case:M6A"][0] > found["case:FM4"][1] / found["case:FM4"][0]
    assert found["case:NA4"][1] > 100 * found["case:NA4"][0]
    assert found["case:NB4"][1] > 100 * found["case:NB4"][0]


@pytest.mark.parametrize("error", [0.0, 0.005, 0.02])
@pytest.mark.parametrize("teeth", [13, 30])
def test_phase_modulation_is_the_error_of_the_angle_times_the_teeth(teeth, error):
    angle = TURN * np.arange(16 * teeth) / (16 * teeth)
    wrong = angle + error * np.sin(angle + 0.7)
    wheel = (1 + 0.3 * np.cos(angle)) * (np.cos(teeth * wrong) + 0.4 * np.sin(2 * teeth * wrong))
    noise = 0.01 * np.random.default_rng(0).normal(size=(2, len(angle)))
    found = phase_modulation(wheel + noise[0], teeth)
    assert found == pytest.approx(error * teeth, rel=0.12, abs=0.01)
    # Without a mesh, also where a resonance stands in its place: noise near it is as high.
    order = np.arange(len(angle) // 2 + 1) / teeth
    resonance = 1 / np.abs(1 - order**2 + 3j * order / teeth)  # 3 orders wide
    noise = np.random.default_rng(0).normal(size=(100, len(angle)))
    noise = np.fft.irfft(np.fft.rfft(noise) * resonance, len(angle))
    assert sum(phase_modulation(average, teeth) > 0 for average in noise) <= 2


def test_an_error_of_the_reference_hides_a_fault_and_is_stated():
    def measured(error, **options):
        recording = gearbox(**options)
        angle = recording.angle + error * np.sin(recording.angle)
        return Recording(dict(recording.signals), FS, angle=angle)

    sound, broken = over_angle(*(measured(0.0, seed=k, missing=m) for k, m in ((1, 0), (2, 0.1))))
    right = indicators([sound, broken], fitted_on=[sound])
    wrong = over_angle(*(measured(0.03, seed=k, missing=m) for k, m in ((1, 0), (2, 0.1))))
    with pytest.warns(UserWarning, match=r"recording 0: case: the phase.* 0\.[34].* in 2 of 2 rec"):
        seen = indicators(wrong, fitted_on=wrong[:1])
    assert right["case:FM4"][1] > 1.3 * right["case:FM4"][0]
    assert seen["case:FM4"][1] < 1.1 * seen["case:FM4"][0]
    assert seen["case:NB4"][1] > 10 * seen["case:NB4"][0]


def test_na4_of_a_recording_is_relative_to_the_recordings_of_fit():
    runs = over_angle(gearbox(1), gearbox(2), gearbox(3, missing=0.3))
    alone = indicators(runs[2:])
    relative = indicators(runs[2:], fitted_on=runs[:2])
    assert relative["case:NA4"][0] > 20 * alone["case:NA4"][0]
    assert relative["case:FM4"][0] == alone["case:FM4"][0]
    both = indicators(runs, fitted_on=runs[:2])
    np.testing.assert_array_equal(both.to_numpy()[2], relative.to_numpy()[0])


def test_the_average_is_exact_over_whole_revolutions():
    rng = np.random.default_rng(5)
    one_turn = rng.normal(size=N)
    signal = np.tile(one_turn, 21)[: 20 * N + 17]
    from emacm.stroke_features.gears import average_revolution
    from emacm.stroke_features.transformer import StrokeSignal

    travel = TURN / N * np.arange(len(signal))
    stroke = StrokeSignal(signal, travel, 0.0, 1)
    np.testing.assert_allclose(average_revolution([stroke], N), one_turn, atol=1e-12)


def test_what_another_shaft_does_averages_out():
    recording = gearbox(0, turns=200)
    average = SynchronousAverage(by_direction=False).fit_transform(over_angle(recording))
    motor, case = average.reshape(2, N)
    assert np.abs(motor).max() < 0.01  # 0.5 at order 6.3
    angle = TURN * np.arange(N) / N
    expected = np.cos(TEETH * angle) + 0.3 * np.cos(2 * TEETH * angle + 1)
    np.testing.assert_allclose(case, expected, atol=0.03)


def test_strokes_of_both_directions_are_aligned_at_the_shaft_angle():
    forward, reverse = over_angle(gearbox(0), gearbox(1, reverse=True))
    averages = SynchronousAverage(channels=["case"], by_direction=False)
    one, other = averages.fit_transform([forward, reverse])
    np.testing.assert_allclose(one, other, atol=0.06)


def test_columns_are_named_by_channel_and_indicator():
    rows = over_angle(gearbox(0))
    gears = GearIndicators(13, channels=["case"], by_direction=False).fit(rows)
    assert list(gears.get_feature_names_out()) == [f"case:{word}" for word in INDICATORS]
    average = SynchronousAverage(channels=["case"], by_direction=False).fit(rows)
    assert list(average.get_feature_names_out()[:2]) == ["case:average0", "case:average1"]
    assert len(average.get_feature_names_out()) == N


def test_forward_and_reverse_flanks_are_apart():
    t = np.arange(6 * FS) / FS
    angle = 60 * np.sin(TURN * t / 6)
    amplitude = np.where(np.gradient(angle) > 0, 1.0, 3.0)
    rows = over_angle(Recording({"case": amplitude * np.cos(9 * angle)}, FS, angle=angle))
    average = SynchronousAverage().fit_transform(rows).reshape(2, N)
    np.testing.assert_allclose(average.max(axis=1), [1, 3], rtol=0.01)


def test_the_difference_signal_lacks_mesh_and_first_sidebands_and_shaft():
    angle = TURN * np.arange(100) / 100
    kept = 0.2 * np.cos(3 * angle) + 0.1 * np.cos(14 * angle)
    regular = 7 + np.cos(angle) + np.cos(2 * angle) + np.cos(12 * angle) + np.cos(24 * angle)
    sides = np.cos(11 * angle) + np.cos(25 * angle)
    np.testing.assert_allclose(residual_signal(kept + regular, 12), kept, atol=1e-12)
    whole = kept + regular + sides
    np.testing.assert_allclose(residual_signal(whole, 12, sidebands=1), kept, atol=1e-12)
    np.testing.assert_allclose(residual_signal(whole, 12), kept + sides, atol=1e-12)


def test_a_silent_channel_gives_finite_indicators():
    angle = TURN * np.linspace(0, 40, 16_000)
    rows = over_angle(Recording({"case": np.zeros(16_000)}, FS, angle=angle))
    assert np.all(np.isfinite(indicators(rows).to_numpy()))


def test_what_cannot_be_averaged_is_refused():
    recording = gearbox(0)
    with pytest.raises(TypeError, match="put an OrderResampler before"):
        SynchronousAverage().fit([recording])
    odd = OrderResampler(0.05).fit_transform([recording])
    with pytest.raises(ValueError, match="samples per revolution"):
        SynchronousAverage(by_direction=False).fit(odd)
    travel = over_angle(recording, direction="travel")
    with pytest.raises(ValueError, match="direction='travel'"):
        SynchronousAverage(by_direction=False).fit(travel)
    slow = over_angle(recording, ratio=0.01)
    with pytest.raises(ValueError, match="no stroke of two samples and 1 revolutions"):
        SynchronousAverage(by_direction=False).fit_transform(slow)


@pytest.mark.parametrize(
    ("teeth", "error", "words"),
    [
        (63, ValueError, "63 teeth and 1 sidebands need more than 128 samples per revolution"),
        (2.5, TypeError, "teeth must be a whole number of at least 4"),
        (3, ValueError, "teeth must be a whole number of at least 4"),
    ],
)
def test_invalid_teeth_are_refused(teeth, error, words):
    with pytest.raises(error, match=words):
        GearIndicators(teeth).fit(over_angle(gearbox(0)))
