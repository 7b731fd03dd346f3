"""Facts of powers in octave and third-octave bands, which have fixed frequencies."""

import joblib
import numpy as np
import pandas as pd
import pytest
from scipy import signal
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV, GroupKFold

from emacm import (
    BandPowers,
    OrderMonitor,
    Recording,
    explain_decision,
    maintenance_report,
    outside_training,
    score,
    spectrum_recipe,
)

FS, SECONDS = 16_000, 3.0
T = np.arange(int(FS * SECONDS)) / FS


def run(x, fs=FS, velocity=60.0, **options):
    return Recording({"sound": x}, fs, velocity=velocity, **options)


def powers(x, **options):
    frame = BandPowers(**options).set_output(transform="pandas").fit_transform([run(x)])
    return frame.iloc[0].rename(lambda name: name.removeprefix("sound@"))


def noise(seed, n=48_000):
    return np.random.default_rng(seed).normal(size=n)


def test_bands_have_the_nominal_frequencies_and_touch():
    names = "25 31.5 40 50 63 80 100 125 160 200 250 315 400 500 630 800 1000 1250 1600 2000 2500"
    names += " 3150 4000 5000 6300"  # 3 s resolve 25 Hz, and 16 kHz do not hold 8000 Hz
    fitted = BandPowers().fit([run(T)])
    assert list(fitted.bands_["sound"]) == [f"{name}Hz" for name in names.split()]
    edges = np.array([*fitted.bands_["sound"].values()])
    np.testing.assert_allclose(edges[1:, 0], edges[:-1, 1], rtol=1e-12)
    np.testing.assert_allclose(edges[16], [891.250938, 1122.018454])  # 1000 Hz of IEC 61260-1


def test_a_tone_has_half_its_squared_amplitude_in_its_band():
    tones = [25.1189, 125.893, 1000.0, 5011.87]
    x = sum(k * np.sin(2 * np.pi * f * T + k) for k, f in enumerate(tones, 1))
    found = powers(x + 100)  # a mean is no power of a band
    for k, name in enumerate(("25Hz", "125Hz", "1000Hz", "5000Hz"), 1):
        assert found[name] == pytest.approx(k**2 / 2, rel=0.01)
    assert found.drop(["25Hz", "125Hz", "1000Hz", "5000Hz"]).max() < 0.01


def test_the_bands_of_a_noise_add_up_to_its_variance_in_their_range():
    x = np.cumsum(noise(0)) * 0.01 + noise(1)
    spectrum = np.abs(np.fft.rfft(x)) ** 2 / len(x) ** 2 * 2
    frequencies = np.fft.rfftfreq(len(x), 1 / FS)
    low, high = 1000 * 10 ** (np.array([-33, 17]) / 20)
    within = (frequencies >= low) & (frequencies < high)
    assert powers(x).sum() == pytest.approx(spectrum[within].sum(), rel=0.01)


def test_a_band_has_the_power_behind_a_filter_of_these_edges():
    x = noise(2, 20 * FS)
    found = powers(x, low=400, high=2500)
    for name in ("400Hz", "1000Hz", "2500Hz"):
        k = round(10 * np.log10(float(name[:-2]) / 1000))
        edges = 1000 * 10 ** (np.array([2 * k - 1, 2 * k + 1]) / 20)
        filtered = signal.sosfilt(signal.butter(8, edges, "bandpass", fs=FS, output="sos"), x)
        assert 10 * np.log10(found[name] / filtered.var()) == pytest.approx(0, abs=0.1)


def test_an_octave_is_three_third_octaves():
    thirds, octave = (
        BandPowers(bands, low=low, high=high).fit([run(T)]).bands_["sound"]
        for bands, low, high in (("third-octave", 200, 315), ("octave", 250, 250))
    )
    assert octave["250Hz"] == pytest.approx((thirds["200Hz"][0], thirds["315Hz"][1]))


def test_a_line_follows_the_shaft_and_a_resonance_does_not():
    sos = signal.butter(2, [1400, 1800], "bandpass", fs=FS, output="sos")
    found = {}
    for hz in (20, 40):
        x = np.sin(2 * np.pi * 10 * hz * T) + 0.3 * signal.sosfilt(sos, noise(hz))
        found[hz] = powers(x)
    assert found[20].drop("1600Hz").idxmax() == "200Hz"
    assert found[40].drop("1600Hz").idxmax() == "400Hz"
    assert found[20]["1600Hz"] == pytest.approx(found[40]["1600Hz"], rel=0.1)


def test_the_columns_are_those_of_fit():
    fitted = BandPowers().fit([run(T), run(T[: FS * 2])])  # the shorter one resolves 40 Hz
    assert fitted.get_feature_names_out()[0] == "sound@40Hz"
    assert fitted.transform([run(noise(0)), run(noise(0, 5 * 12_800), 12_800 * 2)]).shape == (2, 23)
    with pytest.raises(ValueError, match=r"recording 1: channel 'sound': it is sampled at 8000 Hz"):
        fitted.transform([run(T), run(T[::2], 8000)])
    with pytest.raises(ValueError, match=r"lasts 0\.25 s, but the band 40Hz needs at least 0\.43"):
        fitted.transform([run(T[:4000])])


