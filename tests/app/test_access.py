"""A server that other computers reach: the link, the cookie, and who stays outside."""

from __future__ import annotations

import asyncio
import posixpath
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.access import VARIABLE, token_for
from app.errors import RequestError
from app.security import Guard
from app.server import create_app, reached_at

HOST = {"host": "192.168.1.7:8000"}
PAGES = ("/", "/projects/any", "/api/projects", "/api/openapi.json", "/static/js/home.js", "/views/any/scene/")


@pytest.fixture
def client(make_client: Callable[..., Any]) -> Any:
    """An app that listens at an address of the network."""
    return make_client(bound="192.168.1.7")


def test_without_the_token_there_is_nothing(client: Any) -> None:
    """Neither page nor list nor file, and nothing is made; the answer says how to get in."""
    for url in PAGES:
        answer = client.get(url, headers=HOST)
        assert answer.status_code == 401
        assert answer.json()["error"]["kind"] == "TokenMissing"
        assert "link" in answer.json()["error"]["message"]
    assert client.post("/api/projects", json={"sample": "hall"}, headers=HOST).status_code == 401
    page = client.get("/", headers={**HOST, "accept": "text/html,*/*"})
    assert page.status_code == 401
    assert "link" in page.text
    assert "unsafe" not in page.headers["content-security-policy"]


@pytest.mark.parametrize("page", ["/follow/x", "/follow/walk/x"])
def test_who_follows_gets_all_that_the_page_is_made_of(client: Any, page: str) -> None:
    """Styles, scripts and whatever these import, without the token: a class on other computers has none."""
    waiting, seen = [page], set[str]()
    while waiting:
        path = waiting.pop()
        answer = client.get(path, headers=HOST)
        assert answer.status_code == 200 or path == page == "/follow/x", path  # nobody shares that view
        seen.add(path)
        named = re.findall(r'(?:src|href)="(/static/[^"#]+)', answer.text) if path == page else []
        if path.endswith(".js"):
            named = [
                posixpath.join(posixpath.dirname(path), name) for name in re.findall(r'from "(\.[^"]+)"', answer.text)
            ]
        waiting += {posixpath.normpath(name) for name in named} - seen
    assert len(seen) > 8


@pytest.mark.parametrize("brought", ["wrong", "", "é", "x" * 32, "%00"])
def test_a_wrong_token_is_none(client: Any, brought: str) -> None:
    """In the link, in the cookie and in the header."""
    assert client.get("/", params={"token": brought}, headers=HOST).status_code == 401
    for name, value in (("cookie", f"segmap-8000={brought}"), ("authorization", f"Bearer {brought}")):
        answer = client.get("/api/projects", headers={**HOST, name: value.encode()})
        assert answer.status_code == 401
        assert "set-cookie" not in answer.headers


def test_the_link_lets_a_browser_in(client: Any) -> None:
    """Its token goes into a cookie that scripts and foreign pages do not get, and out of the address."""
    token = client.app.state.token
    answer = client.get(f"/projects/x?a=1&token={token}&b=%26", headers=HOST)
    assert (answer.status_code, answer.headers["location"]) == (303, "/projects/x?a=1&b=%26")
    cookie, *attributes = answer.headers["set-cookie"].split("; ")
    assert cookie == f"segmap-8000={token}"
    assert {"HttpOnly", "Path=/", "SameSite=lax"} <= set(attributes)
    assert client.get("/api/projects", headers={**HOST, "cookie": f"other=1; {cookie}"}).status_code == 200
    other_port = {"host": "192.168.1.7:8001", "cookie": cookie}
    assert client.get("/api/projects", headers=other_port).status_code == 401


@pytest.mark.parametrize("path", ["//evil.example/", "/\\evil.example", "/%5cevil.example", "/%2fevil.example"])
def test_the_link_leads_nowhere_else(client: Any, path: str) -> None:
    """An address that begins with two slashes is still one of ours."""
    answer = client.request("GET", f"http://192.168.1.7:8000{path}?token={client.app.state.token}")
    assert answer.status_code == 303
    assert answer.headers["location"].startswith("/evil")


def test_a_cookie_alone_changes_nothing_for_foreign_pages(client: Any) -> None:
    """Who was let in is still asked for the origin; and the token opens no other name of the server."""
    brought = {"authorization": f"Bearer {client.app.state.token}"}
    assert client.get("/api/projects", headers={**HOST, **brought}).status_code == 200
    foreign = {**HOST, **brought, "origin": "http://evil.example"}
    assert client.post("/api/projects", json={"sample": "hall"}, headers=foreign).status_code == 403
    assert client.get("/", headers={**brought, "host": "evil.example"}).status_code == 403


@pytest.mark.parametrize(("header", "passes"), [({}, False), ({"cookie": "segmap-8000=wrong"}, False), (None, True)])
def test_sockets_ask_too(header: dict[str, str] | None, passes: bool) -> None:
    """The scene's socket opens for the cookie alone."""
    reached = []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        reached.append(scope)

    async def send(message: Any) -> None:
        assert message == {"type": "websocket.close", "code": 1008}

    brought = {"cookie": "segmap-8000=right"} if header is None else header
    headers = {**HOST, "origin": "http://192.168.1.7:8000", **brought}
    scope = {"type": "websocket", "path": "/", "headers": [(k.encode(), v.encode()) for k, v in headers.items()]}
    asyncio.run(Guard(app, "192.168.1.7", token="right")(scope, None, send))  # type: ignore[arg-type]
    assert bool(reached) is passes


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1"])
def test_this_computer_is_asked_for_nothing(host: str) -> None:
    """Loopback needs no token."""
    assert token_for(host) is None


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "", "192.168.1.7", "workstation", "127.0.0.1.evil.example"])
def test_every_other_address_has_a_token(host: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A new one each time, that cannot be guessed; or the one the environment gives, where it is long enough."""
    first, second = (create_app(tmp_path, bound=host).state.token for _ in range(2))
    assert first != second
    assert len(first) >= 32
    monkeypatch.setenv(VARIABLE, "a-token-of-my-own")
    assert create_app(tmp_path, bound=host).state.token == "a-token-of-my-own"
    for bad in ("short", "long enough but with spaces", "0123456789abcdef;"):
        monkeypatch.setenv(VARIABLE, bad)
        with pytest.raises(RequestError, match=VARIABLE):
            token_for(host)


def test_addresses_to_give_people() -> None:
    """A server on all addresses tells this computer's own, and others' way to it where there is one."""
    assert reached_at("192.168.1.7") == ["192.168.1.7"]
    assert reached_at("0.0.0.0")[0] == "127.0.0.1"
    assert reached_at("::")[0] == "::1"
    assert not {"0.0.0.0", "::"} & {*reached_at("0.0.0.0"), *reached_at("::")}
