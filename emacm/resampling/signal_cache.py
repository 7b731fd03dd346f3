"""Resample once for several estimators that read the same recordings one after the other."""

from __future__ import annotations

from typing import Any

from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_count
from emacm.envelopes.transformer import RecordingTransformer
from emacm.recordings.inputs import check_channels
from emacm.resampling.angle_recording import AngleRecording
from emacm.resampling.order_resampler import as_angle_recordings


class SignalCache(RecordingTransformer, auto_wrap_output_keys=None):  # type: ignore[call-arg]
    """Keep the resampled signals of recordings for all members of a `FeatureUnion`.

    Recordings over the shaft angle are resampled whenever an estimator reads them. A
    `FeatureUnion` gives all recordings to its members one after the other, so each member resamples
    them again. With this step before the union, strokes are found and signals resampled once.
    The results are identical bit for bit. Signals are released with the recordings, when the union
    is done.

    Parameters
    ----------
    max_bytes : int
        Largest size of all signals that are kept in one call of `transform` [bytes]. Each
        recording may use an equal share; what does not fit is resampled again by each member.

    Attributes
    ----------
    channels_ : tuple of str
        Channels of the recordings.

    Notes
    -----
    Threads share the kept signals. Kept signals are neither pickled nor included in joblib's hash,
    so each worker process resamples again.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn.pipeline import make_pipeline, make_union
    >>> from emacm import OrderPSD, OrderResampler, Recording, RecordingStatistics
    >>> from emacm.resampling.signal_cache import SignalCache
    >>> rng = np.random.default_rng(0)
    >>> run = Recording({"torque": rng.normal(size=4000)}, 1000, velocity=np.full(4000, 50.0))
    >>> union = make_union(OrderPSD(4), RecordingStatistics(by_direction=False))
    >>> make_pipeline(OrderResampler(), SignalCache(), union).fit_transform([run]).shape
    (1, 263)
    """

    def __init__(self, max_bytes: int = 1 << 28) -> None:
        self.max_bytes = max_bytes

    def fit(self, X: Any, y: Any = None) -> SignalCache:
        """Check the recordings; nothing is resampled.

        Parameters
        ----------
        X : list of AngleRecording
            Recordings over the shaft angle.
        y : ignored

        Returns
        -------
        SignalCache
            Itself.

        Raises
        ------
        TypeError, ValueError
            If X is not such a list, or `max_bytes` is not a number of bytes.
        """
        check_count(self.max_bytes, "max_bytes", at_least=0)
        self.channels_ = as_angle_recordings(X, "SignalCache")[0].channels
        return self

    def transform(self, X: Any) -> list[AngleRecording]:
        """Return the recordings, which keep their signals from now on.

        Parameters
        ----------
        X : list of AngleRecording
            Recordings with the channels seen in `fit`.

        Returns
        -------
        list of AngleRecording

        Raises
        ------
        TypeError, ValueError
            If X is not such a list, or a recording has other channels.
        """
        check_is_fitted(self)
        rows = as_angle_recordings(X, "SignalCache")
        check_channels(rows, self.channels_, others=False, ordered=True)
        share = check_count(self.max_bytes, "max_bytes", at_least=0) // len(rows)
        return [row.keeping(share) for row in rows]
