"""How a merged map of many segments feels in the browser: answers of the API and frames a second while it is shown.

    python benchmarks/browser_map.py [--segments 20000] [--rounds 20] [--chromium PATH]

Makes a project whose accepted integrations put scans with many corners side by side, so that the merged map has
about so many segments in one component; serves it; opens its page in chromium at the stage `map`; then asks the API
what a person at work would make it ask, `--rounds` times each, while the page turns the map. Printed: median and
95th percentile of each kind of request, of all together, how long the map took to be on the screen, the frames a
second and the renderer. Where a machine has no graphics card chromium draws in software, and says so.
"""

from __future__ import annotations

import argparse
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import httpx
import numpy as np
from common import markdown, provenance
from playwright.sync_api import Page, sync_playwright

from segmap.events import Choice, Decide
from segmap.pose import Pose2
from segmap.store import Store

SERVE = "import sys; from pathlib import Path; from app.server import serve; serve(port=0, workspace=Path(sys.argv[1]))"
ARGUMENTS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage")
BEAMS = 720
CORNERS = 100
"""of the room each scan sees; a segment between two of them"""
APART, ROW = 14.0, 25
"""metres between two scans, and scans in a row of the map"""
FRAMES_SECONDS = 6.0
FRAMES = """seconds => new Promise((done) => {
  const start = performance.now();
  let frames = 0;
  const turn = () => {
    frames += 1;
    window.__viserMutable.cameraControl.truck(0.2 * Math.sin(frames / 9), 0, false);
    if (performance.now() - start < 1000 * seconds) requestAnimationFrame(turn);
    else done(frames / ((performance.now() - start) / 1000));
  };
  requestAnimationFrame(turn);
})"""
RENDERER = """() => {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  return gl ? gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER) : "no WebGL";
}"""
SHOWN = (
    "() => Object.keys(window.__viserMutable?.nodeRefFromName ?? {}).some((name) => name.startsWith('/map/component'))"
)


