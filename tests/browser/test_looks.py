"""Looks: readable and labelled by axe-core's judgement, reachable by keyboard, whole at the sizes people have."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

axe_playwright = pytest.importorskip(
    "axe_playwright_python.sync_playwright", reason="pip install axe-playwright-python"
)

SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"
SERIOUS = ("serious", "critical")
SHEETS = (("#parameters-open", "#parameters-close"), ("#help-open", "#help button"), ("#share", ".share > button"))
"""what opens a drawer or a sheet, and what closes it"""
FAILURE = '{"error": {"message": "It broke.", "kind": "X"}}'
SIZES = ((1280, 720), (1440, 900), (1024, 768), (820, 1180))
CLIPPED = """() => {
  const out = [];
  const seen = (element) => element.checkVisibility({ visibilityProperty: true }) && element.getClientRects().length;
  const beyond = (box, frame) => box.left < frame.left - 1 || box.right > frame.right + 1;
  for (const control of document.querySelectorAll("button, select, input, summary, a[href]")) {
    if (!seen(control) || control.closest("[aria-hidden=true], .notices, .only-read")) continue;
    const box = control.getBoundingClientRect(), name = control.id || control.textContent.trim();
    const zones = document.querySelectorAll(".left, .left > section, .bar, .card");
    for (const zone of [document.documentElement, ...zones]) {
      if (zone.contains(control) && beyond(box, zone.getBoundingClientRect()))
        out.push(`${name} beyond ${zone.className || zone.tagName}`);
    }
  }
  return out;
}"""
CONTROLS = """() => [...document.querySelectorAll("button, select, input, summary, a[href], [tabindex='0']")]
  .filter((one) => one.id && !one.disabled && one.tabIndex >= 0 && one.checkVisibility() && one.getClientRects().length)
  .map((one) => one.id)"""


def complaints(page: Any, scheme: str = "light") -> list[str]:
    """What axe-core calls serious, each with the elements it is about; of a page, or of a frame in it.

    In the dark only the colours are others.
    """
    options = {"resultTypes": ["violations"], **({} if scheme == "light" else {"runOnly": ["color-contrast"]})}
    found = axe_playwright.Axe().run(page, context={"exclude": [["iframe"]]}, options=options)
    return [
        f"{one['id']}: {node['target']} {' '.join(node['failureSummary'].split())}"
        for one in found.response["violations"]
        if one["impact"] in SERIOUS
        for node in one["nodes"]
    ]


def calm(page: Any, scheme: str = "light") -> None:
    """Colours as they stay: without the transitions of buttons under the pointer."""
    page.emulate_media(reduced_motion="reduce", color_scheme=scheme)
    page.mouse.move(1, 1)


@pytest.fixture(scope="module")
def project(server: Any) -> str:
    """The path of a small project with accepted, rejected and open pairs, and a map."""
    lines = (SAMPLES / "hall.log").read_bytes().splitlines(keepends=True)
    log = b"".join([line for line in lines if line.startswith(b"FLASER")][:12])
    client = httpx.Client(base_url=server.url, timeout=60.0)
    path = str(client.post("/api/projects", files={"files": ("hall.log", log)}).raise_for_status().json()["url"])
    server.wait_until_matched(path)
    ids = [row["id"] for row in server.get(f"/api{path}/integrations")["integrations"] if row["above"]]
    for verdict, chosen in (("accepted", ids[:4]), ("rejected", ids[4:5])):
        body = {"integrations": chosen, "verdict": verdict, "who": "Ada"}
        client.post(f"/api{path}/decisions", json=body).raise_for_status()
    client.close()
    return path


def test_home_page(desk: Any, server: Any, project: str) -> None:
    """The list of projects, a menu, a question and a refusal have nothing serious against them, light and dark."""
    page = desk.page
    page.goto(server.url)
    page.locator("#projects .card:not(.placeholder)").first.wait_for()
    page.locator("#samples .card:not(.placeholder)").first.wait_for()
    page.locator("#files").set_input_files([{"name": "no.log", "mimeType": "text/plain", "buffer": b"\x00\x01"}])
    page.locator("#drop .message.error").wait_for()
    for scheme in ("light", "dark"):
        page.locator("#projects .menu > summary").first.click()
        calm(page, scheme)
        assert complaints(page, scheme) == []
        desk.picture(f"looks-home-{scheme}")
        page.keyboard.press("Escape")
        page.locator("#project-new").click()
        assert complaints(page, scheme) == []
        page.keyboard.press("Escape")
    assert all(re.search("40|42", error) for error in desk.errors)
    desk.errors.clear()


def test_what_is_decided_is_in_sight(new_desk: Callable[..., Any], server: Any, project: str) -> None:
    """In a low window details begin with the pair, not with its candidates; a candidate comes into sight."""
    desk = new_desk(1280, 720)
    top = "document.getElementById('panel-candidates').scrollTop"
    desk.open(server.url + project)
    assert desk.page.evaluate(top) == 0
    desk.page.keyboard.press("n")
    desk.page.wait_for_function(f"() => {top} > 0")
    desk.page.keyboard.press("j")
    desk.page.wait_for_function(f"() => {top} === 0")


GROUNDS = """() => {
  const scene = document.querySelector("#scene")?.contentDocument?.documentElement;
  const ground = getComputedStyle(document.documentElement).backgroundColor.match(/\\d+/g).map(Number);
  return [ground[0] < 100, ...(scene ? [scene.dataset.mantineColorScheme === "dark"] : [])];
}"""
"""whether the page is dark, and the scene in it"""


def test_light_dark_or_as_the_system(new_desk: Callable[..., Any], server: Any, project: str) -> None:
    """One button goes from the system's colours to light to dark; page, scene and player keep them, from the start."""
    desk = new_desk(1280, 720)
    page = desk.page
    ground = "getComputedStyle(document.documentElement).backgroundColor"
    calm(page, "light")
    desk.open(server.url + project)
    for says, dark in (("as the system", False), ("Colours: light", False), ("Colours: dark", True)):
        assert says in page.locator("#appearance").get_attribute("aria-label")
        page.wait_for_function(f"() => ({GROUNDS})().every((it) => it === {str(dark).lower()})")
        page.locator("#appearance").click() if not dark else None
    desk.picture("looks-chosen-dark")
    page.add_init_script(f"requestAnimationFrame(() => window.first = {ground})")
    for path in ("/", "/walk?sample=hall&pair=0.0-0.1&heuristic=random", project):
        page.goto(server.url + path)
        page.locator("#appearance svg").wait_for()
        assert page.evaluate(GROUNDS)[0], path
        assert page.evaluate("window.first") == page.evaluate(ground)
    page.locator("#appearance").click()
    page.wait_for_function(f"() => ({GROUNDS})().every((it) => !it)")
    calm(page, "dark")
    page.wait_for_function(f"() => ({GROUNDS})().every((it) => it)")


