"""Model files: a fitted pipeline without pickled code, with a description of it."""

from __future__ import annotations

import importlib
import json
import os
import platform
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from emacm._checks import located
from emacm._saved import values_as_lists
from emacm._version import __version__
from emacm.resampling.order_resampler import OrderResampler

_SUBPACKAGES = {
    "calibration",
    "conditions",
    "envelopes",
    "files",
    "decisions",
    "machine",
    "alarms",
    "life",
    "streams",
    "orders",
    "recordings",
    "resampling",
    "stroke_features",
}
_OTHERS = {
    "emacm.machine.fault_lines.LineLevels",
    "scipy.sparse._csr.csr_array",
    "scipy.sparse._csr.csr_matrix",
    "sklearn.metrics._scorer._PassthroughScorer",
    "sklearn.model_selection._split.GroupKFold",
    "sklearn.model_selection._split.KFold",
    "sklearn.model_selection._split.LeaveOneGroupOut",
    "sklearn.model_selection._split.StratifiedKFold",
    "sklearn.utils._bunch.Bunch",
    "sklearn.utils._metadata_requests.MetadataRequest",
    "sklearn.utils._metadata_requests.MethodMetadataRequest",
}


def check_types(names: Sequence[str]) -> None:
    """Raise a TypeError if a model file must not contain one of the types.

    Parameters
    ----------
    names : sequence of str
        Full names of types that skops does not trust by itself.

    Raises
    ------
    TypeError
        The message names the types.
    """
    foreign = [name for name in names if name not in _OTHERS and not _is_ours(name)]
    if foreign:
        raise TypeError(
            f"the model contains types that a model file must not hold: {', '.join(foreign)}. Use "
            f"steps of emacm and scikit-learn, and functions of NumPy or SciPy, only; or "
            f"joblib.dump, whose files execute code."
        )


def _is_ours(name: str) -> bool:
    """Tell whether this is an estimator of emacm, or one of its classes that only hold values."""
    module, _, short = name.rpartition(".")
    parts = module.split(".")
    if len(parts) != 3 or parts[0] != "emacm" or parts[1] not in _SUBPACKAGES:
        return False
    if parts[2].startswith("__") or short.startswith("__"):
        return False
    try:
        found: Any = getattr(importlib.import_module(module), short, None)
    except ImportError:
        return False
    if not isinstance(found, type) or found.__module__ != module:
        return False
    holds_values = is_dataclass(found) or (issubclass(found, tuple) and hasattr(found, "_fields"))
    return issubclass(found, BaseEstimator) or holds_values


_START = b"emacm model 1\n"
_LIBRARIES = ("numpy", "scipy", "sklearn", "pandas", "skops")
_LONGEST = 1 << 26  # bytes of the description of a model
_SAME = 1e-6  # by which posteriors of the check rows may differ under other versions
_N_ROWS = 8  # check rows where classes have no means


def save_model(model: Any, path: str | os.PathLike[str], *, note: str | None = None) -> None:
    """Save a fitted model in a file that contains no pickled code.

    The file holds the model, as skops writes it, and a description: versions, classes, decisions,
    costs, priors, channels, sampling rates, and check rows with the posteriors that the model
    gives for them. Costs and priors may have any form. Recordings given as `baseline_recordings`
    are not stored, only the baselines computed from them.

    Parameters
    ----------
    model : estimator or Pipeline
        A fitted model of steps of emacm and scikit-learn. Functions must be those of NumPy or
        SciPy, such as ``FunctionTransformer(np.log10)``.
    path : str or Path
        The file; it replaces an existing one as a whole.
    note : str, optional
        Any text, for example where the training recordings are.

    Raises
    ------
    ImportError
        If skops is not installed (extra ``models``).
    FileNotFoundError
        If there is no such folder.
    NotFittedError
        If the model is not fitted.
    TypeError
        If the model contains something that cannot be stored without pickle; the message names
        it. ``joblib.dump`` stores any model, in files that execute code.

    See Also
    --------
    load_model, describe_model

    Examples
    --------
    >>> import tempfile
    >>> from emacm import CostSensitiveGaussianBayes, describe_model, load_model, save_model
    >>> X, y = [[0.0], [1.0], [5.0], [7.0]], ["new", "new", "worn", "worn"]
    >>> model = CostSensitiveGaussianBayes({("new", "worn"): 20}).fit(X, y)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_model(model, folder + "/bearing.emacm", note="bench 3")
    ...     loaded = load_model(folder + "/bearing.emacm")
    ...     describe_model(folder + "/bearing.emacm")["note"]
    'bench 3'
    >>> loaded.predict([[2.0]]).tolist() == model.predict([[2.0]]).tolist()
    True
    """
    if isinstance(model, type) or not isinstance(model, BaseEstimator):
        raise TypeError(f"model must be a fitted estimator, got {type(model).__name__}.")
    if note is not None and not isinstance(note, str):
        raise TypeError(f"note must be a text, got {note!r}.")
    check_is_fitted(model)
    file = Path(path)
    if not file.parent.is_dir():
        raise FileNotFoundError(f"there is no folder {str(file.parent)!r}.")
    skops = _skops()
    with values_as_lists():
        try:
            stored = skops.dumps(model, compression=8)
        except (TypeError, AttributeError, ValueError) as error:
            raise TypeError(
                f"the model contains something that a model file cannot hold: {error}. Use "
                f"functions of NumPy or SciPy only, or joblib.dump, whose files execute code."
            ) from error
    check_types(skops.get_untrusted_types(data=stored))
    about = json.dumps(_description(model, note), default=str).encode()
    body = len(about).to_bytes(8, "little") + about + stored
    content = _START + sha256(body).hexdigest().encode() + b"\n" + body
    unfinished = file.with_name(f".{file.name}.{os.getpid()}.part")
    unfinished.write_bytes(content)
    os.replace(unfinished, file)


