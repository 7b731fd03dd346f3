"""A model states what is unusual about a recording: speed, rate, level, length, defects."""

import re

import numpy as np
import pytest
from order_models import log, order_bins
from sklearn.base import clone
from sklearn.pipeline import make_pipeline
from sklearn.tree import DecisionTreeClassifier

from emacm import (
    ConditionRouter,
    CostSensitiveGaussianBayes,
    EnvelopeDetector,
    OrderPSD,
    OrderResampler,
    Recording,
    RecordingStatistics,
    ShaftHarmonics,
    SynchronousAverage,
    describe_model,
    load_model,
    outside_training,
    save_model,
    score,
)

FS, SPEED, N = 3_000, 47.0, 12_000  # 30 revolutions in 4 s
CHANNELS = ("vibration", "current")


def run(seed, gain=(1.0, 1.0), speed=SPEED, fs=FS, n=N, load=20, worn=False, change=None):
    """Two channels of different level, with lines at orders 3.2 and 7, at nearly constant speed."""
    rng = np.random.default_rng(seed)
    velocity = speed * (1 + 0.02 * np.sin(2 * np.pi * np.arange(n) / n))
    angle = np.cumsum(velocity) / fs
    vibration = (2.0 if worn else 1.0) * np.sin(3.2 * angle) + 0.3 * rng.standard_normal(n)
    current = 15 * np.cos(7 * angle) + 2 * rng.standard_normal(n)
    signals = {"vibration": gain[0] * vibration, "current": gain[1] * current}
    if change:
        signals = change(signals)
    return Recording(signals, fs, velocity=velocity, meta={"load": load, "unit": f"u{seed}"})


def fitted(**options):
    X = [run(seed, worn=seed % 2 == 1, **options) for seed in range(8)]
    return pipeline().fit(X, ["healthy", "worn"] * 4), X


def pipeline(**options):
    bayes = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto", **options)
    return order_bins(log(), bayes)


def about(recording, model=None):
    """Return the statements as one text."""
    return "; ".join(each.text for each in outside_training(model or fitted()[0], [recording])[0])


def test_nothing_is_stated_of_recordings_like_those_of_the_training():
    model, X = fitted()
    assert outside_training(model, [*X, run(100), run(101, worn=True)]) == [[]] * 10


@pytest.mark.parametrize(("load", "texts"), [(21, []), (40, ["load 40, in the training 20"])])
def test_a_load_that_was_not_in_the_training_is_stated(load, texts):
    found = outside_training(fitted()[0], [run(11, load=load)])[0]
    assert [statement.text for statement in found] == texts


@pytest.mark.parametrize(("factor", "unit"), [(30 / np.pi, "rpm"), (0.5 / np.pi, "revolutions")])
def test_a_speed_in_another_unit_is_stated_with_that_unit(factor, unit):
    text = about(run(9, speed=SPEED * factor))
    way = "above" if factor > 1 else "below"
    assert re.search(f"rpm is {way} that of the training, .* rpm: is it in {unit}?", text)


def test_another_sampling_rate_is_stated_once_for_all_channels():
    text = about(run(9, fs=2_000, n=8_000))
    stated = "channels 'vibration', 'current': sampling rate 2000 Hz, in the training 3000 Hz"
    assert stated in text
    assert text.count("sampling rate") == 1
    assert "highest valid order 131" in text  # 1000 Hz at 7.63 revolutions per second


def test_a_gain_of_all_channels_is_one_statement():
    assert about(run(9, gain=(1000, 1000))) == "all channels 60 dB above training: gain or unit?"
    assert about(run(9, gain=(0.01, 0.01))) == "all channels 40 dB below training: gain or unit?"


def test_a_gain_of_one_channel_names_the_channel():
    assert about(run(9, gain=(1, 30))).startswith("channel 'current' 30 dB above training, 10.7")


def test_exchanged_cables_are_stated_as_such():
    swapped = run(9, change=lambda s: {"vibration": s["current"], "current": s["vibration"]})
    assert about(swapped) == (
        "levels of channels 'vibration', 'current' as if exchanged: are they swapped?"
    )


def test_a_router_compares_with_recordings_of_the_same_condition():
    X = [run(k, load=20 + 20 * (k % 2), gain=(1, 1 + 9 * (k % 2))) for k in range(12)]
    y = np.repeat(["healthy", "worn", "healthy"], 4)
    model = ConditionRouter(pipeline(), "load").fit(X, y)
    assert outside_training(model, X) == [[]] * 12
    (at_20, at_40) = outside_training(model, [run(13, gain=(1, 10), load=20), run(14, load=40)])
    assert at_20[0].text.startswith("channel 'current' 20 dB above training")
    assert at_40[0].text.startswith("channel 'current' 20 dB below training")


def test_an_envelope_is_compared_by_the_signal_it_is_computed_from():
    model = make_pipeline(
        EnvelopeDetector((700, 1100)), OrderResampler(2 * np.pi / 32), OrderPSD(4)
    ).fit([run(seed) for seed in range(4)])
    assert about(run(9), model) == ""
    assert about(run(9, gain=(10, 10)), model).startswith("all channels 20 dB above")


def test_a_model_of_tables_is_refused():
    model = CostSensitiveGaussianBayes().fit([[0.0], [1.0], [3.0], [5.0]], [0, 0, 1, 1])
    with pytest.raises(TypeError, match="contains no OrderResampler, which knows the range"):
        outside_training(model, [run(0)])


