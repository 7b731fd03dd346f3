"""Parallel execution over recordings, and its progress."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from numbers import Integral
from typing import Any

from joblib import Parallel, delayed
from joblib.parallel import SequentialBackend, ThreadingBackend, get_active_backend

from emacm._checks import located_error


def run(
    function: Callable[..., Any],
    *arguments: Sequence[Any],
    names: Sequence[Callable[[], str]] | None = None,
    n_jobs: int | None = None,
    verbose: bool | int = False,
    unit: str = "recording",
    prefer: str = "threads",
) -> list[Any]:
    """Call a function for each recording, under joblib's active backend; by default, in threads.

    Parameters
    ----------
    function : callable
        Called with one element of each of `arguments`, as by `map`.
    *arguments : sequence
        Sequences of equal length.
    names : sequence of callable, optional
        What to put in front of the message of a ValueError or TypeError of each call.
    n_jobs : int, optional
        Number of recordings processed in parallel.
    verbose : bool or int
        Report to stderr how many recordings are done, the rate and the time left: by tqdm, if it is
        installed, otherwise by joblib.
    unit : str
        Name of one call in the report, if it is not a recording.
    prefer : {"threads", "processes"}
        Default backend.

    Returns
    -------
    list
        The results, in order.

    Raises
    ------
    TypeError, ValueError
        If `n_jobs` is not a whole number, or is 0.

    Notes
    -----
    Threads are those of `concurrent.futures`: joblib polls its own every 10 ms, which is as long as
    a recording takes. In a task of a Dask cluster, recordings are processed by its worker.

    Examples
    --------
    >>> run(pow, [2, 3], [3, 2])
    [8, 9]
    """
    total = len(arguments[0])
    if not total:
        return []
    if names is not None:
        function, arguments = partial(_located, function), (names, *arguments)
    backend, n_workers = _backend(prefer, n_jobs)
    bar = _bar() if verbose else None
    tasks = (delayed(function)(*values) for values in zip(*arguments, strict=True))
    if bar is None and verbose:
        return Parallel(n_jobs=n_jobs, verbose=int(verbose), prefer=prefer)(tasks)
    results: Iterable[Any]
    if min(n_workers, total) == 1:
        results = map(function, *arguments)
    elif isinstance(backend, SequentialBackend | ThreadingBackend):
        results = _in_threads(function, arguments, n_workers)
    else:
        try:
            results = Parallel(n_jobs=n_jobs, return_as="generator")(tasks)
        except ValueError:  # a backend that returns nothing before it has all
            return Parallel(n_jobs=n_jobs, verbose=int(verbose))(tasks)
    if bar is None:
        return list(results)
    return list(bar(results, total=total, unit=unit))


def n_parallel(n_jobs: int | None) -> int:
    """Return how many recordings `run` processes in parallel."""
    return _backend("threads", n_jobs)[1]


def _backend(prefer: str, n_jobs: int | None) -> tuple[Any, int]:
    """Return joblib's backend and how many recordings it processes in parallel."""
    if n_jobs is not None:
        _check_whole(n_jobs)
    if _in_dask_task():
        # There, joblib's active backend is the whole cluster again: each recording would be sent on
        # as a task of its own.
        threads = ThreadingBackend()
        return threads, threads.effective_n_jobs(n_jobs)
    backend, jobs_of_context = get_active_backend(prefer=prefer)
    return backend, backend.effective_n_jobs(jobs_of_context if n_jobs is None else n_jobs)


def _in_dask_task() -> bool:
    """Tell whether a worker of a Dask cluster calls this."""
    distributed = sys.modules.get("distributed")
    if distributed is None:
        return False
    try:
        distributed.get_worker()
    except ValueError:  # not in a task
        return False
    return True


def _located(function: Callable[..., Any], name: Callable[[], str], *values: Any) -> Any:
    try:
        return function(*values)
    except (TypeError, ValueError) as error:
        raise located_error(error, name()) from error


def _check_whole(n_jobs: Any) -> None:
    meaning = "it is the number of recordings processed in parallel, -1 for one on each core."
    if isinstance(n_jobs, bool) or not isinstance(n_jobs, Integral):
        raise TypeError(f"n_jobs must be None or a whole number, got {n_jobs!r}: {meaning}")
    if n_jobs == 0:
        raise ValueError(f"n_jobs must not be 0: {meaning}")


def _in_threads(
    function: Callable[..., Any], arguments: Sequence[Sequence[Any]], n_workers: int
) -> Iterable[Any]:
    with ThreadPoolExecutor(n_workers) as workers:
        yield from workers.map(function, *arguments)


def _bar() -> Any:
    """Return tqdm's progress bar, or None where it is not installed."""
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None
    return tqdm
