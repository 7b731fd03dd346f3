"""Model cards: what a model file states about its model, as tables and a picture."""

from __future__ import annotations

import html
import importlib.util
import json
import os
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from emacm.displays.domain import DomainDisplay
from emacm.displays.drawing import offscreen_panels
from emacm.evaluation.evaluate import as_texts
from emacm.models.evidence import evidence_table
from emacm.models.model_files import model_description
from emacm.reports.written_pages import encoded_svg, plain_page


class ModelCard(dict[str, Any]):
    """What a model file states about its model; printed as a model card.

    It is a dictionary with the keys of `emacm.models.model_files.model_description`.
    """

    @property
    def evidence(self) -> dict[str, Any]:
        """The evidence; empty if none was stored."""
        return self.get("evidence") or {}

    def facts(self) -> dict[str, str]:
        """Return what is stated in single sentences."""
        evidence, folds = self.evidence, evidence_table(self.evidence, "rates").get("folds", {})
        texts = {
            "Model": f"{self['model']}: {', '.join(self['steps'])}".rstrip(": "),
            "Saved": self["saved"],
            "Note": self["note"],
            "Intended use": evidence.get("intended_use") or "not stated",
            "Limits": evidence.get("limits") or "not stated",
            "States": ", ".join(map(str, self["classes"] or ())),
            "Healthy state": self["healthy"],
            "Channels": ", ".join(self["channels"]),
            "Training files": f"{len(evidence['files'])} of known SHA-256" if evidence else None,
            "Splits": "; ".join(f"{name}, {n:g} folds" for name, n in folds.items() if n > 0),
            "Evidence": None if evidence else "none stored; emacm train stores it",
            "Versions": ", ".join(f"{name} {text}" for name, text in self["versions"].items()),
        }
        return {name: str(text) for name, text in texts.items() if text not in (None, "")}

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return tables of text by their titles, without those that would be empty."""
        stated = partial(evidence_table, self.evidence)
        tables = {
            "Costs (rows: decisions, columns: true states)": pd.DataFrame(
                self["cost"], self["decisions"], self["truths"]
            ),
            "Training recordings": stated("states"),
            "Recordings held out (95 % intervals over whole units)": as_texts(stated("rates")).T,
            "Whole units held out, decisions (rows) and true states": stated("confusion"),
            "Families of faults left out of training": as_texts(stated("left_out")).T,
            "Calibration, whole units held out": stated("calibration").round(3),
            "Operating conditions of the training": self._ranges(),
        }
        return {title: table for title, table in tables.items() if len(table)}

    def _ranges(self) -> pd.DataFrame:
        ranges: dict[str, Any] = {}
        for own in self["training_range"]:  # one for each resampler
            for name, ends in (own or {}).items():
                known = *ranges.get(name, ()), *ends
                ranges[name] = min(known), max(known)
        points = evidence_table(self.evidence, "domain").select_dtypes("number")
        ranges |= {name: (points[name].min(), points[name].max()) for name in points}
        for name in ("slowest", "fastest"):
            if name in ranges:
                ranges[f"{name} [rpm]"] = tuple(30 / np.pi * np.array(ranges.pop(name)))
        return pd.DataFrame(ranges, ["lowest", "highest"]).T.map("{:.5g}".format)

    def to_json(self) -> str:
        """Return everything that the file states, as JSON."""
        return json.dumps(self, indent=1)

    def to_html(self) -> str:
        """Return the card as a page."""
        return plain_page("Model card", self._repr_html_())

    def _repr_html_(self) -> str:
        facts = pd.Series(self.facts()).to_frame().to_html(header=False)
        caveats = "".join(f"<li>{html.escape(t)}</li>" for t in self.evidence.get("caveats", ()))
        tables = "".join(
            f"<h2>{html.escape(title)}</h2>{table.to_html()}"
            for title, table in self.tables().items()
        )
        points = evidence_table(self.evidence, "domain")
        picture = ""
        if len(points) and importlib.util.find_spec("matplotlib"):
            figure, axes = offscreen_panels(height=3.4)
            DomainDisplay(points.reset_index(), healthy=self["healthy"]).plot(ax=axes[0, 0])
            source = f"data:image/svg+xml;base64,{encoded_svg(figure)}"
            picture = f'<h2>Training domain</h2><img src="{source}" alt="training domain">'
        return f"{facts}<ul>{caveats}</ul>{picture}{tables}"

    def __str__(self) -> str:
        lines = [f"{name}: {text}" for name, text in self.facts().items()]
        lines += [f"- {text}" for text in self.evidence.get("caveats", ())]
        for title, table in self.tables().items():
            lines += ["", title, table.to_string()]
        return "\n".join(lines)

    __repr__ = __str__


def describe_model(path: str | os.PathLike[str]) -> ModelCard:
    """Return what a model file states about its model, without loading the model.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    ModelCard
        A dictionary with the keys of `emacm.models.model_files.model_description`, printed as a
        model card: facts, costs, training recordings, figures of merit with intervals, confusions,
        calibration, and the range of the operating conditions.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is not a model file, or is damaged.

    See Also
    --------
    emacm.save_model : How the file is written.
    emacm.displays.DomainDisplay : The map of the training domain.
    """
    return ModelCard(model_description(path))
