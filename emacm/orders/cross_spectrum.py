"""Cross spectra, coherence and frequency response of two channels over orders.

All are sums or ratios of products of two channels in the same segments, so a shift of the angle's
origin cancels: the phase *between* two channels at an order does not depend on the absolute shaft
angle (and so on how a unit was assembled), in contrast to the phase of either channel.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.orders.segment_plan import SegmentPlan, WeightedLines

Pair = tuple[int, int]
Complex = NDArray[np.complexfloating]

KINDS = ("response", "coherence", "cross")
Part = tuple[str, Callable[[Any], NDArray[np.floating]]]
# The real columns of a complex quantity.
FORMS: dict[str, tuple[Part, ...]] = {
    "rectangular": (("real", np.real), ("imag", np.imag)),
    "polar": (("magnitude", np.abs), ("phase", np.angle)),
    "log": (("log", lambda values: np.log(np.abs(values))), ("phase", np.angle)),
}


@dataclass(frozen=True, eq=False)
class CrossAverages:
    """Averages over segments of channels and of pairs of channels, by Welch's method.

    `cross_averages` makes them. Coherence and response are ratios of averages, so lines within a
    bin are summed before, by `gathered`.

    Attributes
    ----------
    power : ndarray of shape (n_channels, n_orders)
        Power spectral densities S_xx [U²/order].
    cross : ndarray of shape (n_pairs, n_orders)
        Cross-spectral densities S_xy of input and output, complex [U_x U_y/order].
    pairs : tuple of (int, int)
        Input and output channel of each pair.
    n_segments : int
        Number of segments averaged.
    channels : sequence of str
        Names of the channels, for messages.
    """

    power: NDArray[np.floating]
    cross: Complex
    pairs: tuple[Pair, ...]
    n_segments: int
    channels: Sequence[str]

    def gathered(self, operator: Any) -> CrossAverages:
        """Return the averages integrated over bins.

        Parameters
        ----------
        operator : ndarray or sparse array of shape (n_bins, n_orders)
            Weights of the lines, such as `emacm.orders.bins.bin_operator` makes them.

        Returns
        -------
        CrossAverages
            With bins in place of orders.
        """
        power, cross = self.power @ operator.T, self.cross @ operator.T
        return replace(self, power=power, cross=cross)

    def coherence(self) -> NDArray[np.floating]:
        """Return the magnitude-squared coherence ``|S_xy|² / (S_xx S_yy)``.

        Returns
        -------
        ndarray of shape (n_pairs, n_orders)
            From 0 to 1; 0 where either has no power (as at order 0 if the mean was removed).

        Raises
        ------
        ValueError
            If there is a single segment, or a channel has no power at all.
        """
        if self.n_segments < 2:
            raise ValueError(
                "coherence of a single segment is 1 for any signals; at least two segments are "
                "needed, better ten. Lower revolutions (or n_per_segment), or raise overlap."
            )
        of_x, of_y = (self._ratios(side) for side in (0, 1))
        # Divided one by one, as the product of small powers may be 0.
        return np.minimum(np.abs(of_x) * np.abs(of_y), 1.0)

    def response(self) -> Complex:
        """Return the frequency response from input to output, ``H1 = S_xy / S_xx``.

        Returns
        -------
        ndarray of shape (n_pairs, n_orders)
            Complex [U_y/U_x]; 0 where the input has no power.

        Raises
        ------
        ValueError
            If an input has no power at all.
        """
        return self._ratios(0)

    def columns(self, kinds: Sequence[str], form: str) -> NDArray[np.floating]:
        """Return quantities of the pairs as real numbers.

        Parameters
        ----------
        kinds : sequence of {"response", "coherence", "cross"}
            Quantities.
        form : {"rectangular", "polar", "log"}
            The columns of complex quantities.

        Returns
        -------
        ndarray of shape (n_pairs, n_quantities, n_orders)
        """
        found: list[NDArray[np.floating]] = []
        for kind in kinds:
            if kind == "coherence":
                found.append(self.coherence())
            else:
                values = self.response() if kind == "response" else self.cross
                found += [part(values) for _, part in FORMS[form]]
        return np.stack(found, axis=1)

    def _ratios(self, side: int) -> Complex:
        """Cross spectra divided by the powers of the inputs (0) or the outputs (1)."""
        channels = [pair[side] for pair in self.pairs]
        power = self.power[channels]
        strongest = power.max(axis=1, keepdims=True)
        if not strongest.all():
            dead = self.channels[channels[int(np.argmin(strongest))]]
            raise ValueError(
                f"channel {dead!r} has no power at any order, so neither response nor coherence "
                f"exists. Check its sensor, or leave the channel out."
            )
        present = power > 1e-28 * strongest  # less is due to rounding errors
        return np.divide(self.cross, power, out=np.zeros_like(self.cross), where=present)


def cross_averages(
    plan: SegmentPlan,
    segments: Iterable[WeightedLines],
    pairs: Sequence[Pair],
    channels: Sequence[str],
) -> CrossAverages:
    """Average products of channels over segments [1]_.

    Parameters
    ----------
    plan : SegmentPlan
        How signals are cut; its `average` has no effect, the mean is used.
    segments : iterable of (lines, weight)
        What its `lines_of` or `padded_lines` yield for signals, such as the strokes of a
        recording; read one at a time.
    pairs : sequence of (int, int)
        Input and output channel of each pair.
    channels : sequence of str
        Names of the channels, for messages.

    Returns
    -------
    CrossAverages

    Raises
    ------
    ValueError
        If there is no segment.

    References
    ----------
    .. [1] J. S. Bendat and A. G. Piersol, Random Data, 4th ed., Wiley, 2010, ch. 6 and 11.
    """
    power: Any = 0.0
    cross: Any = 0.0
    total, n_segments = 0.0, 0
    for lines, weight in segments:
        power = power + (lines.real**2 + lines.imag**2).sum(axis=1)
        # The input is conjugated, as in scipy.signal.csd.
        cross = cross + np.stack(
            [np.einsum("so,so->o", lines[x].conj(), lines[y]) for x, y in pairs]
        )
        total, n_segments = total + weight, n_segments + lines.shape[1]
    if not n_segments:
        raise ValueError(f"no signal holds a segment of {plan.n_per_segment} samples.")
    scale = plan.sides / total
    return CrossAverages(power * scale, cross * scale, tuple(pairs), n_segments, channels)