def test_what_is_asked_for_and_cannot_be_is_refused():
    with pytest.raises(ValueError, match=r"the band 8000Hz ends at 8913 Hz.*Lower high"):
        BandPowers(high=8000).fit([run(T)])
    with pytest.raises(ValueError, match=r"the band 4Hz needs at least 4\.3.* s\. Raise low"):
        BandPowers(low=4).fit([run(T)])
    with pytest.raises(ValueError, match=r"has no third-octave band with low = 500"):
        BandPowers(low=500, high=400).fit([run(T)])
    slow = {"sound": T, "temperature": T[:30]}
    with_slow = Recording(slow, {"sound": FS, "temperature": 10}, velocity=6.0, shaft_fs=FS)
    with pytest.raises(ValueError, match=r"channel 'temperature', sampled at 10 Hz.*by channels="):
        BandPowers().fit([with_slow])


def test_channels_of_two_rates_have_their_own_bands():
    signals, rates = {"a": noise(0), "b": noise(0)[::8]}, {"a": FS, "b": FS / 8}
    both = Recording(signals, rates, velocity=60.0, shaft_fs=FS)
    names = BandPowers(low=500).fit([both]).get_feature_names_out().tolist()
    assert names[-3:] == ["b@500Hz", "b@630Hz", "b@800Hz"]
    assert names.index("b@500Hz") == names.index("a@6300Hz") + 1


STATES = np.tile(["healthy", "rub", "unbalance"], 8)
UNITS = np.repeat(np.arange(8), 3)


def machine(seed, state, gain=1.0, unit="Pa"):
    """Rubbing excites a resonance, and unbalance the 1x component, at speeds that differ."""
    hz = 20 + 3 * (seed % 8)
    rng = np.random.default_rng([seed, len(state)])
    times = np.arange(6000) / 4000
    sos = signal.butter(2, [700, 900], "bandpass", fs=4000, output="sos")
    x = rng.normal(size=6000) + np.exp(0.1 * rng.normal()) * np.sin(2 * np.pi * hz * times)
    x += (state == "unbalance") * 2 * np.sin(2 * np.pi * hz * times)
    x += (state == "rub") * signal.sosfilt(sos, 3 * rng.normal(size=6000))
    velocity, meta = 2 * np.pi * hz, {"unit": seed}
    return Recording({"sound": gain * x}, 4000, velocity=velocity, units={"sound": unit}, meta=meta)


X = [machine(unit, state) for unit, state in zip(UNITS, STATES, strict=True)]


@pytest.fixture(scope="module")
def fitted():
    groups = {"costsensitivegaussianbayes__groups": UNITS}
    return spectrum_recipe("bands").fit(X, STATES, **groups)


def test_a_search_on_units_left_out_chooses_orders_bands_or_both():
    choices = [{"featureunion__bands": ["drop"]}, {"featureunion__orders": ["drop"]}, {}]
    recipe = spectrum_recipe(
        max_order=8, revolutions=8, unknown=None, temperature=None, cost={("healthy", "rub"): 5}
    )
    search = GridSearchCV(recipe, choices, cv=GroupKFold(4), scoring="balanced_accuracy")
    search.fit(X, STATES, groups=UNITS)
    orders, bands, both = search.cv_results_["mean_test_score"]
    assert both > 0.9 > max(orders, bands)  # rubbing at 800 Hz has no order, 1x has no frequency
    assert search.best_params_ == {}
    names = clone(recipe).fit(X, STATES)[:-1].get_feature_names_out()
    assert {"sound@0-1", "sound@800Hz"} < set(names)


def test_frames_copies_and_processes_have_the_same_values(fitted, tmp_path):
    values = fitted[:-1].transform(X)
    frame = clone(fitted[:-1]).set_output(transform="pandas").fit_transform(X)
    assert isinstance(frame, pd.DataFrame)
    np.testing.assert_array_equal(frame, values)
    joblib.dump(fitted, tmp_path / "model")
    np.testing.assert_array_equal(joblib.load(tmp_path / "model")[:-1].transform(X), values)


def test_a_model_of_bands_knows_the_range_of_its_training(fitted):
    def stated(**options):
        return {s.kind for s in outside_training(fitted, [machine(3, "healthy", **options)])[0]}

    assert stated() == set()
    assert stated(gain=10) == {"level"}
    assert stated(unit="mPa") == {"unit"}


def test_a_dead_channel_has_no_decision_and_a_loud_one_is_unknown(fitted, tmp_path):
    dead = Recording({"sound": np.zeros(6000)}, 4000, velocity=130.0, meta={"unit": 1})
    faint = machine(1, "rub", gain=1e-4)
    with np.errstate(divide="ignore"):
        table = score(fitted, [dead, faint, X[1]])
    assert "column 'sound@50Hz', does not exist" in table["error"][0]
    assert "constant" in table["warnings"][0]
    assert table["decision"].tolist()[1:] == ["unknown", "rub"]
    (page,) = maintenance_report(fitted, [X[1]], tmp_path)[:1]
    assert "800Hz" in page.read_text(encoding="utf-8")


def test_an_explanation_names_the_band(fitted):
    explained = explain_decision(fitted, X[1], decision="rub", against="healthy")
    assert "800Hz" in explained.iloc[0].astype(str).str.cat()


def test_a_stream_of_a_model_of_bands_is_refused(fitted):
    with pytest.raises(ValueError, match="BandPowers, which needs whole recordings"):
        OrderMonitor(fitted, fs=4000, channels=("sound",), max_speed=300.0)
