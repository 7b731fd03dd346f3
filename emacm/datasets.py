"""Recordings of real machines, read from the files of the user."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.distance import pdist, squareform

from emacm._checks import located
from emacm._statements import warn
from emacm.recordings.recording import Recording
from emacm.shaft.angle import angle_from_position

_CONSTANTS = ("fs", "lead_mm")
_LABELS = ("state", "load_kgf", "run", "group")
_SIGNALS = ("current", "position_error", "set_point")


def load_cranfield(
    path: str | Path,
) -> tuple[list[Recording], NDArray[np.str_], pd.DataFrame]:
    """Read a file of the Cranfield linear actuator [1]_.

    A ball screw (lead 5 mm) moves a load out and back with a trapezoidal speed profile.
    The shaft angle is that of the screw, ``2 pi (set_point - position_error) / lead``.
    At 25 Hz and 4.8 rev/s, the highest valid order is 2.6.

    Parameters
    ----------
    path : str or Path
        An .npz file with arrays `set_point` [mm], `position_error` [mm],
        `current` [A] of shape (n_sequences, n_times), `state`, `load_kgf`,
        `run`, `group` of shape (n_sequences,), and numbers `fs` [Hz] and
        `lead_mm`.

    Returns
    -------
    recordings : list of Recording
        Channels "current" [A] and "position_error" [mm]; `meta` contains
        state, load, run and group.
    labels : ndarray of str, shape (n_recordings,)
        State of health.
    frame : DataFrame of n_recordings rows
        Columns "load" [kgf], "run" and "group".

    Warns
    -----
    EmacmWarning
        If the file contains sequences twice; the copy of the later run is left out.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file lacks an array, or its signals are not finite.

    References
    ----------
    .. [1] C. Ruiz-Carcel and A. Starr, IEEE Trans. Instrum. Meas. 67(9),
       2035-2043, 2018, doi:10.1109/TIM.2018.2814067; recordings:
       doi:10.17862/cranfield.rd.5097649.
    """
    file = Path(path).name
    with located(file), np.load(path, allow_pickle=False) as stored:
        arrays = dict(stored.items())
    expected = (*_SIGNALS, *_LABELS, *_CONSTANTS)
    missing = [name for name in expected if name not in arrays]
    if missing:
        raise ValueError(f"{file} lacks {', '.join(missing)}; expected are {', '.join(expected)}.")
    kept = _without_copies(arrays)
    frame = pd.DataFrame({name.removesuffix("_kgf"): arrays[name][kept] for name in _LABELS})
    frame["state"] = frame["state"].astype(str)
    positions = arrays["set_point"] - arrays["position_error"]
    fs, lead = (float(arrays[name].squeeze()) for name in _CONSTANTS)
    recordings = [
        Recording(
            {name: arrays[name][index] for name in _SIGNALS[:2]},
            fs,
            angle=angle_from_position(positions[index], lead),
            meta=meta,
        )
        for index, meta in zip(kept, frame.to_dict("records"), strict=True)
    ]
    labels = frame.pop("state").to_numpy(str)
    return recordings, labels, frame


def _without_copies(arrays: dict[str, NDArray[Any]], same: float = 1e-5) -> NDArray[np.intp]:
    """Return the sequences to keep; of two equal ones, that of the earlier run.

    Sequences whose currents differ by at most `same` [A] are one measurement.
    """
    current, run = arrays["current"], arrays["run"]
    by_run = np.argsort(run, kind="stable")
    close = squareform(pdist(current[by_run], "chebyshev") <= same)
    later = np.unique(by_run[np.nonzero(np.triu(close))[1]])
    if len(later):
        text = f"{len(later)} sequences are in the file twice; those of the later runs are left out"
        warn("repeated recordings", f"{text}: numbers {later.tolist()}.", stacklevel=3)
    return np.setdiff1d(np.arange(len(run)), later)
