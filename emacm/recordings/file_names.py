"""Properties of a recording that are written in the name of its file."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import lru_cache
from pathlib import PurePath
from string import Formatter
from typing import Any

_KINDS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "": (r".+", str),
    "d": (r"[+-]?\d+", int),
    "g": (r"[+-]?\d+(?:\.\d+)?", float),
}


def meta_from_name(path: PurePath, pattern: str) -> dict[str, Any]:
    """Return what a pattern finds in the name of a file.

    Parameters
    ----------
    path : Path
        The file.
    pattern : str
        Such as "{unit}_{state}_{run:d}.mat": fields are texts; ``:d`` makes a field an integer,
        ``:g`` a number. Without a suffix it is matched against the name without its suffix; with
        "/" also against the folders.

    Returns
    -------
    dict of str to object

    Raises
    ------
    ValueError
        If the name does not match, or matches in several ways.

    Examples
    --------
    >>> meta_from_name(PurePath("data/A7_worn_03.mat"), "{unit}_{state}_{run:d}")
    {'unit': 'A7', 'state': 'worn', 'run': 3}
    """
    greedy, lazy, kinds = _compiled(pattern)
    n_parts = pattern.count("/") + 1
    name = "/".join(path.parts[-n_parts:])
    tried = name.removesuffix(path.suffix) if path.suffix not in pattern[-8:] else name
    longest, shortest = greedy.fullmatch(tried), lazy.fullmatch(tried)
    if longest is None or shortest is None:
        raise ValueError(
            f"the file name {name!r} does not match the pattern {pattern!r} of meta. Rename the "
            f"file, leave it out, or pass meta as a table."
        )
    if longest.groups() != shortest.groups():
        raise ValueError(
            f"the file name {name!r} matches the pattern {pattern!r} of meta in several ways: "
            f"{longest.groupdict()} and {shortest.groupdict()}. Pass meta as a table."
        )
    return {field: kinds[field](text) for field, text in longest.groupdict().items()}


def check_pattern(pattern: str) -> str:
    """Return a pattern of file names.

    Raises
    ------
    ValueError
        If it has no field, a field twice, or a field of an unknown kind.
    """
    _compiled(pattern)
    return pattern


@lru_cache(maxsize=64)
def _compiled(
    pattern: str,
) -> tuple[re.Pattern[str], re.Pattern[str], dict[str, Callable[[str], Any]]]:
    greedy = lazy = ""
    kinds: dict[str, Callable[[str], Any]] = {}
    example = "such as '{unit}_{state}_{run:d}.mat'"
    try:
        parts = list(Formatter().parse(pattern))
    except ValueError as error:
        raise ValueError(f"meta must be a pattern {example}, got {pattern!r}: {error}.") from error
    for text, field, kind, _ in parts:
        greedy, lazy = greedy + re.escape(text), lazy + re.escape(text)
        if field is None:
            continue
        if not field.isidentifier() or field in kinds or kind not in _KINDS:
            raise ValueError(
                f"meta must be a pattern {example}, with each field once and ':d' or ':g' for "
                f"numbers; got {field!r} in {pattern!r}."
            )
        expression, kinds[field] = _KINDS[kind or ""]
        expression = expression.replace(".+", "[^/]+") if not kind else expression
        greedy += f"(?P<{field}>{expression})"
        lazy += f"(?P<{field}>{expression if kind else expression + '?'})"
    if not kinds:
        raise ValueError(f"meta must be a pattern {example}, got {pattern!r} without a field.")
    return re.compile(greedy), re.compile(lazy), kinds
