"""Facts about order tracking: amplitude and phase along the shaft."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp

from emacm import Recording, order_components, order_track
from emacm.displays import OrderMapDisplay, OrderTrackDisplay

FS = 2000.0
CRITICAL = 2 * np.pi * 25


def complex_of(track):
    return (track["amplitude"] * np.exp(1j * track["phase"])).to_numpy()


def run_up(duration, damping):
    """Return a recording of an unbalanced rotor, and its exact complex amplitude over time.

    With displacement ``real(a exp(i angle))``, the equation of motion is one of `a` alone.
    """
    acceleration = 2 * np.pi * 49 / duration

    def change(t, state):
        a, rate = state
        v = 2 * np.pi + acceleration * t
        force = v**2 - 1j * acceleration
        stiffness = CRITICAL**2 - v**2 + 1j * acceleration + 2j * damping * CRITICAL * v
        return rate, force - 2 * (1j * v + damping * CRITICAL) * rate - stiffness * a

    time = np.arange(round(duration * FS)) / FS
    options = {"method": "DOP853", "dense_output": True}
    motion = solve_ivp(change, (0, time[-1]), [0j, 0j], rtol=1e-8, atol=1e-10, **options)
    angle = 2 * np.pi * time + acceleration * time**2 / 2
    a = motion.sol(time)[0]
    noise = 1e-3 * np.random.default_rng(0).normal(size=len(time))
    return Recording({"x": np.real(a * np.exp(1j * angle)) + noise}, FS, angle=angle), time, a


@pytest.mark.parametrize(("damping", "revolutions", "latest"), [(0.05, 8, 1.03), (0.02, 4, 1.04)])
def test_a_rotor_in_a_run_up_is_followed_through_its_resonance(damping, revolutions, latest):
    recording, time, a = run_up(20.0, damping)
    track = order_track(recording, 1, revolutions=revolutions)
    track = track[track["time"] > 4]  # the amplitude is 1.5 % of that at the resonance before
    exact = np.interp(track["time"], time, a.real) + 1j * np.interp(track["time"], time, a.imag)
    ratio = complex_of(track) / exact
    assert np.abs(np.abs(ratio) - 1).max() < 0.01
    assert np.abs(np.angle(ratio, deg=True)).max() < 0.5
    assert np.median(np.abs(np.abs(ratio) - 1)) < 1e-3
    highest = track["speed"].iloc[track["amplitude"].argmax()]
    assert 1.0 < highest / CRITICAL < latest  # a run-up shows a resonance late


def test_forward_and_reverse_strokes_have_one_phase_relative_to_the_shaft_angle():
    time = np.arange(round(20 * FS)) / FS
    angle = 0.4 + 2 * np.pi * 30 * np.cos(2 * np.pi * time / 8)
    signal = 2 * np.cos(angle + 0.7) + 0.5 * np.cos(3.5 * angle - 2) + 100
    track = order_track(Recording({"i": signal}, FS, angle=angle), [3.5, 1])
    assert {-1, 1} == set(np.sign(track["speed"]))
    for order, amplitude, phase in ((1, 2, 0.7), (3.5, 0.5, -2)):
        rows = track[track["order"] == order]
        np.testing.assert_allclose(rows["amplitude"], amplitude, rtol=2e-3)
        np.testing.assert_allclose(rows["phase"], phase, atol=5e-3)


def test_no_segment_spans_a_standstill():
    turning = np.r_[np.full(4000, 60.0), np.zeros(4000), np.full(4000, 60.0)]
    angle = np.cumsum(turning) / FS
    signal = np.where(np.arange(12_000) < 6000, 1.0, 3.0) * np.cos(angle)
    track = order_track(Recording({"x": signal}, FS, angle=angle), 1)
    np.testing.assert_allclose(track["amplitude"].round(2).unique(), [1, 3], rtol=0.01)
    assert not track["time"].between(2, 4).any()


def test_an_amplitude_that_changes_evenly_is_found_in_the_middle_of_each_segment():
    turns = np.arange(64 * 40) / 64
    wave = np.exp(2j * np.pi * 3 * turns)
    signal = np.real((1 + 0.2j * turns + 0.01 * turns**2) * wave) + np.cos(2 * np.pi * 5 * turns)
    middles, found = order_components([signal, 2 * signal], 64, [3, 5])
    expected = 1 + 0.2j * middles + 0.01 * middles**2
    np.testing.assert_allclose(found[:, 0], [expected, 2 * expected], rtol=1e-9)
    np.testing.assert_allclose(found[0, 1], 1, rtol=1e-9)


@pytest.mark.parametrize(
    ("orders", "options", "word"),
    [([1, 1.2], {}, "Raise rev"), (100, {}, "sampling rate"), (1, {"revolutions": 1e4}, "hold")],
)
def test_what_cannot_be_separated_or_was_not_sampled_is_refused(orders, options, word):
    recording = Recording({"x": np.ones(40_000)}, FS, velocity=2 * np.pi * 25)
    with pytest.raises(ValueError, match=word):
        order_track(recording, orders, **options)


def test_people_read_rpm():
    recording, _, _ = run_up(10.0, 0.1)
    display = OrderTrackDisplay.from_recording(recording, 1)
    line = display.ax_[0].lines[0]
    assert line.get_xdata().max() == pytest.approx(3000, rel=0.03)
    assert display.ax_[1].get_xlabel() == "shaft speed [rpm]"
    by_speed = OrderMapDisplay.from_recording(recording, over="speed", ax=Figure().subplots())
    assert by_speed.ax_.get_xlim()[1] == pytest.approx(3000, rel=0.03)
    polar = OrderTrackDisplay.from_recording(recording, 1, polar=True)
    assert any(float(text.get_text()) > 1500 for text in polar.ax_[0].texts)
