"""The steps from a vibration signal to its speed, each on a signal with a known answer."""

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.signal import hilbert

from emacm.shaft import speed_evidence
from emacm.shaft.line_families import orders_stand_out
from emacm.shaft.phase_refinement import (
    Course,
    _along,
    _analytic,
    _demodulated,
    _lines_of_shaft,
    _phase_speeds,
    refined_speed,
)
from emacm.shaft.speed_evidence import Evidence, Whitened, measure, whiten
from emacm.shaft.vibration import _at, _course, _covered, _margins, _most_likely_path, _windowed

TURN = 2 * np.pi
FS = 1000.0


def noise(n_times, seed=0):
    return np.random.default_rng(seed).normal(size=n_times)


def tones(frequencies, times, amplitude=1.0):
    return amplitude * sum(np.cos(TURN * f * times + f * f) for f in frequencies)


# Spectra of frames


def test_frames_overlap_by_half_and_the_last_one_ends_with_the_signal():
    signal = noise(21)
    powers, starts = speed_evidence._powers(signal, 8, np.zeros(1), 4.0)
    assert starts.tolist() == [0, 4, 8, 12, 13]
    assert speed_evidence._powers(signal[:20], 8, np.zeros(1), 4.0)[1].tolist() == [0, 4, 8, 12]
    window = np.sin(np.pi * np.arange(1, 9) / 9) ** 2
    window /= np.sqrt((window**2).sum())
    expected = [np.abs(np.fft.rfft(signal[k : k + 8] * window)) ** 2 for k in starts]
    np.testing.assert_allclose(powers[:, 0], expected, rtol=1e-12)
    lower = speed_evidence._powers(signal, 8, np.zeros(1), 4.0, 1.0)[0]
    np.testing.assert_array_equal(lower, powers[..., :4])


def test_a_frame_that_is_warped_by_its_rate_of_change_has_narrow_lines():
    centred = (np.arange(4000) - 1999.5) / FS
    rates = np.array([-0.02, 0.0, 0.02])
    for number, rate in enumerate(rates):
        signal = np.cos(TURN * 50 * (centred + rate * centred**2 / 2))
        powers = speed_evidence._powers(signal, 4000, rates, FS)[0][0]
        assert powers.max(axis=1).argmax() == number
        assert powers[number].argmax() == 200
        # A tone of amplitude 1 has (sum of the window)² / 4 = n / 6.
        assert powers[number, 200] == pytest.approx(4000 / 6, rel=0.02)
        assert powers[(number + 1) % 3].max() < 0.8 * powers[number, 200]


# Evidence by rank


def test_ranks_of_powers_are_their_share_and_all_clear_lines_count_alike():
    rng = np.random.default_rng(1)
    powers = rng.exponential(size=(4, 1, 5000))
    powers[:, :, 100:150] = rng.uniform(40, 900, (4, 1, 50))  # 1 % are clear lines
    usable = np.arange(5000) < 4900
    powers[..., ~usable] = 1e6
    powers[1, 0, 7] = 0.0
    places, ranks = speed_evidence._rank_of(powers, usable)
    assert places.shape == powers.shape
    found = ranks[places]
    assert ranks[0] == pytest.approx(1)
    assert places[1, 0, 7] == 0
    assert places.max() == len(ranks) - 1
    assert np.all(np.diff(ranks) <= 0)
    assert np.all(found[:, :, 100:150] == ranks[-1])
    assert ranks[-1] == pytest.approx(50 / 4900, rel=1e-6)
    middle = (powers > 0.5) & (powers < 3)
    expected = (50 + 4850 * np.exp(-powers[middle])) / 4900
    np.testing.assert_allclose(found[middle], expected, rtol=0.08)


