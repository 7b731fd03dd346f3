"""The content of one page: what is stated about one recording, in the order of importance."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.decisions.pipelines import parts_of, parts_with_input
from emacm.decisions.risks import LeastRiskMixin
from emacm.displays.drawn_values import envelopes_of
from emacm.explanations.deviations import class_deviations, second_state_statement
from emacm.explanations.explain import explain_decision
from emacm.machine.fault_lines import FaultLines
from emacm.machine.fault_orders import fault_series
from emacm.machine.find_faults import find_faults
from emacm.models import scoring
from emacm.orders.columns import parse_order_columns
from emacm.orders.order_psd import OrderPSD
from emacm.recordings.names import unit_ratio
from emacm.recordings.recording import Recording
from emacm.reports.facts import (
    Facts,
    channel_name,
    confidence,
    listed,
    percent,
    recording_facts,
    when,
)
from emacm.reports.findings import Findings, Spectra, find_raised
from emacm.resampling.order_resampler import OrderResampler

Source = Callable[[], Any]  # of a recording
Further = Callable[[Any], dict[str, Any]] | None  # values of a recording for its row


@dataclass(frozen=True)
class Settings:
    """What is the same for all pages of a report.

    Attributes
    ----------
    model : estimator
        Fitted classifier.
    facts : list of (str, str)
        Facts about the model.
    actions : mapping of str to str, optional
        Recommended action for each decision.
    parts : part or sequence of parts, optional
        Components of the machine.
    healthy : label
        The healthy state; None if there is none.
    background : list of Recording, optional
        Healthy recordings.
    """

    model: Any
    facts: Facts
    actions: Mapping[str, str] | None
    parts: Any
    healthy: Any
    background: Any


URGENCIES = ("fault", "unknown", "uncertain", "undecided", "check", "listed", "healthy")


@dataclass
class Page:
    """The content of one page.

    Attributes
    ----------
    name : str
        The recording.
    decision : str
        The decision, or that there is none.
    kind : {"healthy", "fault", "unknown", "uncertain", "undecided", "listed"}
        Kind of the decision; "listed" where it is not known which state is the healthy one.
    first : list of str
        What is wrong with the recording; the decision may be wrong if `doubtful`.
    doubtful : bool
        Whether it is so far from what can be decided on that it must be checked first.
    sentences : list of str
        The decision and its confidence.
    since, action : str
        Since when, and the recommended action; empty if they are not known.
    statements : list of str
        What deviates from the training, of an unknown state; lines of a second state.
    reference : str
        The class above which they are raised.
    normal, notes : list of str
        What was found normal, and what must be noted.
    recording, model_facts : list of (str, str)
        Facts.
    spectra : mapping of channels to (orders, power)
        Order spectra of the first `OrderPSD` of the model [U²/order, or U²], to be drawn.
    healthy_spectra : mapping of channels to ndarray of shape (n_orders,)
        Mean order spectra of the healthy recordings, if these are given.
    deviations : DataFrame, optional
        What is drawn.
    findings : Findings, optional
        What is raised.
    units, envelopes : mapping of str to str
        Units of the channels, and kinds of those that are envelopes.
    parts : part or sequence of parts, optional
        Whose orders are marked.
    digest : str
        Of the file and the settings, by which the page is recognised later.
    unit, date : str
        The machine, and when it was recorded ("file time": written); empty if not known.
    row : mapping
        What was decided, as a row of `score`.
    """

    name: str
    decision: str
    kind: str
    first: list[str] = field(default_factory=list)
    doubtful: bool = False
    sentences: list[str] = field(default_factory=list)
    since: str = ""
    action: str = ""
    statements: list[str] = field(default_factory=list)
    reference: str = ""
    normal: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    recording: Facts = field(default_factory=list)
    model_facts: Facts = field(default_factory=list)
    spectra: Spectra = field(default_factory=dict)
    healthy_spectra: Mapping[str, NDArray[np.floating]] = field(default_factory=dict)
    deviations: pd.DataFrame | None = None
    findings: Findings | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    envelopes: Mapping[str, str] = field(default_factory=dict)
    parts: Any = None
    digest: str = ""
    unit: str = ""
    date: str = ""
    row: Mapping[str, Any] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """Unit and date; the name of the recording if its unit is not known."""
        machine = f"Unit {self.unit}" if self.unit else Path(self.name).name
        return f"{machine}, {self.date or 'date of the recording unknown'}"

    @property
    def urgency(self) -> str:
        """A word for the decision, one of `URGENCIES`."""
        return "check" if self.kind == "healthy" and self.doubtful else self.kind

    @property
    def heading(self) -> str:
        """What precedes the warnings about the recording."""
        if self.kind == "undecided":
            return "The recording could not be decided on"
        if self.doubtful:
            return "Check the measurement first: the decision may be wrong"
        return "Outside the range of the training"


def page_of(settings: Settings, source: Source, name: str, facts: Further = None) -> Page:
    """Return the page of a recording that a function opens; an error is its content.

    Parameters
    ----------
    settings : Settings
        What is the same for all pages.
    source : callable
        Returns the recording.
    name : str
        Name of the recording.
    facts : callable, optional
        Returns further values of the recording for its row.

    Returns
    -------
    Page
        Its `since` is empty.
    """
    (row,) = scoring.scored_rows(settings.model, [source], [name], facts=facts)
    if row["error"]:
        page = Page(name, "no decision", "undecided", [row["error"]], True, row=row)
        page.recording, page.model_facts = [("File", name)], settings.facts
        return page
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # what they say is on the page
        recording = source()
        page = Page(name, str(row["decision"]), "uncertain", row=row, model_facts=settings.facts)
        other = _add_decision(page, settings, recording)
        page.recording = recording_facts(recording, name)
        page.unit, page.units = str(recording.meta.get("unit", "")), recording.units
        start = getattr(recording, "start", None)  # of a file only
        page.date = "" if start is None else when(start)
        page.envelopes = envelopes_of(settings.model)
        if settings.actions is not None:
            page.action = settings.actions.get(page.decision, "none is given for this decision")
        _add_warnings(page, settings.model, recording)
        _add_typicality(page)
        _add_findings(page, settings, recording, other)
        if settings.healthy is None and page.kind == "fault":
            page.kind = "listed"
    return page


def _add_decision(page: Page, settings: Settings, recording: Recording) -> Any:
    """State the decision, how certain it is, and which other states are possible.

    Returns
    -------
    label
        The most probable known state that was not decided; None if there is none.
    """
    classifier, table = scoring.opened_classifier(settings.model, [recording])
    decision, unknown = page.row["decision"], getattr(classifier, "unknown", None)
    states, posterior = classifier.classes_.tolist(), classifier.predict_proba(table)[0]
    own = _stands_for(classifier, decision)
    others = [k for k in np.argsort(-posterior, kind="stable") if not own[k]]
    probability = float(posterior[own].sum())
    if decision == unknown:
        page.kind = "unknown"
        page.sentences.append(
            f"The recording is unlike all states that the model knows ({listed(states)}). What it "
            f"is must be found out at the machine."
        )
    elif decision == settings.healthy or own.any():
        page.kind = "healthy" if decision == settings.healthy else "fault"
        beyond = page.row.get(scoring.P_UNKNOWN, 0.0)
        page.sentences.append(
            f"Confidence: {confidence(probability)}. The probability of this state is "
            f"{percent(probability)}."
            if beyond <= 0.5
            else f"Confidence: low. The state is probably ({percent(beyond)}) none of the model."
        )
    else:
        text = f"No state is certain enough: {page.decision!r} has the lowest expected cost."
        page.sentences.append(text)
    likely = [k for k in others if posterior[k] >= 0.01][:4]
    if likely and decision != unknown:
        possible = [f"{states[k]} ({percent(posterior[k])})" for k in likely]
        page.sentences.append(f"Possible too: {listed(possible)}.")
    if page.kind in ("healthy", "fault") and probability < max(posterior[others], default=0.0):
        text = "It was decided because the costs of the other decisions are higher."
        page.sentences.append(text)
    if all(getattr(part, "temperature", None) is None for part in parts_of(classifier)):
        page.sentences.append(
            "The probabilities were not calibrated on left-out recordings: they are usually too "
            "close to certainty."
        )
    if hasattr(classifier, "second_states"):
        (second,) = classifier.second_states(table, [decision])
        if second is not None:
            page.sentences.append(f"There are {second_state_statement(decision, second)}.")
    return states[others[0]] if others else None


def _stands_for(classifier: Any, decision: Any) -> NDArray[np.bool_]:
    """Return for which classes a decision stands: its own, or all of a family."""
    states = classifier.classes_.tolist()
    own = np.array([state == decision for state in states])
    if isinstance(classifier, LeastRiskMixin):
        decisions, cost = classifier.decisions_.tolist(), classifier.cost_[:, : len(states)]
        covered = cost[decisions.index(decision)] <= cost.min(axis=0)
        own |= covered & [state not in decisions for state in states]
    return own


def _add_typicality(page: Page) -> None:
    """State how far the recording is from its state, beside those of the training."""
    typicality, unknown = float(page.row["typicality"]), page.row.get(scoring.P_UNKNOWN)
    if np.isnan(typicality):
        return
    beside = (
        "" if unknown is None else f"; the probability of an unknown state is {percent(unknown)}"
    )
    if typicality <= 0.01:  # 1 in 100
        page.sentences.append(
            f"The recording is unusual: fewer than 1 in 100 training recordings are as far away "
            f"from the states of the model{beside}."
        )
    else:
        page.normal.append(
            f"{percent(typicality)} of the training recordings are as far from their state, or "
            f"farther{beside}"
        )


def _add_warnings(page: Page, model: Any, recording: Recording) -> None:
    """State what is wrong with a recording, or that nothing is."""
    resamplers = [part for part, _ in parts_with_input(model, [recording], OrderResampler)]
    usual = {kind for resampler in resamplers for kind in resampler.training_range_.defects}
    defects = scoring.defects_of(resamplers, recording)
    page.first = [defect.text for defect in defects if defect.kind not in usual]
    page.notes += [f"As in the training: {d.text}." for d in defects if d.kind in usual]
    if resamplers and not defects:
        page.normal.append(
            "channels without clipping, overflow, drop-outs, offsets or constant values"
        )
    page.doubtful = bool(page.first)
    with suppress(TypeError):  # the model does not know the range of its training
        statements = scoring.outside_training(model, [recording])[0]
        if all(statement.kind in ("new line", "new unit") for statement in statements):
            page.normal.append(
                "speed, sampling rates, levels and length within those of the training"
            )
        page.doubtful |= any(statement.severe for statement in statements)
        page.first += [statement.text for statement in statements]


def _add_findings(page: Page, settings: Settings, recording: Recording, other: Any) -> None:
    """State which orders are raised, or why this is not known."""
    model, parts = settings.model, settings.parts
    if parts is None:
        known = (part.parts for part in parts_of(model) if isinstance(part, FaultLines))
        parts = next(known, None)
    page.parts = parts
    reference = settings.healthy if settings.healthy is not None else other
    background, healthy = settings.background, {}
    spectra = _order_spectra(model, [recording])
    page.spectra = {channel: (orders, power[0]) for channel, (orders, power) in spectra.items()}
    try:
        explained = explain_decision(model, recording, background=background)
        page.statements = explained.attrs.get("statements", [])
        table = class_deviations(model, recording, reference, background=background)
        if background is not None:
            spectra = _order_spectra(model, list(background))
            healthy = {channel: powers for channel, (_, powers) in spectra.items()}
            page.healthy_spectra = {name: powers.mean(axis=0) for name, powers in healthy.items()}
    except (TypeError, ValueError) as error:
        page.notes.append(f"Which orders are raised is not known: {error}")
        return
    judged = lines_of_envelopes(page, parts, recording)
    if page.kind == "fault" and parts is not None:  # nothing is normal against the decision
        judged = [fault.name for fault in fault_series(parts, 1)]
    found = find_raised(table, str(reference), parts, page.spectra, healthy, judged=judged)
    page.deviations, page.findings, page.reference = table, found, str(reference)
    page.normal += found.normal
    page.notes += found.notes
    of = "healthy recordings given" if healthy else f"training recordings of {str(reference)!r}"
    page.notes.append(
        f"Deviations are from the mean of the {of}; those of at least 3 dB and 4 standard "
        f"deviations are listed."
    )
    if page.spectra and not healthy:
        page.notes.append(
            "The rise of a line is at least its own power over that of the whole band of orders in "
            "healthy recordings; with healthy recordings as background, it is measured exactly."
        )


def _order_spectra(model: Any, X: list[Any]) -> dict[str, tuple[Any, Any]]:
    """Return orders and power of each channel, as the first `OrderPSD` of a model computes them."""
    for part, own in list(parts_with_input(model, X, OrderPSD))[:1]:
        power = np.asarray(part.transform(own), dtype=np.float64)
        blocks = parse_order_columns(list(part.get_feature_names_out())) or ()
        return {block.channel: (block.orders, power[:, block.columns]) for block in blocks}
    return {}


def lines_of_envelopes(page: Page, parts: Any, recording: Recording) -> list[str]:
    """State which lines `find_faults` finds in vibrations, and return the names of these faults."""
    units = {name: recording.units.get(name) or "g" for name in recording.channels}
    shaken = [n for n, u in units.items() if unit_ratio(u, "g") or unit_ratio(u, "m/s")]
    if parts is None or not shaken or not any(fault.slips for fault in fault_series(parts, 1)):
        return []
    try:
        found = find_faults([recording], parts, channels=shaken)
    except (TypeError, ValueError) as error:
        page.notes.append(f"Lines in the envelope were not looked for: {error}")
        return []
    names: list[str] = []
    for row in found.itertuples():
        own = [name for name in (row.named, row.suspected) if name != "none"]
        if own:
            explanation = row.explanation.removesuffix(".")
            text = f"{channel_name(row.channel)}, without training: {explanation}"
            page.sentences.append(f"In the envelope of {text}.")
            names += " + ".join(own).split(" + ")
    return names
