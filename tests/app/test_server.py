"""The server as it really runs: sockets, streams, and its end."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.errors import RequestError
from app.resources import samples_folder
from app.server import _listen
from app.streams import WAITING_EVENTS, Streams

PATIENCE = 120.0
SERVE = """
import sys
from pathlib import Path
from app.server import serve
serve([Path(argument) for argument in sys.argv[2:]], workspace=Path(sys.argv[1]))
"""


class Running:
    """A server in a process of its own."""

    def __init__(self, process: subprocess.Popen[str], url: str) -> None:
        self.process = process
        self.url = url
        self.base = re.match(r"http://[^/]+", url)[0]  # type: ignore[index]

    def interrupt(self) -> int:
        """Ctrl+C; the status it ends with."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(PATIENCE)


@contextmanager
def running(*arguments: str, **environment: str) -> Iterator[Running]:
    """``segmap serve`` until the test is done with it."""
    environment = {**os.environ, "PYTHONWARNINGS": "error", **environment}
    command = [sys.executable, "-c", SERVE, *arguments]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment) as process:
        try:
            assert process.stderr is not None
            lines = iter(process.stderr.readline, "")
            url = next((found[0] for line in lines if (found := re.search(r"http://\S+", line))), "")
            assert url
            yield Running(process, url)
        finally:
            process.kill()


def events(response: httpx.Response) -> Iterator[dict[str, Any]]:
    """Server-sent events as they come."""
    for line in response.iter_lines():
        if line.startswith("data: "):
            yield json.loads(line.removeprefix("data: "))


@pytest.mark.slow
def test_served_while_it_matches_and_ended_while_pages_listen(tmp_path: Path) -> None:
    """The page is there at once, events come as matches are found, and Ctrl+C ends it with streams open."""
    with running(str(tmp_path / "projects"), str(samples_folder() / "hall.log")) as server:
        assert httpx.get(server.url).status_code == 200
        api = server.base + "/api" + server.url.removeprefix(server.base)
        assert httpx.get(api, timeout=PATIENCE).json()["name"] == "hall"
        with httpx.stream("GET", f"{api}/events", timeout=PATIENCE) as stream:
            assert stream.headers["content-type"].startswith("text/event-stream")
            heard = events(stream)
            assert next(heard)["type"] == "hello"
            match = next(event for event in heard if event["type"] == "match")
            assert match["row"]["id"] == match["integration"]
            assert server.interrupt() == 0
    with running(str(tmp_path / "projects"), str(samples_folder() / "hall.log")) as again:
        assert again.url.rpartition("/")[2] == server.url.rpartition("/")[2]


@pytest.mark.slow
def test_two_pages_see_each_others_decisions(tmp_path: Path) -> None:
    """What one decides, the other's stream tells."""
    with running(str(tmp_path / "projects"), str(samples_folder() / "hall.log")) as server:
        api = server.base + "/api" + server.url.removeprefix(server.base)
        with httpx.stream("GET", f"{api}/events", timeout=PATIENCE) as stream:
            heard = events(stream)
            next(heard)
            body = {"integrations": ["0.0-0.1"], "verdict": "rejected", "who": "Ada"}
            assert httpx.post(f"{api}/decisions", json=body, timeout=PATIENCE).status_code == 200
            event = next(event for event in heard if event["type"] == "decision")
            assert (event["integrations"], event["rows"][0]["who"]) == (["0.0-0.1"], "Ada")


