"""Deciding in the page: queue, candidates, why, reason and name, two browsers, laying by hand, one set of keys."""

from __future__ import annotations

import gzip
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.resources import static_folder

ON_SCREEN = """([name, x, y]) => {
  const viewer = window.__viserMutable, camera = viewer.camera;
  const node = viewer.nodeRefFromName[name];
  const at = node.localToWorld(camera.position.clone().set(x, y, 0)).project(camera);
  const box = viewer.canvas.getBoundingClientRect();
  return [box.left + (at.x + 1) / 2 * box.width, box.top + (1 - at.y) / 2 * box.height];
}"""


@pytest.fixture(scope="module", params=["hall", "intel"])
def project(request: pytest.FixtureRequest, server: Any) -> str:
    """The path of a project whose pairs are all matched: a sample, and the first 100 scans of a real log."""
    if request.param == "hall":
        path = server.open_sample("hall")
    else:
        log = Path(request.getfixturevalue("datasets")) / "intel" / "intel-corrected.log.gz"
        scans = [line for line in gzip.decompress(log.read_bytes()).splitlines(True) if line.startswith(b"FLASER")]
        files = {"files": ("intel-100.log", b"".join(scans[:100]))}
        path = httpx.post(f"{server.url}/api/projects", files=files, timeout=60.0).raise_for_status().json()["url"]
    server.wait_until_matched(path)
    return str(path)


def decided(server: Any, project: str, integration: str) -> dict[str, Any]:
    """A row, as the API has it."""
    return dict(server.get(f"/api{project}/integrations/{integration}")["row"])


def snapshot(desk: Any, server: Any) -> dict[str, Any]:
    """What the view of a page shows."""
    view = re.search(r"/views/([^/]+)/", desk.scene.url)
    assert view is not None
    return dict(server.get(f"/api/views/{view[1]}"))


def on_screen(desk: Any, name: str, x: float, y: float) -> tuple[float, float]:
    """Where a point of a node's frame is in the window."""
    left, top = desk.scene.evaluate(ON_SCREEN, [name, x, y])
    frame = desk.page.locator("#scene").bounding_box()
    return frame["x"] + left, frame["y"] + top


def test_decide_with_name_and_reason(new_desk: Callable[..., Any], server: Any, project: str) -> None:
    """Both are kept with the decision; the effect is told before it; what is skipped waits at the end; one undo."""
    desk = new_desk(1440, 900)
    desk.open(server.url + project)
    page, pair = desk.page, desk.selected
    page.locator("#detail-graph").get_by_text("If you accept the candidate shown").wait_for()
    page.locator("#who").fill("Ada")
    page.keyboard.press("Enter")
    page.keyboard.press("c")
    page.keyboard.type("a glass door")
    page.keyboard.press("Enter")
    desk.until(lambda: snapshot(desk, server)["reason"] == "a glass door", "the reason")
    desk.scene.get_by_text("You decide as Ada.").wait_for()
    desk.picture("deciding-reason")
    page.keyboard.press("y")
    desk.until(lambda: desk.selected != pair, "the next pair")
    made = decided(server, project, pair)
    assert (made["state"], made["who"], made["reason"]) == ("accepted", "Ada", "a glass door")
    assert page.locator("#reason").input_value() == ""
    skipped = desk.selected
    page.keyboard.press("l")
    desk.until(lambda: desk.selected != skipped, "the pair after the one skipped")
    page.locator("[data-filter=later]").click()
    desk.until(lambda: desk.count("later") == 1 and desk.row(skipped).is_visible(), "the one for later")
    assert "later" in desk.row(skipped).inner_text()
    page.locator("[data-filter=all]").click()
    page.keyboard.press("u")
    desk.until(lambda: decided(server, project, pair)["state"] == "pending", "the undo")
    desk.until(lambda: desk.selected == pair, "the pair it was about")


