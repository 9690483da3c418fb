"""What is kept so that many can ask is what would be made anew."""

from __future__ import annotations

import gzip
import json
import os
import random
from pathlib import Path
from typing import Any

import pytest

from app.errors import UnknownError
from app.pairs import Pairs, integrations_of
from app.queue_text import EARLIER, QueueTexts
from app.review import Row, Rows, counts, queue
from app.routes.files import _Files
from app.schemas import Integration
from app.session import Session
from segmap.errors import ProjectError
from segmap.events import Proposal
from segmap.scans import ScanId


def patched(rows: list[Any], answer: dict[str, Any]) -> list[Any]:
    """What a page has after an answer, as ``app.schemas.Queue`` says."""
    if answer["since"] is None:
        return list(answer["integrations"])
    out = {*answer["gone"], *(row["id"] for row in answer["integrations"])}
    rows = [row for row in rows if row["id"] not in out]
    for place, row in zip(answer["places"], answer["integrations"], strict=True):
        rows.insert(place, row)
    return rows


def made_anew(session: Session) -> list[Row]:
    """The queue, with nothing remembered."""
    state, blank = session.state, Rows(session.integrations)
    found = (blank.row(id, state, session.outcome(id), session.loops.graph) for id in session.integrations)
    return queue(found, state.mode, state.parameters)


def test_the_text_of_the_queue_is_the_queue(session: Session) -> None:
    """After any steps: the rows in their order, of which each is as its schema says; another tag for another text."""
    chance, tags = random.Random(3), dict[str, bytes]()
    held, told, sizes = list[Any](), "", set[int]()
    for _ in range(25):
        id = chance.choice(session.integrations)
        step = chance.choice(("accepted", "rejected", "clear", "undo", "redo", "propose", "threshold"))
        try:
            if step == "propose":
                session.propose(
                    [Proposal(integration=f"0.{chance.randrange(3)}-0.{chance.randrange(4, 7)}", kind="manual")]
                )
            elif step == "threshold":
                session.set_parameters({"confidence_accept": chance.choice((0.7, 0.9, 0.99))})
            elif step == "clear":
                session.clear([id])
            elif step in ("undo", "redo"):
                getattr(session, step)()
            else:
                session.decide([id], step)
        except ProjectError:
            continue
        assert session.settle(60.0)
        text = session.queue_text()
        whole = json.loads(text.plain)["integrations"]
        assert whole == [Integration.of(row).model_dump() for row in session.rows()]
        answer = json.loads(session.queue_text(told).plain)
        held, told = patched(held, answer), answer["tag"]
        assert (held, told) == (whole, text.tag)
        sizes.add(len(answer["integrations"]))
        assert gzip.decompress(text.packed) == text.plain
        assert tags.setdefault(text.tag, text.plain) == text.plain
        assert session.integrations == integrations_of(session.state, session.scan_ids)
        assert session.rows() == made_anew(session)
        assert session.counts() == counts(session.rows())
        assert [session.listed.row(row.id) for row in session.rows()] == session.rows()
    assert len(tags) > 5
    assert {0, 1} < sizes
    assert session.queue_text() is session.queue_text()


def rows_of(names: str) -> tuple[Row, ...]:
    return tuple(ROWS[name] for name in names)


ROWS = {name: Row(f"0.{i}-0.{i + 1}", ScanId(0, i), ScanId(0, i + 1), "pending") for i, name in enumerate("abcdefgh")}


@pytest.mark.parametrize(
    ("before", "after", "since", "sent"),
    [
        ("abcdefgh", "abcdefgh", True, ""),
        ("abcdefgh", "abcdegh", True, ""),
        ("abcdefg", "abhcdefg", True, "h"),
        ("abcdef", "ghabcdef", True, "gh"),
        ("abcdef", "bacdef", False, "bacdef"),
        ("abc", "abcdefgh", False, "abcdefgh"),
        ("", "abc", False, "abc"),
        ("abc", "", True, ""),
    ],
)
def test_only_what_changed_is_sent(before: str, after: str, since: bool, sent: str) -> None:
    """Rows that are new or others, and where they stand; all where most are, or the rest is in another order."""
    texts = QueueTexts()
    tag = texts.of(rows_of(before)).tag
    answer = json.loads(texts.of(rows_of(after), tag).plain)
    assert (answer["since"] == tag) is since
    assert [row["id"] for row in answer["integrations"]] == [ROWS[name].id for name in sent]
    held = patched([row.to_json() for row in rows_of(before)], answer)
    assert held == [row.to_json() for row in rows_of(after)]


