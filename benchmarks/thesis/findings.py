"""Results of a reproduction: published figures and ours, tables and pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib import pyplot
from numpy.typing import ArrayLike

Report = Callable[[str], None]  # receives lines of progress


class Finding(NamedTuple):
    """One published number and ours.

    Attributes
    ----------
    where : str
        Place in the publication, such as "Table 2.1, eigenvalue 1".
    published : float
        The published number.
    ours : float
        Our number; the median of the draws.
    low, high : float
        Range of our numbers.
    tolerance : float
        Distance from that range which still agrees, such as rounding in print or one test run.
    draws : int
        Number of draws; 1 if nothing is random, as the figure follows from definitions.
    agrees_by_range : bool
        Whether the published number lies within the range, or its tolerance beside it.
    agrees_by_median : bool
        Whether it lies within the middle half of the draws (first to third quartile), as about
        half of further draws would, or its tolerance beside it.
    note : str
        Method and, where the numbers do not agree, the reason.
    """

    where: str
    published: float
    ours: float
    low: float
    high: float
    tolerance: float
    draws: int
    agrees_by_range: bool
    agrees_by_median: bool
    note: str


class Verdict(NamedTuple):
    """What a chapter's claim amounts to.

    Attributes
    ----------
    text : str
        The answer with its figures.
    evidence : str
        Name of the table or picture of the chapter that shows them.
    first : bool
        Whether that table follows the verdicts, and not in its chapter.
    """

    text: str
    evidence: str
    first: bool = False


@dataclass
class Chapter:
    """Results of one chapter.

    Attributes
    ----------
    number : int
        Number of the chapter in the publication.
    title : str
        Its title.
    inputs : DataFrame
        Inputs and chosen readings with their sources.
    opening : str
        The result and what it rests on, at the beginning of the chapter.
    verdicts : list of Verdict
        The answers that the report begins with.
    remarks : list of str
        Paragraphs of plain text, in order.
    findings : list of Finding
        Published figures and ours.
    tables : dict of str to DataFrame
        Tables by name.
    figures : dict of str to (bytes, str)
        Pictures (PNG) and their captions by name, such as "Fig. 2.7".
    """

    number: int
    title: str
    inputs: pd.DataFrame
    opening: str = ""
    verdicts: list[Verdict] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    tables: dict[str, pd.DataFrame] = field(default_factory=dict)
    figures: dict[str, tuple[bytes, str]] = field(default_factory=dict)

    def draw(self, name: str, figure: Any, caption: str) -> None:
        """Keep a picture and its caption, and close the figure."""
        image = BytesIO()
        figure.savefig(image, dpi=110, metadata={"Software": None})
        pyplot.close(figure)
        self.figures[name] = (image.getvalue(), caption)

    def compare(
        self, where: str, published: float, values: ArrayLike, note: str, *, tolerance: float = 0.0
    ) -> Finding:
        """Compare a published number with our values of it, one for each draw.

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
        tolerance : float
            Distance from the range of the values which still agrees.

        Returns
        -------
        Finding
            Also appended to `findings`.
        """
        ours = np.atleast_1d(np.asarray(values, dtype=float))
        low, first, median, third, high = np.quantile(ours, (0, 0.25, 0.5, 0.75, 1)).tolist()
        within = low - tolerance <= published <= high + tolerance
        middle = first - tolerance <= published <= third + tolerance
        numbers = (float(published), median, low, high, tolerance, len(ours))
        self.findings.append(Finding(where, *numbers, within, middle, note))
        return self.findings[-1]


def lowest(values: pd.Series) -> str:
    """Name all entries that have the smallest value, and this value; "none" if it is infinite.

    Examples
    --------
    >>> lowest(pd.Series({"Current": 0.1, "LVDT": 0.1, "Motor Velocity": 0.4}))
    'Current and LVDT (0.1)'
    """
    if not np.isfinite(values.min()):
        return "none"
    return f"{' and '.join(values.index[values == values.min()])} ({values.min():.2g})"


def silent(line: str) -> None:
    """Report no progress."""


def counted(findings: Sequence[Finding]) -> str:
    """Return how many random figures lie within the range of ours, as text."""
    random = [finding for finding in findings if finding.draws > 1]
    within = sum(finding.agrees_by_range for finding in random)
    middle = sum(finding.agrees_by_median for finding in random)
    others = len(findings) - len(random)
    return (
        f"{within} of {len(random)} random figures within the range of ours, {middle} within its "
        f"middle half; {others} other figure{'s' * (others != 1)}"
    )
