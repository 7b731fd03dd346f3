"""Results of a reproduction: published figures and ours, tables and pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike


class Finding(NamedTuple):
    """One published number and ours.

    Attributes
    ----------
    where : str
        Place in the publication, such as "Table 2.1, eigenvalue 1".
    published : float
        The published number.
    ours : float
        Our number; the median of several seeds.
    low, high : float
        Range of our numbers, including a tolerance for rounding in print.
    agrees : bool
        Whether the published number lies within the range.
    note : str
        Method and, where the numbers do not agree, the reason.
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
    """Results of one chapter.

    Attributes
    ----------
    number : int
        Number of the chapter in the publication.
    title : str
        Its title.
    remarks : list of str
        Paragraphs of plain text, in order.
    findings : list of Finding
        Published figures and ours.
    tables : dict of str to DataFrame
        Tables by name.
    figures : dict of str to matplotlib Figure
        Pictures by name, such as "Fig. 2.7"; with their captions in `captions`.
    captions : dict of str to str
        Captions of the pictures.
    opening : str
        Text at the beginning of the report and of the chapter; may be empty.
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
        """Keep a picture and its caption."""
        self.figures[name] = figure
        self.captions[name] = caption

    def compare(
        self, where: str, published: float, values: ArrayLike, note: str, *, slack: float = 0.0
    ) -> Finding:
        """Compare a published number with our values of it, one for each seed.

        Parameters
        ----------
        where : str
            Place in the publication.
        published : float
            The published number.
        values : float or array-like
            Ours.
        note : str
            Method.
        slack : float
            Tolerance beyond the range of the values, for rounding in print.

        Returns
        -------
        Finding
            Also appended to `findings`.
        """
        ours = np.atleast_1d(np.asarray(values, dtype=float))
        low, high = float(ours.min()) - slack, float(ours.max()) + slack
        agrees = bool(low <= published <= high)
        finding = Finding(where, published, float(np.median(ours)), low, high, agrees, note)
        self.findings.append(finding)
        return finding


def findings_frame(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return findings as a table, one row each."""
    return pd.DataFrame(list(findings), columns=list(Finding._fields))