# New spectral lines, in bins of one order beside the line of the current at order 7


def with_new_line(seed, amplitude=1.0):
    wave = np.sin(6.4 * np.cumsum(run(seed).velocity) / FS)
    return run(seed, change=lambda s: s | {"current": s["current"] + amplitude * wave})


def test_beside_another_gain_no_lines_are_stated():
    model, _ = fitted()
    bad = with_new_line(9)
    signals = {"vibration": bad.signals["vibration"], "current": 10 * bad.signals["current"]}
    louder = Recording(signals, FS, velocity=bad.velocity, meta=bad.meta)
    for text in (about(louder, model), score(model, [louder])["outside_training"][0]):
        assert text.startswith("channel 'current' 20 dB above training")
        assert "line at" not in text


def test_a_recording_without_a_segment_is_stated_to_be_short():
    model = fitted()[0]
    assert about(run(9, n=N // 10), model).endswith("revolutions, in the training at least 29.92")


# What is stated of single recordings


def in_units(recording, **units):
    """Return a recording with the same samples, stated to be in other units."""
    signals = dict(recording.signals)
    return Recording(signals, FS, velocity=recording.velocity, units=units, meta=recording.meta)


@pytest.fixture(scope="module")
def in_g():
    X = [in_units(run(seed, worn=seed % 2 == 1), vibration="g", current="A") for seed in range(8)]
    return pipeline().fit(X, ["healthy", "worn"] * 4)


@pytest.mark.parametrize(
    ("unit", "remedy"),
    [("m/s²", "multiply it by 0.101972"), ("mV", "convert it"), ("counts", "convert it")],
)
def test_a_channel_in_another_unit_is_stated_whatever_its_level(in_g, unit, remedy):
    stated = f"channel 'vibration' is in {unit}, in the training in g: {remedy}, or correct the un"
    assert stated in about(in_units(run(9), vibration=unit), in_g)


@pytest.mark.parametrize("units", [{}, {"vibration": "g"}, {"vibration": "gn", "current": " A"}])
def test_the_same_unit_or_none_is_not_stated(in_g, units):
    assert about(in_units(run(9), **units), in_g) == ""


def test_units_are_stored_in_model_files(in_g, tmp_path):
    pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
    save_model(in_g, tmp_path / "model.emacm")
    described = describe_model(tmp_path / "model.emacm")["units"]
    assert described == [{"vibration": ["g"], "current": ["A"]}]
    table = score(load_model(tmp_path / "model.emacm"), [in_units(run(9), vibration="mV")])
    assert "channel 'vibration' is in mV, in the training in g" in table["outside_training"][0]


# Directions of rotation


def turning(seed, ways):
    """Return a recording whose shaft turns 15 revolutions in each of some directions."""
    rng = np.random.default_rng(seed)
    velocity = np.concatenate([way * np.full(6000, SPEED) for way in ways])
    signals = {name: rng.standard_normal(len(velocity)) for name in CHANNELS}
    return Recording(signals, FS, velocity=velocity)


FEATURES = [
    make_pipeline(OrderResampler(2 * np.pi / 32), OrderPSD(4, by_direction="auto")),
    make_pipeline(OrderResampler(2 * np.pi / 32), RecordingStatistics(by_direction="auto")),
    RecordingStatistics(by_direction="auto"),
    ShaftHarmonics((1,), phase=None, by_direction="auto"),
    make_pipeline(OrderResampler(2 * np.pi / 32), SynchronousAverage(by_direction="auto")),
]


@pytest.mark.parametrize("features", FEATURES)
@pytest.mark.parametrize(
    ("known", "new", "text"),
    [
        (1, (-1,), "100 % of the revolutions are in reverse, in the training only forward: check"),
        (-1, (1,), "100 % of the revolutions are forward, in the training only in reverse: check"),
        (1, (1, -1), "50 % of the revolutions are in reverse, in the training only forward: check"),
        (-1, (1, -1), "50 % of the revolutions are forward, in the training only in reverse"),
    ],
)
def test_a_direction_that_the_training_does_not_have_is_stated(features, known, new, text):
    model = make_pipeline(clone(features), DecisionTreeClassifier(random_state=0))
    X, y = [turning(seed, (known,)) for seed in range(6)], ["healthy", "worn"] * 3
    model.fit(X, y)
    assert outside_training(model, X) == [[]] * 6
    stated = outside_training(model, [turning(9, new)])[0]
    assert [text in each.text for each in stated if each.kind == "direction"] == [True]


def test_directions_of_the_training_and_short_moves_are_not_stated():
    separate = [turning(seed, (way,)) for seed, way in enumerate((1, -1, 1, -1))]
    rocking = turning(0, (1,) * 10 + (-1,))  # 9 % of the revolutions
    for X, new in (
        (separate, turning(9, (1, -1))),
        ([turning(1, (1, -1)), turning(2, (1, -1))], turning(9, (-1,))),
        ([turning(1, (1,)), turning(2, (1,))], rocking),
    ):
        statistics = RecordingStatistics(by_direction=False).fit(X)
        assert outside_training(statistics, [new]) == [[]]
        resampler = OrderResampler(2 * np.pi / 32).fit(X)
        stated = outside_training(resampler, [new])[0]
        assert "direction" not in {statement.kind for statement in stated}
