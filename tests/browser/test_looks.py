"""Looks: readable and labelled by axe-core's judgement, reachable by keyboard, whole at the sizes people have."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest

axe_playwright = pytest.importorskip(
    "axe_playwright_python.sync_playwright", reason="pip install axe-playwright-python"
)

pytestmark = pytest.mark.browser

SERIOUS = ("serious", "critical")
SCHEMES = ("light", "dark")
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


def complaints(page: Any) -> list[str]:
    """What axe-core calls serious, each with the elements it is about; of a page, or of a frame in it."""
    found = axe_playwright.Axe().run(page, context={"exclude": [["iframe"]]})
    return [
        f"{one['id']}: {node['target']} {' '.join(node['failureSummary'].split())}"
        for one in found.response["violations"]
        if one["impact"] in SERIOUS
        for node in one["nodes"]
    ]


def calm(page: Any) -> None:
    """Colours as they stay: without the transitions of buttons under the pointer."""
    page.mouse.move(1, 1)
    page.emulate_media(reduced_motion="reduce")


@pytest.fixture(scope="module")
def project(server: Any) -> str:
    """The path of a project with accepted, rejected and open pairs, and a map."""
    path = str(server.open_sample("office"))
    server.wait_until_matched(path)
    return path


@pytest.fixture
def worked_on(project: str, server: Any) -> str:
    """The same, with something decided."""
    import httpx

    rows = server.get(f"/api{project}/integrations")["integrations"]
    able = [row["id"] for row in rows if row["above"] and row["state"] == "pending"]
    for verdict, ids in (("accepted", able[:6]), ("rejected", able[6:7])):
        if ids:
            body = {"integrations": ids, "verdict": verdict, "who": "Ada"}
            httpx.post(f"{server.url}/api{project}/decisions", json=body, timeout=60.0).raise_for_status()
    return project


@pytest.mark.parametrize("scheme", SCHEMES)
def test_home_page(new_desk: Callable[..., Any], server: Any, worked_on: str, scheme: str) -> None:
    """The list of projects, a menu, a question and a refusal have nothing serious against them."""
    desk = new_desk(scheme=scheme)
    page = desk.page
    page.goto(server.url)
    page.locator("#projects .card:not(.placeholder)").first.wait_for()
    page.locator("#samples .card:not(.placeholder)").first.wait_for()
    calm(page)
    assert complaints(page) == []
    page.locator("#projects .menu > summary").first.click()
    page.mouse.move(1, 1)
    assert complaints(page) == []
    desk.picture(f"looks-home-{scheme}")
    page.keyboard.press("Escape")
    page.locator("#project-new").click()
    assert complaints(page) == []
    page.keyboard.press("Escape")
    page.locator("#files").set_input_files([{"name": "no.log", "mimeType": "text/plain", "buffer": b"\x00\x01"}])
    page.locator("#drop .message.error").wait_for()
    assert complaints(page) == []
    assert all(re.search("40|42", error) for error in desk.errors)
    desk.errors.clear()


@pytest.mark.parametrize("scheme", SCHEMES)
def test_project_page(new_desk: Callable[..., Any], server: Any, worked_on: str, scheme: str) -> None:
    """Every tab, menu, drawer and sheet of a project's page, and its scene, has nothing serious against it."""
    desk = new_desk(1440, 900, scheme=scheme)
    page = desk.page
    desk.open(server.url + worked_on)
    calm(page)
    found = {}
    for tab in page.locator("#tabs [role=tab]").all():
        tab.click()
        page.mouse.move(1, 1)
        found[tab.inner_text()] = complaints(page)
    page.locator("#tab-map").click()
    page.get_by_text("How firmly component 1 holds").wait_for()
    found["map"] = complaints(page)
    desk.picture(f"looks-project-{scheme}")
    desk.scene.wait_for_function("() => !document.querySelector('button:not([aria-label]):empty')")
    found["scene"] = complaints(desk.scene)
    for opener, closer in (
        ("#parameters-open", "#parameters-close"),
        ("#help-open", "#help button"),
        ("#share", ".share > button"),
    ):
        page.locator(opener).click()
        page.mouse.move(1, 1)
        page.locator(closer).first.wait_for()
        found[opener] = complaints(page)
        page.locator(closer).first.click()
    for menu in ("#loops", "#export"):
        page.locator(f"{menu} > summary").click()
        page.mouse.move(1, 1)
        found[menu] = complaints(page)
        page.keyboard.press("Escape")
    assert {where: told for where, told in found.items() if told} == {}


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_sizes(new_desk: Callable[..., Any], server: Any, worked_on: str, size: tuple[int, int]) -> None:
    """From a laptop's window to a tablet's, no control is cut off, in either page."""
    desk = new_desk(*size)
    page = desk.page
    page.goto(server.url)
    page.locator("#projects .card:not(.placeholder)").first.wait_for()
    assert page.evaluate(CLIPPED) == []
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    desk.open(server.url + worked_on)
    found = {}
    for tab in page.locator("#tabs [role=tab]").all():
        tab.click()
        found[tab.inner_text()] = page.evaluate(CLIPPED)
    desk.picture(f"looks-{size[0]}")
    assert {where: told for where, told in found.items() if told} == {}


def test_keyboard(desk: Any, server: Any, worked_on: str) -> None:
    """With Tab alone one comes to every control of a project's page that is shown and can be used."""
    page = desk.page
    desk.open(server.url + worked_on)
    page.locator("#tab-map").click()
    controls = page.evaluate(
        """() => [...document.querySelectorAll("button, select, input, summary, a[href], [tabindex='0']")]
          .filter((e) => e.id && !e.disabled && e.tabIndex >= 0 && e.checkVisibility() && e.getClientRects().length)
          .map((e) => e.id)"""
    )
    page.locator(".brand").focus()
    reached = set()
    for _ in range(len(controls) + 60):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.id"))
        if set(controls) <= reached:
            break
    assert set(controls) - reached == set()
    assert {"rename", "map-colouring", "map-compare", "map-measure", "share", "threshold", "search", "queue"} <= reached


def test_states(new_desk: Callable[..., Any], server: Any, worked_on: str) -> None:
    """Loading, empty and failed say so in words, on both pages."""
    desk = new_desk()
    page = desk.page
    page.route("**/api/projects", lambda route: None if route.request.method == "GET" else route.continue_())
    page.goto(server.url)
    assert page.locator("#projects").get_attribute("aria-busy") == "true"
    assert page.locator("#projects .placeholder").count() > 0
    desk.picture("looks-loading")
    page.unroute("**/api/projects")
    page.route(
        f"**/api{worked_on}",
        lambda route: route.fulfill(status=500, body='{"error": {"message": "It broke.", "kind": "X"}}'),
    )
    page.goto(server.url + worked_on)
    page.get_by_text("It broke.").wait_for()
    page.get_by_role("link", name="All projects").last.wait_for()
    calm(page)
    assert complaints(page) == []
    desk.picture("looks-failed")
    desk.errors.clear()
