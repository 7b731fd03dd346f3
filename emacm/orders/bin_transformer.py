"""The third step of a pipeline: order spectra over bins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_finite_table, check_number, group_codes, located
from emacm._statements import Statement
from emacm.findings.training_range import KnownLines
from emacm.orders.bins import Band, bin_operator, named_bins
from emacm.orders.columns import (
    BARE_CHANNEL,
    BinPowers,
    OrderBlock,
    OrderTableTransformer,
    column_names,
    parse_order_columns,
)


class BinTransformer(OrderTableTransformer):
    """Integrate order spectra over bins.

    The PSD is interpolated linearly between its lines and integrated between the exact edges, so
    the sum of the bins equals the integral of the PSD for any bin size, and a search over
    `bin_size` is not biased.

    Parameters
    ----------
    bin_size : float
        Width of a bin [orders], δb of Chirico.
    max_order : float
        Where the last bin ends [orders]; that bin may be narrower.
    edges : array-like of shape (n_bins + 1,) or mapping of str to (low, high), optional
        User-defined bins in place of `bin_size` and `max_order`: edges of adjacent bins, or named
        bands, such as ``{"BPFI": (6.0, 6.25)}``.
    stop_bands : sequence of (low, high)
        Bands that are removed [orders], exact at their edges: the ideal band-stop filter. A bin
        that lies completely inside a stop band gives no column.
    order_step : float, optional
        Distance between the lines [orders] of a table without an axis. If it is None, such a table
        is assumed to be evenly spaced over 0 to `max_order`.

    Attributes
    ----------
    bins_ : tuple of (low, high)
        Edges of the bins [orders].
    operator_ : sparse array of shape (n_bins_of_all_channels, n_features)
        The operator that is applied to each row.
    known_lines_ : KnownLines
        Largest height of each spectral line over its local background in the training, and the
        excess from which a line is new; see `new_lines`. It is determined when it is first asked
        for, or when the transformer is saved: until then, the transformer refers to the spectra of
        `fit`.
    n_features_in_ : int
        Number of columns seen in `fit`.
    feature_names_in_ : ndarray of str
        Their names, where they have names.

    See Also
    --------
    emacm.OrderPSD : Spectra that are summed.
    emacm.order_bands : Bins around the orders of a machine's faults.
    emacm.FaultLines : Levels of fault lines over their background.

    Notes
    -----
    The axis is read from columns named ``channel@order``, as returned by `OrderPSD`. The bins are
    named ``channel@low-high``, or ``channel@name``.

    A new spectral line that is weak, or beside a strong one, changes its bin by little; `new_lines`
    looks for such lines, and `score`, reports and monitors ask for them.

    Examples
    --------
    >>> import pandas as pd
    >>> from emacm import BinTransformer
    >>> psd = pd.DataFrame([[0.0, 4.0, 0.0, 0.0, 2.0]], columns=[f"current@{k}" for k in range(5)])
    >>> bins = BinTransformer(2, max_order=4).set_output(transform="pandas")
    >>> bins.fit_transform(psd)
       current@0-2  current@2-4
    0          4.0          1.0
    """

    needs_groups = True
    __metadata_request__fit: ClassVar = {"groups": True}  # where metadata routing is enabled

    def __init__(
        self,
        bin_size: float = 1.0,
        *,
        max_order: float = 50.0,
        edges: ArrayLike | Mapping[str, Band] | None = None,
        stop_bands: Sequence[Band] = (),
        order_step: float | None = None,
    ) -> None:
        self.bin_size = bin_size
        self.max_order = max_order
        self.edges = edges
        self.stop_bands = stop_bands
        self.order_step = order_step

    def fit(self, X: Any, y: Any = None, groups: Any = None) -> BinTransformer:
        """Read the axis from the columns, and set the bins.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_columns)
            Power spectral densities [U²/order].
        y : ignored
        groups : array-like of shape (n_recordings,), optional
            Labels of recordings that were measured together (unit, run): they are left out together
            to determine from which height on a line is new. None: single recordings are left out;
            if those of a unit are alike, lines of a new unit may be stated. A `FeatureUnion` passes
            groups to its members, at any depth, only with scikit-learn's metadata routing:
            ``sklearn.set_config(enable_metadata_routing=True)``, and ``fit(X, y, groups=units)`` of
            the pipeline.

        Returns
        -------
        BinTransformer
            The estimator itself.

        Raises
        ------
        TypeError, ValueError
            If a parameter is invalid, or bins reach beyond the orders of the spectra.
        """
        psd = self._checked_table(X, reset=True)
        blocks = self._blocks(column_names(X))
        bins = named_bins(self.bin_size, self.max_order, self.edges, self.stop_bands)
        self.bins_ = tuple(bins.values())

        @cache
        def operator_of(axis: bytes) -> sparse.csr_array:  # that of most channels is the same
            orders = np.frombuffer(axis)
            return sparse.csr_array(bin_operator(orders, self.bins_, stop_bands=self.stop_bands))

        operators = [operator_of(block.orders.astype(np.float64).tobytes()) for block in blocks]
        self.operator_ = sparse.block_diag(operators, format="csr")
        self._columns_out = tuple(f"{block.channel}@{name}" for block in blocks for name in bins)
        codes = None if groups is None else group_codes(groups, len(psd))
        self._trained_on: tuple[Any, Any] | None = (psd, codes)
        return self

    @property
    def known_lines_(self) -> KnownLines:
        """Spectral lines of the training."""
        check_is_fitted(self)
        training = self._trained_on
        if training is not None:  # another thread may be here, too
            psd, codes = training
            within_bins = np.asarray(self.operator_.sum(axis=0)).ravel() > 0
            self._lines = KnownLines.of(psd, self._axes(), within_bins, codes)
            self._trained_on = None
        return self._lines

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for a copy or a file, which holds no spectra."""
        if getattr(self, "_trained_on", None) is not None:
            self.known_lines_  # noqa: B018
        return super().__getstate__()

    def transform(self, X: Any) -> NDArray[np.floating]:
        """Integrate over the bins.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_columns)
            Power spectral densities [U²/order] over the orders seen in `fit`.

        Returns
        -------
        ndarray of shape (n_recordings, n_bins_of_all_channels)
            Mean square within each bin [U²], channel by channel; float32 where `X` is.

        Raises
        ------
        ValueError
            If the columns are not those of `fit`.
        """
        psd = self._checked_table(X, reset=False)
        # Summed in float64 in any case. The type, as the dtype of an order table has metadata.
        with np.errstate(over="ignore"), located("a power is too large, state another unit"):
            powers = np.ascontiguousarray((self.operator_ @ psd.T).T, dtype=psd.dtype.type)
            check_finite_table(powers, "recording", self._columns_out)
        return BinPowers(powers, self._columns_out)

    def new_lines(self, X: Any) -> list[list[Statement]]:
        """State at which orders recordings have spectral lines that the training does not have.

        Each line, relative to the background of its own recording, is compared with its maximum in
        the training. How weak a line is recognised depends on the noise at its order: of lines at
        random orders in the vibration of simulated units, with 0.02, 0.05, 0.1, 0.2 and 0.5 times
        the amplitude of the whole signal, 9, 29, 63, 68 and 88 %; in their current, from 0.01 times
        on, at least 96 %. Of recordings like those of the training, about 2 in 100 have such lines.
        A line remains unknown where some state of the training has one of that height, and with few
        units (``benchmarks/unknown.py``).

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_columns)
            Power spectral densities [U²/order] over the orders seen in `fit`.

        Returns
        -------
        list of list of Statement
            For each recording, the line that is farthest above the maximum first; empty with fewer
            than five recordings, or groups, in the training.

        Raises
        ------
        ValueError
            If the columns are not those of `fit`.
        """
        return self.known_lines_.new_lines(self._checked_table(X, reset=False), self._axes())

    def _axes(self) -> tuple[OrderBlock, ...]:
        return self._blocks(getattr(self, "feature_names_in_", None))

    def _blocks(self, names: Sequence[Any] | None) -> tuple[OrderBlock, ...]:
        """Return the order axis of each channel."""
        blocks = None if names is None else parse_order_columns(names)
        step = self.order_step
        if step is not None:
            step = check_number(step, "order_step", above=0, unit="orders")
        if blocks is None:
            if step is None:
                top = check_number(self.max_order, "max_order", above=0, unit="orders")
                step = top / (self.n_features_in_ - 1)
            orders = step * np.arange(self.n_features_in_, dtype=np.float64)
            return (OrderBlock(BARE_CHANNEL, orders, slice(0, self.n_features_in_)),)
        for block in blocks:
            if step is not None and not np.allclose(np.diff(block.orders), step, rtol=1e-9, atol=0):
                raise ValueError(
                    f"order_step = {step:g} contradicts the columns of {block.channel!r}, whose "
                    f"first orders are {block.orders[:2].tolist()}. Leave order_step out."
                )
        return blocks
