"""The README's quick start runs as printed."""

import re
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"


def code_blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)


def test_the_quick_start_runs_and_saves_a_model(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (script,) = code_blocks("python")
    names = {}
    exec(compile(script, "README.md", "exec"), names)
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
    links = re.findall(r"\]\(([^):]+)\)", README.read_text(encoding="utf-8"))
    assert "docs/simulated.png" in links
    for link in links:
        assert (README.parent / link).is_file(), link
