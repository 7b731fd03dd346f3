"""What is known of a stream before its first sample, and the loops that are compiled for it."""

from __future__ import annotations

import warnings
from contextlib import suppress
from io import BytesIO
from typing import Any

import numpy as np

from emacm.resampling.spreading import spread_rows
from emacm.shaft.paths import ShaftPath
from emacm.streams.spectrum_stream import Settings, SpectrumStream
from emacm.streams.streamed_models import StreamedModel

_EMPTY = "{}"


def packed(state: dict[str, Any]) -> bytes:
    """Return a state as the bytes of an npz file.

    Parameters
    ----------
    state : dict
        Arrays, numbers and texts, also in nested dictionaries, whose keys are texts without "/",
        lists and tuples. Entries that are None are omitted.

    Returns
    -------
    bytes

    Examples
    --------
    >>> unpacked(packed({"values": [1.5, {"name": "current", "none": {}}]}))
    {'values': [array(1.5), {'name': array('current', dtype='<U7'), 'none': {}}]}
    """
    stream = BytesIO()
    np.savez(stream, **_flat(state, ""))
    return stream.getvalue()


def unpacked(content: bytes) -> dict[str, Any]:
    """Return the state whose bytes `packed` returned; lists for tuples, arrays for all values.

    Raises
    ------
    ValueError
        If it is not such a state.
    """
    try:
        with np.load(BytesIO(content), allow_pickle=False) as file:
            arrays = dict(file)
    except Exception as error:  # zip, zlib and NumPy raise many kinds
        raise ValueError(
            f"state must be the bytes that OrderMonitor.state returned, and these cannot be read "
            f"({error}). Was the file written completely?"
        ) from error
    tree: dict[str, Any] = {}
    for path, value in arrays.items():
        *parents, name = path.split("/")
        branch = tree
        for parent in parents:
            branch = branch.setdefault(parent, {})
        branch[name] = value
    return _lists(tree)


def _flat(value: Any, path: str) -> dict[str, Any]:
    if value is None:
        return {}
    if isinstance(value, list | tuple):
        value = {f"#{i}": item for i, item in enumerate(value)} or {"#": np.empty(0)}
    if not isinstance(value, dict):
        array = np.asarray(value)
        if array.dtype.hasobject:  # would be stored as code
            raise TypeError(f"a state holds arrays, numbers and texts, got {value!r} at {path!r}.")
        return {path: array}
    flat: dict[str, Any] = {} if value else {f"{path}/{_EMPTY}": np.empty(0)}
    for name, item in value.items():
        flat |= _flat(item, f"{path}/{name}" if path else str(name))
    return flat


def _lists(tree: Any) -> Any:
    if not isinstance(tree, dict):
        return tree
    branches = {name: _lists(item) for name, item in tree.items() if name != _EMPTY}
    if any(name.startswith("#") for name in branches):
        return [branches[f"#{i}"] for i in range(len(branches)) if f"#{i}" in branches]
    return branches


def compile_loops(model: StreamedModel, settings: Settings) -> None:
    """Run all inner loops once, so that the first samples need not wait for the compiler."""
    plan, theta_s = settings.plan, settings.theta_s
    n_rows = sum(len(group) for _, group in settings.groups)
    path = ShaftPath(np.linspace(0, 100 * theta_s, 201), 1000.0, 0.0, 0.0, 1)
    for fs in (1000.0, 1e5):  # upsampled, and not
        list(spread_rows([np.zeros(int(fs / 5) + 1)] * n_rows, fs, path, theta_s))
    stream = SpectrumStream(settings)
    stream.append([[np.zeros(3)] * len(group) for _, group in settings.groups], np.full(3, 1.0))
    stream.shaft.advance()
    section = np.random.default_rng(0).normal(size=(n_rows, plan.n_per_segment + plan.step))
    powers = plan.spectrum_of(plan.section_powers(section, 0, 2), 2)
    with warnings.catch_warnings(), suppress(ValueError):
        warnings.simplefilter("ignore")
        model.reading(0.0, 0.0, np.stack([powers] * len(settings.kinds), axis=1))
