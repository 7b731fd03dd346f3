"""Facts about the course of a channel along the strokes of recordings."""

import numpy as np
import pytest

from emacm import Recording, StrokeProfile

FS = 1000
TURN = 2 * np.pi
SPEED = np.repeat([0.0, 40.0, 0.0, -40.0, 0.0], FS)


def out_and_back(shape, speed=None):
    """A channel that is `shape` of the position of the screw, out as back."""
    speed = SPEED if speed is None else speed
    angle = np.concatenate([[0.0], np.cumsum(speed)[:-1]]) / FS
    return Recording({"force": shape(angle / np.ptp(angle))}, FS, angle=angle)


def profile(recording, n=4, **options):
    options = {"min_speed": 10, **options}
    return StrokeProfile(n, **options).fit_transform([recording])[0].reshape(-1, n)


def test_speed_does_not_change_a_profile_over_the_position():
    def shape(p):
        return np.sin(3 * p) + p**2

    steady = np.repeat([40.0, -40.0], 2 * FS)
    swinging = 40 * np.pi / 2 * np.sin(np.pi * np.arange(4 * FS) / FS / 2)
    found = [profile(out_and_back(shape, speed), 5, min_speed=0)[0] for speed in (steady, swinging)]
    np.testing.assert_allclose(found[1], found[0], atol=2e-3)


def test_few_coefficients_do_not_see_the_phase_of_the_first_order():
    angle = np.linspace(0, 24 * TURN, 5000)
    waves = [Recording({"force": np.sin(angle + phase)}, FS, angle=angle) for phase in (0, 1, 2, 3)]
    found = StrokeProfile(8, by_direction=False).fit_transform(waves)
    # A wave of amplitude 1; all low cosines together see less than a hundredth of its power.
    assert np.max(np.sum(found**2, axis=1)) < 0.005


def test_strokes_of_one_direction_are_averaged_by_their_lengths():
    speed = np.repeat([40.0, -40.0, 40.0], [1000, 4000, 3000])
    force = np.repeat([8.0, 0.0, 0.0], [1000, 4000, 3000])
    found = StrokeProfile(1).fit_transform([Recording({"force": force}, FS, velocity=speed)])
    assert found[0, 0] == pytest.approx(2, rel=2e-3)


@pytest.mark.parametrize(
    ("parameters", "error", "message"),
    [
        ({"n_coefficients": 0}, ValueError, "n_coefficients must be a whole number of at least 1"),
        ({"n_coefficients": 2.5}, TypeError, "n_coefficients must be a whole number"),
    ],
)
def test_wrong_parameters_are_refused(parameters, error, message):
    with pytest.raises(error, match=message):
        StrokeProfile(**parameters).fit([out_and_back(lambda p: p)])