def load_model(path: str | os.PathLike[str]) -> Any:
    """Load a model that `save_model` has saved.

    Nothing in the file is executed: only types of emacm and scikit-learn that hold numbers are
    constructed, and a file in which any byte was changed is refused. The check rows are evaluated;
    under other versions than those of the file, a warning states the versions. A digest is not a
    signature: load files only from sources that you trust. skops does not protect against files
    that exhaust the memory.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    estimator
        The fitted model; its posteriors are equal bit by bit to those of the saved one.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ImportError
        If skops is not installed (extra ``models``).
    TypeError
        If the file contains types that are not trusted; the message names them.
    ValueError
        If it is not a model file, is damaged, or the check rows give other posteriors.

    Warns
    -----
    UserWarning
        If the model was saved under other versions.
    """
    about, stored = _read(path)
    skops = _skops()
    with located(f"model {path}"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # versions are compared below, all at once
        try:
            types = skops.get_untrusted_types(data=stored)
            check_types(types)
            model = skops.loads(stored, trusted=types)
        except TypeError:
            raise
        except Exception as error:
            raise ValueError(
                f"it cannot be read ({type(error).__name__}: {error}). Save the model again, with "
                f"the versions installed here: {_versions()}."
            ) from error
        differ = _differences(about["versions"])
        _replay(model, about["check"], differ)
    if differ:
        warnings.warn(
            f"{path} was saved under other versions: {differ}. Its check rows give the same "
            f"posteriors here.",
            UserWarning,
            stacklevel=2,
        )
    return model


def describe_model(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return what a model file states about its model, without loading the model.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    dict
        "note", "saved" (time, UTC), "versions", "model" (class), "steps", "classes", "decisions",
        "cost" (rows: decisions, columns: truths), "truths", "priors", "channels", "units" and
        "training_range" (of the training recordings of each resampler) and "check" (rows of
        features with their posteriors).

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is not a model file, or is damaged.
    """
    return _read(path)[0]


def _skops() -> Any:
    try:
        return importlib.import_module("skops.io")
    except ImportError as error:
        raise ImportError(
            "model files are written by skops, which is not installed; run "
            "pip install 'emacm[models]'."
        ) from error


def _read(path: str | os.PathLike[str]) -> tuple[dict[str, Any], bytes]:
    """Return the description and the stored model of a file, if no byte was changed."""
    file = Path(path)
    if not file.is_file():
        raise FileNotFoundError(f"there is no model {str(path)!r}.")
    content = file.read_bytes()
    with located(f"model {path}"):
        start = len(_START)
        if content[:start] != _START:
            raise ValueError("it is not a model file of emacm.save_model, or of a later version.")
        digest, body = content[start : start + 64], content[start + 65 :]
        if sha256(body).hexdigest().encode() != digest or content[start + 64 : start + 65] != b"\n":
            raise ValueError(
                "it is damaged: its content does not have the digest that it states. Copy it again."
            )
        length = int.from_bytes(body[:8], "little")
        if not 0 < length <= min(_LONGEST, len(body) - 8):
            raise ValueError("it is damaged: its description is incomplete.")
        try:
            about = json.loads(body[8 : 8 + length])
            known = isinstance(about["versions"], dict) and isinstance(about["check"], list)
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise ValueError(f"it is damaged: its description is invalid ({error}).") from error
        if not known:
            raise ValueError("it is damaged: its description is invalid.")
        return about, body[8 + length :]


def parts_of(model: Any) -> Iterator[Any]:
    """Yield a fitted model and all estimators that it contains, each once, outer ones first."""
    seen: set[int] = set()

    def walk(value: Any) -> Iterator[Any]:
        if id(value) in seen:
            return
        seen.add(id(value))
        if isinstance(value, BaseEstimator):
            yield value
            value = vars(value)
        if isinstance(value, Mapping):
            value = list(value.values())
        if isinstance(value, list | tuple):
            for inner in value:
                if isinstance(inner, BaseEstimator | Mapping | list | tuple):
                    yield from walk(inner)

    yield from walk(model)


def _description(model: Any, note: str | None) -> dict[str, Any]:
    resamplers = [part for part in parts_of(model) if isinstance(part, OrderResampler)]
    fitted = [part for part in resamplers if hasattr(part, "channels_")]
    return {
        "note": note,
        "saved": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "versions": _versions(),
        "model": type(model).__name__,
        "steps": [name for name, _ in getattr(model, "steps", ())],
        **{name: _plain(model, f"{name}_") for name in ("classes", "decisions", "truths", "cost")},
        "priors": _plain(model, "priors_"),
        "channels": list(fitted[0].channels_) if fitted else [],
        "units": [getattr(part, "training_units_", {}) for part in fitted],
        "training_range": [getattr(part, "training_range_", None) for part in fitted],
        "check": list(_check_rows(model)),
    }


def _versions() -> dict[str, str]:
    found = {name: importlib.import_module(name).__version__ for name in _LIBRARIES}
    return {"emacm": __version__, "python": platform.python_version(), **found}


def _differences(saved: Mapping[str, str]) -> str:
    here = _versions()
    pairs = {name: (version, here.get(name)) for name, version in saved.items() if name != "python"}
    return ", ".join(
        f"{name} {old} (here {new})" for name, (old, new) in pairs.items() if old != new
    )


def _plain(model: Any, name: str) -> Any:
    """Return an attribute of the model, or of its last step, as lists; None if it has none."""
    for part in (model, *([model.steps[-1][1]] if getattr(model, "steps", None) else [])):
        try:
            value = getattr(part, name)
        except (AttributeError, ValueError, TypeError):
            continue
        return np.asarray(value).tolist()
    return None


def _classifiers(model: Any) -> list[Any]:
    """Return the fitted parts that give posteriors for rows of features."""
    return [
        part
        for part in parts_of(model)
        if hasattr(part, "classes_")
        and not hasattr(part, "steps")
        and hasattr(part, "predict_proba")
        and isinstance(getattr(part, "n_features_in_", None), int)
    ]


def _check_rows(model: Any) -> Iterator[dict[str, Any]]:
    """Yield rows of features and their posteriors, for each classifier."""
    for part in _classifiers(model):
        rows = _rows_for(part)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                posterior = part.predict_proba(rows)
            except (ValueError, TypeError, AttributeError):  # not rows of numbers
                posterior = np.empty(0)
        yield {"rows": rows.tolist(), "posterior": np.asarray(posterior).tolist()}


def _rows_for(classifier: Any) -> Any:
    """Return the means of the classes and rows half way between them; or rows of any kind."""
    means = getattr(classifier, "means_", None)
    if means is not None and np.ndim(means) == 2:
        return np.vstack([means, (means + np.roll(means, 1, axis=0)) / 2])
    return np.random.default_rng(0).normal(size=(_N_ROWS, classifier.n_features_in_))


def _replay(model: Any, checks: list[Any], differ: str) -> None:
    """Raise a ValueError if the check rows give other posteriors than when the model was saved."""
    parts = _classifiers(model)
    versions = f" The versions differ: {differ}. Install those of the file." if differ else ""
    same = len(parts) == len(checks)
    for part, check in zip(parts, checks, strict=False):
        expected = np.asarray(check["posterior"], float)
        if expected.size:
            found = np.asarray(part.predict_proba(np.asarray(check["rows"], float)))
            same &= found.shape == expected.shape and np.allclose(found, expected, 0, _SAME)
    if not same:
        raise ValueError(
            f"its check rows give other posteriors than when it was saved.{versions} Otherwise fit "
            f"the model again."
        )
