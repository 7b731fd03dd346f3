"""The third step of a pipeline: order spectra, integrated over bins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from emacm._checks import check_number
from emacm.orders.bins import (
    Band,
    bin_operator,
    check_stop_bands,
    named_bins,
)
from emacm.orders.columns import (
    BARE_CHANNEL,
    BinPowers,
    OrderBlock,
    OrderTableTransformer,
    column_names,
    parse_order_columns,
)
from emacm.orders.new_lines import (
    KnownLines,
    learn_lines,
    state_new_lines,
    warn_of_new_lines,
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
    operator_ : sparse array of shape (n_bins_of_all_channels, n_features_in_)
        The operator that is applied to each row.
    line_maxima_ : ndarray of shape (n_features_in_,)
        Largest height of each spectral line over its local background in the training [dB]; inf
        outside of the bins.
    new_line_limits_ : ndarray of shape (n_features_in_,)
        Excess over it [dB] from which a line is stated to be new: at least 4, and exceeded by two
        groups of known recordings in a hundred (`emacm.orders.new_lines`). inf with fewer than five
        recordings or groups.
    n_features_in_ : int
        Number of columns seen in `fit`.
    feature_names_in_ : ndarray of str
        Their names, where they have names.

    Notes
    -----
    The axis is read from columns named ``channel@order``, as returned by `OrderPSD`. The bins are
    named ``channel@low-high``, or ``channel@name``.

    A new spectral line that is weak, or beside a strong one, changes its bin by little. `transform`
    therefore compares each spectral line, relative to the background of its own recording, with its
    maximum in the training, and warns of new ones. How weak a line is recognised depends on the
    noise at its order: of lines at random orders in the vibration of simulated units, with 0.02,
    0.05, 0.1, 0.2 and 0.5 times the amplitude of the whole signal, 9, 29, 63, 68 and 88 %; in their
    current, from 0.01 times on, at least 96 %. A line remains unknown where some state of the
    training has one of that height, and with few units (``benchmarks/unknown.py``).

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
        """Read the axis from the columns, set the bins, and learn the maxima of spectral lines.

        Parameters
        ----------
        X : array-like of shape (n_recordings, n_columns)
            Power spectral densities [U²/order].
        y : ignored
        groups : array-like of shape (n_recordings,), optional
            Labels of recordings that were measured together (unit, run): they are left out together
            to determine `new_line_limits_`. None: single recordings are left out; if those of a
            unit are alike, the limits are then too low, and lines of a new unit may be stated.
            A `FeatureUnion` passes groups to its members, at any depth, only with scikit-learn's
            metadata routing (``sklearn.set_config(enable_metadata_routing=True)``): call
            ``set_fit_request(groups=True)`` of the classifier, and ``fit(X, y, groups=units)`` of
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
        psd = self._fit_table(X)
        blocks = self._blocks(column_names(X))
        bins = named_bins(self.bin_size, self.max_order, self.edges, self.stop_bands)
        stops = check_stop_bands(self.stop_bands)
        self.bins_ = tuple(bins.values())
        axes = tuple(block.orders.tobytes() for block in blocks)
        operator, used = _operator(axes, self.bins_, tuple(stops))
        self.operator_ = operator.copy()
        self._columns_out = _columns(tuple(block.channel for block in blocks), tuple(bins))
        known = learn_lines(psd, blocks, used, groups)
        self.line_maxima_, self.new_line_limits_, self._largest_lines = known
        return self

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

        Warns
        -----
        UserWarning
            If spectral lines exceed their maximum in the training by more than `new_line_limits_`.
        """
        psd = self._read_table(X)
        warn_of_new_lines(self._new_lines(psd), stacklevel=3)
        return self._integrated(psd)

    def fit_transform(self, X: Any, y: Any = None, groups: Any = None) -> NDArray[np.floating]:
        """Fit, and integrate the same spectra, in which no line is new.

        Parameters
        ----------
        X, y, groups
            As for `fit`.

        Returns
        -------
        ndarray of shape (n_recordings, n_bins_of_all_channels)
            As of `transform`.
        """
        return self.fit(X, y, groups)._integrated(self._read_table(X))

    def _integrated(self, psd: NDArray[np.floating]) -> BinPowers:
        """Return the bins of checked spectra."""
        # Summed in float64 in any case. The type, as the dtype of an order table has metadata.
        with np.errstate(over="ignore"):
            powers = np.ascontiguousarray((self.operator_ @ psd.T).T, dtype=psd.dtype.type)
        names = self.get_feature_names_out()
        if not np.isfinite(powers).all():
            row, column = np.argwhere(~np.isfinite(powers))[0]
            raise ValueError(
                f"the integral over recording {row}, bin {str(names[column])!r}, exceeds the range "
                f"of {powers.dtype}. State the channels in other units."
            )
        return BinPowers(powers, names.tolist())

    def _new_lines(self, psd: NDArray[np.floating]) -> list[list[str]]:
        """Return statements on new lines of each recording."""
        limits = getattr(self, "new_line_limits_", None)  # models of earlier versions have none
        if limits is None or np.isinf(limits).all():
            return []
        blocks = self._blocks(getattr(self, "feature_names_in_", None))
        return state_new_lines(
            psd, KnownLines(self.line_maxima_, limits, self._largest_lines), blocks
        )

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
            steps = np.diff(block.orders)
            if step is not None and not np.allclose(steps, step, rtol=1e-9, atol=0):
                other = steps[np.argmax(np.abs(steps - step))]
                raise ValueError(
                    f"order_step = {step:g} contradicts the columns of {block.channel!r}, where "
                    f"orders lie {other:g} apart. Leave order_step out."
                )
        return blocks


@lru_cache(maxsize=64)
def _operator(
    axes: tuple[bytes, ...], bins: tuple[Band, ...], stops: tuple[Band, ...]
) -> tuple[sparse.csr_array, NDArray[np.bool_]]:
    """Make the operator of all channels, which the folds of a search copy; tell used lines."""
    operators = {
        orders: sparse.csr_array(bin_operator(np.frombuffer(orders), bins, stop_bands=stops))
        for orders in dict.fromkeys(axes)
    }
    operator = sparse.block_diag([operators[orders] for orders in axes], format="csr")
    return operator, np.asarray(operator.sum(axis=0)).ravel() > 0


@lru_cache(maxsize=64)
def _columns(channels: tuple[str, ...], names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(f"{channel}@{name}" for channel in channels for name in names)
