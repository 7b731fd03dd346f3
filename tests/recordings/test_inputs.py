"""Every estimator reads X in the same way, and refuses the same things with the same words."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone

from emacm import (
    EnvelopeDetector,
    FaultLines,
    OrderCrossSpectrum,
    OrderPSD,
    OrderResampler,
    Recording,
    RecordingStatistics,
)
from emacm.orders.columns import OrderTable, order_columns
from emacm.recordings.inputs import as_list, as_recordings, check_channels


def run(*channels, **meta):
    rng = np.random.default_rng(4)
    signals = {name: rng.normal(size=900) for name in channels or ("torque", "current")}
    return Recording(signals, 300, velocity=np.full(900, 31.0), meta=meta)


OVER_TIME = [OrderResampler(), EnvelopeDetector((20, 60)), RecordingStatistics(by_direction=False)]
OVER_ANGLE = [OrderPSD(2), OrderCrossSpectrum(2)]
ALL = [pytest.param(model, id=type(model).__name__) for model in OVER_TIME + OVER_ANGLE]


@pytest.mark.parametrize("model", ALL)
@pytest.mark.parametrize("X", ["runs/a.csv", Path("runs/a.csv")], ids=["text", "path"])
def test_a_path_for_X_is_refused_with_what_to_do(model, X):
    with pytest.raises(TypeError, match=r"X must be a list.*'runs/a.csv'.*use open_recording"):
        model.fit(X)


@pytest.mark.parametrize("model", ALL)
def test_a_single_recording_an_empty_list_and_a_set_are_refused(model):
    single = run() if model in OVER_TIME else OrderResampler().fit_transform([run()])[0]
    with pytest.raises(TypeError, match=r"list of recordings, got a single one; write \[recording"):
        model.fit(single)
    with pytest.raises(ValueError, match="X contains no recording; at least one"):
        model.fit([])


@pytest.mark.parametrize("model", [p for p in ALL if p.id != "OrderPSD"])
@pytest.mark.parametrize("X", [{1, 2}, pd.DataFrame({0: [1, 2]}), {"a": 1}, iter([1]), 2.5, None])
def test_what_is_no_list_is_refused(model, X):
    with pytest.raises(TypeError, match="X must be a list of recordings, got"):
        model.fit(X)


def test_every_step_says_alike_which_channel_a_recording_lacks():
    models = [OrderResampler(), RecordingStatistics(by_direction=False)]
    X, other = [run(load=20)], run("torque", "speed", load=40)
    words = r"recording 1 \(load=40\) has no channel 'current'; its channels are \['torque'"
    for model in models:
        with pytest.raises(ValueError, match=words):
            model.fit([*X, other])
    over_angle = OrderResampler().fit_transform(X) + OrderResampler().fit_transform([other])
    for model in (OrderPSD(2), OrderCrossSpectrum(2)):
        with pytest.raises(ValueError, match=words):
            model.fit(over_angle)


def test_channels_in_another_order_are_refused_where_the_order_counts():
    there, back = run("torque", "current"), run("current", "torque")
    check_channels([back], there.channels)
    check_channels([back], there.channels, others=False)
    with pytest.raises(ValueError, match=r"order \['current', 'torque'\], expected was \['torque'"):
        check_channels([there, back], there.channels, ordered=True)


def test_further_channels_are_refused_only_where_they_are_not_expected():
    more = run("torque", "noise", "current", "heat", unit="B")
    check_channels([more], ("torque", "current"))
    with pytest.raises(ValueError, match=r"recording 0 \(unit='B'\) has a channel 'noise' besides"):
        check_channels([more], ("torque", "current"), others=False)


def test_sequences_and_arrays_are_lists():
    runs = [run(), run()]
    boxed = np.empty(2, dtype=object)
    boxed[:] = runs
    for X in (runs, tuple(runs), boxed):
        assert as_list(X) == runs


SPECTRA = OrderTable(np.ones((1, 122)), order_columns(["torque", "current"], np.arange(61) / 20))
WITH_CHANNELS = [
    (OrderResampler(), [run()]),
    (EnvelopeDetector((20, 60)), [run()]),
    (RecordingStatistics(by_direction=False), [run()]),
    (FaultLines({"BPFO": 0.7}, harmonics=2), SPECTRA),
]


@pytest.mark.parametrize(("model", "X"), WITH_CHANNELS, ids=lambda v: type(v).__name__)
@pytest.mark.parametrize(
    ("channels", "error", "message"),
    [
        ("torque", TypeError, r"list of names such as \['torque'\], got 'torque'"),
        (2, TypeError, "list of names such as .*, got 2"),
        ({"torque", "current"}, TypeError, "list of names such as .*, got {'"),
        (iter(["torque"]), TypeError, "It can be read only once; write list"),
        ([0], TypeError, r"list of names such as .*, got \[0\]"),
        ([], ValueError, "at least one name"),
        (["torque", "torque"], ValueError, r"each once; got \['torque', 'torque'\]"),
        (["sound"], ValueError, "no channel 'sound'"),
    ],
)
def test_every_estimator_reads_its_channels_in_the_same_way(model, X, channels, error, message):
    with pytest.raises(error, match=message):
        clone(model).set_params(channels=channels).fit(X)


def test_recordings_over_angle_and_other_things_are_no_recordings_over_time():
    over_angle = OrderResampler().fit_transform([run(unit="A")])
    with pytest.raises(TypeError, match=r"recording 0 \(unit='A'\) is over the shaft .*put Prewh"):
        as_recordings(over_angle, "Prewhitening")
    assert as_recordings(over_angle, "Prewhitening", also=(type(over_angle[0]),)) == over_angle
    with pytest.raises(TypeError, match=r"entry 1 of X must be a recording for Pr.*got a list"):
        as_recordings([run(), [1.0]], "Prewhitening")


def test_a_series_of_recordings_is_a_list_of_them():
    X = [run(f"c{k}", "speed") for k in (1, 2, 3)]
    table = pd.DataFrame({"recording": X}, index=[7, 5, 3])
    assert as_list(table["recording"]) == X
    found = OrderResampler(channels=["speed"]).fit_transform(table["recording"])
    assert [row.measured for row in found] == X
