"""The files of maintenance reports: complete by themselves, valid, readable in a browser."""

import re
import shutil
import subprocess
from html import escape
from html.parser import HTMLParser

import pandas as pd
import pytest
from bearing_models import BEARING, bins_model, recording

from emacm import maintenance_report, save_model

pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra 'plot')")
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
VOID = {"meta", "img", "br"}


class Strict(HTMLParser):
    """A parser that fails where elements are not nested, and keeps what refers elsewhere."""

    def __init__(self):
        super().__init__()
        self.open, self.links, self.text = [], [], ""

    def handle_starttag(self, tag, attributes):
        self.links += [value for name, value in attributes if name in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag, f"{tag} is closed at {self.getpos()}"

    def handle_data(self, data):
        self.text += data + " "


def parsed(html):
    parser = Strict()
    parser.feed(html)
    parser.close()
    assert parser.open == []
    return parser


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the report of three recordings; the third one is too short."""
    target = tmp_path_factory.mktemp("bearing")
    meta = [{"unit": "A", "cycle": cycle} for cycle in (100, 300, 400)]
    new = [
        recording("healthy", 97, meta=meta[0]),
        recording("outer race", 99, meta=meta[1]),
        recording("healthy", 93, n=900, meta=meta[2]),
    ]
    history = pd.DataFrame({"decision": ["outer race"], "unit": ["A"], "time": [200]})
    files = maintenance_report(
        bins_model(),
        new,
        target / "report",
        actions={"outer race": 'Replace <6205> & "seal".'},
        parts=BEARING,
        history=history,
        unit="unit",
        time="cycle",
    )
    names = [f"recording_{n}.html" for n in range(3)]
    assert [file.name for file in files] == [*names, "index.html"]
    return target / "report"


def test_a_page_is_valid_and_refers_to_no_other_file(folder):
    found = parsed((folder / "recording_1.html").read_text(encoding="utf-8"))
    assert len(found.links) == 1
    assert found.links[0].startswith("data:image/svg+xml;base64,")
    assert 'Replace <6205> & "seal".' in found.text
    assert "outer ring (drive end BPFO)" in found.text
    assert "Since cycle 200, in 2 recordings in a row" in found.text
    assert "before that, 'healthy' (cycle 100)" in found.text
    assert re.search(r"rder spectrum of \w+ with predicted lines and deviations", found.text)


def test_no_page_has_nats_or_a_probability_of_one(folder):
    for file in folder.glob("*.html"):
        text = parsed(file.read_text(encoding="utf-8")).text
        assert not re.search(r"\bnats?\b|1\.000|100 %", text)


def test_a_saved_model_states_its_note_and_digest(tmp_path):
    pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
    save_model(bins_model(), tmp_path / "model.emacm", note="bench <3>")
    new = [recording("healthy", 97)]
    (file,) = maintenance_report(tmp_path / "model.emacm", new, tmp_path / "all.html")
    text = parsed(file.read_text(encoding="utf-8")).text
    assert "bench <3>" in text
    assert "model.emacm, saved 20" in text
    assert re.search(r"Digest\s+[0-9a-f]{16}\s", text)


def test_recordings_must_be_a_list_and_the_path_a_report(tmp_path):
    with pytest.raises(TypeError, match=r"write \[recording\]"):
        maintenance_report(bins_model(), recording("healthy", 1), tmp_path)
    (tmp_path / "a.txt").write_text("")
    for name in ("a.txt", "all.pdf"):
        with pytest.raises(ValueError, match="path must end with"):
            maintenance_report(bins_model(), [recording("healthy", 1)], tmp_path / name)
    with pytest.raises(ValueError, match="no meta key 'unit'"):
        maintenance_report(bins_model(), [recording("healthy", 1)], tmp_path, unit="unit")


# In a browser

MEASURE = """<iframe srcdoc="{page}" width="{width}" height="600" onload="
 const d = this.contentDocument, i = d.images[0], r = d.querySelector('.decision');
 document.body.dataset.found = [d.compatMode, i.naturalWidth > 0, i.getBoundingClientRect().width,
   d.documentElement.scrollWidth, getComputedStyle(r).borderLeftColor].join('|')"></iframe>"""


def browser():
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip(f"no browser is installed; one of {', '.join(BROWSERS)} is looked for")
    return found


def run_browser(folder, *arguments):
    options = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder}"]
    result = subprocess.run(
        [browser(), *options, *arguments], capture_output=True, timeout=120, check=True
    )
    return result.stdout.decode()


@pytest.mark.slow
@pytest.mark.parametrize("width", [360, 1000])
def test_a_browser_shows_the_picture_and_a_phone_needs_no_scrolling(folder, tmp_path, width):
    page = escape((folder / "recording_1.html").read_text(encoding="utf-8"), quote=True)
    (tmp_path / "frame.html").write_text(MEASURE.format(page=page, width=width), encoding="utf-8")
    shown = run_browser(tmp_path / "profile", "--dump-dom", f"file://{tmp_path}/frame.html")
    found = re.search(r'data-found="([^"]*)"', shown)[1].split("|")
    assert found[:2] == ["CSS1Compat", "true"]
    picture, page_width = float(found[2]), float(found[3])
    assert 0.8 * min(width, 768) < picture <= page_width <= width
    assert found[4] == "rgb(213, 94, 0)"


@pytest.mark.slow
def test_a_browser_prints_a_page_for_each_recording(tmp_path):
    new = [recording("outer race", 99), recording("healthy", 97)]
    (file,) = maintenance_report(bins_model(), new, tmp_path / "all.html", parts=BEARING)
    printed = tmp_path / "all.pdf"
    run_browser(tmp_path / "profile", f"--print-to-pdf={printed}", f"file://{file}")
    assert len(re.findall(rb"/Type /Page\b", printed.read_bytes())) == 2
