"""Facts about shaft-locked lines relative to the forward wave."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emacm import Recording, ShaftHarmonics

FS = 1000
TURN = 2 * np.pi
SWAY = 80 * np.sin(TURN * np.arange(6 * FS) / FS / 6) + 3
FORWARD = np.gradient(SWAY) > 0


def recording(signal, angle=SWAY, **options):
    return Recording({"current": signal}, FS, angle=angle, **options)


def lines(recordings, **options):
    options = {"orders": (1,), **options}
    return ShaftHarmonics(phase="relative", **options).fit_transform(recordings)


def two_ways(zero=0.0, lag=0.0, order=1):
    """A wave that stands at `zero` on the shaft, and elsewhere on the way back."""
    return 3 * np.cos(order * (SWAY - zero) - lag * ~FORWARD)


@settings(max_examples=20)
@given(st.floats(-10, 10))
def test_the_zero_of_the_shaft_angle_changes_nothing(zero):
    signal = two_ways(0.4, 0.7) + 0.5 * two_ways(1.0, 0.2, order=2)
    known = lines([recording(signal)], orders=(1, 2))
    found = lines([recording(signal, SWAY + zero)], orders=(1, 2))
    np.testing.assert_allclose(found, known, atol=1e-6)


def test_the_phase_of_the_way_back_is_counted_from_the_way_out():
    found = lines([recording(two_ways(1.3, 0.7))]).reshape(2, 2)
    known = [[3, 0], [3 * np.cos(0.7), 3 * np.sin(0.7)]]
    np.testing.assert_allclose(found, known, atol=0.02)


def test_phases_are_those_of_shaft_harmonics_turned_by_one_angle():
    X = [recording(two_ways(1.3, 0.7))]
    absolute, relative = (
        ShaftHarmonics((1,), phase=phase, n_sections=2).fit_transform(X).reshape(-1, 2) @ [1, -1j]
        for phase in ("absolute", "relative")
    )
    turned = relative / absolute
    np.testing.assert_allclose(turned, turned[0], atol=1e-9)
    assert abs(turned[0]) == pytest.approx(1)


def test_orders_that_are_no_multiples_of_the_first_are_refused():
    with pytest.raises(ValueError, match=r"whole multiples of the first one, .*order 1\.5"):
        lines([recording(SWAY)], orders=(1, 1.5))
