"""How the workbench feels in the browser: steps, decisions, parameters and a large queue, as a person sees them.

    python benchmarks/browser.py [--rounds 20] [--log FILE --first SCAN] [--chromium PATH]

Timed in chromium, from the key or the slider until what it changes is there, `--rounds` times each:

- candidate: N pressed, until the second map stands elsewhere in the scene;
- decision: Y pressed, until the row of the queue says accepted, and until another pair is selected;
- parameter: a slider moved, on a pair with 40 segments in each scan or as near to that as there is, until the scene
  has other segments and the page says what was tried;
- queue: the page of a project with 2,000 integrations opened, until J selects another pair.

Printed: medians, 95th percentiles, limits, and how busy the machine was: how much longer than its own CPU time a short
loop took, before each step. Where that is far above 1 the times are inflated as much. The scene is drawn in software
where there is no graphics card; frames are not waited for.
"""

from __future__ import annotations

import argparse
import gzip
import shutil
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

import httpx
import numpy as np
from browser_map import ARGUMENTS, Served
from common import markdown, provenance
from playwright.sync_api import Browser, Page, sync_playwright

from app.resources import samples_folder

SEGMENTS = 40
SCANS = 60
"""of the log that pairs are taken from"""
LARGE = 2_001
"""scans of the project with the large queue"""
LOOP = 0.03
"""seconds"""
NOISE: list[float] = []
"""what the loop told before each step"""
LIMITS = {"candidate": 100, "decision": 150, "decision, next pair": 150, "parameter": 300, "queue": 2000}
"""milliseconds"""
READY = "() => window.__viserMutable?.nodeRefFromName?.['/second']"
TIMES = """async ([kind, key, id]) => {
  const scene = document.getElementById("scene").contentWindow;
  const node = (name) => scene.__viserMutable.nodeRefFromName[name];
  const place = () => node("/second").position.toArray().concat(node("/second").quaternion.toArray()).join();
  const starts = () => {
    let found = "";
    const add = (part) => {
      const held = part.geometry?.attributes?.instanceStart;
      if (held) found += held.count + ":" + Array.from(held.array).join();
    };
    for (const name of ["/first/segments", "/second/segments"]) node(name).traverse(add);
    return found;
  };
  const trial = () => document.getElementById("parameters-trial").textContent;
  const selected = () => document.querySelector(".item[aria-selected=true]")?.dataset.id;
  const state = () => document.getElementById(`row-${id}`)?.dataset.state;
  const queue = document.getElementById("queue");
  const press = (key) => queue.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
  const slide = ([name, value]) => {
    const slider = document.querySelector(`[data-name=${name}] input[type=range]`);
    slider.value = value;
    slider.dispatchEvent(new Event("input", { bubbles: true }));
  };
  const before = { place: place(), starts: starts(), trial: trial(), selected: selected() };
  const done = {
    candidate: [() => place() !== before.place],
    decision: [() => state() === "accepted", () => selected() !== before.selected],
    parameter: [() => starts() !== before.starts && trial() !== before.trial],
  }[kind];
  const channel = new MessageChannel();
  const turn = () => new Promise((next) => ((channel.port1.onmessage = next), channel.port2.postMessage(0)));
  const start = performance.now();
  if (kind === "parameter") slide(key);
  else press(key);
  const times = done.map(() => null);
  while (times.includes(null) && performance.now() - start < 20000) {
    done.forEach((there, k) => (times[k] ??= there() ? performance.now() - start : null));
    await turn();
  }
  return times;
}"""
OPENED = """async () => {
  const selected = () => document.querySelector(".item[aria-selected=true]")?.dataset.id;
  while (!selected()) await new Promise((next) => setTimeout(next, 5));
  const before = selected();
  document.getElementById("queue").dispatchEvent(new KeyboardEvent("keydown", { key: "j", bubbles: true }));
  while (selected() === before) await new Promise((next) => setTimeout(next, 5));
  return performance.now();
}"""


def log_of(scans: int) -> bytes:
    """A log of so many scans: those of a sample, again and again."""
    lines = (samples_folder() / "hall.log").read_bytes().splitlines(keepends=True)
    laser = [line for line in lines if line.startswith(b"FLASER")]
    head = [line for line in lines if not line.startswith(b"FLASER")]
    return b"".join(head + [laser[i % len(laser)] for i in range(scans)])


def part_of(path: Path, first: int, scans: int) -> bytes:
    """Some scans of a CARMEN log, with all that is not a scan."""
    content = path.read_bytes()
    lines = (gzip.decompress(content) if content[:2] == b"\x1f\x8b" else content).splitlines(keepends=True)
    laser = [line for line in lines if line.startswith((b"FLASER", b"ROBOTLASER1"))]
    wanted = set(laser[first : first + scans])
    return b"".join(line for line in lines if not line.startswith((b"FLASER", b"ROBOTLASER1")) or line in wanted)


def new_project(served: Served, name: str, content: bytes) -> str:
    """A project of a log, all its pairs matched."""
    made = served.client.post("/api/projects", files={"files": (name, content)}).raise_for_status().json()
    wait_until_matched(served.client, made["id"])
    return str(made["id"])


def wait_until_matched(client: httpx.Client, project: str) -> None:
    """Back when every pair is matched."""
    while (progress := client.get(f"/api/projects/{project}").json()["progress"])["done"] < progress["total"]:
        time.sleep(0.2)