def ranges(seed: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """A sweep over a room with ``CORNERS`` corners, metres."""
    corners = np.random.default_rng(seed).uniform(3.0, 6.0, CORNERS)
    at = np.linspace(0.0, 2.0 * math.pi, CORNERS, endpoint=False)
    x, y = corners * np.cos(at), corners * np.sin(at)
    beams = np.arange(BEAMS) * 2.0 * math.pi / BEAMS
    first = (beams / (2.0 * math.pi / CORNERS)).astype(int) % CORNERS
    second = (first + 1) % CORNERS
    dx, dy = x[second] - x[first], y[second] - y[first]
    return (x[first] * dy - y[first] * dx) / (np.cos(beams) * dy - np.sin(beams) * dx)


def log_of(scans: int) -> bytes:
    """The sweeps as JSON lines."""
    step = 360.0 / BEAMS
    lines = []
    for i in range(scans):
        told = ", ".join(f"{value:.4f}" for value in ranges(i))
        lines.append(f'{{"time": {i}, "first_angle_deg": 0, "angle_step_deg": {step}, "ranges": [{told}]}}')
    return ("\n".join(lines) + "\n").encode()


def place(scan: int) -> Pose2:
    """Where a scan lies on the map: to and fro in rows."""
    row, column = divmod(scan, ROW)
    return Pose2(APART * (column if row % 2 == 0 else ROW - 1 - column), APART * row, 0.0)


def accept_all(path: Path, scans: int) -> None:
    """Accept each pair of neighbours at the pose that puts it in its place."""
    with Store.open(path) as store:
        choices = tuple(
            Choice(
                integration=f"0.{i}-0.{i + 1}",
                verdict="accepted",
                parameters=store.state.fingerprint,
                T_1_2=place(i).inverse() @ place(i + 1),
            )
            for i in range(scans - 1)
        )
        store.append(Decide(choices=choices, who="benchmark"))


class Served:
    """`segmap serve` on a folder, until it is closed."""

    def __init__(self, folder: Path) -> None:
        self._process = subprocess.Popen([sys.executable, "-c", SERVE, str(folder)], stderr=subprocess.PIPE, text=True)
        assert self._process.stderr is not None
        line = next(line for line in self._process.stderr if "segmap is at" in line)
        url = line.split("segmap is at ")[1].split()[0]
        self.client = httpx.Client(base_url=url.rstrip("/"), timeout=600.0)

    def wait_for_map(self, project: str) -> int:
        """Back when the map is merged; its number of segments."""
        while (info := self.client.get(f"/api/projects/{project}").json())["merging"] or not info["components"]:
            time.sleep(0.2)
        return sum(part["segments"] for part in info["components"])

    @property
    def processor_ms(self) -> float:
        """Milliseconds of processor time the server has used; NaN where the system does not tell."""
        told = Path(f"/proc/{self._process.pid}/stat")
        if not told.exists():
            return math.nan
        user, system = told.read_text().rpartition(")")[2].split()[11:13]
        return 1000.0 * (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")

    def close(self) -> None:
        """End the server."""
        self.client.close()
        self._process.terminate()
        self._process.wait(20)


def timed(ask: Callable[[], httpx.Response]) -> float:
    """Milliseconds until an answer is there, which must be a good one."""
    start = time.perf_counter()
    ask().raise_for_status()
    return 1000.0 * (time.perf_counter() - start)


def requests(client: httpx.Client, project: str, view: str) -> dict[str, Callable[[], httpx.Response]]:
    """What a person at work makes the page ask, by name."""

    def act(action: str, value: object = None) -> Callable[[], httpx.Response]:
        return lambda: client.post(f"/api/views/{view}", json={"action": action, "value": value})

    base = f"/api/projects/{project}"
    return {
        "project": lambda: client.get(base),
        "queue": lambda: client.get(f"{base}/integrations"),
        "one pair": lambda: client.get(f"{base}/integrations/0.0-0.1"),
        "next pair": act("next"),
        "colour by misfit": act("set_colouring", "misfit"),
        "colour by component": act("set_colouring", "components"),
        "switch a layer": act("toggle_layer", "trajectory"),
        "click a wall": act("set_picked", {"source": "component 1", "segment": 7}),
        "snapshot": lambda: client.get(f"/api/views/{view}"),
    }


def summary(name: str, times: list[float]) -> list[str]:
    """A row of the table."""
    return [name, f"{median(times):.0f}", f"{np.quantile(times, 0.95):.0f}", str(len(times))]


def frames_while(page: Page, ask: Callable[[], None] | None) -> float:
    """Frames a second of the scene while the map is moved, and something is asked meanwhile."""
    scene = next(frame for frame in page.frames if "/scene" in frame.url)
    scene.evaluate(f"() => {{ window.counted = ({FRAMES})({FRAMES_SECONDS}); }}")
    if ask is not None:
        ask()
    return float(scene.evaluate("() => window.counted"))


def measure(served: Served, project: str, rounds: int, chromium: str) -> None:
    """Open the page, ask, print."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=list(ARGUMENTS))
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(300_000)
        page.goto(f"{served.client.base_url}/projects/{project}")
        page.locator(".item").first.wait_for()
        page.locator("#scene-cover").wait_for(state="hidden")
        while not any("/scene" in frame.url for frame in page.frames):
            page.wait_for_timeout(50)
        scene = next(frame for frame in page.frames if "/scene" in frame.url)
        scene.wait_for_function("() => window.__viserMutable?.cameraControl")
        start = time.perf_counter()
        page.locator("#queue").focus()
        page.keyboard.press("6")
        scene.wait_for_function(SHOWN)
        print(f"On the screen {time.perf_counter() - start:.1f} s after it was asked for.")
        view = scene.url.split("/views/")[1].split("/")[0]
        told: dict[str, list[float]] = {}

        def ask() -> None:
            for _ in range(rounds):
                for name, request in requests(served.client, project, view).items():
                    told.setdefault(name, []).append(timed(request))

        still = frames_while(page, None)
        before = served.processor_ms
        working = frames_while(page, ask)
        spent = (served.processor_ms - before) / sum(map(len, told.values()))
        rows = [summary(name, times) for name, times in told.items()]
        rows.append(summary("all", [one for times in told.values() for one in times]))
        print(markdown(["request, ms", "median", "95 %", "times"], rows))
        print(f"{still:.1f} frames a second while the map is moved, {working:.1f} while requests come in as well;")
        print(f"{spent:.0f} ms of the server's processor time a request, what it sends to the scene included;")
        print(f"renderer: {scene.evaluate(RENDERER)}")
        browser.close()


def main() -> None:
    """Make the project, serve it, measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--segments", type=int, default=20_000)
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--chromium", default=shutil.which("chromium") or shutil.which("google-chrome") or "")
    chosen = parser.parse_args()
    scans = max(2, round(chosen.segments / CORNERS))
    with tempfile.TemporaryDirectory() as folder:
        served = Served(Path(folder))
        try:
            files = {"files": ("rooms.jsonl", log_of(scans))}
            project = served.client.post("/api/projects", files=files).raise_for_status().json()["id"]
            accept_all(Path(folder) / f"{project}.segmap", scans)
            served.client.post(f"/api/projects/{project}/matching", json={"action": "cancel"})
            start = time.perf_counter()
            segments = served.wait_for_map(project)
            print(provenance())
            print(f"{segments} segments of {scans} scans, merged in {time.perf_counter() - start:.0f} s.")
            measure(served, project, chosen.rounds, chosen.chromium)
        finally:
            served.close()


if __name__ == "__main__":
    main()
