"""Parallel execution over recordings, and its progress."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import partial
from typing import Any

from joblib import Parallel, delayed, parallel_config
from joblib.parallel import get_active_backend

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

    Notes
    -----
    In a task of a Dask cluster, recordings are processed by its worker.

    Examples
    --------
    >>> run(pow, [2, 3], [3, 2])
    [8, 9]
    """
    if names is not None:
        function, arguments = partial(_located, function), (names, *arguments)
    tasks = [delayed(function)(*values) for values in zip(*arguments, strict=True)]
    # There, joblib's active backend is the whole cluster again: each recording would be sent on.
    with parallel_config("threading") if _in_dask_task() else nullcontext():
        generates = get_active_backend(prefer=prefer)[0].supports_return_generator
        bar = _bar() if verbose and generates else None
        if bar is None:
            return Parallel(n_jobs=n_jobs, verbose=int(verbose), prefer=prefer)(tasks)
        parallel = Parallel(n_jobs=n_jobs, prefer=prefer, return_as="generator")
        return list(bar(parallel(tasks), total=len(tasks), unit=unit))


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


def _bar() -> Any:
    """Return tqdm's progress bar, or None where it is not installed."""
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None
    return tqdm
