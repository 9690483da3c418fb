"""Many browsers on one server: python benchmarks/load.py [--browsers 20] [--seconds 60] [--projects 200] [--pages 2]

A folder of projects is made: small ones, and one of 5,000 scans and 20,000 integrations, matched and
partly accepted. Then `segmap serve` runs on it, and clients do what the page does: the list of
projects with its pictures, a project's page and files, its queue, a view, its scene and the scene's
socket, the stream of events and what the page loads again after each of them; and what people do:
select, look, move the threshold, decide, take back. Half of them are on the large project. --pages adds
real chromium pages on it. Printed: time of each kind of request, the share below a second, and the
memory of the server; all figures come from one run, clients and server on the same machine.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import random
import re
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

import httpx
import viser
from common import markdown, percent
from load_projects import large_project, small_projects
from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException
from websockets.typing import Subprotocol

SERVE = "import sys; from pathlib import Path; from app.server import serve; serve(workspace=Path(sys.argv[1]), port=0)"
BOUND = 1.0
"""seconds, for 95 % of requests"""
GIBIBYTES = 4.0
VISER = Subprotocol(f"viser-v{viser.__version__}")
CONNECTIONS = httpx.Limits(max_connections=6)
RELOADS = {"hello", "match", "decision", "parameters", "log", "graph", "map"}
CHROMIUM = ("--no-sandbox", "--disable-dev-shm-usage", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


class Times:
    """How long requests took, in seconds, by kind."""

    def __init__(self) -> None:
        self.of: dict[str, list[float]] = defaultdict(list)
        self.bytes: dict[str, int] = defaultdict(int)
        self.failed: dict[str, int] = defaultdict(int)

    def rows(self) -> Iterator[tuple[object, ...]]:
        """A row for each kind, the slowest first."""
        for kind, found in sorted(self.of.items(), key=lambda item: -_quantile(item[1], 0.95)):
            yield (kind, *_told(found), f"{self.bytes[kind] / len(found) / 1024:.0f}", self.failed[kind])

    @property
    def all(self) -> list[float]:
        """Of all kinds."""
        return [seconds for found in self.of.values() for seconds in found]


def _told(found: list[float]) -> tuple[object, ...]:
    times = (_quantile(found, share) for share in (0.5, 0.95, 0.99, 1.0))
    return (
        len(found),
        *(f"{1000 * seconds:.0f}" for seconds in times),
        percent(sum(t < BOUND for t in found) / len(found)),
    )


def _quantile(found: list[float], share: float) -> float:
    held = sorted(found)
    return held[min(int(share * len(held)), len(held) - 1)]


class Browser:
    """One page of the workbench, as far as its requests go."""

    def __init__(self, url: str, project: str, seed: int, times: Times) -> None:
        self.url, self.project, self.times = url, project, times
        self.numbers = random.Random(seed)
        self.client = httpx.AsyncClient(base_url=url, timeout=120.0, limits=CONNECTIONS, trust_env=False)
        self.api = f"/api/projects/{project}"
        self.view, self.scene, self.tag, self.rows = "", "", "", list[dict[str, Any]]()
        self.etags: dict[str, str] = {}
        self.stale = asyncio.Event()

    async def request(self, kind: str, method: str, path: str, **more: Any) -> httpx.Response:
        """A request, and the time until all of its answer is there."""
        headers = {"If-None-Match": self.etags[path]} if path in self.etags else {}
        start = time.perf_counter()
        answer = await self.client.request(method, path, headers=headers, **more)
        self.times.of[kind].append(time.perf_counter() - start)
        self.times.bytes[kind] += len(answer.content)
        self.times.failed[kind] += answer.status_code >= 400
        if "etag" in answer.headers:
            self.etags[path] = answer.headers["etag"]
        return answer

    async def home(self) -> None:
        """The list of projects, with the pictures in sight."""
        await self.page("/")
        listed, *_ = await asyncio.gather(
            self.request("list of projects", "GET", "/api/projects"),
            self.request("samples", "GET", "/api/samples"),
            self.request("deleted", "GET", "/api/deleted"),
        )
        shown = [held for held in listed.json()["projects"] if held["integrations"]["accepted"]][:12]
        for held in shown:
            answer = await self.request("picture", "GET", f"/api/projects/{held['id']}/map.svg")
            self.times.failed["picture"] -= answer.status_code == 404  # not drawn yet

    async def page(self, path: str) -> None:
        """A page, its styles and its modules."""
        html = (await self.request("page", "GET", path)).text
        files = re.findall(r'(?:src|href)="(/static/[^"#]+)', html)
        seen = set(files)
        while files:
            answers = await asyncio.gather(*(self.request("file", "GET", file) for file in files))
            found = {f"/static/js/{name}" for a in answers for name in re.findall(r'from "\./([\w.]+)"', a.text)}
            files = sorted(found - seen)
            seen |= found

    async def open(self) -> None:
        """A project's page, its queue, a view, and the scene with its socket."""
        await self.page(f"/projects/{self.project}")
        await self.load()
        made = (await self.request("open a view", "POST", f"{self.api}/views")).json()
        self.view, self.scene = made["id"], made["scene"]
        await self.request("view", "GET", f"/api/views/{self.view}")
        await self.request("scene", "GET", self.scene)

    async def load(self) -> None:
        """What the page loads again when something changed."""
        since = f"?since={self.tag}" if self.tag else ""
        info, rows = await asyncio.gather(
            self.request(self.named("project"), "GET", self.api),
            self.request(self.named("queue"), "GET", f"{self.api}/integrations{since}"),
        )
        tag = re.match(rb'\{"tag":"([^"]+)"', rows.content)  # a client that read every answer would measure itself
        self.tag = tag[1].decode() if tag else self.tag
        if not self.rows and info.content:
            self.rows = rows.json()["integrations"][:200]

    def named(self, what: str) -> str:
        """The kind of a request that depends on the size of the project."""
        return f"{what} (large)" if self.project == "large" else what

    async def reload(self) -> None:
        """Load again after events, never twice at once."""
        while True:
            await self.stale.wait()
            await asyncio.sleep(0.06)
            self.stale.clear()
            await self.load()

    async def listen(self) -> None:
        """The stream of events."""
        url = f"{self.url}{self.api}/events?view={self.view}"
        async with httpx.AsyncClient(timeout=None, trust_env=False) as client, client.stream("GET", url) as stream:
            async for line in stream.aiter_lines():
                if line.startswith("data: ") and json.loads(line[6:]).get("type") in RELOADS:
                    self.stale.set()

    async def watch(self) -> None:
        """The scene's socket."""
        url = self.url.replace("http", "ws") + self.scene.rstrip("/")
        with suppress(WebSocketException, OSError):
            async with connect(url, subprotocols=[VISER], max_size=None, proxy=None, compression=None) as socket:
                async for _ in socket:
                    pass

    async def act(self) -> None:
        """One thing a person does."""
        if not self.rows:
            return
        row = self.numbers.choice(self.rows)
        await self.numbers.choices(
            (self.select, self.look, self.decide, self.threshold, self.step), (40, 15, 20, 10, 15)
        )[0](row)

    async def select(self, row: dict[str, Any]) -> None:
        body = {"action": "select", "value": row["id"]}
        await self.request("select", "POST", f"/api/views/{self.view}", json=body)
        await self.request("integration", "GET", f"{self.api}/integrations/{row['id']}")

    async def look(self, row: dict[str, Any]) -> None:
        await self.request("preview", "GET", f"{self.api}/integrations/{row['id']}/preview")

    async def step(self, _: dict[str, Any]) -> None:
        body = {"action": "next_candidate", "value": None}
        await self.request("next candidate", "POST", f"/api/views/{self.view}", json=body)

    async def threshold(self, _: dict[str, Any]) -> None:
        value = round(self.numbers.uniform(0.5, 0.99), 2)
        await self.request(self.named("threshold"), "GET", f"{self.api}/threshold?value={value}")

    async def decide(self, row: dict[str, Any]) -> None:
        body = {"integrations": [row["id"]], "verdict": self.numbers.choice(("accepted", "rejected", "undecided"))}
        answer = await self.request(self.named("decide"), "POST", f"{self.api}/decisions", json=body)
        self.times.failed[self.named("decide")] -= answer.status_code == 400  # a pair without a pose, or undecided
        self.stale.set()

    async def live(self, seconds: float, think: float) -> None:
        """Come, work for some time, go."""
        await self.home()
        await self.open()
        around = [asyncio.create_task(work) for work in (self.listen(), self.watch(), self.reload())]
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            await asyncio.sleep(self.numbers.uniform(0.5, 1.5) * think)
            await self.act()
        for task in around:
            task.cancel()
        await asyncio.gather(*around, return_exceptions=True)
        await self.request("close the view", "DELETE", f"/api/views/{self.view}")
        await self.client.aclose()


