"""The scene behind our own address: what passes, and what a foreign page cannot do; a real server, no browser."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any

import httpx
import pytest
import uvicorn
import viser
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

from app import proxy
from app.dressing import SCRIPT
from app.errors import UnknownError
from app.proxy import POLICY
from app.server import create_app
from app.workspace import Workspace

PATIENCE = 60.0
VISER = Subprotocol(f"viser-v{viser.__version__}")


@contextmanager
def serving(app: Any) -> Iterator[str]:
    """An app on a loopback port of its own; yields ``host:port``."""
    config = uvicorn.Config(app, port=0, log_level="error", ws_per_message_deflate=False, timeout_graceful_shutdown=1)
    server = uvicorn.Server(config)
    ready = threading.Event()
    original = server.startup

    async def startup(sockets: Any = None) -> None:
        await original(sockets)
        ready.set()

    server.startup = startup  # type: ignore[method-assign]
    thread = threading.Thread(target=lambda: asyncio.run(server.serve()), daemon=True)
    thread.start()
    assert ready.wait(PATIENCE)
    try:
        yield f"127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join(PATIENCE)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory, log_bytes: bytes) -> Iterator[tuple[str, str]]:
    """Host and port of a server, and the path of the scene of a view on it."""
    folder: Path = tmp_path_factory.mktemp("projects")
    with serving(create_app(Workspace(folder))) as host:
        url = f"http://{host}"
        project = httpx.post(f"{url}/api/projects", files={"files": ("robot.log", log_bytes)}, timeout=PATIENCE).json()
        made = httpx.post(f"{url}/api/projects/{project['id']}/views", timeout=PATIENCE).json()
        yield host, made["scene"]


def open_socket(host: str, path: str, *, origin: str | None = None, **headers: str) -> ClientConnection:
    """viser's socket, as its page opens it: without the last slash."""
    return connect(
        f"ws://{host}{path.rstrip('/')}",
        origin=None if origin is None else Origin(origin),
        subprotocols=[VISER],
        additional_headers=headers,
        max_size=None,
        open_timeout=PATIENCE,
        proxy=None,
    )


# --- what passes ----------------------------------------------------------------------------------


def test_the_page_is_visers_with_our_policy_and_script(site: tuple[str, str]) -> None:
    """Once, at the beginning of the head, so that it runs before anything else."""
    host, path = site
    answer = httpx.get(f"http://{host}{path}?fixedDpr=1")
    assert answer.status_code == 200
    assert answer.headers["content-security-policy"] == POLICY
    assert answer.content.count(SCRIPT) == 1
    assert answer.content.index(SCRIPT) == answer.content.index(b"<head>") + len(b"<head>")


def test_the_policy_lets_nothing_out(site: tuple[str, str]) -> None:
    """Connections, frames and forms stay within our origin; nothing is loaded by default."""
    rules = dict(rule.split(maxsplit=1) for rule in POLICY.split("; "))
    assert rules["default-src"] == "'none'"
    assert rules["connect-src"] == "'self' blob: data:"
    assert rules["frame-ancestors"] == "'self'"
    assert not any("*" in rule or "http" in rule for rule in rules.values())


def test_the_socket_speaks_visers_protocol(site: tuple[str, str]) -> None:
    """The subprotocol is passed on, and the scene arrives."""
    host, path = site
    with open_socket(host, path, origin=f"http://{host}") as joined:
        assert joined.subprotocol == VISER
        assert isinstance(joined.recv(timeout=PATIENCE), bytes)


def test_a_program_without_origin_may_connect(site: tuple[str, str]) -> None:
    """Only pages have an origin; no page can leave it out."""
    host, path = site
    with open_socket(host, path) as joined:
        assert joined.recv(timeout=PATIENCE)


def test_what_is_not_there_is_not_there(site: tuple[str, str]) -> None:
    """Neither files beside viser's page nor files above it."""
    host, path = site
    for name in ("nothing.js", "..%2f..%2f..%2fpyproject.toml", "%2e%2e/%2e%2e/etc/passwd", "a%00b"):
        assert httpx.get(f"http://{host}{path}{name}").status_code == 404


