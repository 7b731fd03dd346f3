"""Tables that users write: costs, and the meta of files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from emacm._checks import located
from emacm.recordings.names import printable


def read_table(path: str | Path, **options: Any) -> pd.DataFrame:
    """Return a table with a header; where it has semicolons, they separate, and commas are decimal.

    Parameters
    ----------
    path : path
        The file.
    **options
        As for `pandas.read_csv`.

    Raises
    ------
    ValueError
        If it is empty, or a row is longer than the header.
    """
    with located(printable(Path(path))):
        header = Path(path).read_text(encoding="utf-8-sig").partition("\n")[0]
        local: dict[str, Any] = {"sep": ";", "decimal": ","} if ";" in header else {}
        return pd.read_csv(path, encoding="utf-8-sig", **local, **options)