@contextmanager
def serving(workspace: Path) -> Iterator[tuple[str, int]]:
    """`segmap serve`: its address and process id."""
    command = [sys.executable, "-c", SERVE, str(workspace)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        line = next(line for line in process.stderr if "segmap is at" in line)
        threading.Thread(target=lambda: [print(told, end="") for told in process.stderr or ()], daemon=True).start()
        try:
            yield line.split()[3].rstrip("/"), process.pid
        finally:
            process.kill()


def memory(pid: int, what: str) -> float:
    """MiB of a process, now (VmRSS) or at the most (VmHWM)."""
    found = re.search(rf"{what}:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text())
    return int(found[1]) / 1024 if found else float("nan")


def cpu(pid: int) -> float:
    """Seconds of processor time a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100.0


async def crowd(url: str, small: list[str], given: argparse.Namespace, times: Times) -> None:
    """All browsers, come within some seconds."""

    async def one(number: int) -> None:
        await asyncio.sleep(number * given.think / 2)
        project = "large" if number < given.large else small[number % len(small)]
        await Browser(url, project, number, times).live(given.seconds, given.think)

    works: list[Awaitable[None]] = [one(number) for number in range(given.browsers)]
    if given.pages:
        works.append(asyncio.to_thread(pages, url, given.pages, given.seconds, given.picture))
    await asyncio.gather(*works)


def pages(url: str, count: int, seconds: float, picture: Path | None) -> None:
    """Real pages on the large project, that step through its queue by the keyboard: how long until the next pair."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=list(CHROMIUM))
        shown = [browser.new_page() for _ in range(count)]
        start = time.monotonic()
        for page in shown:
            page.set_default_timeout(120_000.0)
            page.goto(f"{url}/projects/large")
        for page in shown:
            page.locator(".item").first.wait_for()
        print(f"{count} real pages show their queue after {time.monotonic() - start:.1f} s", flush=True)
        steps = []
        while time.monotonic() < start + seconds:
            for page in shown:
                steps.append(_step(page))
                page.wait_for_timeout(500)
        print(
            f"a step takes {1000 * _quantile(steps, 0.5):.0f} ms, 95 % {1000 * _quantile(steps, 0.95):.0f}", flush=True
        )
        if picture is not None:
            shown[0].screenshot(path=picture)
        browser.close()


def _step(page: Any) -> float:
    """Seconds from a key to the next pair in the address."""
    before, start = page.url, time.monotonic()
    page.keyboard.press("j")
    page.wait_for_function("(before) => location.href !== before", arg=before)
    return time.monotonic() - start


def measured(workspace: Path, given: argparse.Namespace) -> bool:
    """Run the crowd and print what was measured; whether it is within the bounds."""
    small = sorted(path.stem for path in workspace.glob("small-*.segmap"))
    times = Times()
    with serving(workspace) as (url, pid):
        before = memory(pid, "VmRSS")
        first = _timed(lambda: httpx.get(f"{url}/api/projects", timeout=600.0))
        large = _timed(lambda: httpx.get(f"{url}/api/projects/large", timeout=600.0))
        opened = memory(pid, "VmRSS")
        started, used = time.monotonic(), cpu(pid)
        asyncio.run(crowd(url, small, given, times))
        spent, passed = cpu(pid) - used, time.monotonic() - started
        most = memory(pid, "VmHWM")
    kinds = ("request", "count", "median ms", "95 % ms", "99 % ms", "most ms", "below 1 s %", "KiB", "failed")
    every = times.all
    print(markdown(kinds, [*times.rows(), ("all", *_told(every), "", sum(times.failed.values()))]))
    print(
        f"\nlist of {len(small) + 1} projects for the first time {first:.2f} s, the large one opened in {large:.2f} s;"
        f" memory {before:.0f} MiB at the start, {opened:.0f} with the large project open, {most:.0f} at the most;"
        f" {spent:.0f} s of processor time in {passed:.0f} s, {1000 * spent / len(every):.0f} ms a request"
    )
    return _quantile(every, 0.95) < BOUND and most < GIBIBYTES * 1024 and not sum(times.failed.values())


def _timed(work: Callable[[], httpx.Response]) -> float:
    start = time.perf_counter()
    work().raise_for_status()
    return time.perf_counter() - start


def main() -> int:
    """Make the projects, run, print; status 1 where a bound is not kept."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--browsers", type=int, default=20)
    parser.add_argument("--large", type=int, default=10, help="how many of them are on the large project")
    parser.add_argument("--projects", type=int, default=200)
    parser.add_argument("--scans", type=int, default=5000)
    parser.add_argument("--integrations", type=int, default=20_000)
    parser.add_argument("--seconds", type=float, default=60.0, help="that each browser works")
    parser.add_argument("--think", type=float, default=2.0, help="seconds between two things a person does, on average")
    parser.add_argument("--pages", type=int, default=0, help="real chromium pages beside them")
    parser.add_argument("--picture", type=Path, help="what one of them shows in the end, as a PNG")
    parser.add_argument("--workspace", type=Path, help="keep the projects there; used again where it exists")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        workspace = given.workspace or Path(folder) / "projects"
        if not workspace.is_dir():
            workspace.mkdir(parents=True)
            large_project(workspace / "large.segmap", given.scans, given.integrations)
            small_projects(workspace, given.projects - 1)
        return 0 if measured(workspace, given) else 1


if __name__ == "__main__":
    sys.exit(main())
