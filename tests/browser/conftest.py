"""A real browser on a real server: what the tests that drive the page share."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx
import pytest
from pages import photograph

if TYPE_CHECKING:
    from playwright.sync_api import Browser, ConsoleMessage, Frame, Locator, Page

ROOT = Path(__file__).resolve().parents[2]
SERVE = (
    "import sys; from pathlib import Path; from app.server import serve; "
    "serve(port=int(sys.argv[1]), workspace=Path(sys.argv[2]))"
)
STARTED = re.compile(r"segmap is at (http://\S+?)/ ")
START_SECONDS = 60.0
STOP_SECONDS = 20.0
MATCHING_SECONDS = 180.0
SELECTED = ".item[aria-selected=true]:not([hidden])"
PATIENCE = 20_000.0
"""milliseconds; a loaded machine draws slowly"""
DRAWN = "() => window.__viserMutable?.camera && '/second' in (window.__viserMutable.nodeRefFromName ?? {})"
NODES = """() => {
  const nodes = {};
  for (const [name, node] of Object.entries(window.__viserMutable.nodeRefFromName)) {
    const colours = new Set();
    node?.traverse?.((part) => part.material?.color && colours.add(part.material.color.getHexString()));
    nodes[name] = { at: node?.position?.toArray() ?? null, shown: node?.visible ?? null, colours: [...colours] };
  }
  return nodes;
}"""
CAMERA = """() => {
  const camera = window.__viserMutable.camera;
  const ahead = camera.getWorldDirection(camera.position.clone());
  return { fov: camera.fov, ahead: ahead.toArray(), distance: camera.position.length() };
}"""


class Server:
    """`segmap serve` in a process of its own, on a folder of projects; it can be stopped and started again."""

    def __init__(self, workspace: Path) -> None:
        self.workspace = workspace
        self.log = workspace / "server.log"
        self.url = "http://127.0.0.1:0"
        self.start()

    def start(self) -> None:
        """Start, at the port it had before, and wait until it answers."""
        command = [sys.executable, "-c", SERVE, self.url.rpartition(":")[2], str(self.workspace)]
        with self.log.open("w") as log:
            self._process = subprocess.Popen(command, cwd=ROOT, stderr=log)
        end = time.monotonic() + START_SECONDS
        while not (found := STARTED.search(self.log.read_text())):
            if self._process.poll() is not None or time.monotonic() > end:
                pytest.fail(f"the server did not start:\n{self.log.read_text()}")
            time.sleep(0.05)
        self.url = found[1]

    def stop(self) -> None:
        """End it as Ctrl+C does."""
        self._end(signal.SIGINT)

    def kill(self) -> None:
        """End it as a power cut does."""
        self._end(signal.SIGKILL)

    def _end(self, how: signal.Signals) -> None:
        self._process.send_signal(how)
        self._process.wait(STOP_SECONDS)

    def get(self, path: str) -> Any:
        """What the API answers."""
        return httpx.get(self.url + path, timeout=60.0).raise_for_status().json()

    def wait_until_matched(self, project: str) -> None:
        """Back when every pair of a project is matched."""
        end = time.monotonic() + MATCHING_SECONDS
        while (progress := self.get(f"/api{project}")["progress"])["done"] < progress["total"]:
            if time.monotonic() > end:
                pytest.fail(f"matching takes too long: {progress}")
            time.sleep(0.1)

    def open_sample(self, name: str) -> str:
        """The path of the page of a new project made of a sample."""
        answer = httpx.post(f"{self.url}/api/projects", json={"sample": name}, timeout=60.0)
        return str(answer.raise_for_status().json()["url"])


class Desk:
    """A page as a person uses it: what is on it, and what the scene in it shows."""

    def __init__(self, page: Page, pictures: Path) -> None:
        self.page = page
        self._pictures = pictures
        self.errors: list[str] = []
        page.set_default_timeout(PATIENCE)
        page.on("console", self._heard)
        page.on("pageerror", lambda error: self.errors.append(str(error)))

    def _heard(self, message: ConsoleMessage) -> None:
        if message.type == "error":
            self.errors.append(f"{message.text} ({message.location['url']})")

    def open(self, url: str, *, scene: bool = True) -> None:
        """Go to a project's page; back when its queue is there, and its scene."""
        self.page.goto(url)
        self.page.locator(".item").first.wait_for()
        self.page.locator("#candidates-body tr[aria-selected=true]").wait_for()
        if scene:
            self.wait_for_scene()

    def wait_for_scene(self) -> None:
        """Back when the scene has drawn something."""
        self.page.locator("#scene-cover").wait_for(state="hidden")
        self.until(lambda: any("/scene" in frame.url for frame in self.page.frames), "the scene")
        self.scene.wait_for_function(DRAWN)

    def follow(self, url: str) -> None:
        """Go to the page of who follows a view; back when its scene has drawn something."""
        self.page.goto(url)
        self.page.locator("#cover").wait_for(state="hidden")
        self.until(lambda: any("/scene" in frame.url for frame in self.page.frames), "the scene")
        self.scene.wait_for_function(DRAWN)

    @property
    def scene(self) -> Frame:
        """The document of the scene."""
        return next(frame for frame in self.page.frames if "/scene" in frame.url)

    @property
    def nodes(self) -> dict[str, Any]:
        """Everything the scene draws by name: where it is, whether it is shown, in which colours."""
        return dict(self.scene.evaluate(NODES))

    @property
    def camera(self) -> dict[str, Any]:
        """The scene's camera: field of view in degrees, where it looks, how far it is from the origin."""
        return dict(self.scene.evaluate(CAMERA))

    @property
    def selected(self) -> str:
        """The id of the integration selected in the queue; waits for its row to be in sight."""
        return str(self.page.locator(SELECTED).get_attribute("data-id"))

    @property
    def candidate(self) -> int:
        """The rank of the candidate marked in the table, from 0."""
        return int(self.page.locator("#candidates-body tr[aria-selected=true]").get_attribute("data-rank") or -1)

    def count(self, state: str) -> int:
        """The number on a filter of the queue."""
        return int(self.page.locator(f"[data-filter={state}] .number").inner_text().replace("\u202f", ""))

    def row(self, integration: str) -> Locator:
        """The row of an integration."""
        return self.page.locator(f'.item[data-id="{integration}"]:not([hidden])')

    def until(self, true: Callable[[], bool], what: str) -> None:
        """Wait until something becomes true."""
        end = time.monotonic() + PATIENCE / 1000.0
        while time.monotonic() < end:
            if true():
                return
            self.page.wait_for_timeout(25)
        told = self.page.locator("[role=alert], [role=status]").all_inner_texts()
        selected = [row.get_attribute("data-id") for row in self.page.locator(SELECTED).all()]
        queue = f"{selected} are selected and in sight, the filters say {self.page.locator('#filters').inner_text()!r}"
        pytest.fail(f"still waiting for: {what}; {queue}; told: {told}; {self.picture('failed')} shows the page")

    def picture(self, name: str) -> Path:
        """Keep what the page looks like now."""
        path = self._pictures / f"{name}.png"
        if any("/scene" in frame.url for frame in self.page.frames):
            self._close_notes()
        photograph(self.page, path)
        return path

    def _close_notes(self) -> None:
        """viser tells everybody who has no graphics card."""
        note = self.scene.get_by_text("Software WebGL rendering detected")
        if note.count():
            self.scene.locator("button.mantine-Notification-closeButton").first.evaluate("button => button.click()")
            note.wait_for(state="detached")


