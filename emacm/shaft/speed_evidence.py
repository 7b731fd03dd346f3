"""Evidence for each shaft speed in short spectra of a vibration signal.

The multi-order probabilistic approach [1]_ on a common grid of speeds: a speed is likely if there
is spectral power at many of its orders. Power is compared by rank, so that the evidence is a
likelihood ratio whatever the distribution of the background: in noise, its exponential has mean 1.

References
----------
.. [1] Leclère, André and Antoni, A multi-order probabilistic approach for instantaneous angular
   speed tracking, Mech. Syst. Signal Process. 81 (2016).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage
from scipy.signal import hilbert

Array = NDArray[np.floating]


class Whitened(NamedTuple):
    """A signal with a flat background, at a low sampling rate.

    Attributes
    ----------
    signal : ndarray of shape (n_times,)
        Samples; the mean square of the background is 1 per bin of any spectrum.
    fs : float
        Sampling rate [Hz].
    highest : float
        Highest frequency in it [Hz].
    mains : ndarray of shape (n_lines,)
        Frequencies of lines of the mains, which are removed [Hz].
    """

    signal: Array
    fs: float
    highest: float
    mains: Array


class Evidence(NamedTuple):
    """Logarithm of the likelihood ratio of each speed in each frame.

    Attributes
    ----------
    times : ndarray of shape (n_frames,)
        Centres of the frames [s].
    speeds : ndarray of shape (n_speeds,)
        Grid of speeds, evenly spaced [Hz].
    ratios : ndarray of shape (n_frames, n_speeds)
        Logarithms of likelihood ratios to "no lines".
    rates : ndarray of shape (n_frames, n_speeds)
        The most likely relative rate of change of each speed [1/s].
    duration : float
        Of the frames, which overlap by half [s].
    fastest : float
        Largest relative rate of change that is considered [1/s].
    """

    times: Array
    speeds: Array
    ratios: Array
    rates: Array
    duration: float
    fastest: float


class Comb(NamedTuple):
    """The speed whose first orders are highest in the spectrum of a whole signal.

    Attributes
    ----------
    speed : float
        Speed, in the unit of the sampling rate.
    level : float
        Mean height of its lines over the background [dB], each limited.
    margin : float
        Difference of this level to that of any other speed [dB].
    """

    speed: float
    level: float
    margin: float


def comb_heights(signal: Array, fs: float, lowest: float, highest: float) -> tuple[Array, Array]:
    """Return frequencies and heights [dB] of a spectrum over its median in half of `lowest`.

    From 30 dB on, all lines count alike.
    """
    n_fft = fft.next_fast_len(4 * len(signal), real=True)
    power = np.abs(fft.rfft((signal - signal.mean()) * np.hanning(len(signal)), n_fft)) ** 2
    levels = 10 * np.log10(power[: int(highest * n_fft / fs)] + 1e-30)
    size = max(1, int(0.5 * lowest * n_fft / fs))
    n_blocks = max(1, len(levels) // size)
    blocks = np.array_split(levels, n_blocks)
    centres = (np.arange(n_blocks) + 0.5) * len(levels) / n_blocks
    bins = np.arange(len(levels))
    background = np.interp(bins, centres, [np.median(block) for block in blocks])
    return bins * fs / n_fft, np.clip(levels - background, 0, 30)


def find_comb(signal: Array, fs: float, speeds: tuple[float, float]) -> Comb:
    """Return the speed whose first orders are highest, by their mean height in dB.

    The spectrum is that of the whole signal, so the speed must be constant. In decibels, with
    limited heights, no strong line decides alone.
    """
    orders = np.arange(1.0, 7)
    frequencies, heights = comb_heights(signal, fs, speeds[0], (orders[-1] + 1) * speeds[1])
    grid = np.arange(*speeds, frequencies[1] / (2 * orders[-1]))
    levels = _mean_height(frequencies, heights, grid, orders)
    best, margin = _highest(levels, grid, 2 * fs / len(signal))
    return Comb(float(grid[best]), float(levels[best]), margin)


def find_shaft(
    samples: Array, fs: float, speeds: tuple[float, float], families: Sequence[tuple[float, float]]
) -> Comb:
    """Return the speed at which the orders of the shaft and a family of a part are highest.

    A comb of the first orders alone takes the lines of a bearing or a gear for a shaft. If these
    were the orders of the shaft, no line of the part would lie at its own orders above them. All
    lines count alike; those between the orders, which a multiple of the true speed has, count
    against it.

    Parameters
    ----------
    samples : ndarray of shape (n_times,)
        Vibration at a constant speed.
    fs : float
        Sampling rate [Hz].
    speeds : (float, float)
        Lowest and highest speed [Hz].
    families : sequence of (float, float)
        Lowest and highest order of the first line of each family; lines are looked for in the
        signal, and in its squared envelope after whitening.

    Returns
    -------
    Comb
        `level` is the lower of the mean heights of the orders and of the family.
    """
    orders, harmonics = np.arange(1.0, 7), np.arange(1.0, 4)
    least, most = min(low for low, _ in families), max(high for _, high in families)
    top = min(fs / 2, speeds[1] * max(orders[-1], most * harmonics[-1]) * 1.01)
    spectrum = fft.rfft(samples - samples.mean())
    white = fft.irfft(spectrum / np.maximum(np.abs(spectrum), 1e-300), len(samples))
    envelope = np.abs(hilbert(white)) ** 2
    frequencies, heights = comb_heights(samples, fs, speeds[0], top)
    _, of_envelope = comb_heights(envelope, fs, speeds[0], top)
    step = frequencies[1] / (2 * orders[-1] * speeds[1])  # on logarithmic grids
    grid = np.exp(np.arange(np.log(speeds[0]), np.log(speeds[1]), step))
    start = np.log(speeds[0] * least)
    lines = np.exp(np.arange(start, np.log(speeds[1] * most) + step, step))
    of_lines = np.maximum(
        _mean_height(frequencies, heights, lines, harmonics),
        _mean_height(frequencies, of_envelope, lines, harmonics),
    )
    family = np.zeros(len(grid))
    for low, high in families:
        within = ndimage.maximum_filter1d(of_lines, int(np.log(high / low) / step) + 1)
        places = np.rint((np.log(grid * np.sqrt(low * high)) - start) / step).astype(np.intp)
        family = np.maximum(family, within[np.minimum(places, len(within) - 1)])
    shaft = _mean_height(frequencies, heights, grid, orders)
    between = _mean_height(frequencies, heights, grid, orders - 0.5)
    weights = np.array([len(orders), len(harmonics)]) / (len(orders) + len(harmonics))
    levels = weights[0] * (shaft - between) + weights[1] * family
    best, margin = _highest(levels, grid, 2 * fs / len(samples))
    return Comb(float(grid[best]), float(min(shaft[best], family[best])), margin)


def _mean_height(frequencies: Array, heights: Array, speeds: Array, orders: Array) -> Array:
    """Return the mean height of the lines at the orders of each speed."""
    levels = np.zeros(len(speeds))
    for order in orders:
        bins = np.rint(order * speeds / frequencies[1]).astype(np.intp)
        levels += heights[np.minimum(bins, len(heights) - 1)] / len(orders)
    return levels


def _highest(levels: Array, speeds: Array, lobe: float) -> tuple[int, float]:
    """Return the place of the highest level, and its difference to that of any other speed."""
    best = int(levels.argmax())
    others = np.abs(speeds - speeds[best]) > lobe  # the main lobe of a Hann window
    return best, float(levels[best] - levels[others].max(initial=levels.min()))


def whiten(signal: Array, fs: float, highest: float, duration: float) -> Whitened:
    """Flatten the background of a signal, remove lines of the mains, and reduce the rate.

    Parameters
    ----------
    signal : ndarray of shape (n_times,)
        Vibration.
    fs : float
        Sampling rate [Hz].
    highest : float
        Highest frequency of interest [Hz], below fs / 2.
    duration : float
        Of the frames in which lines are looked for [s]. What is broader than 16 / duration on
        either side is background, such as a resonance.

    Returns
    -------
    Whitened
    """
    n_times = len(signal)
    n_fft = fft.next_fast_len(n_times, real=True)
    spectrum = fft.rfft(signal - signal.mean(), n_fft)
    frequencies = np.arange(len(spectrum)) * (fs / n_fft)
    kept = int(np.searchsorted(frequencies, highest)) + 1
    # The background is the power between the lines, over frequency.
    n_frame = min(n_times, int(4 * fs)) // 2 * 2
    n_bins = int(highest * n_frame / fs) + 2
    mean = _powers(signal, n_frame, np.zeros(1), fs)[0][:, 0, :n_bins].mean(axis=0)
    size = 2 * max(4, round(16 / duration * n_frame / fs)) + 1
    background = ndimage.median_filter(mean, size, mode="nearest")
    level = np.interp(frequencies[:kept], np.arange(len(mean)) * (fs / n_frame), background)
    flat = spectrum[:kept] / np.sqrt(np.maximum(level, 1e-300))
    mains = _mains_lines(flat, fs / n_fft, n_times / fs)
    for line in mains:
        reach = _mains_reach(line, 2 * fs / n_times)
        flat[np.abs(frequencies[:kept] - line) < reach] = 0
    n_reduced = fft.next_fast_len(min(4 * kept, n_fft), real=True)
    padded = np.zeros(n_reduced // 2 + 1, complex)
    padded[: min(kept, len(padded))] = flat[: len(padded)]
    rate = fs * n_reduced / n_fft
    reduced = fft.irfft(padded, n_reduced)[: max(2, int(n_times * rate / fs))]
    scale = reduced.std() or 1.0
    return Whitened(reduced / scale, rate, highest, mains)


def measure(
    white: Whitened,
    duration: float,
    speeds: tuple[float, float],
    orders: Array | None,
    *,
    n_rates: int,
    counts: tuple[int, ...],
) -> Evidence:
    """Compute the evidence in frames of one duration.

    Parameters
    ----------
    white : Whitened
        The signal.
    duration : float
        Of a frame [s].
    speeds : (float, float)
        Lowest and highest speed [Hz].
    orders : ndarray of shape (n_orders,), or None
        Orders with lines; None for 1, 2, 3, ...
    n_rates : int
        Number of rates of change that are tried, odd.
    counts : tuple of int
        Without `orders`: numbers of orders that may have lines.

    Returns
    -------
    Evidence
    """
    n_frame = min(len(white.signal), int(duration * white.fs)) // 2 * 2
    duration = n_frame / white.fs
    top_order = counts[-1] if orders is None else float(orders.max())
    top = min(white.highest, top_order * speeds[1])
    slope = 2.0 / (top * duration**2)  # two bins over a frame, at the highest frequency
    rates = slope * (np.arange(n_rates) - n_rates // 2)
    powers, starts = _powers(white.signal, n_frame, rates, white.fs)
    spacing = white.fs / n_frame
    usable = _usable_bins(white, powers.shape[-1], duration, top)
    level = np.median(powers[:, n_rates // 2, usable], axis=-1)  # that between the lines
    powers /= np.maximum(level, 1e-300)[:, np.newaxis, np.newaxis]
    # The skirts of a strong line, up to six bins away, are no lines.
    skirts = powers < 0.02 * ndimage.maximum_filter1d(powers, 13, axis=-1)
    powers[skirts] = np.minimum(powers[skirts], 1.0)
    places, ranks = _rank_of(powers, usable)
    grid = np.arange(speeds[0], speeds[1] + 1e-9, spacing / (2 * top_order))  # half a bin
    rows = []
    # Probability that an order has a line, and the distribution of its rank, Beta(shape, 1): of the
    # first two orders, which have lines in nearly all machines, and of the others.
    for present, shape in ((0.95, 0.08), (0.8, 0.25)):
        # Log likelihood ratios of "line of the shaft" to "any bin".
        table = np.log(1 - present + present * shape * ranks ** (shape - 1))
        score = table.astype(np.float32)[places]
        score[..., ~usable] = 0
        rows.append(np.ascontiguousarray(score.reshape(-1, score.shape[-1]).T))
    if orders is None:
        sums = _sum_over_first_orders(rows, grid / spacing, counts)
    else:
        sums = _on_lattice(rows[:1], grid / spacing, orders, (len(orders),))
    ratios = sums.T.reshape(len(starts), n_rates, len(grid))
    times = (starts + n_frame / 2) / white.fs
    likely = ratios.max(axis=1).astype(np.float64) - np.log(n_rates)
    return Evidence(times, grid, likely, rates[ratios.argmax(axis=1)], duration, float(rates[-1]))


def _usable_bins(
    white: Whitened, n_bins: int, duration: float, highest: float
) -> NDArray[np.bool_]:
    """Return the bins up to a frequency [Hz] without the mean and the lines of the mains."""
    lobe = 1.6 / duration  # half the main lobe of a Hann window, and a little less
    frequencies = np.arange(n_bins) / duration
    usable = (np.arange(n_bins) >= 3) & (np.arange(n_bins) <= int(highest * duration))
    for line in white.mains if duration >= 1 else ():
        usable &= np.abs(frequencies - line) > _mains_reach(line, lobe)
    return usable


def _mains_reach(line: float, resolution: float) -> float:
    """Return how far from its frequency a line of the mains may be [Hz]: grids keep 0.1 %."""
    return 1e-3 * line + resolution


def _mains_lines(flat: NDArray[np.complex128], spacing: float, length: float) -> Array:
    """Return the multiples of the mains frequency at which there is a steady line.

    A machine has one supply: that whose first or second multiple is the strongest. Lines of a shaft
    or a bearing lie near some multiples of the other one by chance.
    """
    power = np.abs(flat) ** 2
    lines_of_supply: Array = np.empty(0)
    most = 0.0
    for mains in (50.0, 60.0):
        lines = mains * np.arange(1, int(len(flat) * spacing / mains) + 1)
        heights = np.zeros(len(lines))
        for number, line in enumerate(lines):
            reach = _mains_reach(line, 1.5 / length)
            low, high = (round((line + side * reach) / spacing) for side in (-1, 1))
            margin = 5 * (high - low + 4)
            near = power[max(0, low - margin) : high + margin]
            height = power[low : high + 1].max(initial=0) / max(np.median(near), 1e-300)
            heights[number] = height if height > 20 else 0.0
        strongest = heights[:2].max(initial=0)
        if strongest > most:
            most, lines_of_supply = strongest, lines[heights > 0]
    return lines_of_supply


def _powers(signal: Array, n_frame: int, rates: Array, fs: float) -> tuple[Array, NDArray[np.intp]]:
    """Return powers of shape (n_frames, n_rates, n_bins) of frames warped by each rate."""
    starts = np.arange(0, len(signal) - n_frame + 1, n_frame // 2)
    if starts[-1] + n_frame < len(signal):  # a last frame that ends with the signal
        starts = np.append(starts, len(signal) - n_frame)
    frames = np.lib.stride_tricks.sliding_window_view(signal, n_frame)[starts]
    window = np.hanning(n_frame + 2)[1:-1]
    window /= np.sqrt(np.sum(window**2))
    powers = np.empty((len(starts), len(rates), n_frame // 2 + 1))
    centred = (np.arange(n_frame) - (n_frame - 1) / 2) / fs
    for number, rate in enumerate(rates):
        warped = frames
        if rate:
            # Equal steps of the phase t + rate t²/2 of a speed that changes at this rate.
            moved = (np.sqrt(np.maximum(1 + 2 * rate * centred, 0.04)) - 1) / rate
            place = np.clip((moved - centred[0]) * fs, 0, n_frame - 1)
            left = np.minimum(place.astype(np.intp), n_frame - 2)
            part = place - left
            warped = frames[:, left] * (1 - part) + frames[:, left + 1] * part
        spectrum = fft.rfft(warped * window, axis=1)
        powers[:, number] = spectrum.real**2 + spectrum.imag**2
    return powers, starts


def _rank_of(powers: Array, usable: NDArray[np.bool_]) -> tuple[NDArray[np.intp], Array]:
    """Return the place of each power in a table, and the ranks of the table, 1 for the smallest.

    A machine has lines that are none of its shaft, in any number, so what counts is how rare a
    power is among all bins. All clear lines count alike: none decides alone.
    """
    pool = powers[..., usable].ravel()
    pool = pool[:: max(1, len(pool) // 20_000)]
    top = np.clip(np.mean(pool > 15), 5e-4, 0.03)  # share of clear lines
    ranks = np.geomspace(1, top, 129)
    knots = np.quantile(pool, 1 - ranks)
    # By table, over the logarithm of the power: much faster than interpolation.
    n_table = 1025
    logs = np.linspace(np.log(max(knots[0], 1e-9)), np.log(max(knots[-1], 2e-9)), n_table)
    per_log = np.float32((n_table - 1) / (logs[-1] - logs[0]))
    place = np.log(np.maximum(powers, 1e-30).astype(np.float32))
    place = (place - np.float32(logs[0])) * per_log
    places = np.clip(place, 0, n_table - 1).astype(np.intp)
    levels = np.exp(logs)
    levels[-1] = max(knots[-1], 2e-9)  # not below it by rounding, as many knots may be equal
    return places, np.exp(np.interp(levels, knots, np.log(ranks)))


def _sum_over_first_orders(
    rows: Sequence[NDArray[np.float32]], places: Array, counts: tuple[int, ...]
) -> NDArray[np.float32]:
    """Sum scores of shape (n_bins, n_rows) at the orders of each speed, given in bins."""
    at_orders = _on_lattice(rows, places, np.arange(1.0, counts[-1] + 1), counts)
    # Lines between the orders mean that the speed is a multiple of the true one.
    between = np.zeros_like(at_orders)
    for fraction in (1 / 2, 1 / 3, 2 / 3):
        lattice = np.arange(counts[-1]) + fraction
        sums = _on_lattice(rows[1:], places, lattice, counts)
        between = np.maximum(between, sums)
    return at_orders - between - np.float32(np.log(len(counts)))


def _on_lattice(
    rows: Sequence[NDArray[np.float32]], places: Array, orders: Array, counts: tuple[int, ...]
) -> NDArray[np.float32]:
    """Sum scores over the first orders, for the number of them that gives most.

    The first of `rows` holds the scores of the first two orders, the last one those of the others.
    """
    total = np.zeros((len(places), rows[0].shape[1]), np.float32)
    most = np.full_like(total, -np.inf)
    for count, order in enumerate(orders, 1):
        scores = rows[0 if count <= 2 else -1]
        bins = np.rint(order * places).astype(np.intp)
        inside = int(np.searchsorted(bins, len(scores)))
        total[:inside] += scores[bins[:inside]]
        if count in counts:
            np.maximum(most, total, out=most)
    return most