def test_two_browsers(new_desk: Callable[..., Any], server: Any, project: str) -> None:
    """Each sees at once what the other decides, by whom; a click that crosses another is told and decides nothing."""
    first, second = new_desk(), new_desk()
    for desk, who in ((first, "Ada"), (second, "Bob")):
        desk.open(server.url + project)
        desk.page.locator("#who").fill(who)
        desk.page.keyboard.press("Enter")
        desk.until(lambda d=desk, w=who: snapshot(d, server)["who"] == w, "the name")
    pair = first.selected
    second.page.locator("#search").fill(pair)
    second.row(pair).click()
    second.until(lambda: snapshot(second, server)["integration"] == pair, "the same pair")
    shown = snapshot(second, server)["revision"]
    first.page.keyboard.press("x")
    second.until(lambda: second.row(pair).get_attribute("data-state") == "rejected", "the other one's decision")
    second.scene.get_by_text(f"Ada rejected {pair}").wait_for()
    second.picture("deciding-two")
    view = second.scene.url.split("/views/")[1].split("/")[0]
    late = {"action": "accept", "value": {"integration": pair, "revision": shown}}
    answer = httpx.post(f"{server.url}/api/views/{view}", json=late, timeout=60.0)
    assert answer.status_code == 409
    assert "Ada" in answer.json()["error"]["message"]
    assert decided(server, project, pair)["who"] == "Ada"
    first.page.keyboard.press("u")
    second.until(lambda: second.row(pair).get_attribute("data-state") == "pending", "the undo")


def test_the_keys_do_the_same_in_the_scene(desk: Any, server: Any, project: str) -> None:
    """After a click into it: the same order as the page lists, the same fields, and the way back; the sheet has all."""
    desk.open(server.url + project)
    page = desk.page
    page.locator("#order").select_option("scans")
    page.locator("#search").fill("0.1")
    rows = server.get(f"/api{project}/integrations")["integrations"]
    listed = sorted((row["id"] for row in rows if "0.1" in row["id"]), key=lambda id: int(id[2:].split("-")[0]))
    box = page.locator("#scene").bounding_box()
    desk.row(listed[0]).click()
    desk.until(lambda: snapshot(desk, server)["integration"] == listed[0], "the first pair listed")
    page.mouse.click(box["x"] + 30, box["y"] + box["height"] - 30)
    assert page.evaluate("document.activeElement.id") == "scene"
    page.keyboard.press("j")
    desk.until(lambda: desk.selected == listed[1], "the next pair of those listed")
    desk.until(lambda: snapshot(desk, server)["integration"] == listed[1], "the same in the scene")
    page.keyboard.press("3")
    desk.until(lambda: snapshot(desk, server)["stage"] == "candidate", "the stage")
    page.keyboard.press("/")
    assert page.evaluate("document.activeElement.id") == "search"
    page.mouse.click(box["x"] + 30, box["y"] + box["height"] - 30)
    page.keyboard.press("Escape")
    assert page.evaluate("document.activeElement.id") == "queue"
    page.mouse.click(box["x"] + 30, box["y"] + box["height"] - 30)
    page.keyboard.press("?")
    keys = page.locator("#help dt").all_inner_texts()
    source = (static_folder() / "js" / "keys.js").read_text()
    told = re.findall(r'^    \["([^"]+)", "[^"]+", "[a-z_]+"\]', source, re.MULTILINE)
    assert [key.replace("\n", "") for key in keys] == [key.replace("+", "") for key in told]
    desk.picture("deciding-help")


def test_the_value_is_explained_either_way(new_desk: Callable[..., Any], server: Any, project: str) -> None:
    """A chain in the list is marked in the scene; a segment clicked in the scene is marked in the list."""
    desk = new_desk(1440, 900)
    desk.open(server.url + project)
    page = desk.page
    assert "other candidate" in (words := page.locator("#candidates-ambiguity").inner_text()) or "candidate" in words
    page.locator("#tab-why").click()
    chain = page.locator("#why-chains button.chain").first
    chain.click()
    desk.until(lambda: (desk.nodes.get("/first/picked") or {}).get("shown"), "the chain in the scene")
    assert chain.get_attribute("aria-pressed") == "true"
    desk.picture("deciding-why")
    pair = page.locator("#why-chains button.pair").first
    segment = int(pair.get_attribute("data-first"))
    x, y = segment_of(server, desk, segment)
    page.keyboard.press("Escape")
    page.mouse.click(*on_screen(desk, "/first", x, y))
    desk.until(lambda: snapshot(desk, server)["picked"] is not None, "the click")
    desk.until(lambda: page.locator("#why-chains button.pair[aria-pressed=true]").count() > 0, "its mark in the list")