@pytest.fixture(scope="session")
def server(chromium: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """The server all tests share; every test opens projects of its own."""
    server = Server(tmp_path_factory.mktemp("projects"))
    yield server
    server.kill()
    complaints = server.log.read_text()
    assert "Traceback" not in complaints, complaints


@pytest.fixture(scope="session")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where screenshots go: SEGMAP_SCREENSHOTS, or a temporary folder."""
    folder = Path(os.environ.get("SEGMAP_SCREENSHOTS") or tmp_path_factory.mktemp("screenshots"))
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.fixture(scope="session")
def make_desk(chromium: Browser, pictures: Path) -> Callable[..., Desk]:
    """Open a window of its own; whoever asks for it closes it."""

    def make(width: int = 1280, height: int = 800, scheme: str = "light") -> Desk:
        size: Any = {"width": width, "height": height}
        context = chromium.new_context(viewport=size, color_scheme=scheme)  # type: ignore[arg-type]
        return Desk(context.new_page(), pictures)

    return make


@pytest.fixture
def new_desk(make_desk: Callable[..., Desk]) -> Iterator[Callable[..., Desk]]:
    """Open a window of its own; it is closed at the end, and nothing may have complained in it."""
    desks: list[Desk] = []

    def make(*size: int, **looks: Any) -> Desk:
        desks.append(make_desk(*size, **looks))
        return desks[-1]

    yield make
    for desk in desks:
        desk.page.context.close()
    assert [error for desk in desks for error in desk.errors] == []


@pytest.fixture
def desk(new_desk: Callable[..., Desk]) -> Desk:
    """A window of the usual size."""
    return new_desk()