@pytest.mark.parametrize(
    ("every", "level", "share"), [(20, 15.0, 5e-4), (20, 15.1, 0.03), (50, 15.1, 0.02)]
)
def test_the_share_of_clear_lines_is_limited(every, level, share):
    powers = np.random.default_rng(1).uniform(0, 0.4, (1, 1, 1000))
    powers[..., ::every] = level
    ranks = speed_evidence._rank_of(powers, np.ones(1000, bool))[1]
    assert ranks[-1] == pytest.approx(share, rel=1e-3)


@pytest.mark.parametrize(("present", "shape"), [(0.95, 0.08), (0.8, 0.25), (0.5, 1.0)])
def test_scores_are_likelihood_ratios_with_mean_1_in_noise(present, shape):
    ranks = np.array([1.0, 0.1, 1e-3])
    found = speed_evidence._scores_by_rank(np.array([[2, 0], [1, 1]]), ranks, present, shape)
    density = 1 - present + present * shape * ranks ** (shape - 1)
    np.testing.assert_allclose(found, np.log(density[[[2, 0], [1, 1]]]), rtol=1e-6)
    even = np.linspace(0, 1, 2001)[1:]  # the ranks are even in the Beta distribution
    fine = speed_evidence._scores_by_rank(np.arange(2000), even ** (1 / shape), present, shape)
    weight = even ** (1 / shape - 1) / shape
    assert trapezoid(np.exp(fine.astype(float)) * weight, even) == pytest.approx(1, abs=2e-3)


def naive_lattice(first, others, places, orders, counts):
    """Sum scores order by order, in a loop over the speeds."""
    found = np.full((len(places), first.shape[1]), -np.inf)
    for row, place in enumerate(places):
        total = np.zeros(first.shape[1])
        for count, order in enumerate(orders, 1):
            bin_ = round(order * place)
            if bin_ < len(first):
                total = total + (first if count <= 2 else others)[bin_]
            if count in counts:
                found[row] = np.maximum(found[row], total)
    return found


def test_scores_are_summed_over_the_number_of_orders_that_gives_most():
    rng = np.random.default_rng(2)
    first, others = rng.normal(size=(2, 60, 3)).astype(np.float32)
    places, counts = np.linspace(3.1, 15, 20), (2, 4, 7)
    orders = np.array([1.0, 2, 3.5, 5, 6, 7, 9])
    found = speed_evidence._on_lattice(first, others, places, orders, counts)
    np.testing.assert_allclose(found, naive_lattice(first, others, places, orders, counts), 1e-4)
    found = speed_evidence._sum_over_first_orders(first, others, places, counts)
    own = naive_lattice(first, others, places, np.arange(1, 8), counts)
    between = [
        np.maximum(0, naive_lattice(others, others, places, np.arange(7) + share, counts))
        for share in (1 / 2, 1 / 3, 2 / 3)
    ]
    expected = own - np.max(between, axis=0) - np.log(3)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5)


def test_evidence_is_highest_at_the_speed_and_the_rate_of_change_of_the_lines():
    times = np.arange(8000) / FS
    rate = 7 * 2 / (450 * 16)  # two bins over a frame are one step, at the highest frequency
    centred = times - 2  # the first of three frames of 4 s
    turns = 21.3 * (centred + rate * centred**2 / 2)
    signal = 0.15 * sum(np.cos(TURN * k * turns + k * k) for k in range(1, 21)) + noise(8000)
    white = Whitened(signal, FS, 450.0, np.empty(0))
    found = measure(white, 4.0, (15.0, 40.0), None, n_rates=15)
    assert found.times.tolist() == [2, 4, 6]
    assert (found.duration, found.hop) == (4, 2)
    step = 0.5 * 0.25 / 24  # half a bin at order 24
    np.testing.assert_allclose(np.diff(found.speeds), step, rtol=1e-6)
    assert found.speeds[0] == 15
    assert 40 - step < found.speeds[-1] <= 40 + 1e-9
    assert found.ratios.shape == found.rates.shape == (3, len(found.speeds))
    best = found.ratios.argmax(axis=1)
    speeds = 21.3 * (1 + rate * (found.times - 2))
    np.testing.assert_allclose(found.speeds[best], speeds, rtol=1e-3)
    assert found.fastest == pytest.approx(rate)
    np.testing.assert_allclose(np.unique(found.rates) / rate, np.arange(-7, 8) / 7, atol=1e-12)
    assert found.rates[0, best[0]] == pytest.approx(rate, rel=0.3)
    assert found.ratios.max(axis=1).min() > 15
    assert np.median(found.ratios) < 0


