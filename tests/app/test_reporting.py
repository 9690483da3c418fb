"""The report of a project: the same from the workbench and from the command line, with the evidence of each pair."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from segmap.store import Store

FIRST, SECOND = "0.0-0.1", "0.1-0.2"
EVIL = "<script>alert(1)</script>"


def decide(client: Any, project: str, verdict: str, *ids: str, **more: Any) -> None:
    body = {"integrations": list(ids), "verdict": verdict, **more}
    assert client.post(f"/api/projects/{project}/decisions", json=body).status_code == 200
    client.settle(project)


def report(client: Any, project: str) -> str:
    answer = client.get(f"/api/projects/{project}/export/report")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/html")
    assert ".html" in answer.headers["content-disposition"]
    return answer.text


def test_report_of_a_project(client: Any, project: str) -> None:
    """It tells who decided what and why, the evidence at the pose decided on, and every pair of the project."""
    decide(client, project, "accepted", FIRST, who="Ada")
    decide(client, project, "rejected", SECOND, who=EVIL, reason=EVIL)
    page = report(client, project)
    assert "How far can I trust this map?" in page
    assert EVIL not in page
    assert page.count("&lt;script&gt;alert(1)&lt;/script&gt;") >= 3
    record = client.session(project).record()
    assert [pair.integration for pair in record.pairs] == list(client.session(project).integrations)
    told = {pair.integration: pair for pair in record.pairs}
    match = client.session(project).match(FIRST)
    assert told[FIRST].state == "accepted"
    assert told[FIRST].confidence == pytest.approx(match.confidence)
    assert told[FIRST].evidence == match.best.evidence
    assert told[FIRST].weakest == pytest.approx(match.best.uncertainty.weakest)
    assert client.session(project).merged().hash in page
    assert page == report(client, project)


def test_report_before_anything_is_accepted(client: Any, project: str) -> None:
    """There is a report of a project without a map, and it says that there is none."""
    assert "There is no map yet: nothing is accepted." in report(client, project)


def test_a_decision_keeps_its_evidence(client: Any, project: str) -> None:
    """After the parameters have changed the evidence of a decision is still that of its own parameters."""
    decide(client, project, "accepted", FIRST)
    before = client.session(project).record().pairs[0]
    client.post(f"/api/projects/{project}/parameters", json={"changes": {"sight_tolerance": 0.31}})
    client.settle(project)
    after = client.session(project).record().pairs[0]
    assert (after.evidence, after.confidence) == (before.evidence, before.confidence)
    page = report(client, project)
    assert re.search(r"Some decisions were made under the set \w+, with sight_tolerance", page)


def test_command_line_writes_the_same(client: Any, project: str, run: Any, tmp_path: Path) -> None:
    """`segmap report` and `segmap export --to report` write what the workbench saves, byte for byte."""
    decide(client, project, "accepted", FIRST, who="Ada")
    copy = tmp_path / "copy.segmap"
    client.app.state.services.workspace.backup(project, copy)
    assert run("report", copy, "--out", tmp_path / "a.html")[0] == 0
    assert run("export", copy, "--to", "report", "--out", tmp_path / "b.html")[0] == 0
    assert (tmp_path / "a.html").read_text() == (tmp_path / "b.html").read_text() == report(client, project)


def test_command_line_without_the_cache(client: Any, project: str, run: Any, tmp_path: Path) -> None:
    """Results in the file are a cache: without them decisions have their evidence all the same."""
    decide(client, project, "accepted", FIRST, who="Ada")
    copy = tmp_path / "copy.segmap"
    client.app.state.services.workspace.backup(project, copy)
    with Store.open(copy) as store:
        store.drop_results()
    assert run("report", copy, "--out", tmp_path / "a.html")[0] == 0
    page = (tmp_path / "a.html").read_text()
    (row,) = re.findall(rf'<tr><th scope="row">{FIRST}</th>(.*?)</tr>', page)
    confidence = client.session(project).match(FIRST).confidence
    assert f"<td>{confidence:.2f}</td>" in row


def test_report_refused(run: Any, tmp_path: Path) -> None:
    """A file that is no project is refused in one line, and nothing is written."""
    (tmp_path / "x.segmap").write_text(json.dumps({}))
    status, _, err = run("report", tmp_path / "x.segmap", "--out", tmp_path / "a.html")
    assert status == 2
    assert err.count("\n") == 1
    assert not (tmp_path / "a.html").exists()
