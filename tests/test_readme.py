"""The README's code runs as printed, and gives the figures that the text has."""

import re
from pathlib import Path

import pytest

README = Path(__file__).parents[1] / "README.md"
README_TEXT = README.read_text(encoding="utf-8")


def code_blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README_TEXT, re.DOTALL)


def names_after(*scripts):
    names = {}
    for script in scripts:
        exec(compile(script, "README.md", "exec"), names)
    return names


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("campaign"))
        return names_after(*code_blocks("python")[1:])


def test_the_quick_start_runs_and_saves_a_model(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = names_after(code_blocks("python")[0])
    assert (tmp_path / "model.joblib").exists()
    assert set(names["model"].predict(names["recordings"])) <= {"healthy", "worn screw", "inspect"}
    printed = capsys.readouterr().out
    for name in ("max_order", "current@0.125", "current@1-2", "bintransformer__bin_size"):
        assert name in printed


def test_there_are_two_commands_and_they_install_before_they_run():
    demo, tests = code_blocks("sh")
    assert "pip install" in demo
    assert demo.strip().endswith("-m emacm demo")
    assert "pip install" in tests
    assert "-m pytest" in tests


def test_every_file_that_the_readme_links_to_is_there():
    links = re.findall(r"\]\(([^):]+)\)", README_TEXT)
    assert "notebooks/simulated.png" in links
    for link in links:
        assert (README.parent / link).is_file(), link


def test_the_table_of_the_campaign_holds_what_its_code_gives(campaign):
    rows = re.findall(r"^\| ([a-z ]+) \| ([\d.]+) \| ([\d.]+) \| ([\w. ]+) \|$", README_TEXT, re.M)
    assert [name for name, *_ in rows] == list(campaign["models"])
    for name, *printed in rows:
        cost = campaign["found"][name].table["expected_cost"]
        # Half of the last digit, and a recording or two that another library decides otherwise.
        for scheme, figure in zip(cost.index, printed, strict=True):
            if figure == "it refuses":
                assert "refuses" in " ".join(campaign["found"][name].caveats)
            else:
                assert cost[scheme] == pytest.approx(float(figure), abs=0.012, rel=0.02)


def test_one_classifier_misses_half_of_the_faults_under_a_load_it_never_saw(campaign):
    figures = campaign["found"]["one classifier"].table.loc["by condition"]
    assert figures["missed_detection_rate"] == pytest.approx(0.5, abs=0.03)


def test_two_runs_of_each_are_too_few_for_one_classifier_of_all_channels(campaign):
    found = campaign["found"]
    cost = {name: result.table.loc["by unit", "expected_cost"] for name, result in found.items()}
    assert campaign["table"].shape == (100, 32)
    assert cost["product of channels"] == pytest.approx(0.23, abs=0.03)
    assert cost["one of all channels"] == pytest.approx(0.33, abs=0.05)
    assert "current_a+:rms" in campaign["table"]
    assert "accelerometer-:cosine0" in campaign["table"]