def test_known_orders_are_searched_for_at_these_only():
    times = np.arange(4000) / FS
    white = Whitened(tones([21.3 * 3, 21.3 * 7], times) + noise(4000), FS, 450.0, np.empty(0))
    found = measure(white, 4.0, (10.0, 40.0), np.array([3.0, 7.0]), n_rates=1)
    assert found.speeds[found.ratios[0].argmax()] == pytest.approx(21.3, rel=4e-3)
    assert np.diff(found.speeds).mean() == pytest.approx(0.5 * 0.25 / 7)
    assert found.fastest == 0


def test_the_evidence_of_clear_lines_follows_from_how_rare_they_are():
    times = np.arange(4000) / FS
    signal = tones([21.0, 63.0], times) + noise(4000)
    white = Whitened(signal, FS, 450.0, np.empty(0))
    found = measure(white, 4.0, (15.0, 40.0), np.array([1.0, 3.0]), n_rates=3)
    slope = 2 / (120 * 16)
    powers = speed_evidence._powers(signal, 4000, slope * np.arange(-1, 2), FS)[0][0]
    usable = slice(3, 481)  # from above the lobe of the mean up to order 3 at the highest speed
    powers = powers[:, usable] / np.median(powers[1, usable])
    share = np.mean(powers > 15)
    assert 0.01 < share < 0.03
    score = np.log(0.05 + 0.95 * 0.08 * share**-0.92)
    assert found.ratios.max() == pytest.approx(2 * score - np.log(3), rel=1e-3)


def test_lines_of_the_mains_are_no_evidence():
    times = np.arange(4000) / FS
    signal = tones([25, 50, 75, 100], times) + noise(4000)
    options = ((15.0, 40.0), np.array([2.0, 4.0]))
    plain = measure(Whitened(signal, FS, 450.0, np.empty(0)), 4.0, *options, n_rates=1)
    supply = np.array([50.0, 100.0])
    without = measure(Whitened(signal, FS, 450.0, supply), 4.0, *options, n_rates=1)
    shaft = np.abs(plain.speeds - 25).argmin()
    assert plain.speeds[plain.ratios[0].argmax()] == pytest.approx(25, rel=5e-3)
    assert without.ratios[0, shaft] == 0


# The background