def segment_of(server: Any, desk: Any, segment: int) -> tuple[float, float]:
    """A point a quarter along a segment of the first scan, which the page marks by its number."""
    view = desk.scene.url.split("/views/")[1].split("/")[0]
    value = {"action": "set_picked", "value": {"source": "first", "segment": segment}}
    httpx.post(f"{server.url}/api/views/{view}", json=value, timeout=60.0).raise_for_status()
    points = """() => {
      const node = window.__viserMutable.nodeRefFromName["/first/picked"];
      let found = null;
      node?.traverse((part) => {
        const held = part.geometry?.attributes;
        if (held?.instanceStart?.count === 1) {
          const [a, b] = [held.instanceStart, held.instanceEnd];
          found = [0.75 * a.getX(0) + 0.25 * b.getX(0), 0.75 * a.getY(0) + 0.25 * b.getY(0)];
        }
      });
      return found;
    }"""
    desk.until(lambda: desk.scene.evaluate(points) is not None, "the segment marked")
    x, y = desk.scene.evaluate(points)
    return float(x), float(y)


def test_parameters_show_as_the_slider_moves(desk: Any, server: Any, project: str) -> None:
    """The selected pair is drawn anew, nothing else changes; put back, all is as it was."""
    desk.open(server.url + project)
    page, before = desk.page, snapshot(desk, server)
    revision = server.get(f"/api{project}")["revision"]
    page.locator("#parameters-open").click()
    slider = page.locator("[data-name=split_tolerance] input[type=range]")
    for value in ("150", "140", "130"):
        slider.fill(value)
    page.get_by_text("Tried on").wait_for()
    desk.until(lambda: (snapshot(desk, server)["trial"] or {}).get("number", 0) >= 1, "the trial")
    desk.scene.get_by_text("on trial").wait_for()
    desk.picture("deciding-trial")
    page.locator("#parameters-revert").click()
    desk.until(lambda: snapshot(desk, server)["trial"] is None, "what was before")
    assert snapshot(desk, server)["value"] == before["value"]
    assert server.get(f"/api{project}")["revision"] == revision


def test_the_second_scan_is_laid_by_hand(new_desk: Callable[..., Any], server: Any, project: str) -> None:
    """Dragged by its handle the value changes while it is held; let go it settles, is accepted, and taken back."""
    desk = new_desk(1440, 900)
    desk.open(server.url + project)
    page, pair = desk.page, desk.selected
    page.keyboard.press("g")
    desk.until(lambda: "/hand" in desk.nodes and snapshot(desk, server)["nudging"], "the handle")
    page.wait_for_timeout(400)
    x, y = on_screen(desk, "/second", 0.0, 0.0)
    handle = drag(desk, server, x, y)
    held = [snapshot(desk, server)]
    assert held[0]["held"]
    desk.picture("deciding-held")
    page.mouse.move(handle[0] + 45, handle[1] + 30, steps=4)
    desk.until(lambda: snapshot(desk, server)["pose"] != held[0]["pose"], "the next place")
    assert snapshot(desk, server)["score"] != held[0]["score"]
    page.mouse.up()
    desk.until(lambda: not snapshot(desk, server)["held"], "it to settle")
    assert snapshot(desk, server)["undo"] == f"laid {pair} by hand"
    desk.scene.get_by_text("it settled").wait_for()
    desk.picture("deciding-nudged")
    page.keyboard.press("y")
    desk.until(lambda: decided(server, project, pair)["state"] == "accepted", "the decision")
    for state in ("pending", "pending"):
        page.keyboard.press("u")
        desk.until(lambda s=state: decided(server, project, pair)["state"] == s, "the undo")
    desk.until(lambda: "nudge" not in str(snapshot(desk, server)["origin"]), "the pose that was found")


