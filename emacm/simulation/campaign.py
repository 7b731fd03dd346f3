"""Sets of bench recordings that are simulated when they are read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, overload

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm._checks import check_count, check_number
from emacm.recordings.recording import Recording
from emacm.simulation.bench import LaboratoryBench
from emacm.simulation.conditions import CONDITIONS

Run = tuple[LaboratoryBench, int, int]


class LaboratoryRecordings(Sequence[Recording]):
    """Recordings of laboratory benches, each simulated when it is read.

    Only benches, conditions and numbers of runs are stored: the set is small and can be pickled,
    and read one by one it needs the memory of one recording. An index gives a recording; a slice,
    an array of indices or a mask gives a smaller set that is not yet simulated. Any estimator
    accepts a set as `X`.

    Parameters
    ----------
    runs : iterable of (LaboratoryBench, int, int)
        Bench, condition and number of the run of each recording.

    Raises
    ------
    TypeError, ValueError
        If an entry is not such a triple, or the condition or run does not exist.

    Notes
    -----
    Estimators hold all recordings of a set while they process it. Where that is too much memory,
    compute the features one by one, and search and decide on these:
    ``np.vstack([features.transform(runs[i : i + 1]) for i in range(len(runs))])``.

    Examples
    --------
    >>> runs = laboratory_recordings(conditions=[3, 4], n_runs=2)
    >>> len(runs), runs.labels.tolist()[::4], runs.groups.tolist()
    (8, ['healthy', 'inner ring + lubrication'], [0, 0, 0, 0, 1, 1, 1, 1])
    >>> runs[runs.frame["condition"] == 4].frame["run"].tolist()
    [1, 2, 1, 2]
    """

    def __init__(self, runs: Iterable[Run]) -> None:
        checked = []
        for index, entry in enumerate(runs):
            if not isinstance(entry, tuple) or len(entry) != 3:
                raise TypeError(f"run {index} must be (bench, condition, run), got {entry!r}.")
            bench, condition, run = entry
            if not isinstance(bench, LaboratoryBench):
                raise TypeError(f"bench of run {index} must be a LaboratoryBench, got {bench!r}.")
            bench.meta(condition, run)  # raises an error if they do not exist
            checked.append((bench, int(condition), int(run)))
        self._runs: tuple[Run, ...] = tuple(checked)

    def __len__(self) -> int:
        """Return the number of recordings."""
        return len(self._runs)

    @overload
    def __getitem__(self, index: int) -> Recording: ...
    @overload
    def __getitem__(self, index: Any) -> Any: ...
    def __getitem__(self, index: Any) -> Any:
        """Simulate a recording, or select some without simulating them."""
        if isinstance(index, int | np.integer) and not isinstance(index, bool):
            bench, condition, run = self._runs[index]
            return bench.record(condition, run)
        if isinstance(index, slice):
            return LaboratoryRecordings(self._runs[index])
        chosen = np.asarray(index)
        mask = chosen.dtype == bool and chosen.shape == (len(self),)
        if chosen.ndim != 1 or not (mask or chosen.dtype.kind in "iu" or not len(chosen)):
            raise TypeError(
                f"an index must be a number, a slice, an array of numbers or a mask of "
                f"{len(self)} truth values, got {index!r}."
            )
        places = np.flatnonzero(chosen) if mask else chosen.astype(int)
        return LaboratoryRecordings(self._runs[i] for i in places)

    def __iter__(self) -> Iterator[Recording]:
        """Simulate one recording after the other."""
        for bench, condition, run in self._runs:
            yield bench.record(condition, run)

    def __eq__(self, other: object) -> bool:
        """Two sets are equal if their benches, conditions and runs are."""
        return self._runs == other._runs if isinstance(other, LaboratoryRecordings) else False

    def __hash__(self) -> int:
        """Agree for equal sets."""
        return hash(self._runs)

    def __repr__(self) -> str:
        """Return number, labels and units."""
        labels = ", ".join(dict.fromkeys(self.labels.tolist()))
        units = sorted(set(self.groups.tolist()))
        return f"<{len(self)} LaboratoryRecordings: {labels}; units {units}>"

    @property
    def labels(self) -> NDArray[np.str_]:
        """State of each unit: the `y` of a classifier."""
        return np.array([bench.label for bench, _, _ in self._runs], dtype=np.str_)

    @property
    def groups(self) -> NDArray[np.intp]:
        """Unit of each recording, for `GroupKFold`."""
        return np.array([bench.unit for bench, _, _ in self._runs], dtype=np.intp)

    @property
    def frame(self) -> pd.DataFrame:
        """One row per recording: unit, condition, run, label and severity."""
        columns = ["unit", "condition", "run", "label", "severity"]
        metas = [bench.meta(condition, run) for bench, condition, run in self._runs]
        return pd.DataFrame(
            [{name: meta[name] for name in columns} for meta in metas], columns=columns
        )


def thesis_benches(
    *,
    severity: float = 0.5,
    grease: float = 0.75,
    electrical_noise: tuple[float, float] = (1.0, 0.2),
    **constants: Any,
) -> tuple[LaboratoryBench, LaboratoryBench]:
    """Return the two units of the thesis: a healthy one and one with a bad bearing.

    Parameters
    ----------
    severity : float
        Severity of the defect of the inner ring; not in the thesis, assumed.
    grease : float
        Fraction of the grease in that bearing; 0.75 in chapter 4.
    electrical_noise : (float, float)
        Electrical noise in the cables of the healthy and of the degraded unit. Section 4.5
        reports it for LVDT and velocity of the healthy unit, and less for the other (the ratio is
        assumed): a classifier can distinguish the units by noise that is unrelated to the fault.
        Use equal values for a study without this confounding.
    **constants
        Parameters of both benches, as for `LaboratoryBench`.

    Returns
    -------
    healthy, degraded : LaboratoryBench
        Units 0 and 1.

    Raises
    ------
    TypeError, ValueError
        If a parameter is invalid.

    Examples
    --------
    >>> [bench.label for bench in thesis_benches()]
    ['healthy', 'inner ring + lubrication']
    """
    if not isinstance(electrical_noise, tuple) or len(electrical_noise) != 2:
        raise TypeError(
            f"electrical_noise must be a pair, of the healthy and of the degraded unit; "
            f"got {electrical_noise!r}."
        )
    grease = check_number(grease, "grease", at_least=0, at_most=1)
    faults = {"inner ring": severity, "lubrication": 1 - grease}
    return (
        LaboratoryBench(unit=0, electrical_noise=electrical_noise[0], **constants),
        LaboratoryBench(unit=1, faults=faults, electrical_noise=electrical_noise[1], **constants),
    )


def laboratory_recordings(
    benches: Iterable[LaboratoryBench] | None = None,
    *,
    conditions: Iterable[int] = tuple(CONDITIONS),
    n_runs: int = 20,
    first_run: int = 1,
) -> LaboratoryRecordings:
    """Return the recordings of a test campaign, which are simulated when they are read.

    Parameters
    ----------
    benches : iterable of LaboratoryBench, optional
        Units on the bench. Default: `thesis_benches`.
    conditions : iterable of int
        Rows of Table 4.3.
    n_runs : int
        Runs of each unit in each condition; 20 in the thesis, of which 1 to 10 are for training.
    first_run : int
        Number of the first run.

    Returns
    -------
    LaboratoryRecordings
        Sorted by bench, condition and run.

    Raises
    ------
    TypeError, ValueError
        If a parameter is invalid.

    Examples
    --------
    >>> laboratory_recordings()
    <200 LaboratoryRecordings: healthy, inner ring + lubrication; units [0, 1]>
    """
    check_count(n_runs, "n_runs")
    check_count(first_run, "first_run")
    if isinstance(benches, LaboratoryBench):
        benches = [benches]
    chosen = list(conditions)
    return LaboratoryRecordings(
        (bench, condition, run)
        for bench in (thesis_benches() if benches is None else benches)
        for condition in chosen
        for run in range(first_run, first_run + n_runs)
    )
