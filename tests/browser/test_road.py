"""The whole road in a browser: from a log to an exported map, with the server stopped in between."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

FIRST, SECOND = "0067be", "e06000"
"""colours of the two maps on a light background"""
PAIR = "0.84-0.85"
"""two scans of intel-corrected that fit well"""


def candidates(server: Any, project: str, integration: str) -> list[Any]:
    """The ranked candidates as the API has them."""
    return list(server.get(f"/api{project}/integrations/{integration}")["match"]["ranked"])


def test_a_sample_becomes_a_map(new_desk: Callable[..., Any], server: Any) -> None:
    """Step candidates and heuristics, accept, reject, undo, export; stop, start again: every decision is there."""
    desk = new_desk(1440, 900)
    project = server.open_sample("office")
    desk.open(server.url + project)
    see_both_maps(desk)
    step_candidates(desk, server, project)
    step_heuristics(desk, server.get(f"/api{project}")["heuristics"])
    decide(desk)
    export(desk)
    decided = states(server, project)
    server.stop()
    desk.page.locator("#offline").wait_for()
    server.start()
    assert states(server, project) == decided
    desk.page.locator("#offline").wait_for(state="hidden")
    desk.wait_for_scene()
    desk.errors.clear()
    assert desk.count("accepted") == list(decided.values()).count("accepted")
    desk.page.locator("#undo").click()
    desk.until(lambda: desk.count("accepted") == 1, "the undo of a decision made before")


def see_both_maps(desk: Any) -> None:
    """Both maps are drawn in their colours, seen straight from above through a field of view of one degree."""
    nodes = desk.nodes
    assert FIRST in nodes["/first/sensor"]["colours"]
    assert SECOND in nodes["/second/sensor"]["colours"]
    desk.until(lambda: any(name.startswith("/first/chains/") for name in desk.nodes), "the matching chains")
    assert desk.camera["fov"] == pytest.approx(1.0)
    assert desk.camera["ahead"] == pytest.approx([0.0, -1.0, 0.0], abs=1e-2)


def step_candidates(desk: Any, server: Any, project: str) -> None:
    """Keys in the page, a click in the table and keys in the scene move the second map to the candidate."""
    ranked = candidates(server, project, desk.selected)
    for act, rank in (
        (lambda: desk.page.keyboard.press("n"), 1),
        (lambda: desk.page.locator("#candidates-body tr").nth(4).click(), 4),
        (lambda: desk.page.keyboard.press("p"), 3),
        (lambda: (desk.page.mouse.click(620, 700), desk.page.keyboard.press("n")), 4),
    ):
        act()
        desk.until(lambda rank=rank: desk.candidate == rank, f"candidate {rank} in the table")
        pose = ranked[rank]["T_1_2"]
        desk.until(
            lambda pose=pose: desk.nodes["/second"]["at"][:2] == pytest.approx([pose["x"], pose["y"]], abs=1e-3),
            "the pose",
        )


def step_heuristics(desk: Any, names: list[str]) -> None:
    """Next and previous heuristic: each is tried on the pair, and told with what it tried and found."""
    desk.page.locator("#tab-heuristics").click()
    for heuristic in names[1:]:
        desk.page.locator("#heuristic-next").click()
        line = desk.page.locator(f"#panel-heuristics tr[data-heuristic={heuristic}][aria-selected=true]")
        desk.until(lambda line=line: line.locator("td").count() == 3, f"the result of {heuristic}")
    desk.picture("heuristics")
    for _ in names[1:]:
        desk.page.keyboard.press("Shift+H")
    desk.page.locator(f"tr[data-heuristic={names[0]}][aria-selected=true]").wait_for()
    desk.page.locator("#tab-candidates").click()


def decide(desk: Any) -> None:
    """Accept and reject go on to the next pair; undo and redo say what they do, and come back to the pair."""
    accepted = desk.selected
    desk.page.keyboard.press("y")
    desk.until(lambda: desk.count("accepted") == 1 and desk.selected != accepted, "the accepted pair")
    rejected = desk.selected
    desk.page.wait_for_timeout(400)
    desk.page.keyboard.press("x")
    desk.until(lambda: desk.count("rejected") == 1 and desk.selected != rejected, "the rejected pair")
    assert rejected in (desk.page.locator("#undo").get_attribute("title") or "")
    desk.page.keyboard.press("u")
    desk.until(lambda: desk.count("rejected") == 0 and desk.selected == rejected, "the undo")
    desk.page.keyboard.press("r")
    desk.until(lambda: desk.count("rejected") == 1, "the redo")
    desk.page.locator("#accept-above").click()
    desk.until(lambda: desk.count("accepted") > 20, "the bulk decision")


def export(desk: Any) -> None:
    """The merged map is drawn, counted, and saved as a file that holds it."""
    desk.page.locator("#tab-map").click()
    desk.page.locator("#components h3").first.wait_for()
    desk.page.keyboard.press("6")
    desk.until(lambda: "being computed" not in desk.page.locator("#components").inner_text(), "the merged map")
    desk.until(lambda: any(name.startswith("/map/") for name in desk.nodes), "the merged map in the scene")
    desk.page.wait_for_timeout(500)
    desk.picture("map")
    desk.page.locator("#export summary").click()
    with desk.page.expect_download() as saving:
        desk.page.get_by_text("Merged map, GeoJSON").click()
    assert saving.value.suggested_filename.endswith(".geojson")
    saved = json.loads(Path(saving.value.path()).read_text(encoding="utf-8"))
    assert saved["type"] == "FeatureCollection"
    assert len(saved["features"]) > 20


OUT_OF_ORDER = """async () => {
  const { View } = await import("/static/js/view.js");
  const view = new View({});
  view.apply({ serial: 8, integration: "new" });
  view.hear({ serial: 7, integration: "old" });
  await new Promise((done) => setTimeout(done, 100));
  const late = view.integration;
  view.hear({ serial: 10, integration: "newest" });
  view.hear({ serial: 9, integration: "newer" });
  await new Promise((done) => setTimeout(done, 100));
  return [late, view.integration];
}"""


def test_what_arrives_late_does_not_turn_the_page_back(new_desk: Callable[..., Any], server: Any) -> None:
    """Of several snapshots of a view the newest is shown, in whichever order they come."""
    desk = new_desk(800, 600)
    desk.page.goto(server.url)
    assert desk.page.evaluate(OUT_OF_ORDER) == ["new", "newest"]


def states(server: Any, project: str) -> dict[str, str]:
    """The decisions by integration."""
    rows = server.get(f"/api{project}/integrations")["integrations"]
    return {row["id"]: row["state"] for row in rows if row["state"] in ("accepted", "rejected")}


def test_a_real_log_while_it_is_matched(new_desk: Callable[..., Any], server: Any, datasets: Path) -> None:
    """The first pair is on the screen while the rest is matched; matching can be stopped and goes on."""
    log = datasets / "intel" / "intel-corrected.log.gz"
    with log.open("rb") as file:
        answer = httpx.post(f"{server.url}/api/projects", files={"files": (log.name, file)}, timeout=60.0)
    project = answer.raise_for_status().json()["url"]
    desk = new_desk(1440, 900)
    desk.open(server.url + project)
    assert desk.page.locator("#matching").is_visible()
    desk.until(lambda: any(name.startswith("/first/chains/") for name in desk.nodes), "the first pair")
    desk.page.get_by_role("button", name="Cancel").click()
    desk.page.get_by_role("button", name="Resume").wait_for()
    progress = server.get(f"/api{project}")["progress"]
    assert 0 < progress["done"] < progress["total"]
    for key, state, number in (("y", "accepted", 1), ("y", "accepted", 2), ("x", "rejected", 1)):
        desk.page.wait_for_timeout(400)
        desk.page.keyboard.press(key)
        desk.until(lambda state=state, number=number: desk.count(state) == number, f"{number} {state}")
    desk.page.get_by_role("button", name="Resume").click()
    desk.until(lambda: server.get(f"/api{project}/integrations/{PAIR}")["match"] is not None, "a good pair")
    look_at(desk, PAIR)
    for width in (1440, 1280, 1100, 950):
        desk.page.set_viewport_size({"width": width, "height": 900})
        assert desk.page.locator("#matching").is_visible()
        assert right_edge(desk, "#help-open") <= width, f"the bar is wider than {width} pixels"
    desk.page.set_viewport_size({"width": 1440, "height": 900})
    look_at(desk, PAIR)
    desk.picture("workbench")


def right_edge(desk: Any, selector: str) -> float:
    """Where an element ends, pixels from the left."""
    return float(desk.page.locator(selector).evaluate("element => element.getBoundingClientRect().right"))


def look_at(desk: Any, integration: str) -> None:
    """Select a pair as a person who knows its name, and wait until it is drawn."""
    desk.page.locator("#search").fill(integration)
    desk.row(integration).click()
    desk.page.locator("#search").fill("")
    desk.page.locator("#search").blur()
    desk.until(lambda: desk.selected == integration, "the pair")
    desk.until(lambda: "/first/chains/3" in desk.nodes, "its chains")
    desk.page.wait_for_timeout(500)
