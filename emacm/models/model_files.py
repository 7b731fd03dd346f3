"""Model files: a fitted pipeline without pickled code, with a description of it."""

from __future__ import annotations

import importlib
import json
import os
import re
import sys
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import is_dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.pipeline import FeatureUnion
from sklearn.utils.validation import check_is_fitted

from emacm._checks import located
from emacm._saved import installed_versions, values_as_lists, write_whole
from emacm._statements import warn
from emacm.decisions.costs import label_positions
from emacm.decisions.pipelines import (
    check_unknown_states,
    final_estimator,
    fitted_resamplers,
    parts_of,
)
from emacm.machine.fault_lines import LineLevels

# Numbers and their descriptions. Modules of scikit-learn that read files or run tests are left out.
_TRUSTED = re.compile(
    r"emacm\.[a-z_]+\.[a-z][a-z_]+|scipy\.sparse\._csr|numpy"
    r"|sklearn\.(?!externals|datasets|utils)[a-z_.]+|sklearn\.utils\.(_bunch|_metadata_requests)"
)
_START = b"emacm model 2\n"


def _check_types(names: Sequence[str]) -> None:
    """Raise a TypeError with the types that skops does not trust, if they may hold code."""
    foreign = [name for name in names if not _is_trusted(name)]
    if foreign:
        raise TypeError(
            f"it contains types that a model file must not hold: {', '.join(foreign)}. Use steps "
            f"of emacm and scikit-learn and functions of NumPy or SciPy (of a search, save the "
            f"best_estimator_), or joblib.dump."
        )


def _is_trusted(name: str) -> bool:
    """Tell whether it is a class of emacm or scikit-learn, or a function that only computes."""
    module, _, short = name.replace("numpy.core._multiarray_umath", "numpy").rpartition(".")
    if not _TRUSTED.fullmatch(module):  # NumPy 1 names the module of its functions
        return False
    found: Any = getattr(importlib.import_module(module), short, None)
    if module == "numpy":
        return isinstance(found, np.ufunc) or found is np.dtype
    if not isinstance(found, type):
        return bool(re.match(r"sklearn\.(metrics|feature_selection)\b", module)) and callable(found)
    is_value = issubclass(found, BaseEstimator | tuple | LineLevels) or is_dataclass(found)
    return found.__module__ == module and (is_value or not module.startswith("emacm."))


def _stored(skops: Any, model: Any) -> bytes:
    """Return a model as skops writes it; a TypeError names what cannot be stored, and where."""
    try:
        stored = skops.dumps(model, compression=8)
    except (TypeError, AttributeError, ValueError) as error:
        raise TypeError(
            f"it contains something that a model file cannot hold: {error}. Use functions of NumPy "
            f"or SciPy only (of a search over costs, save the best_estimator_), or joblib.dump, "
            f"whose files execute code."
        ) from error
    _check_types(skops.get_untrusted_types(data=stored))
    return stored


