"""Recordings of real machines, read from the files of the user."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.distance import pdist

from emacm.recordings.recording import Recording
from emacm.shaft.angle import angle_from_position

_SIGNALS = ("set_point", "position_error", "current")
_LABELS = ("state", "load_kgf", "run", "group")
_CONSTANTS = ("fs", "lead_mm")


class CranfieldRecordings(NamedTuple):
    """Result of `load_cranfield`."""

    recordings: list[Recording]
    labels: NDArray[np.str_]
    frame: pd.DataFrame


def load_cranfield(path: str | Path) -> CranfieldRecordings:
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
    UserWarning
        If the file contains sequences twice; the copy of the later run is left out.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file does not have this layout; the message names the array.

    References
    ----------
    .. [1] C. Ruiz-Carcel and A. Starr, IEEE Trans. Instrum. Meas. 67(9),
       2035-2043, 2018, doi:10.1109/TIM.2018.2814067; recordings:
       doi:10.17862/cranfield.rd.5097649.
    """
    arrays = _read_arrays(Path(path))
    kept = _without_copies(arrays)
    labels = arrays["state"][kept].astype(str)
    frame = pd.DataFrame(
        {
            "load": arrays["load_kgf"][kept],
            "run": arrays["run"][kept],
            "group": arrays["group"][kept],
        }
    )
    recordings = [
        _recording(
            arrays, index, {"state": str(label), **dict(zip(frame.columns, row, strict=True))}
        )
        for index, label, row in zip(kept, labels, frame.to_numpy().tolist(), strict=True)
    ]
    return CranfieldRecordings(recordings, labels, frame)


def _recording(arrays: dict[str, NDArray[Any]], index: int, meta: dict[str, Any]) -> Recording:
    position = arrays["set_point"][index] - arrays["position_error"][index]
    return Recording(
        {name: arrays[name][index] for name in ("current", "position_error")},
        float(arrays["fs"].ravel()[0]),
        angle=angle_from_position(position, float(arrays["lead_mm"].ravel()[0])),
        meta=meta,
    )


def _read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    if not path.is_file():
        raise FileNotFoundError(
            f"there is no file {path}. The recordings are not part of emacm; see the "
            f"documentation of load_cranfield for their source."
        )
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: array for name, array in file.items()}
    except (BadZipFile, EOFError, OSError, TypeError, ValueError) as error:
        raise ValueError(f"{path.name} cannot be read as an .npz file: {error}") from error
    expected = (*_SIGNALS, *_LABELS, *_CONSTANTS)
    missing = [name for name in expected if name not in arrays]
    if missing:
        raise ValueError(
            f"{path.name} lacks {', '.join(missing)}; expected are the arrays "
            f"{', '.join(expected)}."
        )
    shape = arrays["current"].shape
    for name in expected:
        array, is_text = arrays[name], name == "state"
        if array.dtype.kind not in ("US" if is_text else "fiu") or not (
            is_text or np.isfinite(array).all()
        ):
            what = "text" if is_text else "finite real numbers"
            raise ValueError(f"{name} of {path.name} must be {what}, got dtype {array.dtype}.")
        wanted = shape if name in _SIGNALS else shape[:1]
        if name in _CONSTANTS:
            array, wanted = array.squeeze(), ()
        if array.shape != wanted:
            raise ValueError(
                f"{name} of {path.name} must have shape {wanted}, got {array.shape}: "
                f"signals (n_sequences, n_times), labels (n_sequences,), constants ()."
            )
    return arrays


def _without_copies(arrays: dict[str, NDArray[Any]], same: float = 1e-5) -> NDArray[np.intp]:
    """Return the sequences to keep; of two equal ones, that of the earlier run.

    Sequences whose currents differ by at most `same` [A] are one measurement.
    """
    current, run = arrays["current"], arrays["run"]
    by_run = np.argsort(run, kind="stable")
    close = np.flatnonzero(pdist(current[by_run], "chebyshev") <= same)
    if not len(close):
        return np.arange(len(run))
    first, later = (by_run[place[close]] for place in np.triu_indices(len(run), k=1))
    copies = sorted(
        {
            f"{arrays['state'][j]} at {arrays['load_kgf'][j]} kgf, run {run[j]} = run {run[i]}"
            for i, j in zip(first, later, strict=True)
        }
    )
    warnings.warn(
        f"{len(set(later))} sequences are in the file twice and were left out: "
        f"{'; '.join(copies)}.",
        stacklevel=3,
    )
    return np.setdiff1d(np.arange(len(run)), later)