def test_who_was_away_for_long_gets_everything() -> None:
    """Earlier queues are remembered for some time, and not for ever; of another server's nothing is known."""
    texts = QueueTexts()
    tag = texts.of(rows_of("abcdefg")).tag
    for turn in range(EARLIER - 1):
        rows = rows_of("abcdefgh" if turn % 2 else "abcdef")
        assert json.loads(texts.of(rows, tag).plain)["since"] == tag
    now = texts.of(rows_of("abcdefg")).tag
    for old in (tag, "", "x-1", QueueTexts().of(rows_of("abcdefg")).tag):
        assert json.loads(texts.of(rows, old).plain)["since"] is None
    assert json.loads(texts.of(rows, now).plain)["since"] == now


def test_pairs_are_made_again_where_there_are_others(session: Session) -> None:
    """Decisions on neighbours leave the very list that there was; a proposal, an undo and a log make another."""
    pairs, state, scans = Pairs(), session.state, session.scan_ids
    first = pairs.of(state, scans)
    session.decide(["0.0-0.1"], "rejected")
    assert pairs.of(session.state, scans) is first
    session.propose([Proposal(integration="0.0-0.4", kind="manual")])
    assert pairs.of(session.state, scans) == integrations_of(session.state, scans) != first
    session.undo()
    assert pairs.of(session.state, scans) == first
    assert pairs.of(session.state, scans[:4]) == integrations_of(session.state, scans[:4])


def test_a_queue_that_is_the_same_is_not_sent_again(client: Any, project: str) -> None:
    """Asked with its tag; after a decision it is another one. Who takes gzip gets it."""
    url = f"/api/projects/{project}/integrations"
    answer = client.get(url)
    tag = answer.headers["etag"]
    assert answer.headers["content-encoding"] == "gzip"
    assert client.get(url, headers={"if-none-match": tag}).status_code == 304
    plain = client.get(url, headers={"accept-encoding": "identity"})
    assert "content-encoding" not in plain.headers
    assert plain.json() == answer.json()
    body = {"integrations": ["0.0-0.1"], "verdict": "rejected"}
    assert client.post(f"/api/projects/{project}/decisions", json=body).status_code == 200
    again = client.get(url, headers={"if-none-match": tag})
    assert (again.status_code, again.headers["etag"] != tag) == (200, True)
    changes = client.get(url, params={"since": plain.json()["tag"]})
    assert (changes.headers["cache-control"], "etag" in changes.headers) == ("no-store", False)
    assert patched(plain.json()["integrations"], changes.json()) == again.json()["integrations"]
    assert len(changes.json()["integrations"]) < len(again.json()["integrations"])


def test_files_of_the_pages(tmp_path: Path) -> None:
    """As they are now, by name: new, changed and gone ones too; nothing that is no file below the folder."""
    folder = tmp_path / "static"
    (folder / "js").mkdir(parents=True)
    (folder / "js" / "a.js").write_text("1")
    (tmp_path / "secret").write_text("x")
    files = _Files(folder)
    first = files.get("js/a.js")
    assert (first.content, first.kind) == (b"1", "text/javascript")
    assert files.get("js/a.js") is first
    (folder / "js" / "a.js").write_text("2")
    os.utime(folder / "js" / "a.js", ns=(1, 1))
    assert files.get("js/a.js").content == b"2"
    assert files.get("js/a.js").tag != first.tag
    (folder / "new.css").write_text("b {}")
    assert files.get("new.css").kind == "text/css"
    (folder / "js" / "a.js").unlink()
    for name in ("js/a.js", "js", "", "../secret", "js/../../secret", "/etc/passwd", "a\0b", str(tmp_path / "secret")):
        with pytest.raises(UnknownError):
            files.get(name)


def test_files_are_asked_for_again_and_not_sent(client: Any) -> None:
    """A browser that has a file hears that it is the same."""
    answer = client.get("/static/js/api.js")
    assert answer.headers["cache-control"] == "no-cache"
    assert client.get("/static/js/api.js", headers={"if-none-match": answer.headers["etag"]}).status_code == 304
    assert client.request("HEAD", "/static/js/api.js").status_code == 200
