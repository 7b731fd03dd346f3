"""Constant speed as a number, units, parts of a recording and its channels."""

import numpy as np
import pytest
from sklearn.pipeline import make_pipeline

from emacm import EnvelopeDetector, OrderPSD, OrderResampler, Recording
from emacm.displays import OrderMapDisplay, OrderSpectrumDisplay, RecordingDisplay

RNG = np.random.default_rng(5)


def two_rates(**options):
    """Ten seconds: vibration at 1200 Hz, current at 50 Hz, shaft at 300 Hz."""
    options = {"velocity": np.linspace(7.0, 9.0, 3000), "shaft_fs": 300} | options
    signals = {"vibration": RNG.normal(size=12_000), "current": RNG.normal(size=500)}
    fs = {"vibration": 1200, "current": 50}
    return Recording(signals, fs, units={"vibration": "g", "current": "A"}, **options)


# A constant speed


def test_a_number_is_a_constant_velocity():
    signal = RNG.normal(size=700)
    by_number = Recording({"b": signal}, 210.5, velocity=157.0)
    assert by_number == Recording({"b": signal}, 210.5, velocity=np.full(700, 157.0))
    assert by_number.duration == 700 / 210.5


def test_a_constant_velocity_has_the_rate_of_the_shaft():
    recording = two_rates(velocity=157)
    assert recording.shaft_fs == 300
    np.testing.assert_array_equal(recording.velocity, np.full(3000, 157.0))


# Units


def test_units_are_kept_and_compared():
    recording = two_rates()
    assert dict(recording.units) == {"vibration": "g", "current": "A"}
    plain = Recording({"b": [1.0, 2.0]}, 2, velocity=3.0)
    assert plain != Recording({"b": [1.0, 2.0]}, 2, velocity=3.0, units={"b": "g"})
    assert plain.digest == Recording({"b": [1.0, 2.0]}, 2, velocity=3.0, units={"b": "g"}).digest


@pytest.mark.parametrize(
    ("units", "error", "message"),
    [
        ({"torque": "Nm"}, ValueError, "units names 'torque', which is not a channel"),
        ({"b": 5}, TypeError, "the unit of channel 'b' must be a text"),
        ("g", TypeError, "units must map channels to units"),
    ],
)
def test_invalid_units_are_refused(units, error, message):
    with pytest.raises(error, match=message):
        Recording({"b": [1.0, 2.0]}, 2, velocity=3.0, units=units)


def test_figures_take_the_units_of_the_recording():
    pytest.importorskip("matplotlib")
    recording = two_rates()
    labels = [ax.get_ylabel() for ax in RecordingDisplay.from_recording(recording).ax_]
    assert labels[:2] == ["vibration [g]", "current [A]"]
    angles = OrderResampler(2 * np.pi / 20, channels=["vibration"])
    psd = OrderPSD(2.5, max_order=8)
    model = make_pipeline(angles, psd).fit([recording])
    display = OrderSpectrumDisplay.from_estimator(model, [recording])
    assert "g²/order" in np.ravel(display.ax_)[0].get_ylabel()
    order_map = OrderMapDisplay.from_recording(recording, "vibration", theta_s=2 * np.pi / 20)
    assert order_map.unit == "g"


# Cutting


def test_a_part_holds_the_samples_from_start_to_stop():
    recording = two_rates()
    part = recording.cut(2.0, 3.5)
    np.testing.assert_array_equal(
        part.signals["vibration"], recording.signals["vibration"][2400:4200]
    )
    np.testing.assert_array_equal(part.signals["current"], recording.signals["current"][100:175])
    np.testing.assert_array_equal(part.velocity, recording.velocity[600:1050])
    assert part.duration == 1.5
    assert (part.meta, part.units) == (recording.meta, recording.units)


@pytest.mark.parametrize(("start", "stop"), [(3, 2), (-1, 2), (2, 11), (10, None), (2, 2.001)])
def test_impossible_parts_are_refused(start, stop):
    with pytest.raises(ValueError, match=r"start|samples of"):
        two_rates().cut(start, stop)


def test_a_part_of_an_envelope_is_that_of_the_envelope():
    recording = Recording({"b": RNG.normal(size=3000)}, 1000, velocity=20.0)
    envelope = EnvelopeDetector((100, 300), channels=["b"]).fit_transform([recording])[0]
    part = envelope.cut(1.0, 2.0)
    whole = envelope.signals["b"]  # filtered in other blocks
    np.testing.assert_allclose(part.signals["b"], whole[1000:2000], rtol=0, atol=1e-12)


# Selecting and renaming


def test_channels_are_selected_in_the_order_given():
    recording = two_rates(meta={"unit": "B"})
    assert recording.select(["current", "vibration"]).channels == ("current", "vibration")
    only = recording.select(["current"])
    assert (only.channels, dict(only.fs), dict(only.units)) == (
        ("current",),
        {"current": 50.0},
        {"current": "A"},
    )
    assert only.meta == {"unit": "B"}


@pytest.mark.parametrize(
    ("method", "argument", "error", "message"),
    [
        ("select", ["torque"], ValueError, r"the recording has no channel 'torque'; its channels"),
        ("select", "current", TypeError, r"such as \['current'\]"),
    ],
)
def test_invalid_selections_and_names_are_refused(method, argument, error, message):
    with pytest.raises(error, match=message):
        getattr(two_rates(), method)(argument)
