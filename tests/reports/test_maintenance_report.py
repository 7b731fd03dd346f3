"""The files of maintenance reports: complete by themselves, valid, readable in a browser."""

import re
import shutil
import subprocess
from html import escape
from html.parser import HTMLParser

import pandas as pd
import pytest
from bearing_models import BEARING, bins_model, fitted, recording, steps
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm import CostSensitiveGaussianBayes, maintenance_report, save_model
from emacm.reports.html_pages import html_of
from emacm.reports.pages import Page

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
    names = [f"recording_{n}.{kind}" for n in range(3) for kind in ("html", "pdf")]
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


def test_predicted_lines_are_mentioned_only_if_parts_are_given(tmp_path):
    maintenance_report(bins_model(), [recording("outer race", 99)], tmp_path / "all.html")
    html = (tmp_path / "all.html").read_text(encoding="utf-8")
    assert re.search(r"rder spectrum of \w+ and deviations from", html)
    assert "predicted lines" not in html


def test_no_page_has_nats_or_a_probability_of_one(folder):
    for file in folder.glob("*.html"):
        text = parsed(file.read_text(encoding="utf-8")).text
        assert not re.search(r"\bnats?\b|1\.000|100 %", text)


def test_the_index_lists_every_page(folder):
    found = parsed((folder / "index.html").read_text(encoding="utf-8"))
    assert found.links == [f"recording_{n}.html" for n in range(3)]
    assert "no decision" in found.text


def test_a_pdf_has_one_page_for_each_recording(tmp_path):
    new = [recording("outer race", 99), recording("healthy", 93, n=900)]
    (file,) = maintenance_report(bins_model(), new, tmp_path / "all.pdf", parts=BEARING)
    content = file.read_bytes()
    assert content.startswith(b"%PDF")
    assert len(re.findall(rb"/Type /Page\b", content)) == 2
    assert list(tmp_path.iterdir()) == [file]


def test_an_html_file_has_one_section_for_each_recording(tmp_path):
    new = [recording("outer race", 99), recording("healthy", 93, n=900)]
    (file,) = maintenance_report(bins_model(), new, tmp_path / "all.html")
    html = file.read_text(encoding="utf-8")
    parsed(html)
    assert html.count("<article ") == 2


def test_a_saved_model_states_its_note_and_digest(tmp_path):
    pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
    save_model(bins_model(), tmp_path / "model.emacm", note="bench <3>")
    new = [recording("healthy", 97)]
    (file,) = maintenance_report(tmp_path / "model.emacm", new, tmp_path / "all.html")
    text = parsed(file.read_text(encoding="utf-8")).text
    assert "bench <3>" in text
    assert "model.emacm, saved 20" in text
    assert re.search(r"Digest\s+[0-9a-f]{16}\s", text)


def test_features_with_long_names_and_many_warnings_fit_on_one_page(tmp_path):
    from emacm.reports.pdf_pages import write_pdf

    words = [f"channel 'c{n}' is clipped at samples {n} to {n + 9}: " + 9 * "x " for n in range(60)]
    page = Page("/data/" + 40 * "long_name_" + ".mat", "worn", "fault", words, True)
    write_pdf([page], tmp_path / "long.pdf")
    content = (tmp_path / "long.pdf").read_bytes()
    assert len(re.findall(rb"/Type /Page\b", content)) == 1
    parsed(html_of([page]))


def test_a_long_page_is_printed_in_smaller_letters():
    def scale(n_warnings):
        words = [f"channel 'c{n}' is clipped at samples {n} to {n + 9}" for n in range(n_warnings)]
        html = html_of([Page("a.mat", "worn", "fault", words, True)])
        return float(re.search(r'<article style="--scale:([0-9.]+)">', html)[1])

    scales = [scale(n) for n in (2, 30, 60, 90)]
    assert scales[:2] == [1.0, 1.0]
    assert scales[1] > scales[2] > scales[3] >= 0.48


def test_dollar_signs_are_no_formulas(tmp_path):
    bayes = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto")
    model = fitted(make_pipeline(*steps(FunctionTransformer(), bayes=bayes)))
    new = [recording("healthy", 97, meta={"note": "$x^2 and $ y_1 \\frac"})]
    files = maintenance_report(model, new, tmp_path, actions={"healthy": "Pay 5 $, then $_{."})
    assert files[1].stat().st_size > 5000


def test_recordings_must_be_a_list_and_the_path_a_report(tmp_path):
    with pytest.raises(TypeError, match=r"write \[recording\]"):
        maintenance_report(bins_model(), recording("healthy", 1), tmp_path)
    (tmp_path / "a.txt").write_text("")
    with pytest.raises(ValueError, match=r"path must end with .html or .pdf"):
        maintenance_report(bins_model(), [recording("healthy", 1)], tmp_path / "a.txt")
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
    long = recording("healthy", 97, meta={f"part {n}": 9 * "words " for n in range(12)})
    new = [recording("outer race", 99), recording("healthy", 97), long]
    (file,) = maintenance_report(bins_model(), new, tmp_path / "all.html", parts=BEARING)
    printed = tmp_path / "all.pdf"
    run_browser(tmp_path / "profile", f"--print-to-pdf={printed}", f"file://{file}")
    assert len(re.findall(rb"/Type /Page\b", printed.read_bytes())) == 3
