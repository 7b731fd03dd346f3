"""Features of a machine from its geometry: how far predicted fault lines rise above background."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.machine.lines import LineLevels, fault_series
from emacm.machine.parts import Part
from emacm.orders.columns import column_names, parse_order_columns
from emacm.orders.table_transformer import OrderTableTransformer
from emacm.recordings.inputs import check_channel_names, chosen_channels


class FaultLines(OrderTableTransformer):
    """Level of the spectral lines of each fault above their local background [dB].

    It replaces `BinTransformer` if the geometry of the machine is known. The levels do not depend
    on the gain of a channel, and not on the slip of the rolling elements, so they can be compared
    between machines.

    Parameters
    ----------
    parts : part, or sequence of parts
        `Bearing`, `Gear`, `Motor` and so on, or a mapping of fault names to orders.
    harmonics : int
        Number of lines of each fault: its order, twice its order, and so on.
    slip : float
        Largest deviation of rolling elements from the predicted orders, as a fraction.
    background : float
        The background of a line is the median of the spectrum within this distance on either side
        [orders].
    channels : sequence of str, optional
        Channels, in this order. Default: all.

    Attributes
    ----------
    channels_ : tuple of str
        Channels that are measured.
    faults_ : tuple of str
        Names of the faults.
    n_features_in_ : int
        Number of columns seen in `fit`.
    feature_names_in_ : ndarray of str
        Their names.

    Notes
    -----
    The level of a fault is the mean over its lines of 10 log10(line / background). One common slip
    for all lines of a fault is chosen such that the level is largest. A defect of a ball strikes
    both rings in each turn, so its lines are at 2, 4, ... times BSF. Noise alone has a level of 1
    to 3 dB, because the largest of several lines is taken.

    The segments should be long: 25 revolutions separate the lines of most bearings. For faults of
    rolling bearings the spectra are those of the envelope (`EnvelopeDetector`).

    Columns are named ``channel@BPFI``.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from emacm import FaultLines
    >>> orders = np.arange(0, 10.01, 0.1)
    >>> psd = np.where(np.isin(orders.round(1), [2.5, 5.0]), 100.0, 1.0)
    >>> table = pd.DataFrame([psd], columns=[f"vibration@{order:g}" for order in orders])
    >>> lines = FaultLines({"BPFO": 2.5, "BPFI": 3.5}, harmonics=2).set_output(transform="pandas")
    >>> lines.fit_transform(table)
       vibration@BPFO  vibration@BPFI
    0            20.0             0.0
    """

    def __init__(
        self,
        parts: Part | Mapping[str, float] | Sequence[Part | Mapping[str, float]],
        *,
        harmonics: int = 3,
        slip: float = 0.02,
        background: float = 0.5,
        channels: Sequence[str] | None = None,
    ) -> None:
        self.parts = parts
        self.harmonics = harmonics
        self.slip = slip
        self.background = background
        self.channels = channels

    def fit(self, X: Any, y: Any = None) -> FaultLines:
        """Read the order axis from the columns and locate the lines.

        Parameters
        ----------
        X : table of shape (n_recordings, n_columns)
            Power spectral densities [U²/order], with columns named ``channel@order``.
        y : ignored

        Returns
        -------
        FaultLines
            Itself.

        Raises
        ------
        TypeError, ValueError
            If the columns have no order axis, a line lies outside of it, the spectra are too
            coarse, or a parameter is invalid.
        """
        self._fit_table(X)
        blocks = parse_order_columns(column_names(X) or ())
        if blocks is None:
            raise ValueError(
                "FaultLines needs order spectra whose columns are named channel@order, as OrderPSD "
                "returns them. Put FaultLines after OrderPSD, or pass a DataFrame with such names."
            )
        series = fault_series(self.parts, self.harmonics)
        by_channel = {block.channel: block for block in blocks}
        self.channels_ = chosen_channels(self.channels, tuple(by_channel))
        check_channel_names(tuple(by_channel), self.channels_, "X")
        self.faults_ = tuple(fault.name for fault in series)
        self._levels = {
            channel: (
                by_channel[channel].columns,
                LineLevels(by_channel[channel].orders, series, self.slip, self.background),
            )
            for channel in self.channels_
        }
        self._columns_out = tuple(f"{c}@{fault}" for c in self.channels_ for fault in self.faults_)
        return self

    def transform(self, X: Any) -> NDArray[np.float64]:
        """Measure the levels.

        Parameters
        ----------
        X : table of shape (n_recordings, n_columns)
            Power spectral densities [U²/order] over the orders seen in `fit`.

        Returns
        -------
        ndarray of shape (n_recordings, n_channels * n_faults)
            Level of each fault [dB], channel by channel.

        Raises
        ------
        ValueError
            If the columns are not those of `fit`.
        """
        psd = self._read_table(X).astype(np.float64)
        return np.hstack(
            [levels.measure(psd[:, columns])[0] for columns, levels in self._levels.values()]
        )
