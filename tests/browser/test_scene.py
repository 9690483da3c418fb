"""The scene alone, as chromium shows it through our own address: nodes, colours, camera, panel."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx
import pytest
from pages import photograph

from app.palette import PALETTES, hexadecimal

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

PATIENCE = 30_000
"""milliseconds"""
NODE = """(name) => {
  const node = window.__viserMutable?.nodeRefFromName?.[name];
  if (!node) return null;
  let lines = null, visible = true;
  node.traverse((inner) => { if (inner.isLineSegments2 || inner.type === "LineSegments2") lines = inner; });
  for (let outer = node; outer; outer = outer.parent) visible = visible && outer.visible;
  return {
    visible,
    place: node.position.toArray(),
    turn: 2 * Math.atan2(node.quaternion.z, node.quaternion.w),
    colour: lines ? "#" + lines.material.color.getHexString() : null,
    count: lines ? lines.geometry.attributes.instanceStart.count : null,
    starts: lines ? Array.from(lines.geometry.attributes.instanceStart.array.slice(0, 3)) : null,
  };
}"""
CAMERA = """() => {
  const {camera, cameraControl} = window.__viserMutable;
  return {
    fov: camera.fov, aspect: camera.aspect, turn: camera.quaternion.toArray(), place: camera.position.toArray(),
    distance: cameraControl.distance, left: cameraControl.mouseButtons.left, to_cursor: cameraControl.dollyToCursor,
  };
}"""
ON_SCREEN = """([name, x, y]) => {
  const {camera, canvas, nodeRefFromName} = window.__viserMutable;
  const place = nodeRefFromName[name].localToWorld(nodeRefFromName[name].position.clone().set(x, y, 0)).project(camera);
  const frame = canvas.getBoundingClientRect();
  return [frame.left + (place.x + 1) / 2 * frame.width, frame.top + (1 - place.y) / 2 * frame.height];
}"""


class Window:
    """A browser's window on one view's scene."""

    def __init__(self, page: Page, url: str, view: str) -> None:
        self.page, self._url, self._view = page, url, view
        self.errors: list[str] = []
        page.set_default_timeout(PATIENCE)
        page.on("console", lambda message: message.type == "error" and self.errors.append(message.text))
        page.on("pageerror", lambda error: self.errors.append(str(error)))

    def open(self, query: str = "?fixedDpr=1") -> None:
        self.page.goto(f"{self._url}/views/{self._view}/scene/{query}")
        self.until(lambda: self.shows("/first/segments"), "the first map")
        self.until(lambda: self.camera["fov"] < 5.0, "the camera of 2D")

    @property
    def snapshot(self) -> Any:
        return httpx.get(f"{self._url}/api/views/{self._view}").raise_for_status().json()

    def act(self, action: str, value: Any = None) -> Any:
        body = {"action": action, "value": value}
        return httpx.post(f"{self._url}/api/views/{self._view}", json=body).raise_for_status().json()

    def node(self, name: str) -> Any:
        return self.page.evaluate(NODE, name)

    def shows(self, name: str) -> bool:
        node = self.node(name)
        return node is not None and node["visible"]

    @property
    def camera(self) -> Any:
        return self.page.evaluate(CAMERA)

    def place(self, name: str, x: float, y: float) -> tuple[float, float]:
        """Where a point of a node's frame is on the screen."""
        left, top = self.page.evaluate(ON_SCREEN, [name, x, y])
        return left, top

    def press(self, name: str) -> None:
        self.page.get_by_role("button", name=name, exact=True).first.click()

    def focus(self) -> None:
        """Give the scene the keyboard, by a click on nothing."""
        self.page.mouse.click(40, self.page.viewport_size["height"] - 40)  # type: ignore[index]

    def stands(self, pose: Any) -> bool:
        """Whether the second map's frame stands at a pose."""
        return self.node("/second")["place"][:2] == pytest.approx([pose["x"], pose["y"]], abs=1e-5)

    def says(self, text: str) -> None:
        self.page.get_by_text(text).first.wait_for()

    def until(self, true: Callable[[], Any], what: str) -> None:
        for _ in range(PATIENCE // 25):
            if true():
                return
            self.page.wait_for_timeout(25)
        pytest.fail(f"still waiting for: {what}")


@pytest.fixture
def open_window(chromium: Browser, server: Any) -> Iterator[Callable[..., Window]]:
    """Open the scene of a new view of a sample; at the end, nothing may have complained in it."""
    windows: list[Window] = []

    def open_new(
        sample: str = "laboratory", width: int = 1180, height: int = 800, query: str = "?fixedDpr=1"
    ) -> Window:
        project = server.open_sample(sample).rpartition("/")[2]
        view = httpx.post(f"{server.url}/api/projects/{project}/views", timeout=60.0).raise_for_status().json()["id"]
        page = chromium.new_context(viewport={"width": width, "height": height}).new_page()
        windows.append(Window(page, server.url, view))
        windows[-1].until(lambda: windows[-1].snapshot["candidate"] is not None, "a match")
        windows[-1].open(query)
        return windows[-1]

    yield open_new
    for window in windows:
        window.page.context.close()
    assert [error for window in windows for error in window.errors] == []


@pytest.fixture
def window(open_window: Callable[..., Window]) -> Window:
    """The scene of the first pair of a sample."""
    return open_window()


def test_both_maps_are_drawn_where_the_candidate_puts_them(window: Window) -> None:
    """The nodes of both maps, in their colours, the second under a frame at the candidate's pose."""
    window.act("set_stage", "candidate")
    palette = PALETTES["light"]
    for name, colour in (("/first/segments", palette.first), ("/second/segments", palette.second)):
        window.until(lambda n=name, c=colour: window.node(n)["colour"] == hexadecimal(c), f"the colour of {name}")
    pose = window.snapshot["pose"]
    window.until(lambda: window.stands(pose), "the second map in its place")
    assert window.node("/second")["turn"] == pytest.approx(pose["theta"], abs=1e-5)
    counts = [window.node(f"/{frame}/segments")["count"] for frame in ("first", "second")]
    captions = {layer["name"]: layer["caption"] for layer in window.snapshot["layers"]}
    assert all(f"{count} segment" in captions[name] for count, name in zip(counts, ("first", "second"), strict=True))


def test_next_candidate_moves_the_second_map_only(window: Window) -> None:
    """A click in the panel moves the frame; the map under it is not drawn again; the camera stays."""
    before, camera, held = window.node("/second"), window.camera, window.node("/second/segments")
    window.press("Next ›")
    window.until(lambda: window.node("/second")["place"] != before["place"], "the second map to move")
    assert window.snapshot["candidate"] == 1
    pose = window.snapshot["pose"]
    window.until(lambda: window.stands(pose), "the second map in its place")
    assert window.node("/second/segments")["starts"] == held["starts"]
    assert window.camera["place"] == pytest.approx(camera["place"])
    window.says("Candidate 2")


def test_each_chain_has_its_colour(window: Window) -> None:
    """The colours of the scene are those the page is told."""
    window.act("set_stage", "chains")
    told = window.snapshot["chains"]
    for chain in told[:8]:
        for frame in ("first", "second"):
            name = f"/{frame}/chains/{chain['number']}"
            window.until(lambda n=name, c=chain: (window.node(n) or {}).get("colour") == c["colour"], name)


def test_2d_looks_straight_down_and_never_turns(window: Window, pictures: Path) -> None:
    """Dragging pans, the wheel comes nearer, and neither drags nor keys turn the map."""
    start = window.camera
    assert start["fov"] == pytest.approx(1.0)
    window.until(lambda: window.camera["left"] == 2, "the drag that pans")
    assert window.camera["to_cursor"]
    mouse = window.page.mouse
    mouse.move(300, 400)
    mouse.down()
    mouse.move(420, 460, steps=4)
    mouse.up()
    window.until(lambda: window.camera["place"] != start["place"], "the map to pan")

    def nearer() -> bool:
        """The scene takes no turn of the wheel while it still drags: a person turns on."""
        mouse.wheel(0, -100)
        return bool(window.camera["distance"] < 0.95 * start["distance"])

    window.until(nearer, "the camera to come nearer")
    for key in ("ArrowLeft", "ArrowUp", "q", "w"):
        window.page.keyboard.press(key, delay=80)
    assert window.camera["turn"] == pytest.approx(start["turn"], abs=1e-6)
    window.page.keyboard.press("f")
    window.until(lambda: window.camera["distance"] == pytest.approx(start["distance"], rel=1e-3), "everything in sight")
    photograph(window.page, pictures / "scene-2d.png")


def test_everything_is_in_sight_whatever_the_window(open_window: Callable[..., Window]) -> None:
    """Both sensors are on the canvas, also after the window has changed its shape."""
    window = open_window(width=1000, height=700)
    for width, height in ((1000, 700), (1280, 500), (800, 900)):
        window.page.set_viewport_size({"width": width, "height": height})
        window.page.wait_for_timeout(300)
        for frame in ("/first", "/second"):
            window.until(
                lambda f=frame, w=width, h=height: _inside(window.place(f, 0.0, 0.0), w - 330, h), f"{frame} in sight"
            )


def _inside(place: tuple[float, float], width: float, height: float) -> bool:
    return 0.0 <= place[0] <= width and 0.0 <= place[1] <= height


def test_3d_shows_the_candidates_as_points(window: Window, pictures: Path) -> None:
    """One dot and one bar for each candidate; a drag turns the scene; back in 2D they are gone."""
    window.press("3D")
    window.until(lambda: window.camera["fov"] > 40.0, "the camera of 3D")
    window.until(lambda: window.shows("/first/candidates/points"), "the candidates")
    assert window.node("/first/candidates/points")["count"] == window.snapshot["candidates"]
    window.until(lambda: window.camera["left"] == 1, "the drag that turns")
    photograph(window.page, pictures / "scene-3d.png")
    window.press("2D")
    window.until(lambda: window.camera["fov"] < 5.0, "the camera of 2D")
    window.until(lambda: not window.shows("/first/candidates/points"), "the candidates to go")


def test_a_click_tells_what_a_segment_adds(window: Window, pictures: Path) -> None:
    """The segment is marked in the scene, and explained in the panel."""
    window.act("set_stage", "segments")
    window.act("toggle_layer", "returns")
    window.until(lambda: not window.shows("/first/returns"), "the returns to go")
    window.page.wait_for_timeout(500)
    x, y, _ = window.node("/first/segments")["starts"]
    window.page.mouse.click(*window.place("/first", x, y))
    window.until(lambda: window.snapshot["picked"] is not None, "the click")
    assert window.snapshot["picked"]["source"] == "first"
    window.until(lambda: window.shows("/first/picked"), "the mark")
    assert window.node("/first/picked")["colour"] == hexadecimal(PALETTES["light"].accent)
    window.says("m long, heading")
    photograph(window.page, pictures / "scene-picked.png")
    window.focus()
    window.until(lambda: window.snapshot["picked"] is None, "the mark to go")


def test_accept_in_the_panel_goes_on_and_undo_comes_back(window: Window) -> None:
    """Two clicks in quick succession decide once; the map stage then shows the accepted pair."""
    first = window.snapshot["integration"]
    accept = window.page.get_by_role("button", name="Accept", exact=True)
    accept.dblclick()
    window.until(lambda: window.snapshot["integration"] != first, "the next pair")
    assert window.snapshot["undo"] is not None
    assert first in window.snapshot["undo"]
    window.press("Undo")
    window.until(lambda: window.snapshot["integration"] == first, "the pair again")
    assert window.snapshot["row"]["state"] == "pending"
    window.focus()
    window.page.keyboard.press("r")
    window.until(lambda: window.snapshot["row"]["state"] == "accepted", "the decision again")
    window.act("set_stage", "map")
    window.until(lambda: window.shows("/map/pair/first") and window.shows("/map/pair/second"), "the pair in the map")
    assert not window.shows("/first/segments")


def test_heuristics_are_stepped_through_in_the_scene(window: Window) -> None:
    """The next heuristic is computed, told and drawn."""
    window.focus()
    window.page.keyboard.press("h")
    window.until(lambda: window.snapshot["heuristic"] == "all", "the next heuristic")
    window.until(lambda: window.snapshot["heuristics"][1]["tried"] is not None, "its result")
    window.page.keyboard.press("Shift+H")
    window.until(lambda: window.snapshot["heuristic"] == "automatic", "the heuristic before")


def test_a_layer_is_switched_by_its_checkbox(window: Window) -> None:
    """Off: its nodes are hidden and its line of the legend goes; on: they come back."""
    window.page.get_by_text("Layers", exact=True).click()
    box = window.page.get_by_role("checkbox").nth([layer["name"] for layer in window.snapshot["layers"]].index("grid"))
    for visible in (False, True):
        box.click()
        window.until(lambda v=visible: window.shows("/first/grid/fine") is v, f"the grid: {visible}")


def test_a_page_loaded_again_shows_the_same(window: Window) -> None:
    """The scene owns nothing: candidate, stage and layers are those of the view."""
    window.act("set_stage", "candidate")
    window.act("set_candidate", 3)
    pose = window.snapshot["pose"]
    window.open()
    window.until(lambda: window.shows("/first/angle/segments"), "the stage")
    window.until(lambda: window.stands(pose), "the candidate")


def test_dark_is_dark(open_window: Callable[..., Window], pictures: Path) -> None:
    """The scene has the colours of the dark palette on its background."""
    window = open_window()
    window.act("set_theme", "dark")
    window.act("set_stage", "candidate")
    window.until(lambda: window.node("/first/segments")["colour"] == hexadecimal(PALETTES["dark"].first), "the colours")
    photograph(window.page, pictures / "scene-dark.png")
