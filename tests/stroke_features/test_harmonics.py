"""Facts about shaft-locked lines: amplitude and phase at any motion, absolute and relative."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emacm import OrderResampler, Recording, ShaftHarmonics
from emacm.stroke_features.harmonics import harmonic_coefficients, whole_revolutions

FS = 1000
TURN = 2 * np.pi
TIMES = np.arange(6 * FS) / FS
MOTIONS = {
    "constant": 40 * TIMES + 0.8,
    "ramping": 5 * TIMES + 8 * TIMES**2,
    "reversing": 80 * np.sin(TURN * TIMES / 6) + 3,
}
motions = pytest.mark.parametrize("motion", MOTIONS)


def line(angle, amplitude=2.0, phase=0.6, order=1):
    return amplitude * np.cos(order * angle - phase)


def recording(angle, signal, **options):
    return Recording({"current": signal}, FS, angle=angle, **options)


def lines(recordings, **options):
    options = {"by_direction": False, **options}
    return ShaftHarmonics(**options).fit_transform(recordings)


@motions
@pytest.mark.parametrize("resample", [False, True])
def test_amplitude_and_phase_of_a_tone_are_found_at_any_motion(motion, resample):
    angle = MOTIONS[motion]
    signal = 5 + 0.01 * TIMES + line(angle) + line(angle, 0.5, 2.0, order=3)
    X = [recording(angle, signal)]
    X = OrderResampler(TURN / 64).fit_transform(X) if resample else X
    found = lines(X, orders=(1, 3)).reshape(2, 2)
    known = [[2 * np.cos(0.6), 2 * np.sin(0.6)], [0.5 * np.cos(2), 0.5 * np.sin(2)]]
    np.testing.assert_allclose(found, known, atol=5e-3)


def test_a_line_stands_at_the_same_place_of_the_shaft_in_both_directions():
    angle = MOTIONS["reversing"]
    found = lines([recording(angle, line(angle))], orders=(1,), by_direction=True)
    np.testing.assert_allclose(found.reshape(2, 2), [[2 * np.cos(0.6), 2 * np.sin(0.6)]] * 2)


def test_parts_of_the_stroke_have_lines_of_their_own():
    angle = np.linspace(0, 40 * TURN, 8000)
    growing = np.where(angle < 20 * TURN, 1.0, 3.0) * np.cos(angle)
    found = ShaftHarmonics((1,), n_sections=4, by_direction=False).set_output(transform="pandas")
    table = found.fit_transform([recording(angle, growing)])
    assert table.columns.tolist() == [
        f"current:{part}of4:{wave}1" for part in (1, 2, 3, 4) for wave in ("cos", "sin")
    ]
    np.testing.assert_allclose(table.to_numpy()[0, ::2], [1, 1, 3, 3], atol=0.01)


def test_strokes_are_averaged_as_vectors_so_that_opposite_ones_cancel():
    speed = np.repeat([TURN, -TURN], 21 * FS // 2)  # ten whole revolutions and a half
    angle = np.cumsum(np.tile(speed, 2)) / FS
    sign = np.repeat([1.0, -1.0], 21 * FS)
    found = lines([recording(angle, sign * np.cos(angle))], orders=(1,), phase=None, min_speed=1)
    assert found[0, 0] == pytest.approx(0, abs=1e-3)


def test_parts_of_less_than_a_revolution_are_refused():
    angle = np.linspace(0, 5 * TURN, 1000)
    with pytest.raises(ValueError, match=r"each of 6 sections of a stroke, .* has 5 revolutions"):
        lines([recording(angle, np.cos(angle))], n_sections=6)


def test_the_phase_of_an_integrated_velocity_is_refused_and_its_amplitude_is_not():
    moving = Recording({"current": line(MOTIONS["constant"])}, FS, velocity=np.full(6 * FS, 40.0))
    for X in ([moving], OrderResampler(TURN / 32).fit_transform([moving])):
        with pytest.raises(ValueError, match=r"recording 0: its shaft reference is a velocity"):
            lines(X)
        assert lines(X, orders=(1,), phase=None)[0, 0] == pytest.approx(2, rel=1e-3)


def test_joined_directions_have_no_shaft_angle():
    X = [recording(MOTIONS["reversing"], line(MOTIONS["reversing"]))]
    joined = OrderResampler(TURN / 32, direction="travel").fit_transform(X)
    with pytest.raises(ValueError, match="'travel', which has no shaft angle"):
        lines(joined)


# Coefficients

STEP = TURN / 64
EVEN = 0.7 + STEP * np.arange(64 * 5)
ACCELERATING = 0.7 + 30 * np.linspace(0.1, 1.2, 900) ** 2


def two_lines(angle, amplitude=2.0, phase=0.4):
    return amplitude * np.cos(angle - phase) + 0.5 * np.sin(2.5 * angle)


@pytest.mark.parametrize("angle", [EVEN, EVEN[::-1], ACCELERATING, -ACCELERATING])
def test_lines_are_found_exactly_at_any_motion_beside_level_and_trend(angle):
    found = harmonic_coefficients([angle], [40 - 0.3 * angle + two_lines(angle)], (1, 2.5))
    np.testing.assert_allclose(found[0], [2 * np.cos(0.4), 0], atol=1e-10)
    np.testing.assert_allclose(found[1], [2 * np.sin(0.4), 0.5], atol=1e-10)


def test_over_whole_revolutions_they_are_fourier_coefficients_of_the_synchronous_average():
    noise = np.random.default_rng(0).normal(size=EVEN.size)
    # Without its trend along the cosine and the sine, which the fit takes out.
    trend = EVEN - EVEN.mean()
    waves = np.array([np.cos(EVEN), np.sin(EVEN)]) * 2 / EVEN.size
    left = trend - (waves @ trend) @ np.array([np.cos(EVEN), np.sin(EVEN)])
    noise = noise - left * (left @ noise) / (left @ left)
    average = noise.reshape(5, 64).mean(axis=0)
    found = harmonic_coefficients([EVEN], [noise], (1,))
    assert found[0, 0] == pytest.approx(2 * np.mean(average * np.cos(EVEN[:64])), abs=1e-12)
    assert found[1, 0] == pytest.approx(2 * np.mean(average * np.sin(EVEN[:64])), abs=1e-12)


@pytest.mark.parametrize("other", [2, 3, 7.4])
def test_other_orders_stay_out_over_whole_revolutions(other):
    found = harmonic_coefficients([EVEN], [5 * np.cos(other * (EVEN - EVEN.mean()))], (1,))
    # An even function about the middle has no trend; what 7.4 leaks falls with the distance.
    size = np.hypot(*found[:, 0])
    assert size < (1e-12 if other == int(other) else 0.05)


def test_other_orders_stay_out_at_changing_speed_as_samples_count_by_their_angle():
    angle = TURN * 10 * np.linspace(0.2, 1, 4000) ** 2
    angle = angle[whole_revolutions(angle - angle[0])]
    found = harmonic_coefficients([angle], [5 * np.cos(3 * angle)], (1,))
    plain = np.linalg.lstsq(
        np.column_stack([np.ones_like(angle), angle, np.cos(angle), np.sin(angle)]),
        5 * np.cos(3 * angle),
        rcond=None,
    )[0]
    leaked = np.hypot(*found[:, 0])
    assert leaked < 0.02
    assert leaked < np.hypot(*plain[2:]) / 3


@given(st.floats(-10, 10))
def test_turning_the_zero_of_the_shaft_turns_the_vector_and_keeps_the_amplitude(shift):
    found = harmonic_coefficients([EVEN + shift], [two_lines(EVEN)], (1, 2.5))
    vector = (found[0] + 1j * found[1]) * np.exp(-1j * shift * np.array([1, 2.5]))
    np.testing.assert_allclose(vector, [2 * np.exp(0.4j), 0.5j], atol=1e-9)


def test_stretches_are_fitted_together_each_with_a_level_and_a_trend_of_its_own():
    rng = np.random.default_rng(1)
    angles = [EVEN[:200], EVEN[::-1][:90] + 2, EVEN[:5]]
    signals = [rng.normal(size=angle.size) for angle in angles]
    model = np.zeros((295, 8))
    stops = np.cumsum([0, *(angle.size for angle in angles)])
    for k, angle in enumerate(angles):
        rows = slice(stops[k], stops[k + 1])
        model[rows, :2] = np.column_stack([np.cos(angle), np.sin(angle)])
        model[rows, 2 + 2 * k : 4 + 2 * k] = np.column_stack([np.ones_like(angle), angle])
    known = np.linalg.lstsq(model, np.concatenate(signals), rcond=None)[0]
    found = harmonic_coefficients(angles, signals, (1,))
    np.testing.assert_allclose(found[:, 0], known[:2], atol=1e-12)


def test_whole_revolutions_lie_in_the_middle():
    travel = STEP * np.arange(64 * 4 + 32)
    assert whole_revolutions(travel) == slice(16, 16 + 64 * 4)


@pytest.mark.parametrize("n_sections", [1, 2, 3, 4])
def test_parts_of_whole_revolutions_share_no_sample(n_sections):
    travel = STEP * np.arange(64 * 12 + 20)
    parts = [whole_revolutions(travel, part, n_sections) for part in range(n_sections)]
    assert all((part.stop - part.start) % 64 == 0 for part in parts)
    assert all(a.stop <= b.start for a, b in itertools.pairwise(parts))
    assert parts[0].start >= 0
    assert parts[-1].stop <= len(travel)


def test_less_than_a_revolution_holds_none():
    assert whole_revolutions(STEP * np.arange(60)) is None
    assert whole_revolutions([0.0]) is None
    assert whole_revolutions([0.0, 7.0], 1, 2) is None
    assert whole_revolutions(STEP * np.arange(64 * 2), 0, 3) is None


def test_orders_above_half_the_samples_of_a_revolution_are_refused():
    with pytest.raises(ValueError, match=r"order 32 is above the Nyquist order 32 of 64 samples"):
        harmonic_coefficients([EVEN], [two_lines(EVEN)], (1, 32))


def test_orders_that_the_angle_cannot_tell_apart_are_refused():
    with pytest.raises(ValueError, match=r"do not separate the orders .* fewer orders"):
        harmonic_coefficients([EVEN], [two_lines(EVEN)], (1, 1 + 1e-12))


# Relative phases

SWAY = 80 * np.sin(TURN * np.arange(6 * FS) / FS / 6) + 3
FORWARD = np.gradient(SWAY) > 0


def relative_lines(recordings, orders=(1,)):
    return ShaftHarmonics(orders, phase="relative").fit_transform(recordings)


def two_ways(zero=0.0, lag=0.0, order=1):
    """A wave that stands at `zero` on the shaft, and elsewhere on the way back."""
    return 3 * np.cos(order * (SWAY - zero) - lag * ~FORWARD)


@settings(max_examples=20)
@given(st.floats(-10, 10))
def test_the_zero_of_the_shaft_angle_changes_nothing(zero):
    signal = two_ways(0.4, 0.7) + 0.5 * two_ways(1.0, 0.2, order=2)
    known = relative_lines([recording(SWAY, signal)], orders=(1, 2))
    found = relative_lines([recording(SWAY + zero, signal)], orders=(1, 2))
    np.testing.assert_allclose(found, known, atol=1e-6)


def test_the_phase_of_the_way_back_is_counted_from_the_way_out():
    found = relative_lines([recording(SWAY, two_ways(1.3, 0.7))]).reshape(2, 2)
    known = [[3, 0], [3 * np.cos(0.7), 3 * np.sin(0.7)]]
    np.testing.assert_allclose(found, known, atol=0.02)


def test_phases_are_those_of_shaft_harmonics_turned_by_one_angle():
    X = [recording(SWAY, two_ways(1.3, 0.7))]
    absolute, relative = (
        ShaftHarmonics((1,), phase=phase, n_sections=2).fit_transform(X).reshape(-1, 2) @ [1, -1j]
        for phase in ("absolute", "relative")
    )
    turned = relative / absolute
    np.testing.assert_allclose(turned, turned[0], atol=1e-9)
    assert abs(turned[0]) == pytest.approx(1)


def test_orders_that_are_no_multiples_of_the_first_are_refused():
    with pytest.raises(ValueError, match=r"whole multiples of the first one, .*order 1\.5"):
        relative_lines([recording(SWAY, SWAY)], orders=(1, 1.5))
