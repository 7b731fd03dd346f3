"""Work on many recordings, and how far it is."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from typing import Any, TextIO

from joblib import Parallel, effective_n_jobs


def run(
    tasks: Iterable[Any],
    total: int,
    *,
    n_jobs: int | None = None,
    verbose: bool | int = False,
    done: int = 0,
) -> list[Any]:
    """Do tasks under joblib, in threads unless another backend is active; a single one at once.

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
    ValueError
        If `n_jobs` is 0.

    Examples
    --------
    >>> from joblib import delayed
    >>> run((delayed(abs)(n) for n in (-1, -2)), 2)
    [1, 2]
    """
    if not total:
        return []
    # A single one needs no workers; to ask for them takes joblib a third of a ms.
    if total == 1 and not verbose and effective_n_jobs(n_jobs):  # which refuses 0
        return [function(*args, **kwargs) for function, args, kwargs in tasks]
    bar = _bar() if verbose else None
    if bar is None:
        return Parallel(n_jobs=n_jobs, verbose=int(verbose), prefer="threads")(tasks)
    try:
        parallel = Parallel(n_jobs=n_jobs, prefer="threads", return_as="generator")
    except ValueError:  # a backend that returns nothing before it has all
        return Parallel(n_jobs=n_jobs, verbose=int(verbose), prefer="threads")(tasks)
    return list(bar(parallel(tasks), total=done + total, initial=done, unit="recording"))


class Teller:
    """Say in a line what is being done, and how much of the whole is.

    By tqdm's bar, if it is installed, or else by lines that begin with the seconds passed.

    Parameters
    ----------
    total : int
        Parts of the whole.
    unit : str
        What a part is called.
    file : file-like, optional
        Where to write. Default: stderr.

    Examples
    --------
    >>> with Teller(2, unit="chapter") as tell:
    ...     tell("chapter 1: pictures")
    ...     tell.advance()
    """

    def __init__(self, total: int, *, unit: str, file: TextIO | None = None) -> None:
        bar = _bar()
        self._file = sys.stderr if file is None else file
        self._start = time.perf_counter()
        self._shown = None if bar is None else bar(total=total, unit=unit, file=self._file)

    def __enter__(self) -> Teller:
        return self

    def __exit__(self, *error: object) -> None:
        if self._shown is not None:
            self._shown.close()

    def __call__(self, line: str) -> None:
        """Say what is being done."""
        if self._shown is not None:
            self._shown.set_postfix_str(line)
            return
        passed = time.perf_counter() - self._start
        print(f"[{passed:4.0f} s] {line}", file=self._file, flush=True)

    def advance(self) -> None:
        """Count one part as done."""
        if self._shown is not None:
            self._shown.update()


def _bar() -> Any:
    """Return tqdm's progress bar, or None where it is not installed."""
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None
    return tqdm
