"""The reference is built from the docstrings, and nothing in it refers to what does not exist."""

import ast
import builtins
import functools
import importlib
import os
import pkgutil
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import emacm
import emacm.displays

PUBLIC_MODULES = [
    "emacm",
    "emacm.shaft",
    "emacm.monitoring",
    "emacm.displays",
    "emacm.simulation",
    "emacm.datasets",
]
PACKAGES = {"emacm", "joblib", "matplotlib", "numpy", "pandas", "scipy", "sklearn"}
TEMPLATES = Path(__file__).parents[1] / ".ci" / "reference"
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


@pytest.fixture(scope="module")
def class_names():
    """Return the names of all classes of emacm, its displays, scikit-learn and pandas."""
    import pandas
    import sklearn

    names = {*dir(builtins), *dir(pandas), *emacm.displays.__all__, *emacm.__all__}
    for path in FILES:
        names |= {node.name for node in owners(path) if isinstance(node, ast.ClassDef)}
    for module in pkgutil.iter_modules(sklearn.__path__):
        if not module.name.startswith("_") and module.name not in {"conftest", "tests"}:
            found = importlib.import_module(f"sklearn.{module.name}")
            names |= {name for name in dir(found) if name[0].isupper()}
    return names


@pytest.mark.slow
def test_full_names_in_docstrings_exist():
    broken = [
        f"{path.name}:{line} {name}"
        for path in FILES
        for line, text in docstrings(path)
        for name in DOTTED.findall(text)
        if name.partition(".")[0] in PACKAGES and not resolves(name)
    ]
    assert not broken


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of scikit-learn's own modules
def test_classes_named_in_docstrings_exist(class_names):
    broken = [
        f"{path.name}:{line} {name}"
        for path in FILES
        for line, text in docstrings(path)
        for name in CLASSES.findall(text)
        if name not in class_names
    ]
    assert not broken


class Page(HTMLParser):
    """The links and the anchors of a page."""

    def __init__(self, path):
        super().__init__()
        self.links, self.anchors = set(), set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.anchors |= {attributes.get("id"), attributes.get("name")}
        if tag == "a" and attributes.get("href"):
            self.links.add(attributes["href"])


def broken_links(folder):
    pages = {path.resolve(): Page(path) for path in folder.rglob("*.html")}
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            anchor = unquote(parts.fragment)
            if target not in pages or (anchor and anchor not in pages[target].anchors):
                yield f"{path.name}: {link}"


@pytest.mark.slow
def test_the_reference_is_built_and_no_link_is_broken(tmp_path):
    pytest.importorskip("pdoc", reason="pdoc is not installed (extra 'test')")
    command = [sys.executable, "-m", "pdoc", "-t", TEMPLATES, "--docformat", "numpy", "--math"]
    # Public names are imported at first use; pdoc documents those that are there.
    environment = {**os.environ, "EAGER_IMPORT": "1"}
    subprocess.run(
        [*command, "-o", tmp_path, *PUBLIC_MODULES],
        env=environment,
        check=True,
        capture_output=True,
    )
    text = (tmp_path / "emacm.html").read_text(encoding="utf-8")
    for name in emacm.__all__:
        assert f'id="{name}"' in text, name
    assert 'id="CostSensitiveGaussianBayes.predict"' in text  # inherited from a private class
    assert sorted(broken_links(tmp_path)) == []
