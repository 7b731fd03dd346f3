"""Work on many recordings, and how far it is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from numbers import Integral
from typing import Any

from joblib import Parallel
from joblib.parallel import SequentialBackend, ThreadingBackend, get_active_backend


def run(
    tasks: Iterable[Any],
    total: int,
    *,
    n_jobs: int | None = None,
    verbose: bool | int = False,
    done: int = 0,
) -> list[Any]:
    """Do tasks under joblib's active backend; by default, in threads.

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

    Raises
    ------
    TypeError, ValueError
        If `n_jobs` is no whole number, or 0.

    Notes
    -----
    Threads are those of `concurrent.futures`: joblib looks every 10 ms whether its own are done,
    which is as long as a recording takes.

    Examples
    --------
    >>> from joblib import delayed
    >>> run((delayed(abs)(n) for n in (-1, -2)), 2)
    [1, 2]
    """
    if not total:
        return []
    backend, jobs_of_context = get_active_backend(prefer="threads")
    n_workers = backend.effective_n_jobs(jobs_of_context if n_jobs is None else _whole(n_jobs))
    bar = _bar() if verbose else None
    if bar is None and verbose:
        return Parallel(n_jobs=n_jobs, verbose=int(verbose), prefer="threads")(tasks)
    if isinstance(backend, SequentialBackend | ThreadingBackend):
        results = _here(tasks) if min(n_workers, total) == 1 else _in_threads(tasks, n_workers)
    elif total == 1 and not verbose:
        results = _here(tasks)
    else:
        try:
            results = Parallel(n_jobs=n_jobs, return_as="generator")(tasks)
        except ValueError:  # a backend that returns nothing before it has all
            return Parallel(n_jobs=n_jobs, verbose=int(verbose))(tasks)
    if bar is None:
        return list(results)
    return list(bar(results, total=done + total, initial=done, unit="recording"))


def _whole(n_jobs: Any) -> int:
    told = "as many recordings are in work at the same time, and -1 means one for each core."
    if isinstance(n_jobs, bool) or not isinstance(n_jobs, Integral):
        raise TypeError(f"n_jobs must be None or a whole number, got {n_jobs!r}: {told}")
    if n_jobs == 0:
        raise ValueError(f"n_jobs == 0 would do nothing: {told}")
    return int(n_jobs)


def _here(tasks: Iterable[Any]) -> Iterator[Any]:
    for function, args, kwargs in tasks:
        yield function(*args, **kwargs)


def _in_threads(tasks: Iterable[Any], n_workers: int) -> Iterator[Any]:
    with ThreadPoolExecutor(n_workers) as workers:
        yield from workers.map(lambda task: task[0](*task[1], **task[2]), tasks)


def _bar() -> Any:
    """Return tqdm's progress bar, or None where it is not installed."""
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None
    return tqdm
