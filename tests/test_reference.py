"""Nothing in the docstrings refers to what does not exist."""

import ast
import builtins
import functools
import importlib
import pkgutil
import re
from pathlib import Path

import pandas
import pytest
import sklearn

import emacm
import emacm.displays

PACKAGES = {"emacm", "joblib", "matplotlib", "numpy", "pandas", "scipy", "sklearn"}
FILES = sorted(Path(emacm.__file__).parent.rglob("*.py"))
DOTTED = re.compile(r"`([a-z]\w*(?:\.\w+)+)`")
CLASSES = re.compile(r"`([A-Z][a-z]\w*[A-Z]\w*)`")


@functools.cache
def owners(path):
    """Return the module, the classes and the functions of a file."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    return [node for node in nodes if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)]


def docstrings(path):
    """Yield each docstring of a file, with the line where its owner begins."""
    for node in owners(path):
        yield getattr(node, "lineno", 1), ast.get_docstring(node) or ""


def resolves(name):
    """Return whether a full name can be imported."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:length]))
        except ImportError:
            continue
        for part in parts[length:]:
            if not hasattr(found, part):
                return False
            found = getattr(found, part)
        return True
    return False


def class_names():
    """Return the names of all classes of emacm, its displays, scikit-learn and pandas."""
    names = {*dir(builtins), *dir(pandas), *emacm.displays.__all__, *emacm.__all__}
    for path in FILES:
        names |= {node.name for node in owners(path) if isinstance(node, ast.ClassDef)}
    for module in pkgutil.iter_modules(sklearn.__path__):
        if not module.name.startswith("_") and module.name not in {"conftest", "tests"}:
            found = importlib.import_module(f"sklearn.{module.name}")
            names |= {name for name in dir(found) if name[0].isupper()}
    return names


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of scikit-learn's own modules
def test_full_names_and_classes_in_docstrings_exist():
    classes, broken = class_names(), []
    for path in FILES:
        for line, text in docstrings(path):
            full = [name for name in DOTTED.findall(text) if name.partition(".")[0] in PACKAGES]
            wrong = [name for name in full if not resolves(name)]
            wrong += [name for name in CLASSES.findall(text) if name not in classes]
            broken += [f"{path.name}:{line} {name}" for name in wrong]
    assert not broken
