"""What foreign pages, foreign names and foreign hands may not do."""

from __future__ import annotations

import asyncio
import io
import re
import tarfile
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest
from bags import ROS_1, SCAN, laser_scan, write_ros1
from starlette.exceptions import HTTPException

from app.incoming import bounded
from app.security import Guard, allowed_host

FOREIGN = [
    {"origin": "http://evil.example"},
    {"origin": "http://127.0.0.1:9999"},
    {"origin": "http://localhost:8000"},  # the page came from 127.0.0.1
    {"origin": "https://127.0.0.1:8000.evil.example"},
    {"origin": "null"},
    {"origin": ""},
    {"sec-fetch-site": "cross-site"},
    {"sec-fetch-site": "same-site"},
]


@pytest.mark.parametrize("headers", FOREIGN)
def test_foreign_pages_change_nothing(client: Any, project: str, headers: dict[str, str]) -> None:
    """Whatever a page of another origin sends, nothing is decided, made or opened."""
    revision = client.session(project).state.revision
    body = {"integrations": ["0.0-0.1"], "verdict": "accepted"}
    for url in (f"/api/projects/{project}/decisions", f"/api/projects/{project}/views", "/api/projects"):
        answer = client.post(url, json=body, headers=headers)
        assert answer.status_code == 403
        assert answer.json()["error"]["kind"] == "ForbiddenOrigin"
    assert client.delete("/api/views/any", headers=headers).status_code == 403
    assert client.session(project).state.revision == revision
    assert len(client.app.state.services.views) == 0


@pytest.mark.parametrize("headers", FOREIGN)
def test_foreign_pages_read_nothing(client: Any, project: str, headers: dict[str, str]) -> None:
    """They hear nothing of what is here either, whatever they ask for."""
    for url in ("/", "/api/projects", f"/api/projects/{project}", f"/api/projects/{project}/events"):
        answer = client.get(url, headers=headers)
        assert (answer.status_code, answer.json()["error"]["kind"]) == (403, "ForbiddenOrigin")


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_foreign_pages_embed_nothing(client: Any, project: str, site: str) -> None:
    """A picture, frame, script or stream of ours in a foreign page gets nothing; a link to us may be followed."""
    for url in ("/", f"/projects/{project}", f"/api/projects/{project}/export/svg", "/static/js/home.js"):
        for dest, mode in (("image", "no-cors"), ("iframe", "navigate"), ("script", "no-cors"), ("empty", "cors")):
            asked = {"sec-fetch-site": site, "sec-fetch-dest": dest, "sec-fetch-mode": mode}
            assert client.get(url, headers=asked).status_code == 403
    followed = {"sec-fetch-site": site, "sec-fetch-dest": "document", "sec-fetch-mode": "navigate"}
    assert client.get(f"/projects/{project}", headers=followed).status_code == 200


def test_our_own_page_may(client: Any, project: str) -> None:
    """The same requests from our own address are answered, under each name of it."""
    body = {"integrations": ["0.0-0.1"], "verdict": "rejected"}
    url = f"/api/projects/{project}/decisions"
    for host in ("127.0.0.1:8000", "localhost:8000", "[::1]:8000"):
        assert client.post(url, json=body, headers={"host": host, "origin": f"http://{host}"}).status_code == 200
    assert client.post(url, json=body, headers={"sec-fetch-site": "same-origin"}).status_code == 200


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8000", "127.0.0.1.evil.example", "", "[::2]:8000", "0.0.0.0"]
)
def test_rebound_names_are_refused(client: Any, host: str) -> None:
    """A foreign name that was made to point here gets nothing, not even the home page."""
    for url in ("/", "/api/projects", "/static/js/home.js"):
        answer = client.get(url, headers={"host": host})
        assert answer.status_code == 403
        assert answer.json()["error"]["kind"] == "ForbiddenHost"


@pytest.mark.parametrize(
    ("host", "bound", "allowed"),
    [
        ("LOCALHOST:8000", "127.0.0.1", True),
        ("[::1]", "127.0.0.1", True),
        ("workstation:8000", "127.0.0.1", False),
        ("workstation:8000", "workstation", True),
        ("192.168.1.7:8000", "192.168.1.7", True),
        ("192.168.1.8:8000", "192.168.1.7", False),
        ("192.168.1.7:8000", "0.0.0.0", True),
        ("[fe80::1]:8000", "::", True),
        ("rebound.example", "0.0.0.0", False),
        ("0.0.0.0:8000", "0.0.0.0", False),
        (None, "127.0.0.1", False),
    ],
)
def test_names_the_server_answers_to(host: str | None, bound: str, allowed: bool) -> None:
    """Loopback, the address bound, and any address in numbers where all are bound: numbers cannot be rebound."""
    assert allowed_host(host, bound) is allowed