# --- what does not --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "http://127.0.0.1:1", "https://127.0.0.1.evil.example", "null"]
)
def test_a_foreign_page_gets_no_socket(site: tuple[str, str], origin: str) -> None:
    """The handshake is refused before viser hears of it."""
    host, path = site
    with pytest.raises(InvalidStatus) as caught, open_socket(host, path, origin=origin):
        pass
    assert caught.value.response.status_code == 403


def test_a_rebound_name_gets_neither_page_nor_socket(site: tuple[str, str]) -> None:
    """A foreign name made to point here is not us, even where Origin and Host agree."""
    host, path = site
    assert httpx.get(f"http://{host}{path}", headers={"Host": "evil.example"}).status_code == 403
    address, _, port = host.partition(":")
    name = f"evil.example:{port}"
    with socket.create_connection((address, int(port))) as tcp, pytest.raises(InvalidStatus) as caught:
        connect(f"ws://{name}{path.rstrip('/')}", sock=tcp, origin=Origin(f"http://{name}"), proxy=None)
    assert caught.value.response.status_code == 403


def test_a_view_that_is_not_there(site: tuple[str, str]) -> None:
    """A sentence for the page, no handshake for the socket."""
    host, _ = site
    answer = httpx.get(f"http://{host}/views/guessed/scene/")
    assert answer.status_code == 404
    assert answer.json()["error"]["message"].endswith(".")
    with pytest.raises(InvalidStatus), open_socket(host, "/views/guessed/scene/"):
        pass


@pytest.mark.parametrize(
    "query", ["websocket=ws://evil.example", "playbackPath=//evil.example/x", "websocket=", "embed=1"]
)
def test_the_page_obeys_no_other_server(site: tuple[str, str], query: str) -> None:
    """viser's page would connect to, or play, what its address says."""
    host, path = site
    answer = httpx.get(f"http://{host}{path}?{query}")
    assert answer.status_code == 400
    assert "address" in answer.json()["error"]["message"]


# --- the end --------------------------------------------------------------------------------------


def test_a_closed_view_ends_its_socket(site: tuple[str, str]) -> None:
    """The page is told instead of waiting for ever; its address answers with a sentence."""
    host, _ = site
    project = httpx.get(f"http://{host}/api/projects").json()["projects"][0]["id"]
    made = httpx.post(f"http://{host}/api/projects/{project}/views", timeout=PATIENCE).json()
    with open_socket(host, made["scene"]) as joined:
        joined.recv(timeout=PATIENCE)
        assert httpx.delete(f"http://{host}/api/views/{made['id']}", timeout=PATIENCE).status_code == 200
        with pytest.raises(ConnectionClosed):
            _read_to_the_end(joined)
    assert httpx.get(f"http://{host}{made['scene']}").status_code == 404


class _Gone:
    """A browser that left before it was answered."""

    headers = MappingProxyType[str, str]({})

    async def close(self, _: int) -> None:
        raise OSError("nobody is there")


def test_a_closed_view_for_a_browser_that_left() -> None:
    """Neither side is there any more: nothing to tell anybody, and no error."""

    def watched(_: str) -> None:
        raise UnknownError("closed")

    site: Any = SimpleNamespace(views=SimpleNamespace(watched=watched))
    asyncio.run(proxy.socket(site, "x", _Gone()))  # type: ignore[arg-type]


def _read_to_the_end(joined: ClientConnection) -> None:
    while True:
        joined.recv(timeout=PATIENCE)


def test_many_sockets_come_and_go(site: tuple[str, str]) -> None:
    """Pages that leave without a word leave nothing that stops the next one."""
    host, path = site
    for _ in range(5):
        joined = open_socket(host, path)
        joined.recv(timeout=PATIENCE)
        joined.socket.close()
    with open_socket(host, path) as last:
        assert last.recv(timeout=PATIENCE)