def near_forty(client: httpx.Client, project: str) -> tuple[str, list[int]]:
    """The pair whose scans have nearest to 40 segments each, with how many they have."""
    base = f"/api/projects/{project}/integrations"
    found = []
    for row in client.get(base).json()["integrations"]:
        match = client.get(f"{base}/{row['id']}").json()["match"]
        if match:
            found.append((sum(abs(n - SEGMENTS) for n in match["segments"]), row["id"], match["segments"]))
    _, id, segments = min(found)
    return id, segments


def opened(browser: Browser, url: str) -> Page:
    """A page with its scene."""
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.set_default_timeout(120_000)
    page.goto(url)
    page.locator("#scene-cover").wait_for(state="hidden")
    while not any("/scene" in frame.url for frame in page.frames):
        page.wait_for_timeout(50)
    next(frame for frame in page.frames if "/scene" in frame.url).wait_for_function(READY)
    page.wait_for_timeout(2000)
    return page


def noise() -> float:
    """How many times its own CPU time a loop of some milliseconds takes."""
    wall, own = time.perf_counter(), time.process_time()
    while (spent := time.process_time() - own) < LOOP:
        pass
    return (time.perf_counter() - wall) / spent


def timed(page: Page, kind: str, key: object, id: str | None = None) -> list[float]:
    """Milliseconds of one step; a pause follows, as a person makes."""
    NOISE.append(noise())
    times: list[float] = page.evaluate(TIMES, [kind, key, id])
    page.wait_for_timeout(600)
    if None in times:
        raise SystemExit(f"{kind} {key} {id}: nothing came of it within 20 s.")
    return times


def steps(page: Page, rounds: int) -> dict[str, list[float]]:
    """Candidates, then decisions, on one project."""
    found: dict[str, list[float]] = {"candidate": [], "decision": [], "decision, next pair": []}
    page.locator("#queue").focus()
    for turn in range(rounds):
        found["candidate"] += timed(page, "candidate", "n" if turn % 2 == 0 else "p")
    for _ in range(rounds):
        id = page.locator(".item[aria-selected=true]").get_attribute("data-id")
        queue, following = timed(page, "decision", "y", id)
        found["decision"].append(queue)
        found["decision, next pair"].append(following)
    return found


def trials(page: Page, rounds: int) -> list[float]:
    """A slider moved to and fro."""
    page.locator("#parameters-open").click()
    page.locator("[data-name=split_tolerance] input[type=range]").wait_for()
    page.keyboard.press("Tab")
    times = []
    for turn in range(rounds):
        times += timed(page, "parameter", ["split_tolerance", 96 + 3 * (turn % 2) + turn // 2 % 5])
    return times


def openings(browser: Browser, url: str, rounds: int) -> list[float]:
    """The page of the large project, opened afresh each time."""
    times = []
    for _ in range(rounds):
        NOISE.append(noise())
        context = browser.new_context(viewport={"width": 1280, "height": 800})
        page = context.new_page()
        page.set_default_timeout(120_000)
        page.goto(url, wait_until="commit")
        page.locator("#queue").wait_for(state="attached")
        times.append(float(page.evaluate(OPENED)))
        context.close()
    return times


def measured(served: Served, browser: Browser, chosen: argparse.Namespace) -> tuple[dict[str, list[float]], str]:
    """All times, and what the parameter was tried on."""
    content = part_of(chosen.log, chosen.first, SCANS) if chosen.log else log_of(57)
    project = new_project(served, "robot.log", content)
    url = f"{str(served.client.base_url).rstrip('/')}/projects/{project}"
    pair, segments = near_forty(served.client, project)
    page = opened(browser, f"{url}#{pair}")
    found = {"parameter": trials(page, chosen.rounds)}
    page.close()
    page = opened(browser, url)
    found |= steps(page, chosen.rounds)
    page.close()
    large = new_project(served, "large.log", log_of(LARGE))
    found["queue"] = openings(browser, f"{str(served.client.base_url).rstrip('/')}/projects/{large}", chosen.rounds)
    return found, f"parameter: on {pair}, {segments[0]} × {segments[1]} segments"


def row(name: str, times: list[float]) -> list[Any]:
    """A line of the table."""
    return [name, f"{median(times):.0f}", f"{np.quantile(times, 0.95):.0f}", LIMITS[name], len(times)]


def main() -> None:
    """Serve, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--log", type=Path, help=f"a CARMEN log, of which {SCANS} scans are taken")
    parser.add_argument("--first", type=int, default=0, help="the first of them")
    parser.add_argument("--chromium", default=shutil.which("chromium") or shutil.which("google-chrome") or "")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        served = Served(Path(folder))
        browser = playwright.chromium.launch(executable_path=chosen.chromium, args=list(ARGUMENTS))
        try:
            times, told = measured(served, browser, chosen)
        finally:
            browser.close()
            served.close()
    print(provenance())
    print(markdown(["ms", "median", "95 %", "limit", "times"], [row(name, times[name]) for name in LIMITS]))
    print(told)
    print(f"busy: a loop took {median(NOISE):.1f} times its CPU time, 95 % {np.quantile(NOISE, 0.95):.1f} times")


if __name__ == "__main__":
    main()
