"""Every known answer is computed, and a wrong one is found."""

import json
from hashlib import sha256
from inspect import getmembers, isfunction

import pytest

from emacm.__main__ import main
from emacm.verification import answers, record
from emacm.verification.record import known_answers, verify

ANSWERS = known_answers()


@pytest.mark.parametrize("check", ANSWERS.index.unique("check"))
def test_this_installation_computes_the_known_answers(check):
    pytest.importorskip("skops") if check == "model_file" else None
    found = verify(ANSWERS.loc[[check]])
    assert found.passed, found


def test_every_check_has_answers_and_every_answer_a_source():
    functions = getmembers(answers, isfunction)
    own = {name for name, check in functions if check.__module__ == answers.__name__}
    assert set(ANSWERS.index.unique("check")) == {name for name in own if name[0] != "_"}
    assert ANSWERS.notna().all(axis=None)
    assert ANSWERS.index.is_unique


@pytest.mark.parametrize("ending", [".json", ".html", ".txt"])
def test_a_wrong_value_gives_exit_status_1_and_is_marked(monkeypatch, tmp_path, capsys, ending):
    few = ANSWERS.loc[["order_bins", "covariances"]].copy()
    monkeypatch.setattr(record, "known_answers", lambda: few)
    path = tmp_path / f"record{ending}"
    assert main(["verify", "--out", str(path)]) == 0
    few.loc[("order_bins", "sum"), "expected"] *= 1.001
    assert main(["verify", "--out", str(path)]) == 1
    assert "5 of 6 passed" in capsys.readouterr().out
    assert {".json": '"passed":false', ".html": "<td>NO</td>", ".txt": " NO\n"}[ending] in (
        path.read_text().replace(": ", ":") if ending == ".json" else path.read_text()
    )


def test_a_check_that_fails_is_an_answer_that_did_not_pass(monkeypatch):
    monkeypatch.setattr(answers, "PCA", lambda n: 1 / 0)
    found = verify(ANSWERS.loc[["covariances", "chapter_3"]])
    assert found.table["passed"].tolist() == [True, True, False, False]
    assert "ZeroDivisionError" in found.table["source"].iloc[-1]


def test_the_digest_is_that_of_versions_code_and_table():
    found = verify(ANSWERS.loc[["covariances"]])
    content = json.loads(found.to_json())
    facts = content["facts"]
    digest = facts.pop("digest")
    assert sha256((json.dumps(facts) + found.table.to_json()).encode()).hexdigest() == digest
    assert {"emacm", "numpy", "scipy", "sklearn"} <= set(facts)
    assert content["passed"]