def save_model(
    model: Any,
    path: str | os.PathLike[str],
    *,
    note: str | None = None,
    healthy: Any = None,
    evidence: Mapping[str, Any] | None = None,
) -> None:
    """Save a fitted model in a file that contains no pickled code.

    The file holds the model, as skops writes it, and a description: versions, classes, decisions,
    costs, priors, channels, sampling rates, and check rows with the posteriors that the model
    gives for them. Costs and priors may have any form. Recordings given as `baseline_recordings`
    are not stored, only the baselines computed from them.

    Parameters
    ----------
    model : estimator or Pipeline
        A fitted model of steps of emacm and scikit-learn. Functions must be those of NumPy or
        SciPy, such as ``FunctionTransformer(np.log10)``. Not stored are `SplineTransformer`, and
        searches over cost tables or over distributions: of these, save the ``best_estimator_``.
    path : str or Path
        The file; it replaces an existing one as a whole.
    note : str, optional
        Any text, for example where the training recordings are.
    healthy : label, optional
        The class of healthy recordings, to which reports refer. It becomes the attribute
        ``healthy_`` of the model, and is stored with it.
    evidence : mapping, optional
        What `emacm.models.evidence.training_evidence` returns, as ``emacm train`` stores it.

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
    ValueError
        If `healthy` is not a class of the model.

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
    check_is_fitted(model)
    check_unknown_states(model)
    if healthy is not None:
        label_positions([healthy], np.asarray(model.classes_).tolist(), "healthy", "class")
        model.healthy_ = healthy
    skops = _skops()
    for part in parts_of(model):
        if isinstance(part, FeatureUnion) and hasattr(part, "_transformers_feature_names_out"):
            names = part._transformers_feature_names_out  # from pandas, which skops cannot store
            part._transformers_feature_names_out = [np.array(own, dtype=object) for own in names]
    with values_as_lists():
        try:
            stored = _stored(skops, model)
        except TypeError:
            for part in reversed([*parts_of(model)]):  # the innermost first
                with located(f"the model cannot be saved: {type(part).__name__}"):
                    _stored(skops, part)
            raise
    about = json.dumps(_description(model, note, evidence), default=str).encode()
    body = len(about).to_bytes(8, "little") + about + stored
    write_whole(Path(path), _START + sha256(body).hexdigest().encode() + b"\n" + body)


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
    EmacmWarning
        If the model was saved under other versions.

    See Also
    --------
    emacm.save_model : How the file is written.
    emacm.describe_model : What is stored in it.
    """
    about, stored = _read(path)
    skops = _skops()
    with located(f"model {path}"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # versions are compared below, all at once
        try:
            types = skops.get_untrusted_types(data=stored)
            is_safe = all([*map(_is_trusted, types)])  # a module that is gone is found here
            model = skops.loads(stored, trusted=types) if is_safe else None
        except Exception as error:
            raise ValueError(
                f"it cannot be read ({type(error).__name__}: {error}). Save the model again, with "
                f"the versions installed here: {installed_versions()}."
            ) from error
        _check_types(types)
        differ = _differences(about["versions"])
        _replay(model, about["check"], differ)
    if differ:
        warn(
            "version",
            f"{path} was saved under other versions: {differ}. Its check rows give the same "
            f"posteriors here.",
            stacklevel=2,
        )
    return model


def model_description(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return what a model file states about its model, without loading the model.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    dict
        "note", "saved" (time, UTC), "versions", "model" (class), "steps", "classes",
        "healthy" (None if it was not stated), "decisions",
        "cost" (rows: decisions, columns: truths), "truths", "priors", "channels", "units" and
        "training_range" (of the training recordings of each resampler), "check" (rows of
        features with their posteriors) and "evidence" (see
        `emacm.models.evidence.training_evidence`; None if it was not stored).

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is not a model file, or is damaged.
    """
    return _read(path)[0]


def _skops() -> Any:
    """Import skops.io, without what it would import by listing all modules of scikit-learn."""
    absent: dict[str, Any] = dict.fromkeys({"cupy", "dask", "pytest", "torch"} - sys.modules.keys())
    sys.modules.update(absent)  # None: not to be imported
    try:
        return importlib.import_module("skops.io")
    except ImportError as error:
        raise ImportError(
            "model files are written by skops, which is not installed; run "
            "pip install 'emacm[models]'."
        ) from error
    finally:
        for name in absent:
            del sys.modules[name]


def _read(path: str | os.PathLike[str]) -> tuple[dict[str, Any], bytes]:
    """Return the description and the stored model of a file, if no byte was changed."""
    file = Path(path)
    if not file.is_file():
        raise FileNotFoundError(f"there is no model {str(path)!r}.")
    content = file.read_bytes()
    with located(f"model {path}"):
        start = len(_START)
        if content[:start] != _START:
            raise ValueError(
                "it is not a model file of emacm.save_model, or one of another version. Save the "
                "model with the version that is installed here."
            )
        digest, body = content[start : start + 65], content[start + 65 :]
        if sha256(body).hexdigest().encode() + b"\n" != digest:
            raise ValueError(
                "it is damaged: its content does not have the digest that it states. Copy it again."
            )
        length = int.from_bytes(body[:8], "little")
        return json.loads(body[8 : 8 + length]), body[8 + length :]


def _description(
    model: Any, note: str | None, evidence: Mapping[str, Any] | None
) -> dict[str, Any]:
    fitted = fitted_resamplers(model)
    names = "classes", "decisions", "truths", "cost", "priors"
    return {
        "note": note,
        "saved": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "versions": installed_versions(),
        "model": type(model).__name__,
        "steps": [name for name, _ in getattr(model, "steps", ())],
        **{name: _plain(model, name) for name in names},
        "healthy": getattr(model, "healthy_", None),
        "channels": list(fitted[0].channels_) if fitted else [],
        "units": [part.training_range_.units for part in fitted],
        "training_range": [part.training_range_.ranges for part in fitted],
        "check": list(_check_rows(model)),
        "evidence": evidence,
    }


def _differences(saved: Mapping[str, str]) -> str:
    here = installed_versions()
    differ = [name for name in saved if name != "python" and saved[name] != here.get(name)]
    return ", ".join(f"{name} {saved[name]} (here {here.get(name)})" for name in differ)


def _plain(model: Any, name: str) -> Any:
    """Return an attribute of the last step of a model as lists; None if it has none."""
    with suppress(AttributeError, ValueError, TypeError):
        return np.asarray(getattr(final_estimator(model), f"{name}_")).tolist()
    return None


def _classifiers(model: Any) -> list[Any]:
    """Return the fitted parts that give posteriors for rows of features."""
    return [
        part
        for part in parts_of(model)
        if hasattr(part, "predict_proba") and not hasattr(part, "steps")
        if isinstance(getattr(part, "n_features_in_", None), int)
    ]


def _check_rows(model: Any) -> Iterator[dict[str, Any]]:
    """Yield rows of features and their posteriors, for each classifier."""
    for part in _classifiers(model):
        rows, posterior = _rows_for(part), np.empty(0)
        with warnings.catch_warnings(), suppress(ValueError, TypeError, AttributeError):
            warnings.simplefilter("ignore")
            posterior = part.predict_proba(rows)  # an error if it needs more than rows of numbers
        yield {"rows": rows.tolist(), "posterior": posterior.tolist()}


def _rows_for(classifier: Any) -> Any:
    """Return the means of the classes and rows half way between them; or rows of any kind."""
    means: Any = getattr(classifier, "means_", None)
    if np.ndim(means) == 2:
        return np.vstack([means, (means + np.roll(means, 1, axis=0)) / 2])
    return np.random.default_rng(0).normal(size=(8, classifier.n_features_in_))


def _replay(model: Any, checks: list[Any], differ: str) -> None:
    """Raise a ValueError if the check rows give other posteriors than when the model was saved."""
    versions = f" The versions differ: {differ}. Install those of the file." if differ else ""
    for part, check in zip(_classifiers(model), checks, strict=True):
        expected = np.asarray(check["posterior"], float)
        if not expected.size:
            continue
        found = np.asarray(part.predict_proba(np.asarray(check["rows"], float)))
        if found.shape != expected.shape or not np.allclose(found, expected, 0, 1e-6):
            raise ValueError(
                f"its check rows give other posteriors than when it was saved.{versions} Otherwise "
                f"fit the model again."
            )
