"""Reader of TOML files: layouts, actions and parts of machines."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any


def read_toml(path: Path, *, largest: int = 1 << 20, longest: int = 30_000) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    path : Path
        The file, in UTF-8, with or without a byte order mark.
    largest : int
        Limit of its size [bytes].
    longest : int
        Limit of the length of a line, as keys of many parts take long.

    Returns
    -------
    dict of str to object

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is too large, or not TOML.
    """
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {str(path)!r}.")
    lines = path.read_bytes().split(b"\n") if path.stat().st_size <= largest else []
    if not lines or max(map(len, lines)) > longest:
        raise ValueError(
            f"it has more than {largest} bytes, or {longest} in one line. Remove what is no "
            f"setting, or divide the line."
        )
    try:
        return tomllib.loads(b"\n".join(lines).decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"it is not valid TOML: {error}.") from error
