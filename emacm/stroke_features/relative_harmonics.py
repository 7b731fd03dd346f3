"""Shaft-locked lines relative to the forward wave, so that the shaft angle may start anywhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from emacm.orders.columns import number_name
from emacm.stroke_features.harmonics import ShaftHarmonics
from emacm.stroke_features.transformer import Row


class RelativeHarmonics(ShaftHarmonics):
    """Give shaft-locked lines relative to the phase of each channel's forward wave.

    Where on the shaft a wave stands depends on how the parts were put together and on the zero
    of the angle. How it changes along the stroke, and how it differs on the way back, depends on
    neither: all phases are counted from that of the first order in the forward strokes.

    Parameters
    ----------
    orders : sequence of float
        Orders of the lines, in cycles per revolution: whole multiples of the first one, since
        the phase of the others goes with it that many times as fast.
    channels : sequence of str, optional
        Channels, in this order. Default: those of the first recording.
    by_direction : bool
        Give forward and reverse strokes columns of their own, ``channel+:…`` and ``channel-:…``.
        Without it the phase is counted from that of all strokes.
    n_parts : int
        Equal parts of each stroke with coefficients of their own; the reference is their mean.
    min_speed : float
        Speed up to which the shaft counts as standing [rad/s], as for `OrderResampler`; over
        the shaft angle that one's holds.
    min_revolutions : float
        Shorter strokes are passed over [revolutions].
    n_jobs : int, optional
        Recordings in work at the same time, under joblib's active backend (by default, threads).

    Attributes
    ----------
    channels_ : tuple of str
        Channels that are described.

    Notes
    -----
    With c_k - j s_k the coefficient of `ShaftHarmonics` at order k, and φ the angle of the mean
    over parts at the first order k_1 in forward strokes, the columns are real and negative
    imaginary part of (c_k - j s_k) exp(-j φ k / k_1), named ``channel+:in_phase1`` and
    ``channel+:quadrature1``, with parts ``channel+:1of2:in_phase1``.

    Another zero of the shaft angle, or a wave that stands elsewhere on the shaft, changes
    nothing, as long as it stands there in both directions. So the shaft's
    reference may be a velocity. Where the forward wave is no stronger than noise, so is its phase.

    Relative phases are free of the mounting angle, not of everything else that belongs to an
    assembly: only other units can tell that.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import Recording, RelativeHarmonics
    >>> angle = np.concatenate([np.linspace(0.3, 60, 3000), np.linspace(60, 0.3, 3000)])
    >>> lines = RelativeHarmonics((1,)).set_output(transform="pandas")
    >>> for zero in (0, 2.5):
    ...     run = Recording({"current": 2 * np.cos(angle - zero)}, 1000, angle=angle)
    ...     print(np.abs(lines.fit_transform([run]).to_numpy().round(3)))
    [[2. 0. 2. 0.]]
    [[2. 0. 2. 0.]]
    """

    phase = True
    _absolute = False

    def __init__(
        self,
        orders: Sequence[float] = (1,),
        *,
        channels: Sequence[str] | None = None,
        by_direction: bool = True,
        n_parts: int = 1,
        min_speed: float = 0.0,
        min_revolutions: float = 0.0,
        n_jobs: int | None = None,
    ) -> None:
        self.orders = orders
        self.channels = channels
        self.by_direction = by_direction
        self.n_parts = n_parts
        self.min_speed = min_speed
        self.min_revolutions = min_revolutions
        self.n_jobs = n_jobs

    def _check_own_parameters(self) -> None:
        super()._check_own_parameters()
        orders = np.asarray(self.orders, dtype=float)
        whole = np.isclose(orders / orders[0], np.round(orders / orders[0]), rtol=0, atol=1e-9)
        if not np.all(whole):
            raise ValueError(
                f"orders must be whole multiples of the first one, got {list(self.orders)}: the "
                f"phase of order {self.orders[int(np.argmin(whole))]!r} does not follow from that "
                f"of order {self.orders[0]!r}."
            )

    def _feature_names(self) -> list[tuple[str, ...]]:
        words = {"cos": "in_phase", "sin": "quadrature"}
        lines = [(word, number_name(order)) for order in self.orders for word in words]
        named = {word + order: words[word] + order for word, order in lines}
        return [(*key[:-1], named[key[-1]]) for key in super()._feature_names()]

    def _row(self, row: Row, index: int) -> NDArray[np.float64]:
        values = super()._row(row, index)
        n_ways = 2 if self.by_direction else 1
        shape = (len(self.channels_), n_ways, self.n_parts, len(self.orders), 2)
        return _relative(values.reshape(shape), np.asarray(self.orders, dtype=float)).ravel()


def _relative(lines: NDArray[np.float64], orders: NDArray[np.float64]) -> NDArray[np.float64]:
    """Count phases of (channel, way, part, order, [cos, sin]) from the first way's first order."""
    waves = lines[..., 0] - 1j * lines[..., 1]
    reference = np.angle(waves[:, 0, :, 0].mean(axis=-1))
    turned = waves * np.exp(-1j * reference[:, None, None, None] * orders / orders[0])
    return np.stack([turned.real, -turned.imag], axis=-1)
