"""What the workbench's tests share: a small log, sessions that are closed, and a client in the same process."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from anyio.from_thread import BlockingPortal, start_blocking_portal
from fastapi import FastAPI

from app.cli import main
from app.resources import samples_folder
from app.server import create_app
from app.session import Session
from app.views import Views
from app.workbench import View
from app.workspace import Workspace
from segmap.errors import SegmapError
from segmap.integration import Match, match_maps
from segmap.store import Store

PATIENCE = 120.0
"""seconds after which a test gives up waiting; no test asserts how long anything takes"""


Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Run the command in this process: exit status, standard output, standard error."""

    def run(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stopped:
            main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return int(stopped.value.code or 0), out, err

    return run


class Client:
    """A synchronous client of an app in this process; the app lives as long as the client."""

    def __init__(self, app: FastAPI, portal: BlockingPortal) -> None:
        self.app, self._portal = app, portal
        transport = httpx.ASGITransport(app, raise_app_exceptions=False)
        self._client = httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1:8000")

    def request(self, method: str, url: str, **options: Any) -> httpx.Response:
        return self._portal.call(lambda: self._client.request(method, url, **options))

    def get(self, url: str, **options: Any) -> httpx.Response:
        return self.request("GET", url, **options)

    def post(self, url: str, **options: Any) -> httpx.Response:
        return self.request("POST", url, **options)

    def delete(self, url: str, **options: Any) -> httpx.Response:
        return self.request("DELETE", url, **options)

    def upload(self, *files: tuple[str, bytes]) -> httpx.Response:
        return self.post("/api/projects", files=[("files", file) for file in files])

    def session(self, id: str) -> Session:
        return self.app.state.services.workspace.session(id)

    def settle(self, id: str) -> Session:
        """Wait until everything of a project is computed."""
        session = self.session(id)
        assert session.settle(PATIENCE)
        return session

    def close(self) -> None:
        self._portal.call(self._client.aclose)


class Scene:
    """Stands for a scene where no browser looks at it."""

    port = 0

    def __init__(self) -> None:
        self.closed = False

    def close(self) -> None:
        self.closed = True


def without_scene(session: Session) -> tuple[View, Scene]:
    """A view with nothing that draws it."""
    return View(session), Scene()


@pytest.fixture(scope="session")
def log_bytes() -> bytes:
    """A log of seven scans."""
    lines = (samples_folder() / "hall.log").read_bytes().splitlines(keepends=True)
    header = [line for line in lines if not line.startswith(b"FLASER")]
    return b"".join(header + [line for line in lines if line.startswith(b"FLASER")][:7])


@contextmanager
def running(folder: Path) -> Iterator[Client]:
    """A client of an app on a folder of projects, as long as it is needed."""
    app = create_app(Workspace(folder), open_views=Views(without_scene))
    with start_blocking_portal() as portal, portal.wrap_async_context_manager(app.router.lifespan_context(app)):
        client = Client(app, portal)
        yield client
        client.close()


@pytest.fixture(scope="session")
def running_client() -> Callable[[Path], AbstractContextManager[Client]]:
    """For tests that share an app."""
    return running


@pytest.fixture
def make_client(tmp_path: Path) -> Iterator[Callable[..., Client]]:
    """Start an app on the test's own folder of projects; several one after the other see the same projects."""
    with start_blocking_portal() as portal:
        running: list[tuple[Client, Any]] = []

        def stop() -> None:
            while running:
                client, lifespan = running.pop()
                client.close()
                lifespan.__exit__(None, None, None)

        def make(**options: Any) -> Client:
            stop()
            workspace = Workspace(tmp_path / "projects", **options.pop("workspace", {}))
            views = options.pop("open_views", None) or Views(without_scene)
            app = create_app(workspace, open_views=views, **options)
            lifespan = portal.wrap_async_context_manager(app.router.lifespan_context(app))
            lifespan.__enter__()
            running.append((Client(app, portal), lifespan))
            return running[-1][0]

        yield make
        stop()


@pytest.fixture
def client(make_client: Callable[..., Client]) -> Client:
    """An app, running."""
    return make_client()


@pytest.fixture
def project(client: Client, log_bytes: bytes) -> str:
    """The id of a project of the small log, matched."""
    made = client.upload(("robot.log", log_bytes)).json()
    client.settle(made["id"])
    return made["id"]


class Finder:
    """Finds matches as the library does, but can be held back, told to fail, and counts what it is asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[int, str]] = []
        self.stopped = 0
        self.failing: set[int] = set()
        self.started = threading.Semaphore(0)
        self._go = threading.Event()
        self._go.set()

    def hold(self) -> None:
        """Let no match end until ``go``."""
        self._go.clear()

    def go(self) -> None:
        self._go.set()

    def wait_until_asked(self) -> None:
        assert self.started.acquire(timeout=PATIENCE)

    def __call__(self, map_1: Any, map_2: Any, parameters: Any, heuristic: str, mode: str, *, check: Any) -> Match:
        scan = map_1.sources[0][0].scan
        self.asked.append((scan, heuristic))
        self.started.release()
        try:
            while not self._go.wait(0.01):
                check()
        except SegmapError:
            self.stopped += 1
            raise
        if scan in self.failing:
            raise ValueError("the finder was told to fail")
        return match_maps(map_1, map_2, parameters, heuristic, mode, check=check)


@pytest.fixture
def finder() -> Iterator[Finder]:
    """Stands in the library's place; lets everything end when the test does."""
    finder = Finder()
    yield finder
    finder.go()


@pytest.fixture
def project_file(tmp_path: Path, log_bytes: bytes) -> Path:
    """A project file with the small log."""
    path = tmp_path / "project.segmap"
    with Store.create(path, "Seven scans") as store:
        store.add_log("robot.log", log_bytes, scans=7, format="CARMEN")
    return path


@pytest.fixture
def open_session(project_file: Path) -> Iterator[Callable[..., Session]]:
    """Open the project file; sessions opened before are closed first."""
    opened: list[Session] = []

    def open(**options: Any) -> Session:
        while opened:
            opened.pop().close()
        opened.append(Session("seven", Store.open(project_file), **options))
        return opened[-1]

    yield open
    while opened:
        opened.pop().close()


@pytest.fixture
def session(open_session: Callable[..., Session]) -> Session:
    """The project, open and matched."""
    session = open_session()
    assert session.settle(PATIENCE)
    return session
