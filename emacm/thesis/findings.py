"""What a reproduction found: published figures beside ours, tables and pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike


class Finding(NamedTuple):
    """One published number beside ours.

    Attributes
    ----------
    where : str
        Where it stands in the publication, such as "Table 2.1, eigenvalue 1".
    published : float
        The published number.
    ours : float
        Ours; the median where there are several seeds.
    low, high : float
        Range of ours, or what is allowed around it.
    agrees : bool
        Whether the published number lies within the range.
    note : str
        How it was obtained, and, where it does not agree, why.
    """

    where: str
    published: float
    ours: float
    low: float
    high: float
    agrees: bool
    note: str


@dataclass
class Chapter:
    """What one chapter of a reproduction gave.

    Attributes
    ----------
    number : int
        Of the chapter in the publication.
    title : str
        Its title.
    remarks : list of str
        Paragraphs for the reader, in plain text, in order.
    findings : list of Finding
        Published figures beside ours.
    tables : dict of str to DataFrame
        Tables by name.
    figures : dict of str to matplotlib Figure
        Pictures by name, such as "Fig. 2.7"; with their captions in `captions`.
    captions : dict of str to str
        What a picture shows.
    opening : str
        What the reader must know before anything else; empty if nothing.
    """

    number: int
    title: str
    remarks: list[str] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    tables: dict[str, pd.DataFrame] = field(default_factory=dict)
    figures: dict[str, Any] = field(default_factory=dict)
    captions: dict[str, str] = field(default_factory=dict)
    opening: str = ""

    def draw(self, name: str, figure: Any, caption: str) -> None:
        """Keep a picture and what it shows."""
        self.figures[name] = figure
        self.captions[name] = caption

    def compare(
        self, where: str, published: float, values: ArrayLike, note: str, *, slack: float = 0.0
    ) -> Finding:
        """Set a published number beside our values of it, one for each seed.

        Parameters
        ----------
        where : str
            Where it stands.
        published : float
            The published number.
        values : float or array-like
            Ours.
        note : str
            How they were obtained.
        slack : float
            What is allowed beyond the range of the values, for rounding in print.

        Returns
        -------
        Finding
            Also kept in `findings`.
        """
        ours = np.atleast_1d(np.asarray(values, dtype=float))
        low, high = float(ours.min()) - slack, float(ours.max()) + slack
        agrees = bool(low <= published <= high)
        finding = Finding(where, published, float(np.median(ours)), low, high, agrees, note)
        self.findings.append(finding)
        return finding


def findings_frame(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return findings as a table, a row each."""
    return pd.DataFrame(list(findings), columns=list(Finding._fields))
