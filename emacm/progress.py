"""Work on many recordings, and how far it is."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from joblib import Parallel


def run(
    tasks: Iterable[Any],
    total: int,
    *,
    n_jobs: int | None = None,
    verbose: bool | int = False,
    done: int = 0,
) -> list[Any]:
    """Do tasks under joblib, in threads unless another backend is active.

    Parameters
    ----------
    tasks : iterable of joblib.delayed
        What is to be done.
    total : int
        How many there are.
    n_jobs : int, optional
        As many at the same time.
    verbose : bool or int
        Whether to report to stderr what is done, the rate and the time left: by
        tqdm, if it is installed, or else by joblib.
    done : int
        How many were done before; reported with the others.

    Returns
    -------
    list
        The results, in order.

    Examples
    --------
    >>> from joblib import delayed
    >>> run((delayed(abs)(n) for n in (-1, -2)), 2)
    [1, 2]
    """
    if not total:
        return []
    bar = _bar() if verbose else None
    if bar is None:
        return Parallel(n_jobs=n_jobs, verbose=int(verbose), prefer="threads")(tasks)
    try:
        parallel = Parallel(n_jobs=n_jobs, prefer="threads", return_as="generator")
    except ValueError:  # a backend that returns nothing before it has all
        return Parallel(n_jobs=n_jobs, verbose=int(verbose), prefer="threads")(tasks)
    return list(bar(parallel(tasks), total=done + total, initial=done, unit="recording"))


def _bar() -> Any:
    """Return tqdm's progress bar, or None where it is not installed."""
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None
    return tqdm
