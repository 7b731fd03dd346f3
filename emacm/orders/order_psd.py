"""The second step of a pipeline: the power spectral density over orders.

Spectra are kept between calls, folds and searches, and in a folder between processes. There, the
name of a spectrum is a digest of the content of its recording and of all settings. Behind the array
in the format of NumPy is a checksum, so that a damaged one is estimated again.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from hashlib import sha256
from io import BytesIO
from pathlib import Path, PurePath
from typing import Any
from zlib import crc32

import joblib
import numpy as np
from numpy.typing import NDArray
from sklearn.utils.validation import check_is_fitted, validate_data

from emacm._checks import check_choice, check_finite_table, check_signal, check_table
from emacm._saved import write_whole
from emacm._statements import warn
from emacm._version import __version__
from emacm.orders.columns import BARE_CHANNEL, OrderTable, order_columns
from emacm.orders.segment_plan import SegmentPlan
from emacm.orders.welch import WelchEstimator, samples_per_revolution
from emacm.recordings.digests import content_digest
from emacm.recordings.inputs import Recent, as_list, described, refuse_single, run
from emacm.recordings.recording import Recording
from emacm.resampling.angle_recording import (
    AngleRecording,
    as_angle_recordings,
    check_alike,
    separates_directions,
)
from emacm.resampling.order_resampler import check_angle_step

Spectrum = NDArray[np.floating]
_recent: Recent[Spectrum] = Recent(1 << 28)  # of this process


class OrderPSD(WelchEstimator):
    """Estimate the power spectral density over orders, by Welch's method.

    Parameters
    ----------
    revolutions : float
        Length of a segment; the distance between spectral lines is 1/revolutions orders (to the
        nearest whole number of samples), independent of theta_s.
    n_per_segment : int, optional
        Length of a segment in samples (the thesis' L), in place of `revolutions`.
    window : str, tuple or array-like of shape (n_per_segment,)
        As for `scipy.signal.get_window`.
    overlap : float
        Fraction of a segment that overlaps the next one, in [0, 1).
    detrend : {"constant", "linear", None, False}
        What is removed from each segment.
    scaling : {"density", "spectrum"}
        "density" [U²/order] integrates to the mean square, as bins need it. In
        "spectrum" [U²] a tone of amplitude A reads A²/2.
    average : {"mean", "median"}
        How the segments of a recording are combined.
    by_direction : bool or "auto"
        Separate columns for forward and reverse strokes, ``channel+@…`` and ``channel-@…``.
        "auto": if a recording of `fit` has strokes of at least one revolution in both directions.
    short : {"raise", "pad"}
        For a recording whose strokes are all shorter than a segment: an error, or an
        estimate padded with zeros, in which each stroke is weighted by its length (for any
        `average`).
    max_order : float, optional
        Highest order of interest: columns above the first one at or above it are omitted.
    theta_s : float, optional
        Angle between samples [rad] of plain rows. Recordings contain theirs.
    memory : None, False, str, path or joblib.Memory
        Where spectra of recordings are kept between calls, folds and candidates of a search. None:
        in the memory of the process, the latest 256 MiB, as long as it has the recordings. A folder
        keeps them for other processes, too, in files ``emacm_spectra/*.npy``, whose names follow
        from the content of the recording and all settings, including those of resampling; any of
        them may be deleted. Without it, each process of a search with `n_jobs` estimates all
        spectra. False: nowhere. Resampled signals are not kept.
    verbose : bool or int
        Report to stderr how many recordings are done, the rate and the time left: by tqdm, if it is
        installed, otherwise by joblib (the higher, the more often).
    n_jobs : int, optional
        Number of recordings processed in parallel, under joblib's active backend (by default,
        threads).

    Attributes
    ----------
    orders_ : ndarray of shape (n_orders,)
        Orders of the lines; in cycles per sample for plain rows without `theta_s`.
    order_step_ : float
        Exact distance between two lines [orders].
    n_per_segment_ : int
        Samples of a segment.
    channels_ : tuple of str
        Channels of the recordings.
    theta_s_ : float or None
        Angle between samples [rad].
    plan_ : SegmentPlan
        The segments that are averaged.
    n_features_in_ : int
        Samples of a row, where X is a 2-D table.

    See Also
    --------
    emacm.OrderResampler : Resamples to shaft angle, the step before.
    emacm.BinTransformer : Sums spectra into order bins, the step after.
    emacm.OrderCrossSpectrum : Coherence and phase of two channels.

    Notes
    -----
    `X` is what `OrderResampler` returns. It may also be a 2-D array whose rows are equally long
    signals over shaft angle, or a list of 1-D arrays of any lengths. With ``theta_s=None`` such
    rows have no axis: one sample is one revolution, and a segment is at most as long as the row, as
    in `scipy.signal.welch`.

    Source: Chirico, Eqs. (2.14) to (2.22).

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import OrderPSD
    >>> angle = 2 * np.pi / 64 * np.arange(64 * 40)
    >>> rows = [np.sin(5 * angle), np.sin(9 * angle)]
    >>> psd = OrderPSD(8, theta_s=2 * np.pi / 64)
    >>> power = psd.fit_transform(rows)
    >>> psd.orders_[power.argmax(axis=1)]
    array([5., 9.])
    """

    def __init__(
        self,
        revolutions: float = 16,
        *,
        n_per_segment: int | None = None,
        window: Any = "hann",
        overlap: float = 0.5,
        detrend: Any = "constant",
        scaling: str = "density",
        average: str = "mean",
        by_direction: bool | str = False,
        short: str = "raise",
        max_order: float | None = None,
        theta_s: float | None = None,
        memory: Any = None,
        verbose: bool | int = False,
        n_jobs: int | None = None,
    ) -> None:
        self.revolutions = revolutions
        self.n_per_segment = n_per_segment
        self.window = window
        self.overlap = overlap
        self.detrend = detrend
        self.scaling = scaling
        self.average = average
        self.by_direction = by_direction
        self.short = short
        self.max_order = max_order
        self.theta_s = theta_s
        self.memory = memory
        self.verbose = verbose
        self.n_jobs = n_jobs

    def fit(self, X: Any, y: Any = None) -> OrderPSD:
        """Set the order axis; no spectrum is estimated.

        Parameters
        ----------
        X : list of AngleRecording, 2-D array or list of 1-D arrays
            Signals over shaft angle.
        y : ignored

        Returns
        -------
        OrderPSD
            The estimator itself.

        Raises
        ------
        TypeError, ValueError
            If a parameter or X is invalid.
        """
        check_choice(self.by_direction, "by_direction", (True, False, "auto"))
        for seen in ("n_features_in_", "feature_names_in_"):
            self.__dict__.pop(seen, None)  # of an earlier fit on a table
        rows = self._checked(X, reset=True)
        self.by_direction_ = separates_directions(self.by_direction, rows)
        self._over_angle = isinstance(rows[0], AngleRecording)
        self.theta_s_ = rows[0].theta_s if self._over_angle else None
        if self.theta_s is not None:
            self.theta_s_ = check_angle_step(self.theta_s)
        self.channels_ = rows[0].channels if self._over_angle else (BARE_CHANNEL,)
        self._check_rows(rows)
        if self.theta_s_ is not None:
            self._set_plan(samples_per_revolution(self.theta_s_))
        else:
            self._set_plan(1.0)
            shortest = min(len(row) for row in rows)
            if self.n_per_segment_ > shortest:
                self._set_plan(1.0, n_per_segment=shortest)
        self.order_step_ = self.plan_.order_step
        self._columns_out = self._column_names()
        self._names_in = vars(self).get("feature_names_in_")
        self._n_in = len(self.channels_) if self._over_angle else vars(self).get("n_features_in_")
        return self

    def transform(self, X: Any) -> NDArray[np.floating]:
        """Estimate the spectra, one recording at a time.

        Parameters
        ----------
        X : list of AngleRecording, 2-D array or list of 1-D arrays
            Signals over shaft angle, at the theta_s of `fit`.

        Returns
        -------
        OrderTable of shape (n_recordings, n_columns)
            Power spectral densities [U²/order], channel by channel; an array whose ``columns`` are
            named ``channel@order``. Without an axis, a plain array.

        Raises
        ------
        TypeError, ValueError
            If theta_s or channels differ from those of `fit`, or a recording has no stroke as
            long as a segment (the message gives its number and its revolutions).
        """
        check_is_fitted(self)
        rows = self._checked(X, reset=False)
        self._check_rows(rows)
        settings = joblib.hash((vars(self.plan_), __version__))
        memory = getattr(self.memory, "location", self.memory)  # of a joblib.Memory
        folder = None if memory is None or memory is False else _folder_of(memory)
        kept = partial(_spectrum, self.plan_, settings, folder, memory is not False)
        names = [partial(_named, row, index) for index, row in enumerate(rows)]
        options: dict[str, Any] = {"n_jobs": self.n_jobs, "verbose": self.verbose}
        return self.table_of(run(kept, rows, names=names, **options))

    def table_of(self, spectra: Sequence[NDArray[np.floating]]) -> NDArray[np.floating]:
        """Return the table of spectra that were estimated elsewhere, as `transform` does.

        Parameters
        ----------
        spectra : sequence of ndarray of shape (n_channels, [n_directions,] n_orders)
            Of each recording.

        Returns
        -------
        OrderTable of shape (n_recordings, n_columns)
        """
        table = np.stack(spectra).reshape(len(spectra), -1)
        return table if self.theta_s_ is None else OrderTable(table, self._columns_out)

    def _checked(self, X: Any, *, reset: bool) -> Sequence[Any]:
        """Return the rows of X: recordings over shaft angle, or 1-D arrays."""
        rows = as_list(X) if isinstance(X, str | PurePath | Sequence) else []
        if any(isinstance(row, AngleRecording | Recording | str | PurePath) for row in rows):
            return as_angle_recordings(rows, "OrderPSD")
        refuse_single(X)
        if self.by_direction and self.by_direction != "auto":
            raise ValueError(
                "by_direction needs recordings over shaft angle, as OrderResampler returns them; "
                "plain rows have no direction. Set by_direction=False."
            )
        if rows and (self.theta_s is not None or _ragged(rows)):
            return [check_signal(row, f"row {i}") for i, row in enumerate(rows)]
        check_table(X)
        table = validate_data(
            self,
            X,
            reset=reset,
            dtype=[np.float64, np.float32],
            # After fit, a wrong number of columns is the better message.
            ensure_min_features=2 if reset else 1,
            ensure_all_finite=False,
        )
        check_finite_table(table, "row")
        return table

    def _check_rows(self, rows: Sequence[Any]) -> None:
        """Compare rows with the kind of rows, the axis and the channels of `fit`."""
        over_angle = isinstance(rows[0], AngleRecording)
        if over_angle != self._over_angle:
            kinds = "plain rows", "recordings over shaft angle"
            raise ValueError(
                f"X holds {kinds[over_angle]}, but OrderPSD was fitted on "
                f"{kinds[self._over_angle]}. Pass what it was fitted on, or fit again."
            )
        if over_angle:
            known = self.channels_, self.theta_s_
            check_alike(rows, *known, "OrderPSD", by_direction=self.by_direction_)

    def _column_names(self) -> tuple[str, ...]:
        if self.theta_s_ is None:
            return tuple(f"line{k}" for k in range(len(self.orders_)))
        channels = self.channels_
        if self.by_direction_:
            channels = tuple(channel + sign for channel in channels for sign in "+-")
        return order_columns(channels, self.orders_)


def _named(row: AngleRecording | NDArray[np.floating], index: int) -> str:
    return described(row, index) if isinstance(row, AngleRecording) else f"row {index}"


def _ragged(rows: list[Any]) -> bool:
    """Tell whether these are one-dimensional rows of unequal length."""
    shapes = {np.shape(row) for row in rows}
    return len(shapes) > 1 and all(len(shape) == 1 for shape in shapes)


def _folder_of(memory: Any) -> Path:
    """Return the folder of spectra for the parameter `memory`, and make it."""
    try:
        folder = Path(memory) / "emacm_spectra"
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, TypeError) as error:
        raise ValueError(
            f"memory = {str(memory)!r} cannot be used as a folder of spectra: {error}. "
            f"Choose a folder with write permission."
        ) from error
    return folder


def spectrum_key(row: Any, settings: str) -> str:
    """Return the key of the spectrum of a row.

    Parameters
    ----------
    row : AngleRecording or ndarray
        A recording or a signal over shaft angle. Its content counts, and how it is resampled.
    settings : str
        All else that the spectrum depends on, as text.

    Returns
    -------
    str
        64 hexadecimal digits.
    """
    if isinstance(row, AngleRecording):
        content = row.measured.digest
        settings += repr(list(row.settings))
    else:
        content = content_digest("row", [row])
    return sha256(f"{content}{settings}".encode("utf-8", "surrogatepass")).hexdigest()


def _spectrum(
    plan: SegmentPlan, settings: str, folder: Path | None, keep: bool, row: Any
) -> Spectrum:
    """Return the spectrum of a row: of this process, of the folder, or estimated."""
    known = None
    if keep and isinstance(row, AngleRecording):
        known = row.measured.identity, settings, repr(list(row.settings))
        found = _recent.get(known)
        if found is not None:
            return found
    found = plan.spectra_of(row) if folder is None else _from_folder(folder, plan, settings, row)
    if known is not None:
        _recent.put(known, found, found.nbytes)
    return found


def _from_folder(folder: Path, plan: SegmentPlan, settings: str, row: Any) -> Spectrum:
    """Return the spectrum that a file holds; without one, or if it is damaged, estimate it."""
    path = folder / f"{spectrum_key(row, settings)}.npy"
    content = path.read_bytes() if path.is_file() else b""
    if content[-4:] == crc32(content[:-4]).to_bytes(4):
        return np.asarray(np.load(BytesIO(content)))
    found = plan.spectra_of(row)
    file = BytesIO()
    np.save(file, found)
    try:
        write_whole(path, file.getvalue() + crc32(file.getvalue()).to_bytes(4))
    except OSError as error:  # as of a full disk
        warn("not kept", f"a spectrum is not kept in the folder of memory: {error}")
    return found