def test_project_page(new_desk: Callable[..., Any], server: Any, project: str) -> None:
    """Every tab, menu, drawer and sheet of a project's page, and its scene, has nothing serious against it."""
    desk = new_desk(1440, 900)
    page = desk.page
    found = {}
    for scheme in ("light", "dark"):
        calm(page, scheme)
        desk.open(server.url + project)
        for tab in page.locator("#tabs [role=tab]").all():
            tab.click()
            page.mouse.move(1, 1)
            found[f"{scheme} {tab.inner_text()}"] = complaints(page, scheme)
        page.locator("#tab-map").click()
        page.get_by_text("How firmly component 1 holds").wait_for()
        desk.scene.wait_for_function("() => !document.querySelector('button:not([aria-label]):empty')")
        found[f"{scheme} scene"] = complaints(desk.scene, scheme)
        desk.picture(f"looks-project-{scheme}")
        for opener, closer in SHEETS:
            page.locator(opener).click()
            page.mouse.move(1, 1)
            page.locator(closer).first.wait_for()
            found[f"{scheme} {opener}"] = complaints(page, scheme)
            page.locator(closer).first.click()
        page.locator("#export > summary").click()
        page.mouse.move(1, 1)
        found[f"{scheme} menu"] = complaints(page, scheme)
        page.keyboard.press("Escape")
    assert {where: told for where, told in found.items() if told} == {}


def test_sizes_and_keyboard(desk: Any, server: Any, project: str) -> None:
    """From a laptop's window to a tablet's no control is cut off, and Tab alone leads to every one of them."""
    page = desk.page
    page.goto(server.url)
    page.locator("#projects .card:not(.placeholder)").first.wait_for()
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        assert page.evaluate(CLIPPED) == []
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    desk.open(server.url + project)
    found = {}
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        for tab in page.locator("#tabs [role=tab]").all():
            tab.click()
            found[f"{width} {tab.inner_text()}"] = page.evaluate(CLIPPED)
        desk.picture(f"looks-{width}")
    assert {where: told for where, told in found.items() if told} == {}
    page.set_viewport_size({"width": 1280, "height": 720})
    page.locator("#tab-map").click()
    controls = set(page.evaluate(CONTROLS))
    page.locator(".brand").focus()
    reached = set()
    for _ in range(len(controls) + 60):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.id"))
        if controls <= reached:
            break
    assert controls - reached == set()
    assert {"rename", "map-colouring", "map-compare", "map-measure", "share", "threshold", "search", "queue"} <= reached


def test_states(desk: Any, server: Any, project: str) -> None:
    """Loading and failing say so in words, on both pages."""
    page = desk.page
    page.route("**/api/projects", lambda _: None)
    page.goto(server.url)
    assert page.locator("#projects").get_attribute("aria-busy") == "true"
    assert page.locator("#projects .placeholder").count() > 0
    desk.picture("looks-loading")
    page.unroute("**/api/projects")
    page.route(f"**/api{project}", lambda route: route.fulfill(status=500, body=FAILURE))
    page.goto(server.url + project)
    page.get_by_text("It broke.").wait_for()
    page.get_by_role("link", name="All projects").last.wait_for()
    calm(page)
    assert complaints(page) == []
    desk.picture("looks-failed")
    desk.errors.clear()


def test_walkthrough_page(new_desk: Callable[..., Any], server: Any) -> None:
    """The player, a stop of the lesson and the race have nothing serious against them, and are whole at every size."""
    desk = new_desk(1440, 900)
    page = desk.page
    page.goto(f"{server.url}/walk?sample=laboratory&heuristic=consecutive&stage=evaluation&step=3&lesson=4")
    page.locator(".say:not(:empty)").wait_for()
    page.locator("#lesson h2").wait_for()
    for scheme in ("light", "dark"):
        calm(page, scheme)
        assert complaints(page, scheme) == []
    page.locator("#races-open").click()
    page.locator(".races tbody tr").nth(15).wait_for()
    assert complaints(page, scheme) == []
    page.locator(".races").get_by_role("button", name="Close").click()
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        assert page.evaluate(CLIPPED) == [], (width, height)
        desk.picture(f"looks-walk-{width}")
