"""The merged map in the page: its colours, its components, where a wall comes from, measuring, comparison, movement."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

ON_SCREEN = """([x, y]) => {
  const viewer = window.__viserMutable, camera = viewer.camera;
  const node = viewer.nodeRefFromName["/map"];
  const at = node.localToWorld(camera.position.clone().set(x, y, 0)).project(camera);
  const box = viewer.canvas.getBoundingClientRect();
  return [box.left + (at.x + 1) / 2 * box.width, box.top + (1 - at.y) / 2 * box.height];
}"""


def make_project(server: Any, name: str, request: pytest.FixtureRequest) -> str:
    """A sample, or the first 100 scans of a real log: matched, and all that the program would accept accepted."""
    if name == "intel":
        path = Path(request.getfixturevalue("datasets")) / "intel" / "intel-corrected.log.gz"
        lines = gzip.decompress(path.read_bytes()).splitlines(keepends=True)
        scans = [line for line in lines if line.startswith(b"FLASER")][:100]
        files = {"files": ("intel-100.log", b"".join(scans))}
        made = httpx.post(f"{server.url}/api/projects", files=files, timeout=60.0).raise_for_status().json()["url"]
    else:
        made = server.open_sample(name)
    server.wait_until_matched(made)
    rows = server.get(f"/api{made}/integrations")["integrations"]
    body = {"integrations": [row["id"] for row in rows if row["above"]], "verdict": "accepted", "who": "Ada"}
    httpx.post(f"{server.url}/api{made}/decisions", json=body, timeout=60.0).raise_for_status()
    return str(made)


def map_settled(server: Any, project: str) -> bool:
    return not server.get(f"/api{project}")["merging"]


def snapshot(desk: Any, server: Any) -> Any:
    view = next(frame.url for frame in desk.page.frames if "/scene" in frame.url).split("/")[4]
    return server.get(f"/api/views/{view}")


def wall(desk: Any, server: Any, project: str) -> list[float]:
    """The longest wall of the component that is drawn first: that of the selected pair."""
    first = snapshot(desk, server)["row"]["first"]
    parts = server.get(f"/api{project}")["components"]
    home = next((part["name"] for part in parts if first in part["scans"] and len(part["scans"]) > 1), parts[0]["name"])
    found = server.get(f"/api{project}/export/geojson")["features"]
    ends = [one["geometry"]["coordinates"] for one in found if one["properties"]["component"] == home]
    walls = [[*start, *end] for start, end in ends]
    return max(walls, key=lambda w: (w[2] - w[0]) ** 2 + (w[3] - w[1]) ** 2)


def edge(desk: Any, server: Any, project: str) -> tuple[str, tuple[float, float]]:
    """A long line between two scans of the largest component, and its middle; a pair of it is selected meanwhile."""
    told = httpx.get(f"{server.url}/api{project}/export/tum").raise_for_status().text.splitlines()
    poses = [[float(number) for number in line.split()[:3]] for line in told if not line.startswith("#")]
    part = max(server.get(f"/api{project}")["components"], key=lambda one: len(one["scans"]))
    rows = server.get(f"/api{project}/integrations")["integrations"]
    accepted = {row["id"] for row in rows if row["state"] == "accepted"}
    places = dict(zip(sorted(part["scans"], key=lambda name: int(name[2:])), poses, strict=True))
    lines = []
    for pair in accepted:
        a, b = pair.split("-")
        if a in places and b in places:
            (_, x1, y1), (_, x2, y2) = places[a], places[b]
            lines.append(((x2 - x1) ** 2 + (y2 - y1) ** 2, pair, ((x1 + x2) / 2.0, (y1 + y2) / 2.0)))
    (_, other, _), *_, (_, pair, middle) = sorted(lines)
    desk.page.locator("#search").fill(other)
    desk.row(other).click()
    desk.until(lambda: snapshot(desk, server)["integration"] == other, "a pair of that component")
    desk.page.locator("#search").fill("")
    return pair, middle


def click(desk: Any, x: float, y: float) -> None:
    """A click at a place of the map."""
    box = desk.page.locator("#scene").bounding_box()
    left, top = desk.scene.evaluate(ON_SCREEN, [x, y])
    desk.page.mouse.click(box["x"] + left, box["y"] + top)


@pytest.mark.parametrize("name", ["hall", "intel"])
def test_the_map(new_desk: Callable[..., Any], server: Any, request: pytest.FixtureRequest, name: str) -> None:
    """Colour by misfit, click a wall and see its scans and decisions, measure it, isolate, compare with before."""
    project = make_project(server, name, request)
    desk = new_desk(1440, 900)
    desk.open(server.url + project)
    page = desk.page
    page.locator("#tab-map").click()
    desk.until(lambda: map_settled(server, project), "the map")
    page.locator("#map-show").click()
    desk.until(lambda: snapshot(desk, server)["stage"] == "map", "the stage")
    page.locator("#map-show").wait_for(state="hidden")
    page.locator("#map-colouring").select_option("misfit")
    desk.until(lambda: any(node.startswith("/map/component") for node in desk.nodes), "the map in the scene")
    desk.scene.get_by_text("95 % within").wait_for()
    desk.scene.locator("#scale-bar").wait_for()
    assert desk.scene.locator("#scale-bar").inner_text().endswith("m")
    desk.picture(f"map-misfit-{name}")

    x1, y1, x2, y2 = wall(desk, server, project)
    click(desk, (x1 + x2) / 2.0, (y1 + y2) / 2.0)
    page.locator("#map-clicked").get_by_text("accepted by Ada").first.wait_for()
    scans = snapshot(desk, server)["picked"]["scans"]
    assert all(scan in page.locator("#map-clicked").inner_text() for scan in scans)
    desk.until(lambda: "/map/picked/sights" in desk.nodes, "the lines to the sensors")
    desk.picture(f"map-clicked-{name}")

    page.locator("#map-measure").click()
    page.get_by_text("Click two places in the scene").wait_for()
    click(desk, x1, y1)
    click(desk, x2, y2)
    length = ((x2 - x1) ** 2 + (y2 - y1) ** 2) ** 0.5
    desk.until(lambda: f"{length:.2f} m" in page.locator("#map-told").inner_text(), "the length of the wall")
    desk.until(lambda: desk.nodes.get("/map/measure/line", {}).get("shown"), "the line in the scene")
    desk.picture(f"map-measured-{name}")
    page.locator("#map-measure").click()

    pair, (x, y) = edge(desk, server, project)

    def chosen() -> bool:
        """Click until the camera has come to where that component is drawn."""
        click(desk, x, y)
        return desk.selected == pair

    desk.until(chosen, "the integration whose line was clicked")
    page.locator("#tab-map").click()

    page.locator("#map-compare").focus()
    desk.until(lambda: page.locator("#map-compare option").count() > 2, "the maps to compare with")
    page.locator("#map-compare").select_option("given")
    desk.until(lambda: "/map/other/0" in desk.nodes, "the other map beside it")
    desk.picture(f"map-compared-{name}")
    page.locator("#map-side").select_option("over")
    page.locator("#map-compare").select_option("")
    desk.until(lambda: not desk.nodes["/map/other/0"]["shown"], "the other map gone")
    parts = page.locator("#components [data-action=isolate]")
    if parts.count():
        parts.last.click()
        desk.until(lambda: page.locator("#components li.off").count() == parts.count() - 1, "one component alone")
        desk.picture(f"map-alone-{name}")


def test_the_map_moves_after_a_decision(desk: Any, server: Any) -> None:
    """Where a decision moves scans, they are seen on their way."""
    project = server.open_sample("hall")
    server.wait_until_matched(project)
    rows = server.get(f"/api{project}/integrations")["integrations"]
    ids = [row["id"] for row in rows if row["state"] == "pending"]
    url = f"{server.url}/api{project}/decisions"
    httpx.post(url, json={"integrations": ids, "verdict": "accepted"}, timeout=60.0).raise_for_status()
    desk.open(server.url + project)
    desk.page.keyboard.press("6")
    desk.until(lambda: map_settled(server, project), "the map")
    desk.until(lambda: any(name.startswith("/map/component") for name in desk.nodes), "the map in the scene")
    assert not any(name.endswith("/moving") for name in desk.nodes)
    desk.page.locator("#queue").focus()
    first = ids[0]
    httpx.post(url, json={"integrations": [first], "verdict": "undecided"}, timeout=60.0).raise_for_status()
    body = {"integrations": [first], "verdict": "accepted", "candidate": 1}
    httpx.post(url, json=body, timeout=60.0).raise_for_status()
    desk.until(lambda: any(name.endswith("/moving") for name in desk.nodes), "the map on its way")
    desk.until(lambda: not any(n["shown"] for m, n in desk.nodes.items() if m.endswith("/moving")), "the map arrived")
