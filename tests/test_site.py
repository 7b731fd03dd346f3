"""The site: no warning, no dead link, each question answered within three clicks."""

import re
import shutil
import subprocess
import sys
import tomllib
from html import unescape
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote, urldefrag

import pytest

import emacm
from emacm import displays, monitoring, simulation

ROOT = Path(__file__).parents[1]
NEEDS = "sphinx pydata_sphinx_theme myst_nb numpydoc sphinx_design sphinx_copybutton sphinx_gallery"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
COMMAND = "sphinx-build -W notebooks site"  # as README prints it
QUESTIONS = {  # and what its page must say
    "read a CSV with decimal commas": ("plot_decimal_commas", 'decimal=","'),
    "order spectrum of a run-up": ("plot_run_up", "OrderResampler"),
    "which bearing ring": ("plot_which_ring", "inner ring"),
    "decide with costs": ("plot_costs", "prices"),
    "why was this decided": ("plot_why", "explain_decision"),
    "what if it never saw this fault": ("plot_never_seen", "unknown_rate"),
    "evaluate by unit": ("plot_by_unit", "units=units"),
    "monitor a machine": ("plot_monitor", "monitor.push"),
    "save a model": ("plot_save_a_model", "save_model"),
    "add a sensor": ("plot_add_a_sensor", "shaft_fs"),
    "cite": ("cite", "cff-version"),
    "report a bug": ("contributing", PROJECT["urls"]["Issues"]),
    "how many recordings do I need": ("plot_how_many_recordings", "29, if none is missed"),
}


def test_every_public_name_is_in_the_reference():
    reference = (ROOT / "notebooks/reference.rst").read_text(encoding="utf-8")
    parts = emacm, monitoring, displays, simulation
    names = {name for part in parts for name in part.__all__}
    assert names - set(re.findall(r"\w+", reference)) == {"__version__"}


def test_examples_ask_a_question_and_are_short():
    examples = sorted((ROOT / "notebooks/gallery").glob("*/plot_*.py"))
    assert len(examples) >= 24
    for example in examples:
        _, text, code = example.read_text(encoding="utf-8").split('"""', 2)
        lines = [line for line in code.splitlines() if line.strip()]
        assert text.splitlines()[1].endswith("?"), example
        assert len(lines) < 40, example


def test_each_display_is_in_the_gallery_and_the_guide_is_in_the_order_of_its_numbers():
    gallery = "".join(p.read_text("utf-8") for p in (ROOT / "notebooks/gallery").glob("*/*.py"))
    assert [name for name in displays.__all__ if name not in gallery] == []
    guide = (ROOT / "notebooks/guide.md").read_text(encoding="utf-8")
    listed = re.findall(r"^(\d\d_\w+)$", guide, flags=re.M)
    assert listed == sorted(path.stem for path in (ROOT / "notebooks").glob("*.ipynb"))


def built(folder):
    """Build the site; return the texts of its pages by path."""
    missing = [name for name in NEEDS.split() if find_spec(name) is None]
    if missing:
        pytest.skip(f"the extra site is not installed: {missing}")
    others = shutil.ignore_patterns(".*", "tests", "benchmarks", "examples", "site")
    shutil.copytree(ROOT, folder, ignore=others)
    program = Path(sys.executable).with_name("sphinx-build")
    subprocess.run([program, *COMMAND.split()[1:], "-q"], cwd=folder, check=True)
    pages = (path for path in (folder / "site").rglob("*.html") if "_static" not in path.parts)
    return {path: path.read_text(encoding="utf-8") for path in pages}


def links(page, text):
    """Yield the files and anchors to which a page links within the site."""
    text = re.sub(r'srcdoc="[^"]*"', "", text)
    for link in re.findall(r'<(?:a|img|link|script)\b[^>]*?(?:href|src)="([^"]+)"', text):
        if not re.match(r"[a-z]+:", link):
            path, anchor = urldefrag(link)
            path = re.sub(r"\?.*", "", unquote(path))
            yield (page.parent / path).resolve() if path else page, unquote(anchor)


@pytest.mark.slow
def test_no_link_is_dead_and_each_question_is_answered_within_three_clicks(tmp_path):
    site = built(tmp_path / "copy")
    linked = {page: list(links(page, text)) for page, text in site.items()}
    for page, found in linked.items():
        for target, anchor in found:
            assert target.exists(), (page.name, target)
            assert not anchor or f'id="{anchor}"' in site[target], (page.name, target.name, anchor)
    reached = {min(site, key=lambda page: (len(page.parts), page.name != "index.html"))}
    for _ in range(3):
        reached |= {target for page in reached & set(site) for target, _ in linked[page]}
    answers = {page.stem: re.sub(r"<[^>]+>", "", site[page]) for page in reached & set(site)}
    for question, (name, words) in QUESTIONS.items():
        assert words in unescape(answers.get(name, "")), question
