"""Facts about shaft-locked lines of recordings: amplitude and phase at any motion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emacm import OrderResampler, Recording, ShaftHarmonics

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


@settings(max_examples=20)
@given(st.floats(-20, 20))
def test_an_amplitude_knows_no_zero_of_the_shaft(shift):
    angle = MOTIONS["reversing"]
    rough = line(angle) + np.random.default_rng(1).normal(size=angle.size)
    X = [recording(angle, rough), recording(angle + shift, rough)]
    for n_sections in (1, 3):
        found = lines(X, phase=None, n_sections=n_sections, by_direction=True)
        np.testing.assert_allclose(found[0], found[1], atol=1e-8)


def test_a_phase_turns_with_the_zero_of_the_shaft():
    angle = MOTIONS["constant"]
    found = lines([recording(angle + 0.9, line(angle))], orders=(1,))
    np.testing.assert_allclose(found, [[2 * np.cos(1.5), 2 * np.sin(1.5)]], atol=1e-9)


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


@pytest.mark.parametrize(
    ("parameters", "error", "message"),
    [
        ({"orders": 1}, TypeError, "orders must be a list of numbers"),
        ({"orders": "12"}, TypeError, "orders must be a list of numbers"),
        ({"orders": []}, ValueError, "each order once"),
        ({"orders": [1, 1.0]}, ValueError, "each order once"),
        ({"orders": (1, -1)}, ValueError, "an order must be a number above 0, got -1"),
        ({"phase": "yes"}, ValueError, "phase must be one of 'absolute', 'relative', None"),
        ({"phase": True}, ValueError, "phase must be one of"),
        ({"n_sections": 0}, ValueError, "n_sections must be a whole number of at least 1"),
        ({"n_sections": 10**7}, ValueError, "n_sections must be .* at most 10000, got 10000000"),
    ],
)
def test_wrong_parameters_are_refused(parameters, error, message):
    with pytest.raises(error, match=message):
        lines([recording(MOTIONS["constant"], TIMES)], **parameters)