@pytest.mark.parametrize(
    ("headers", "passes"),
    [
        ({"host": "127.0.0.1:8000", "origin": "http://127.0.0.1:8000"}, True),
        ({"host": "127.0.0.1:8000"}, True),
        ({"host": "127.0.0.1:8000", "origin": "http://evil.example"}, False),
        ({"host": "127.0.0.1:8000", "sec-fetch-site": "cross-site"}, False),
        ({"host": "evil.example", "origin": "http://evil.example"}, False),
    ],
)
def test_websockets_are_checked_before_they_open(headers: dict[str, str], passes: bool) -> None:
    """Browsers let any page open a socket to anywhere: only the Origin tells whose it is."""
    reached, sent = [], []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        reached.append(scope)

    async def send(message: Any) -> None:
        sent.append(message)

    scope = {
        "type": "websocket",
        "path": "/views/v/scene",
        "headers": [(k.encode(), v.encode()) for k, v in headers.items()],
    }
    asyncio.run(Guard(app)(scope, None, send))  # type: ignore[arg-type]
    assert bool(reached) is passes
    assert sent == ([] if passes else [{"type": "websocket.close", "code": 1008}])


def test_every_answer_is_marked(client: Any, project: str) -> None:
    """Pages, files, answers and refusals: nothing inline, nothing from elsewhere, framed by nobody else."""
    for url in ("/", f"/projects/{project}", "/projects/none", "/static/js/home.js", "/api/projects", "/api/none"):
        headers = client.get(url).headers
        policy = headers["content-security-policy"]
        assert "default-src 'self'" in policy
        assert "frame-ancestors 'self'" in policy
        assert "unsafe" not in policy
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "same-origin"
        assert "access-control-allow-origin" not in headers


def test_pages_have_nothing_inline(client: Any) -> None:
    """What the policy forbids is not in the pages either: no inline script, style or handler, no foreign address."""
    for page in ("/", "/projects/none"):
        html = client.get(page).text
        assert "<style" not in html
        assert " style=" not in html
        assert " onclick=" not in html
        ours = re.findall(r'<script (?:type="module" )?src="/static/[\w/]+\.js"></script>', html)
        assert html.count("<script") == len(ours)
        assert "http://" not in html.replace("http://www.w3.org", "")
        assert "https://" not in html


def test_names_arrive_as_text(client: Any, log_bytes: bytes) -> None:
    """A script in a file name stays the same text in JSON, in the drawing and in the header of a download."""
    name = '<script>alert(1)<\\script> "quoted"; filename=x.log'
    made = client.upload((name.replace("\\", "|"), log_bytes)).json()
    session = client.settle(made["id"])
    session.decide(session.integrations, "accepted")
    assert "<script>" in made["name"]
    drawing = client.get(f"/api/projects/{made['id']}/export/svg")
    assert "<script" not in drawing.text
    assert "&lt;script" in drawing.text
    disposition = drawing.headers["content-disposition"]
    assert disposition.count('"') == 2
    assert "<" not in disposition


def test_a_reason_is_text_too(client: Any, project: str) -> None:
    """What a person writes comes back as it was written."""
    reason = "</script><img src=x onerror=alert(1)>"
    body = {"integrations": ["0.0-0.1"], "verdict": "rejected", "reason": reason, "who": "<b>"}
    row = client.post(f"/api/projects/{project}/decisions", json=body).json()["rows"][0]
    assert (row["reason"], row["who"]) == (reason, "<b>")


SCRIPT = "<script>alert(1)</script>"