def test_a_port_that_is_taken(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """The next one is used and said, unless this one was asked for."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(RequestError, match="Try another --port"):
            _listen("127.0.0.1", port)
        monkeypatch.setattr("app.server.PORT", port)
        with _listen("127.0.0.1", None) as found:
            assert found.getsockname()[1] != port
            assert f"port {port} is taken" in capsys.readouterr().err
    with pytest.raises(RequestError):
        _listen("no such host.invalid", None)


# --- streams --------------------------------------------------------------------------------------


class Source:
    """Something to subscribe to."""

    def __init__(self) -> None:
        self.callbacks: list[Callable[[Any], None]] = []

    def subscribe(self, callback: Callable[[Any], None]) -> Callable[[], None]:
        self.callbacks.append(callback)
        return lambda: self.callbacks.remove(callback)

    def tell(self, event: Any) -> None:
        for callback in self.callbacks:
            callback(event)


def test_events_of_any_thread_arrive_in_order() -> None:
    """As text, one after the other; closing the stream ends the subscription."""
    source, streams = Source(), Streams()

    async def listen() -> list[str]:
        stream = streams.stream([source.subscribe], first={"type": "hello"})
        texts = [await anext(stream)]
        threading.Thread(target=lambda: [source.tell({"n": n}) for n in range(3)]).start()
        texts += [await anext(stream) for _ in range(3)]
        await stream.aclose()  # type: ignore[attr-defined]
        return texts

    texts = asyncio.run(listen())
    assert texts[0].endswith('data: {"type":"hello"}\n\n')
    assert texts[1:] == [f'data: {{"n":{n}}}\n\n' for n in range(3)]
    assert source.callbacks == []
    assert len(streams) == 0
    source.tell({"late": True})


def test_silence_is_filled_with_heartbeats() -> None:
    """So that a page that has gone is noticed."""
    streams = Streams(heartbeat_seconds=0.01)

    async def listen() -> str:
        stream = streams.stream([], first={})
        await anext(stream)
        text = await anext(stream)
        await stream.aclose()  # type: ignore[attr-defined]
        return text

    assert asyncio.run(listen()).startswith(":")


def test_closing_ends_streams_and_later_ones() -> None:
    """Whatever still waits in them."""
    source, streams = Source(), Streams()

    async def listen() -> list[int]:
        stream = streams.stream([source.subscribe], first={})
        await anext(stream)
        source.tell({"never": "read"})
        await asyncio.sleep(0)
        streams.close()
        rest = [text async for text in stream]
        later = [text async for text in streams.stream([source.subscribe], first={})]
        return [len(rest), len(later)]

    assert asyncio.run(listen()) == [0, 1]
    assert source.callbacks == []


def test_a_page_that_does_not_read_is_cut_off() -> None:
    """Events do not pile up without bound; the page connects again and loads what it missed."""
    source, streams = Source(), Streams()

    async def listen() -> int:
        stream = streams.stream([source.subscribe], first={})
        await anext(stream)
        for n in range(WAITING_EVENTS + 10):
            source.tell({"n": n})
        await asyncio.sleep(0.01)
        return len([text async for text in stream])

    assert asyncio.run(listen()) == 0


# --- large uploads --------------------------------------------------------------------------------

GIBIBYTE = 1 << 30
START = b'--x\r\nContent-Disposition: form-data; name="files"; filename="big.log"\r\n\r\n'
FORM = "POST /api/projects HTTP/1.1\r\nHost: {}\r\nContent-Type: multipart/form-data; boundary=x\r\n{}\r\n\r\n"


def peak_mebibytes(server: Running) -> int:
    """The most memory the server has had."""
    status = Path(f"/proc/{server.process.pid}/status").read_text()
    return int(re.search(r"VmHWM:\s+(\d+) kB", status)[1]) >> 10  # type: ignore[index]


def answered(connection: socket.socket) -> bytes:
    """What has been answered, until the other side closes."""
    pieces = []
    with suppress(ConnectionError):
        while piece := connection.recv(1 << 16):
            pieces.append(piece)
    return b"".join(pieces)


@pytest.mark.slow
def test_a_gibibyte_is_refused(tmp_path: Path) -> None:
    """By its declared length before any of it is read; without one, at the bound: never in memory, and gone then."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    with running(str(tmp_path / "projects"), TMPDIR=str(folder)) as server:
        host, _, port = server.base.removeprefix("http://").partition(":")
        address = (host, int(port))
        before = httpx.get(server.base).status_code and peak_mebibytes(server)
        with socket.create_connection(address, timeout=PATIENCE) as connection:
            connection.sendall(FORM.format(f"{host}:{port}", f"Content-Length: {GIBIBYTE}").encode())
            assert b" 413 " in answered(connection)[:20]
        piece = bytes(1 << 20)
        with socket.create_connection(address, timeout=PATIENCE) as connection:
            connection.sendall(FORM.format(f"{host}:{port}", "Transfer-Encoding: chunked").encode())
            sent = sending(connection, (START, *(piece,) * 1024))
            assert sent < 400 << 20
        assert httpx.get(f"{server.base}/api/projects").json() == {"projects": []}
        assert peak_mebibytes(server) < before + 64
    assert list(folder.iterdir()) == []


def sending(connection: socket.socket, pieces: Iterable[bytes]) -> int:
    """Send pieces as chunks; how many bytes the other side took before it had enough."""
    sent = 0
    with suppress(ConnectionError):
        for piece in pieces:
            connection.sendall(b"%x\r\n%b\r\n" % (len(piece), piece))
            sent += len(piece)
    return sent
