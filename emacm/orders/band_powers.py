"""Mean powers in bands of fixed frequency: octave and third-octave bands."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft, sparse
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_choice, check_number, located
from emacm.orders.bins import Band, bin_operator
from emacm.orders.columns import BinPowers, NamedColumns, number_name
from emacm.orders.segment_plan import SegmentPlan
from emacm.recordings.inputs import as_recordings, check_channels, chosen_channels, for_each
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler
from emacm.shaft.motion import blocks


def frequency_bands(bands: str = "third-octave") -> dict[float, Band]:
    """Return the edges of the octave or third-octave bands from 0.1 Hz to 1 MHz [1]_.

    Parameters
    ----------
    bands : {"third-octave", "octave"}
        Ratio of the edges of a band: 10^(1/10) or 10^(3/10).

    Returns
    -------
    dict of float to (low, high)
        Edges [Hz] by nominal midband frequency [Hz], ascending. The exact midband frequencies are
        1000 Hz times powers of that ratio.

    References
    ----------
    .. [1] IEC 61260-1:2014, Octave-band and fractional-octave-band filters, 5.2 to 5.5 and Annex E.

    Examples
    --------
    >>> list(frequency_bands())[24:29]
    [25.0, 31.5, 40.0, 50.0, 63.0]
    >>> [round(edge, 1) for edge in frequency_bands("octave")[1000]]
    [707.9, 1412.5]
    """
    nominals = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)  # of a decade
    step = {"octave": 3, "third-octave": 1}[
        check_choice(bands, "bands", ("third-octave", "octave"))
    ]
    found = {}
    for k in range(-40, 31):
        if k % step == 0:
            nominal = float(f"{nominals[k % 10] * 10.0 ** (3 + k // 10):.3g}")
            low, high = (1000.0 * 10.0 ** ((2 * k + side * step) / 20) for side in (-1, 1))
            found[nominal] = low, high
    return found


class BandPowers(NamedColumns):
    """Mean powers of each channel in bands of fixed frequency, such as third-octave bands.

    What follows the shaft has a fixed order, and `BinTransformer` its power; a resonance of the
    structure or a noise of flow has a fixed frequency in Hz, whatever the speed. Join both by a
    `FeatureUnion`, or let a search decide.

    Parameters
    ----------
    bands : {"third-octave", "octave"}
        Bands of IEC 61260-1.
    low, high : float, optional
        Nominal midband frequency of the lowest and the highest band [Hz]. Default: what all
        recordings of `fit` hold. The lowest band is at least as wide as 16 divided by the
        duration of the shortest one, so that the random error of its power is at most 25 %, 1 dB
        (one over the root of width and duration [1]_); the highest one of a channel ends below
        half of its lowest sampling rate.
    channels : sequence of str, optional
        Channels, in this order. Default: those of the first recording.

    Attributes
    ----------
    bands_ : dict of str to dict of str to (low, high)
        Edges [Hz] of the bands of each channel, by their name, such as "31.5Hz".
    segment_ : float
        Least length of a segment of Welch's method [s].
    resampler_ : OrderResampler
        Knows the range of the recordings of `fit`, for `emacm.outside_training`; it does not
        resample anything.

    See Also
    --------
    emacm.BinTransformer : Powers in bands of orders, which follow the speed.
    emacm.spectrum_recipe : A pipeline with either, or both.

    Notes
    -----
    The columns are named ``channel@25Hz``, by the nominal midband frequency; they are determined by
    `fit` only. The power spectral density is that of Welch's method over time (Hann window, half
    overlapping), integrated between the exact edges as `BinTransformer` does. The bands are
    therefore adjacent, and their sum is the variance within the range that they cover; a tone of
    amplitude A gives A²/2 in its band. A segment is 4 divided by the width of the lowest band,
    which is then as wide as the main lobe of the window: a tone in its middle has less than 1 % of
    its power in other ones. Standstill and all directions are included.

    Powers are usually compared on a logarithmic scale:
    ``make_pipeline(BandPowers(), FunctionTransformer(np.log10, feature_names_out="one-to-one"))``.

    References
    ----------
    .. [1] J. S. Bendat and A. G. Piersol, Random Data, 4th ed., Wiley, 2010, section 8.5.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import BandPowers, Recording
    >>> t = np.arange(20_000) / 5_000
    >>> run = Recording({"sound": 3 * np.sin(2 * np.pi * 100 * t)}, 5_000, velocity=50.0)
    >>> bands = BandPowers(low=80, high=125).set_output(transform="pandas")
    >>> bands.fit_transform([run]).round(2)
       sound@80Hz  sound@100Hz  sound@125Hz
    0         0.0          4.5          0.0
    """

    def __init__(
        self,
        bands: str = "third-octave",
        *,
        low: float | None = None,
        high: float | None = None,
        channels: Sequence[str] | None = None,
    ) -> None:
        self.bands = bands
        self.low = low
        self.high = high
        self.channels = channels

    def fit(self, X: Any, y: Any = None) -> BandPowers:
        """Set the bands of each channel; no power is computed.

        Parameters
        ----------
        X : list of Recording
            Recordings, as measured.
        y : ignored

        Returns
        -------
        BandPowers
            Itself.

        Raises
        ------
        TypeError, ValueError
            If a parameter or X is invalid, a channel has no band, or a recording does not hold the
            bands from `low` to `high`; the message gives the recording and the channel.
        """
        for name in ("low", "high"):
            if getattr(self, name) is not None:
                check_number(getattr(self, name), name, above=0, unit="Hz")
        rows = as_recordings(X, "BandPowers")
        self.channels_ = chosen_channels(self.channels, rows[0].channels)
        check_channels(rows, self.channels_, others=self.channels is not None)
        self.bands_ = {name: self._bands_of(name, rows) for name in self.channels_}
        edges = [band for own in self.bands_.values() for band in own.values()]
        self.segment_ = 4 / min(high - low for low, high in edges)
        for_each(self._check_row, rows)
        self.resampler_ = OrderResampler(channels=self.channels_).fit(rows)
        self._names_in, self._n_in = None, len(self.channels_)
        self._columns_out = tuple(
            f"{channel}@{name}" for channel, own in self.bands_.items() for name in own
        )
        return self

    def transform(self, X: Any) -> NDArray[np.float64]:
        """Compute the powers, one recording at a time.

        Parameters
        ----------
        X : list of Recording
            Recordings, as measured.

        Returns
        -------
        ndarray of shape (n_recordings, n_columns)
            Mean square within each band [U²], channel by channel.

        Raises
        ------
        TypeError, ValueError
            If X is invalid, or a recording does not hold the bands of `fit`: it is too short, or
            its sampling rate too low. The message gives the recording and the channel.
        """
        check_is_fitted(self)
        rows = as_recordings(X, "BandPowers")
        check_channels(rows, self.channels_, others=self.channels is not None)
        for_each(self._check_row, rows)
        powers = partial(self._powers, cache(self._operator))  # most channels have one rate
        return BinPowers(np.array(for_each(powers, rows)), self._columns_out)

    def __sklearn_tags__(self) -> Any:
        """Declare that X is a list of recordings, not a 2-D table."""
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False
        tags.input_tags.three_d_array = True
        return tags

    def _bands_of(self, channel: str, rows: Sequence[Recording]) -> dict[str, Band]:
        """Return the bands of a channel that the parameters name, or that all recordings hold."""
        shortest = min(len(row.series[channel]) / row.fs[channel] for row in rows)
        rate = min(row.fs[channel] for row in rows)
        kept = {}
        for nominal, (low, high) in frequency_bands(self.bands).items():
            is_wide = (high - low) * shortest >= 16 if self.low is None else nominal >= self.low
            if is_wide and (high <= rate / 2 if self.high is None else nominal <= self.high):
                kept[f"{number_name(nominal)}Hz"] = low, high
        if not kept:
            raise ValueError(
                f"channel {channel!r}, sampled at {rate:g} Hz for {shortest:.4g} s, has no "
                f"{self.bands} band with low = {self.low} and high = {self.high}. Change these, or "
                f"leave the channel out by channels=."
            )
        return kept

    def _check_row(self, row: Recording) -> None:
        """Raise if a recording does not hold the bands."""
        for channel, own in self.bands_.items():
            n_times, rate = len(row.series[channel]), row.fs[channel]
            (first, *_), (*_, name) = own, own
            high = own[name][1]
            with located(f"channel {channel!r}"):
                if high > rate / 2:
                    raise ValueError(
                        f"it is sampled at {rate:g} Hz, but the band {name} ends at {high:.4g} Hz, "
                        f"which needs at least twice that. Lower high of BandPowers and fit again, "
                        f"or leave the recording out."
                    )
                if n_times < self._n_per_segment(rate):
                    raise ValueError(
                        f"it lasts {n_times / rate:.4g} s, but the band {first} needs at least "
                        f"{self.segment_:.4g} s. Raise low of BandPowers and fit again, or leave "
                        f"the recording out."
                    )

    def _n_per_segment(self, rate: float) -> int:
        """Return the samples of a segment; they are even, so that a line is at half the rate."""
        return 2 * fft.next_fast_len(round(self.segment_ * rate / 2), real=True)

    def _operator(self, rate: float, own: tuple[Band, ...]) -> tuple[SegmentPlan, Any]:
        """Return the plan of the segments, and the operator that integrates over bands."""
        plan = SegmentPlan(rate, n_per_segment=self._n_per_segment(rate))
        # One sample is 1/rate "revolutions", so that its orders are frequencies [Hz].
        return plan, sparse.csr_array(bin_operator(plan.orders, own))

    def _powers(self, operator_of: Any, row: Recording) -> NDArray[np.float64]:
        found = []
        for channel, own in self.bands_.items():
            plan, operator = operator_of(row.fs[channel], (*own.values(),))
            signal = (block[np.newaxis] for _, block in blocks(row.series[channel]))
            found.append(operator @ plan.average_of([signal])[0])
        return np.concatenate(found)