def test_the_name_of_a_scan_is_text_everywhere(client: Any, tmp_path: Path) -> None:
    """A topic with a script in its name stays text: in the lists, the view and every file that is written."""
    topics = [f"/{SCRIPT}", "/../../etc/passwd"]
    bag = write_ros1(tmp_path / "x.bag", [(t, SCAN, laser_scan(ROS_1, k)) for k in range(3) for t in topics])
    made = client.upload(("x.bag", bag)).json()
    session = client.settle(made["id"])
    session.decide(session.integrations, "accepted")
    told = client.get(f"/api/projects/{made['id']}").text
    assert "<script>" in told  # as JSON, which no browser takes for a page
    assert "passwd" in told
    assert client.get(f"/api/projects/{made['id']}").headers["content-type"] == "application/json"
    for kind in client.get("/api/exports").json()["formats"]:
        answer = client.get(f"/api/projects/{made['id']}/export/{kind['name']}")
        assert answer.status_code == 200
        assert answer.headers["content-disposition"].startswith("attachment")
        if answer.headers["content-type"].startswith(("image/svg", "text/html")):
            assert b"<script>alert" not in answer.content


def archive_of(kind: str, names: Iterable[str], content: bytes) -> bytes:
    """A zip or tar.gz archive whose members have these names."""
    held = io.BytesIO()
    if kind == "zip":
        with zipfile.ZipFile(held, "w") as archive:
            for name in names:
                archive.writestr(name, content)
    else:
        with tarfile.open(fileobj=held, mode="w:gz") as tar:
            for name in names:
                member = tarfile.TarInfo(name)
                member.size = len(content)
                tar.addfile(member, io.BytesIO(content))
    return held.getvalue()


@pytest.mark.parametrize("kind", ["zip", "tar.gz"])
def test_archives_are_not_unpacked(client: Any, log_bytes: bytes, kind: str) -> None:
    """Whatever paths are in them, nothing is written anywhere; a sentence says to unpack them."""
    folder = client.app.state.services.workspace.folder
    around = set(folder.parent.rglob("*"))
    names = ["../../evil.log", "/tmp/segmap-evil.log", "..\\evil.log", "C:\\evil.log", "good.log"]
    answer = client.upload((f"logs.{kind}", archive_of(kind, names, log_bytes)))
    assert answer.status_code == 400
    assert "archive" in answer.json()["error"]["message"]
    assert set(folder.parent.rglob("*")) - around <= {folder}
    assert not Path("/tmp/segmap-evil.log").exists()


def test_archives_of_ours_hold_plain_names(client: Any, log_bytes: bytes) -> None:
    """Whatever the project is called, its zip unpacks beside itself."""
    made = client.upload(("..\\..\\..$(x)`'evil.log", log_bytes)).json()
    session = client.settle(made["id"])
    session.decide(session.integrations, "accepted")
    answer = client.get(f"/api/projects/{made['id']}/export/ros")
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert len(archive.namelist()) >= 2
        for name in archive.namelist():
            assert re.fullmatch(r"[\w .-]+", name)
            assert not name.startswith((".", "-", " "))


@pytest.mark.parametrize(
    "tail", ["..%2f..%2fpyproject.toml", "%2e%2e/%2e%2e/etc/passwd", "..%5c..%5cx", "js/%00", "//x"]
)
@pytest.mark.parametrize("base", ["/static/", "/projects/", "/api/projects/", "/api/samples/"])
def test_addresses_are_no_paths(client: Any, base: str, tail: str) -> None:
    """No address reaches a file beside those that are meant, or ends in an error of ours."""
    answer = client.get(base + tail)
    assert 400 <= answer.status_code < 500
    assert b"root:" not in answer.content
    assert b"[project]" not in answer.content


def test_a_body_that_does_not_come_is_given_up() -> None:
    """A client that is silent, or sends a byte now and then, does not hold the server; one that waits for news does."""

    async def drip(pieces: int, pause: float) -> int:
        async def receive() -> Any:
            nonlocal pieces
            await asyncio.sleep(pause)
            pieces -= 1
            return {"type": "http.request", "body": b"x", "more_body": pieces > 0}

        piece = bounded(receive, 1000, seconds=0.05, silent=0.02)
        try:
            while (await piece())["more_body"]:
                pass
            await piece()
        except HTTPException as error:
            return error.status_code
        return 200

    assert asyncio.run(drip(2, 60.0)) == 408
    assert asyncio.run(drip(1000, 0.005)) == 408
    assert asyncio.run(drip(3, 0.0)) == 200


def test_large_bodies_are_refused_everywhere(make_client: Callable[..., Any], project: str) -> None:
    """Not only uploads: a decision of a megabyte is none."""
    client = make_client()
    answer = client.post(f"/api/projects/{project}/decisions", content=b" " * (2 << 20))
    assert answer.status_code == 413