@pytest.mark.parametrize(("supply", "height", "found"), [(60, 20.5, 3), (60, 19.5, 0), (50, 30, 4)])
def test_steady_lines_at_multiples_of_one_supply_are_those_of_the_mains(supply, height, found):
    spacing, length = 0.1, 10.0
    flat = np.ones(2200, complex)
    for line in supply * np.arange(1, 1 + 210 // supply):
        flat[round((line + 0.9 * (1e-3 * line + 1.5 / length)) / spacing)] = 1j * np.sqrt(height)
    flat[1550] = 9  # 155 Hz
    flat[round((300 - supply) / spacing / 2) + 33] = 9  # no multiple of either
    lines = speed_evidence._mains_lines(flat, spacing, length)
    np.testing.assert_allclose(lines, supply * np.arange(1, 1 + found))


def test_a_line_beside_a_multiple_of_the_mains_is_none():
    flat = np.ones(2200, complex)
    flat[round((100 + 1.3 * (0.1 + 0.15)) / 0.1)] = 30
    assert len(speed_evidence._mains_lines(flat, 0.1, 10.0)) == 0
    flat[1800] = 30  # a third multiple alone is none
    assert len(speed_evidence._mains_lines(flat, 0.1, 10.0)) == 0


def test_whitening_flattens_a_resonance_removes_the_mains_and_lowers_the_rate():
    n_times = 10_007  # a prime number
    times = np.arange(n_times) / FS
    coloured = np.convolve(noise(n_times + 40), np.hanning(8), mode="valid")[:n_times]
    signal = 5 + coloured + tones([33.3], times, 4) + tones([50, 100, 150], times, 2)
    found = whiten(signal, FS, 120.0, 4.0)
    assert found.mains.tolist() == [50, 100]
    assert found.highest == 120
    assert 480 <= found.fs < 500
    assert len(found.signal) == pytest.approx(n_times * found.fs / FS, abs=1)
    assert found.signal.std() == pytest.approx(1)
    power = np.abs(np.fft.rfft(found.signal)) ** 2
    axis = np.fft.rfftfreq(len(found.signal), 1 / found.fs)
    assert axis[power.argmax()] == pytest.approx(33.3, abs=0.11)
    flat = [np.median(power[(axis > low) & (axis < low + 14)]) for low in (2, 35, 70, 103)]
    np.testing.assert_allclose(flat, np.mean(flat), rtol=0.5)
    assert power[axis > 121].max() < 1e-3 * np.mean(flat)
    for line in (50, 100):
        assert power[np.abs(axis - line) < 0.15].max() < 0.3 * np.mean(flat)


def test_the_background_is_the_median_over_frequency_of_the_mean_over_frames():
    signal = noise(10_000)
    axis, background = speed_evidence._background(signal, FS, 100.0, 2.0)
    np.testing.assert_allclose(axis, np.arange(402) / 4)  # frames of 4 s
    powers = speed_evidence._powers(signal, 4000, np.zeros(1), FS, 100.0)[0][:, 0].mean(axis=0)
    padded = np.pad(powers, 8, mode="edge")
    medians = np.median([padded[k : k + 402] for k in range(17)], axis=0)  # 2 Hz on either side
    np.testing.assert_allclose(background, medians)
    narrow = speed_evidence._background(signal, FS, 100.0, 0.1)[1]  # four bins at least
    padded = np.pad(powers, 4, mode="edge")
    np.testing.assert_allclose(narrow, np.median([padded[k : k + 402] for k in range(9)], axis=0))


# Paths of speeds


def evidence(ratios, speeds, *, fastest=0.01, duration=4.0, hop=2.0):
    ratios = np.asarray(ratios, float)
    times = duration / 2 + hop * np.arange(len(ratios))
    return Evidence(times, speeds, ratios, np.zeros_like(ratios), duration, hop, fastest)


def test_the_most_likely_path_has_bounded_steps():
    rng = np.random.default_rng(4)
    ratios = rng.normal(size=(4, 7))
    found = evidence(ratios, 10 + 0.1 * np.arange(7), fastest=0.008)  # steps of 3 at most
    paths = np.stack(np.meshgrid(*[np.arange(7)] * 4, indexing="ij"), axis=-1).reshape(-1, 4)
    for fastest, most in ((0.008, 3), (0.0, 1), (0.004, 2)):
        allowed = paths[(np.abs(np.diff(paths, axis=1)) <= most).all(axis=1)]
        best = allowed[ratios[np.arange(4), allowed].sum(axis=1).argmax()]
        found = evidence(ratios, 10 + 0.1 * np.arange(7), fastest=fastest)
        assert _most_likely_path(found, ratios).tolist() == best.tolist()


def test_scores_outside_of_the_grid_are_those_of_absent_speeds():
    scores = np.array([[1.0, 2, -300], [4, 5, 6]])
    speeds = np.array([[9.94, 10.04, 10.2, 10.26], [10.0, 10.06, 10.24, 9.0]])
    found = _at(scores, np.array([10.0, 10.1, 10.2]), speeds)
    np.testing.assert_array_equal(found, [[-4, 1, -100, -4], [4, 5, 6, -4]])
    np.testing.assert_array_equal(
        _at(scores, np.array([10.0, 10.1, 10.2]), 9.96 + 0 * speeds), [[1] * 4, [4] * 4]
    )


def test_neighbouring_frames_count_half():
    frames = evidence(np.zeros((4, 1)), np.array([1.0]))
    scores = np.array([[3.0], [6], [12], [0]])
    np.testing.assert_allclose(_windowed(frames, scores)[:, 0], [6, 10.5, 9, 6])
    np.testing.assert_allclose(_windowed(frames, scores[:2])[:, 0], [3, 4.5])
    np.testing.assert_array_equal(_windowed(frames, scores[:1]), scores[:1])


def test_a_second_is_covered_by_the_frames_nearest_to_its_times():
    frames = evidence(np.zeros((3, 1)), np.array([1.0]))  # at 2, 4 and 6 s
    trusted = np.array([True, False, True])
    found = [_covered(frames, trusted, second, second + 1.0) for second in range(8)]
    assert found == [True, True, True, False, False, False, True, True]
    assert all(isinstance(value, bool) for value in found)


def test_the_margin_is_that_to_the_best_rival_and_the_own_lines_are_none():
    speeds = 10 + 0.01 * np.arange(1501)
    ratios = np.zeros((1, 1501))
    for speed, ratio in ((12.0, 30.0), (12.3, 29.0), (24.0, 11.0), (18.0, 7.0)):
        ratios[0, np.abs(speeds - speed).argmin()] = ratio
    margin, own, rival = _margins(evidence(ratios, speeds), np.array([12.0]))
    # Within 2 / (4 s * 12 Hz) = 4.2 % speeds are the same.
    assert (margin[0], own[0]) == (19, 30)
    assert rival[0] == pytest.approx(24, abs=0.02)


@pytest.mark.parametrize(
    ("ratios", "margin", "speed", "trusted"),
    [
        ([20, 20, 20], 4.0, 20.0, [True, True, True]),
        ([20, 2, 20], 4.0, 20.0, [True, True, True]),
        ([20, 1.9, 20], 4.0, 20.0, [True, False, True]),  # no evidence in the frame itself
        ([20, 20, 20], 30.0, 20.0, [True, True, True]),
        ([20, 20, 20], 30.1, 20.0, [False, False, False]),  # nearly as likely as noise
        ([4.6, 4.6, 4.6], 4.0, 20.0, [False, False, False]),  # any of 1001 speeds would be
        ([4.7, 4.7, 4.7], 4.0, 20.0, [True, True, True]),
        ([20, 20, 20], 4.0, 15.05, [False, False, False]),  # at an end of the range
        ([20, 20, 20], 4.0, 24.92, [False, False, False]),
    ],
)
def test_a_frame_is_trusted_if_its_speed_is_clear_and_inside_the_range(
    ratios, margin, speed, trusted
):
    times = np.arange(8000) / FS
    orders = np.arange(1.0, 9)
    white = Whitened(tones(speed * orders, times) + 0.1 * noise(8000), FS, 450.0, np.empty(0))
    speeds = 15 + 0.01 * np.arange(1001)
    table = np.zeros((3, 1001))
    table[:, np.abs(speeds - speed).argmin()] = ratios
    found = _course(white, evidence(table, speeds), 8.0, (15.0, 25.0), orders, margin)
    assert found.trusted.tolist() == trusted
    np.testing.assert_allclose(found.speeds, speed)
    first, middle, last = trusted
    both = [first and middle, middle and last]
    assert found.reliable.tolist() == [
        *[first] * 3,
        both[0],
        middle,
        both[1],
        *[last] * 2,
    ]
    assert f"between {15 * TURN:.4g} and {25 * TURN:.4g} rad/s" in found.refusal
    assert f"{margin:g} is needed" in found.refusal
    assert f"where {np.log(1001):.2g} is needed" in found.refusal
    assert f"The best, {speed * TURN:.5g} rad/s at" in found.refusal


# Refinement by phase


def test_the_analytic_signal_is_that_of_scipy():
    for n_times in (64, 65):
        signal = noise(n_times) - noise(n_times).mean()
        expected = np.fft.fft(hilbert(signal)) / 2
        if n_times % 2 == 0:
            expected[n_times // 2] = 0  # half the sampling rate has no sign
        np.testing.assert_allclose(np.fft.fft(_analytic(signal)), expected, atol=1e-10)


def test_a_signal_is_demodulated_by_each_order():
    turns = np.linspace(0, 3, 50) ** 2
    orders = np.array([0.5, 1.0, 1.5, 4.0, 7.25])
    analytic = noise(50) + 1j * noise(50, 1)
    for order, wave in zip(orders, _demodulated(analytic, turns, orders), strict=True):
        np.testing.assert_allclose(wave, analytic * np.exp(-1j * TURN * order * turns))


def test_the_most_lines_that_one_correction_explains_are_those_of_the_shaft():
    orders = np.arange(1.0, 11)
    moved = 0.004 * orders
    moved[[2, 6]] += (0.1, -0.2)
    agreed, shift = _lines_of_shaft(orders, moved, 20.0, 10.0)
    assert agreed.tolist() == [True, True, False, True, True, True, False, True, True, True]
    assert shift == 0


@pytest.mark.parametrize(("off", "belongs"), [(0.017, True), (-0.017, True), (0.019, False)])
def test_a_line_of_the_shaft_is_within_a_tenth_of_a_bin_and_the_error_of_the_speed(off, belongs):
    orders = np.arange(1.0, 9)
    moved = np.where(orders == 8, off, 0.0)  # 0.1 / 10 s + 5e-5 of 160 Hz
    assert _lines_of_shaft(orders, moved, 20.0, 10.0)[0].tolist() == [True] * 7 + [belongs]


@pytest.mark.parametrize(("n_sidebands", "shift"), [(5, 0.0), (8, 0.3)])
def test_sidebands_must_be_more_by_two_lines_than_orders(n_sidebands, shift):
    orders = np.arange(1.0, 5 + n_sidebands)
    moved = 0.004 * orders
    moved[4:] = 0.3 - 0.01 * orders[4:]
    agreed, found = _lines_of_shaft(orders, moved, 20.0, 10.0)
    assert found == pytest.approx(shift)
    assert agreed.tolist() == [(order > 4) == (shift > 0) for order in orders]


def test_a_correction_of_more_than_half_a_percent_is_that_of_other_lines():
    orders = np.arange(1.0, 8)
    moved = 0.11 * orders  # of 20 Hz
    moved[5:] = 0.02 * orders[5:]
    agreed, _ = _lines_of_shaft(orders, moved, 20.0, 10.0)
    assert agreed.tolist() == [False] * 5 + [True] * 2
    assert _lines_of_shaft(orders, moved, 23.0, 10.0)[0].tolist() == [True] * 5 + [False] * 2


def test_the_phases_of_clear_orders_give_the_correction_of_the_speed():
    times = np.arange(8000) / FS
    orders = np.arange(1.0, 6)
    analytic = sum(k * np.exp(1j * TURN * k * 20.02 * times) for k in (1, 2, 3))
    analytic = analytic + 0.05 * (noise(8000) + 1j * noise(8000, 1))
    at, change, (clear, shift) = _phase_speeds(analytic, 20.0 * times, orders, 500, FS)
    np.testing.assert_allclose(at, 0.75 + 0.5 * np.arange(14))
    np.testing.assert_allclose(change, 0.02, atol=1e-3)
    assert clear.tolist() == [1, 2, 3]
    assert shift == 0
    hiss = 0.05 * (noise(8000) + 1j * noise(8000, 1))
    at, change, (clear, shift) = _phase_speeds(hiss, 20 * times, orders, 500, FS)
    assert len(at) == len(change) == 14
    assert not change.any()
    assert (len(clear), shift) == (0, 0)


def course(white, speeds, trusted, *, rates=0.0, duration=2.0, n_seconds=8):
    times = 1.0 + np.arange(len(speeds))
    rates = np.full(len(speeds), rates)
    speeds, trusted = np.array(speeds, float), np.array(trusted)
    return Course(white, times, speeds, rates, trusted, duration, np.ones(n_seconds, bool), "")


def test_trusted_speeds_are_interpolated_and_go_on_at_their_rate_for_half_a_frame():
    times = np.array([-1.0, 0.0, 0.5, 1.0, 2.0, 3.0, 3.5, 9.0])
    several = course(None, [10, 99, 12], [True, False, True], rates=0.1)
    expected = [10 - 1.0, 10 - 1.0, 10 - 0.5, 10, 11, 12, 12 + 0.6, 12 + 1.2]
    np.testing.assert_allclose(_along(times, several), expected)
    single = course(None, [99, 12], [False, True], rates=0.1)
    expected = 12 * (1 + 0.1 * np.clip(times - 2, -1, 1))
    np.testing.assert_allclose(_along(times, single), expected)


def test_a_coarse_speed_is_refined_to_that_of_its_lines_where_they_last():
    times = np.arange(8000) / FS
    speed = 20 * (1 + 0.002 * np.sin(0.5 * times))
    turns = np.cumsum(speed) / FS
    signal = sum(np.cos(TURN * k * turns + k) for k in range(1, 7)) + 0.3 * noise(8000)
    signal[6500:] = noise(1500, 3)
    white = Whitened(signal, FS, 450.0, np.empty(0))
    found, lasting = refined_speed(course(white, [20.02] * 7, [True] * 7), np.arange(1.0, 9))
    assert np.abs(found[500:5000] / speed[500:5000] - 1).max() < 2e-4
    assert lasting.tolist() == [True] * 6 + [False] * 2


# Families of lines


@pytest.mark.parametrize(("n_families", "clear"), [(0, True), (1, True), (2, False)])
@pytest.mark.parametrize("rate", [0.0, 0.01])
def test_few_families_of_lines_may_lie_between_the_orders(n_families, clear, rate):
    times = np.arange(8000) / 2000
    centred = times - 3999.5 / 2000
    turns = 40 * (centred + rate * centred**2 / 2)
    orders = np.arange(1.0, 9)
    offsets = np.array([0, 0.2, 0.4])[: n_families + 1]  # five bins each, and seven may be as high
    places = np.add.outer(orders, offsets).ravel()
    signal = sum(np.cos(TURN * place * turns + place**2) for place in places)
    signal = signal + 0.1 * noise(8000)
    assert orders_stand_out(signal, 40.0, rate, orders, 2000, 1000) is clear


@pytest.mark.parametrize(
    ("own", "other", "clear"),
    [(1, 0.08, True), (1, 0.11, False), (0.06, 0, True), (0.03, 0, False)],
)
def test_families_count_where_their_lines_stand_out_of_the_noise(own, other, clear):
    times, orders = np.arange(8000) / 2000, np.arange(1.0, 9)
    others = np.add.outer(orders, [0.2, 0.4, 0.7]).ravel()
    signal = tones(40 * orders, times, own) + tones(40 * others, times, other) + noise(8000)
    assert orders_stand_out(signal, 40.0, 0.0, orders, 2000, 1000) is clear


def test_families_need_room_and_a_spectrum_that_holds_them():
    times = np.arange(8000) / 2000
    signal = tones(20 * np.arange(1.0, 9), times) + 0.1 * noise(8000)
    orders = np.arange(1.0, 9)
    assert orders_stand_out(signal, 20.0, 0.0, orders, 2000, 1000)
    assert not orders_stand_out(signal[:1599], 20.0, 0.0, orders, 2000, 1000)  # 16 bins apart
    assert not orders_stand_out(signal, 20.0, 0.0, orders + 60, 2000, 1000)