def drag(desk: Any, server: Any, x: float, y: float) -> tuple[float, float]:
    """Take the square handle of the gizmo, beside its origin, and pull it; where the mouse is then."""
    page = desk.page
    for dx, dy in ((22, -20), (26, -16), (18, -24), (30, -12), (24, -28)):
        page.mouse.move(x + dx, y + dy)
        page.wait_for_timeout(120)
        page.mouse.down()
        page.mouse.move(x + dx + 25, y + dy + 10, steps=4)
        for _ in range(20):
            page.wait_for_timeout(50)
            if snapshot(desk, server)["held"]:
                return x + dx + 25, y + dy + 10
        page.mouse.up()
    pytest.fail(f"the handle cannot be taken; {desk.picture('failed')} shows the page")


def test_the_queue_begins_at_its_top_and_foresees(desk: Any, server: Any) -> None:
    """Opened while it is matched the most doubtful pair is in sight and selected; a bulk decision says what it does."""
    path = server.open_sample("laboratory")
    desk.open(server.url + path)
    server.wait_until_matched(path)
    order = [row["id"] for row in server.get(f"/api{path}/integrations")["integrations"]]
    desk.until(lambda: desk.selected == order[0], "the most doubtful pair")
    assert desk.page.evaluate("document.getElementById('queue').scrollTop") == 0
    assert desk.row(order[0]).is_visible()
    button = desk.page.locator("#accept-above")
    place = button.bounding_box()
    button.hover()
    desk.page.locator("#bulk-preview").get_by_text("would be accepted").wait_for()
    assert button.bounding_box() == place
    assert "would pass" in desk.page.locator("#queue").inner_text()
    desk.picture("deciding-bulk")
    desk.page.locator("#order").select_option("contradicted")
    rows = server.get(f"/api{path}/integrations")["integrations"]
    worst = max(rows, key=lambda row: row["contradicted"] or -1.0)
    desk.until(lambda: desk.page.locator(".item:not([hidden])").first.is_visible(), "the rows")
    desk.until(lambda: desk.row(worst["id"]).is_visible(), "the most contradicted")


def test_a_server_killed_after_a_click_comes_back(desk: Any, server: Any) -> None:
    """The decision is there, the scene stands where it stood, undo goes on; a new decision ends what can be redone."""
    project = server.open_sample("hall")
    server.wait_until_matched(project)
    desk.open(server.url + project)
    pair = desk.selected
    desk.page.keyboard.press("y")
    desk.until(lambda: desk.selected != pair, "the decision")
    here, scene = desk.selected, desk.scene.url
    server.kill()
    desk.page.locator("#offline").wait_for()
    server.start()
    desk.page.locator("#offline").wait_for(state="hidden", timeout=60_000)
    desk.until(lambda: any("/scene" in f.url and f.url != scene for f in desk.page.frames), "another scene")
    desk.wait_for_scene()
    desk.until(lambda: desk.selected == here and snapshot(desk, server)["integration"] == here, "the same pair")
    pose = snapshot(desk, server)["pose"]
    desk.until(lambda: desk.nodes["/second"]["at"][:2] == pytest.approx([pose["x"], pose["y"]], abs=1e-4), "its place")
    assert decided(server, project, pair)["state"] == "accepted"
    desk.page.locator("#queue").focus()
    desk.page.keyboard.press("u")
    desk.until(lambda: decided(server, project, pair)["state"] == "pending", "the undo after the restart")
    desk.until(desk.page.locator("#redo").is_enabled, "something to redo")
    desk.until(lambda: desk.selected == pair, "the pair again")
    desk.page.keyboard.press("x")
    desk.until(lambda: decided(server, project, pair)["state"] == "rejected", "another decision")
    desk.until(lambda: desk.page.locator("#redo").is_disabled(), "nothing to be redone")
    desk.errors.clear()  # of the time without a server
