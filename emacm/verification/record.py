"""Known answers, or the evaluation of a model, computed again, as a table with versions."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import clone

from emacm._saved import installed_versions
from emacm.files.folder import RecordingFolder
from emacm.models.baselines import evaluated_and_fitted
from emacm.models.evidence import evidence_table, training_evidence
from emacm.models.model_files import load_model, model_description
from emacm.recordings.meta import read_meta
from emacm.reports.written_pages import plain_page
from emacm.verification import answers as known

Row = tuple[str, float, float, float]


@dataclass(frozen=True, repr=False)
class Verification:
    """Known answers beside computed values; printed as a table.

    Attributes
    ----------
    table : DataFrame
        One row for each answer: "what" (the quantity, with its unit), "source" (a publication, a
        formula, or another implementation), "expected", "computed", "difference", "tolerance"
        (rounding, the resolution of an axis, or four standard errors where noise is drawn) and
        "passed".
    notes : tuple of str
        Checks that were left out because a package is not installed; versions that differ.
    seconds : float
        Time that the computation took [s].
    """

    table: pd.DataFrame
    notes: tuple[str, ...]
    seconds: float

    @classmethod
    def of(cls, table: pd.DataFrame, notes: Iterable[str], start: float) -> Verification:
        """Compare the columns "expected" and "computed"; `start` is a time of `perf_counter`."""
        table = table[["what", "source", "expected", "computed"]].assign(
            difference=table["computed"] - table["expected"], tolerance=table["tolerance"]
        )
        passed = table["difference"].abs() <= table["tolerance"]
        return cls(table.assign(passed=passed), tuple(notes), perf_counter() - start)

    @property
    def passed(self) -> bool:
        """Whether there are answers, and all are within their tolerance."""
        return bool(len(self.table) and self.table["passed"].all())

    @property
    def summary(self) -> str:
        """The result in one line."""
        passed = f"{self.table['passed'].sum()} of {len(self.table)} passed"
        return "; ".join([f"{passed} in {self.seconds:.1f} s", *self.notes])

    def facts(self) -> dict[str, str]:
        """Return versions, computer and digest.

        Returns
        -------
        dict of str to str
            "digest" is the SHA-256 of table and facts: a copy of the record in which a figure was
            changed does not have it.
        """
        facts = installed_versions() | {"computer": platform.platform()}
        stated = json.dumps(facts) + self.table.to_json()
        return facts | {"digest": sha256(stated.encode()).hexdigest()}

    def to_json(self) -> str:
        """Return table and facts as JSON."""
        answers = json.loads(self.table.to_json(orient="records"))
        content = {"passed": self.passed, "summary": self.summary, "facts": self.facts()}
        return json.dumps(content | {"answers": answers}, indent=1)

    def to_html(self) -> str:
        """Return table and facts as a page."""
        facts = pd.Series(self.facts()).to_frame().to_html(header=False)
        answers = self._as_text().to_html(index=False)
        title = "Known values, computed again by emacm"
        return plain_page(title, f"<p>{self.summary}</p>{answers}{facts}")

    def _as_text(self) -> pd.DataFrame:
        digits = {"expected": 6, "computed": 6, "difference": 2, "tolerance": 2}
        numbers = {name: self.table[name].map(f"{{:.{n}g}}".format) for name, n in digits.items()}
        texts = self.table[["what", "source"]].apply(lambda x: x.str.ljust(x.str.len().max()))
        passed = self.table["passed"].map({True: "yes", False: "NO"})
        return self.table.assign(**numbers, **texts, passed=passed)

    def __repr__(self) -> str:
        facts = "\n".join(f"{name}: {text}" for name, text in self.facts().items())
        return f"{self._as_text().to_string(index=False)}\n\n{facts}\n{self.summary}"


def known_answers() -> pd.DataFrame:
    """Return the known answers.

    Returns
    -------
    DataFrame
        Index: "check" (the function that computes the value) and "name"; columns "what", "source",
        "expected" and "tolerance".
    """
    path = Path(__file__).with_name("known_answers.csv")
    return pd.read_csv(path, index_col=["check", "name"])


def verify(answers: pd.DataFrame | None = None) -> Verification:
    """Compute known answers of the field on this computer.

    Parameters
    ----------
    answers : DataFrame, optional
        Some of, or other answers than those of `known_answers`. A value that cannot be computed
        does not pass; checks that need a package that is not installed are left out.

    Returns
    -------
    Verification
        The table.

    Examples
    --------
    >>> print(verify(known_answers().loc[["order_bins"]]).summary)  # doctest: +ELLIPSIS
    4 of 4 passed in ... s
    """
    answers = (known_answers() if answers is None else answers).copy()
    start, notes = perf_counter(), []
    computed = pd.Series(np.nan, answers.index)
    for name in answers.index.unique("check"):
        try:
            found = getattr(known, name)()
        except ImportError as error:
            notes.append(f"{name} left out: {error}")
            answers = answers.drop(name, level="check")
        except Exception as error:  # whatever is wrong here, the other answers are computed
            answers.loc[[name], "source"] = f"{type(error).__name__}: {error}"
        else:
            computed.update(pd.Series({(name, key): value for key, value in found.items()}))
    return Verification.of(answers.assign(computed=computed), notes, start)


def verify_model(path: str | os.PathLike[str], recordings: RecordingFolder) -> Verification:
    """Compute the evidence of a model file again, and compare.

    Parameters
    ----------
    path : str or Path
        A file of ``emacm train``.
    recordings : RecordingFolder
        The training recordings.

    Returns
    -------
    Verification
        Files by their SHA-256, recordings and units of each state, all figures of merit, and the
        posteriors of a model that is fitted again.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file holds no evidence, or none of files.

    Notes
    -----
    Versions of scikit-learn divide units into folds differently if there are more units than
    folds. Figures of merit are those of the file only under the versions that it states.
    """
    start, about = perf_counter(), model_description(path)
    stated = about.get("evidence") or {}
    if not stated.get("files"):
        raise ValueError(
            f"model {path}: it states no training files. Train it by emacm train, from files."
        )
    model = load_model(path)
    keys = (stated["labels"], stated["groups"])
    labels = read_meta(recordings, keys[0], role="--labels")
    groups = read_meta(recordings, keys[1], role="--groups")
    healthy = about["healthy"]
    found, refit, _ = evaluated_and_fitted(clone(model), recordings, labels, groups, healthy)
    again = training_evidence(found, labels, groups, keys=keys, recordings=recordings, model=model)
    posteriors = refit.predict_proba(recordings) - model.predict_proba(recordings)
    rows = [*_files(stated["files"], again["files"]), *_figures(stated, again)]
    rows.append(("posteriors of the model, fitted again", 0, np.abs(posteriors).max(), 1e-6))
    table = pd.DataFrame(rows, columns=["what", "expected", "computed", "tolerance"])
    here = installed_versions()
    other = [f"{name} {v}" for name, v in about["versions"].items() if here.get(name) != v]
    notes = [f"trained under {', '.join(other)}, which may divide units into other folds"]
    source = f"saved {about['saved']}"
    return Verification.of(table.assign(source=source), notes if other else (), start)


def _files(stated: dict[str, str], found: dict[str, str]) -> Iterator[Row]:
    changed = sum(stated[name] != found[name] for name in stated.keys() & found.keys())
    yield "files with another content", 0, changed, 0
    yield "files that are missing", 0, len(stated.keys() - found.keys()), 0
    yield "files that were added", 0, len(found.keys() - stated.keys()), 0


def _figures(stated: dict[str, Any], found: dict[str, Any]) -> Iterator[Row]:
    """Yield the counts of each state, and the figures of each split and family left out."""
    for table in ("states", "rates", "left_out"):
        before, now = (evidence_table(each, table) for each in (stated, found))
        for case, row in before.select_dtypes("number").iterrows():
            for name, value in row.dropna().items():
                computed = now.get(name, {}).get(case, np.nan)
                yield f"{name.replace('_', ' ')}, {before.index.name} {case}", value, computed, 1e-6
