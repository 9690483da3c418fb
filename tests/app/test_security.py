"""What foreign pages, foreign names and foreign hands may not do."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

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
        assert html.count("<script") == html.count('<script type="module" src="/static/')
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


def test_large_bodies_are_refused_everywhere(make_client: Callable[..., Any], project: str) -> None:
    """Not only uploads: a decision of a megabyte is none."""
    client = make_client()
    answer = client.post(f"/api/projects/{project}/decisions", content=b" " * (2 << 20))
    assert answer.status_code == 413
