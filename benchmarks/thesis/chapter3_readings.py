"""Chapter 3 of the thesis from recordings to decisions, under several readings of the text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.decomposition import PCA
from sklearn.pipeline import Pipeline, make_pipeline

from emacm.decisions.classifier import CostSensitiveGaussianBayes
from emacm.orders.bin_transformer import BinTransformer
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.recording import Recording
from emacm.resampling.order_resampler import OrderResampler
from emacm.shaft.angle import angle_from_velocity
from emacm.simulation.chapter3 import CHAPTER3_ORDERS, chapter3_recordings
from printed_equations import printed_resampling

TURN = 2 * np.pi
FS = 2000.0  # Hz
N_RUNS = 40  # training runs of each class
THETA_S = TURN / 1000
N_ANGLES = 2**14
N_TIMES = 4096
STOP_BAND = (5.6, 6.4)
NINETY = "components that explain 90 %"
NO_LOW_HZ = "Hz without 0-130 Hz"  # where the fundamental smears


@dataclass(frozen=True)
class Reading:
    """One reading of chapter 3.

    Attributes
    ----------
    name : str
        Name.
    sigma : float
        Standard deviation of the noise [A].
    duration : float
        Length of a recording [s].
    angle : {"trapezoid", "late", "printed", "band-limited"}
        Resampling: Eq. (2.13) from x(k-1), with the angle by the trapezoidal rule, or with a delay
        of 0.3 time samples; Eq. (2.13) as printed; or the default of emacm.
    zeros : bool
        Whether a recording that is shorter than the window is followed by zeros under the whole
        window. If False, the window is shortened to the recording, and zeros follow it.
    """

    name: str
    sigma: float = 0.25
    duration: float = N_TIMES / FS
    angle: str = "trapezoid"
    zeros: bool = False


READINGS = (
    Reading("as emacm reads it"),
    Reading("noise of variance 0.25", sigma=0.5),
    Reading("one second of signal", duration=1.0),
    Reading("angle 0.3 samples late", angle="late"),
    Reading("one second, then zeros under the window", duration=1.0, zeros=True),
    Reading("Eq. (2.13) as printed", angle="printed"),
    Reading("emacm's band-limited resampling", angle="band-limited"),
)
TAKEN = READINGS[0]
_DELAY = 0.3  # time samples


def thesis_pipeline(reading: Reading = TAKEN) -> Pipeline:
    """Return the chain of chapter 3 from recordings to bins.

    Parameters
    ----------
    reading : Reading
        Reading of the chapter.

    Returns
    -------
    Pipeline

    Examples
    --------
    >>> thesis_pipeline()[1].n_per_segment
    16384
    """
    resampler = OrderResampler(THETA_S, interpolation="linear", antialias=False)
    # Eqs. (2.14) to (2.16) do not remove the mean.
    psd = OrderPSD(n_per_segment=N_ANGLES, max_order=51, short="pad", detrend=None)
    if reading.angle == "band-limited":
        resampler, psd = OrderResampler(), OrderPSD(16, max_order=51)
    return make_pipeline(resampler, psd, BinTransformer(1, stop_bands=(STOP_BAND,)))


def draw(seed: int, n_new: int = N_RUNS) -> dict[str, dict[str, float]]:
    """Draw the noise once, and evaluate every reading.

    Parameters
    ----------
    seed : int
        Seed of the noise.
    n_new : int
        Test runs of each class.

    Returns
    -------
    dict of str to dict
        The `outcome` by name of the reading; "hertz": comparison with spectra in hertz.
    """
    drawn, found = {}, {}
    for reading in READINGS:
        constants = (reading.sigma, reading.duration)
        if constants not in drawn:
            drawn[constants] = _runs(seed, n_new, sigma=reading.sigma, duration=reading.duration)
        recordings, labels, known = drawn[constants]
        bins = _bins(reading, recordings)
        found[reading.name] = outcome(bins, labels, known)
        if reading is TAKEN:
            found["hertz"] = _hertz_against_orders(recordings, labels, known, bins)
    return found


def outcome(
    bins: NDArray[np.floating], labels: NDArray[np.str_], known: NDArray[np.bool_]
) -> dict[str, float]:
    """Train on known runs, and classify known and new runs.

    Parameters
    ----------
    bins : ndarray of shape (n_recordings, n_bins)
        Power in each bin [A²].
    labels : ndarray of shape (n_recordings,)
        Class of each run.
    known : ndarray of bool, shape (n_recordings,)
        Training runs.

    Returns
    -------
    dict of str to float
        Explained variance, the leading bins and their weights, the largest weight of bins 6 to
        8, correct training runs by class, and the share of correct test runs.
    """
    pca = PCA().fit(bins[known])
    weights = np.abs(pca.components_[:2])
    shares = pca.explained_variance_ratio_
    found = {"share of two components [%]": 100 * shares[:2].sum()}
    found[NINETY] = np.searchsorted(shares.cumsum(), 0.9) + 1
    for number, loading in enumerate(weights, start=1):
        found[f"bin that leads PC{number}"] = loading.argmax() + 1
        found[f"largest weight of PC{number}"] = loading.max()
    found["largest weight of bins 6 to 8"] = weights[:, 5:8].max()
    model = _classifier().fit(bins[known], labels[known])
    decided, truths = model.predict(bins[known]), labels[known]
    for label in CHAPTER3_ORDERS:
        found[f"correct, {label}"] = np.sum((truths == label) & (decided == label))
    missed = np.sum((truths == "defect 1") & (decided == "healthy"))
    found["defect 1 classified as healthy"] = missed
    found["new runs classified correctly [%]"] = 100 * model.score(bins[~known], labels[~known])
    return {name: float(value) for name, value in found.items()}


def _runs(
    seed: int, n_new: int, **constants: Any
) -> tuple[list[Recording], NDArray[Any], NDArray[Any]]:
    """Return recordings, their labels, and which of them are for training."""
    recordings, labels = chapter3_recordings(N_RUNS + n_new, seed=seed, **constants)
    known = np.array([recording.meta["run"] < N_RUNS for recording in recordings])
    return recordings, labels, known


def _bins(reading: Reading, recordings: Sequence[Recording]) -> NDArray[np.floating]:
    resampler, *others = thesis_pipeline(reading).steps
    rows = _over_angle(reading, resampler[1], recordings)
    chain = Pipeline(others).set_params(orderpsd__theta_s=resampler[1].theta_s)
    return np.asarray(chain.fit_transform(rows))


def _over_angle(
    reading: Reading, resampler: OrderResampler, recordings: Sequence[Recording]
) -> NDArray[np.floating]:
    """Return the currents over the shaft angle, shape (n_recordings, n_angles).

    Runs differ only in their noise, not in their motion, so they are resampled together.
    """
    velocity = recordings[0].velocity
    currents = {str(n): recording.signals["current"] for n, recording in enumerate(recordings)}
    angle = angle_from_velocity(velocity, FS)
    if reading.angle == "printed":
        rows = [printed_resampling(current, angle, THETA_S) for current in currents.values()]
        return np.array(rows)[:, :N_ANGLES]
    together = Recording(currents, FS, velocity=velocity)
    if reading.angle == "late":
        together = Recording(currents, FS, angle=angle - _DELAY * velocity / FS)
    (stroke,) = resampler.fit_transform([together])[0].strokes
    n_zeros = N_ANGLES - stroke.n_angles if reading.zeros else 0
    return np.pad(stroke.signals, ((0, 0), (0, n_zeros)))


def _classifier() -> Pipeline:
    return make_pipeline(PCA(2), CostSensitiveGaussianBayes(priors="uniform"))  # Eq. (3.7)


def _hertz_against_orders(
    recordings: list[Recording],
    labels: NDArray[np.str_],
    known: NDArray[np.bool_],
    order_bins: NDArray[np.floating],
) -> dict[str, float]:
    """Classify by bins in hertz and in orders; 10 Hz is order 1 at the mean speed."""
    rows = np.array([recording.signals["current"] for recording in recordings])
    # 2000 samples per second instead of samples per revolution: hertz instead of orders.
    spectra = np.asarray(OrderPSD(n_per_segment=N_TIMES, theta_s=TURN / FS).fit_transform(rows))
    step = FS / N_TIMES
    tables = {"orders": order_bins}
    for name, stop_bands in (("Hz", ()), (NO_LOW_HZ, ((0, 130),))):
        bins = BinTransformer(10, max_order=500, stop_bands=stop_bands, order_step=step)
        tables[name] = np.asarray(bins.fit_transform(spectra))
    tables |= {f"{name}, decibels": np.log10(tables[name]) for name in ("orders", "Hz")}
    found: dict[str, float] = {}
    for name, table in tables.items():
        model = _classifier().fit(table[known], labels[known])
        for which, chosen in (("known runs", known), ("new runs", ~known)):
            found[f"{name}, {which} [%]"] = 100 * model.score(table[chosen], labels[chosen])
    return found
