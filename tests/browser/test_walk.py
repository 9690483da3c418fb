"""The player: on a sample, on a real pair, and as a file with the network off."""

from __future__ import annotations

import gzip
import re
from pathlib import Path
from typing import Any

import httpx

DRAWN = """() => ({
  shapes: [...document.querySelectorAll('.figure .shape')].map((one) => one.outerHTML),
  said: document.querySelector('.say').textContent,
  line: document.querySelector('.lines [data-current]')?.dataset.number ?? '',
  quantities: document.querySelector('.quantities').textContent,
})"""
"""what the page has drawn, element by element"""


class Walk:
    """The player as a person uses it."""

    def __init__(self, desk: Any) -> None:
        self.desk, self.page = desk, desk.page

    def open(self, url: str) -> None:
        self.page.goto(url)
        self.page.locator(".say:not(:empty)").wait_for()

    @property
    def drawn(self) -> dict[str, Any]:
        return dict(self.page.evaluate(DRAWN))

    @property
    def told(self) -> tuple[str, ...]:
        """The words of the step: pictures are as large as there is room."""
        drawn = self.drawn
        return drawn["said"], drawn["line"], drawn["quantities"]

    @property
    def place(self) -> str:
        return str(self.page.locator(".count").inner_text())

    def press(self, name: str) -> None:
        """Press a control; back when the step has changed."""
        before = self.place
        self.page.get_by_role("button", name=name).click()
        self.desk.until(lambda: self.place != before, f"a step after {name}")

    def stage(self, id: str) -> None:
        self.page.locator(f"[data-stage='{id}']").click()
        self.page.locator(f"[data-stage='{id}'][aria-current]").wait_for()
        self.page.locator(".lines [data-current]").wait_for()


def test_a_sample(desk: Any, server: Any) -> None:
    """From a stop of the lesson: steps forward and back draw the same; each stage, moments, playing."""
    desk.page.goto(server.url)
    desk.page.get_by_role("link", name="What a candidate is worth").click()
    walk = Walk(desk)
    desk.page.locator(".say:not(:empty)").wait_for()
    assert "stop 4 of" in desk.page.locator("#lesson").inner_text()
    assert "best so far" in walk.drawn["said"]
    first = walk.drawn
    for _ in range(3):
        walk.press("One step on (right arrow)")
    assert walk.drawn != first
    for _ in range(3):
        walk.press("One step back (left arrow)")
    assert walk.drawn == first
    desk.picture("walk-value")
    desk.page.get_by_role("button", name="pair by pair").last.click()
    desk.page.locator("[data-stage^='pairs:'][aria-current]").wait_for()
    desk.page.get_by_label("Jump to a moment").select_option(label="the pair that adds most")
    desk.until(lambda: walk.drawn["line"] in ("16", "18"), "the pair that adds most")
    desk.picture("walk-pair")
    ids = [stage.get_attribute("data-stage") for stage in desk.page.locator("[data-stage]").all()]
    for id in ids:
        walk.stage(id)
        desk.until(lambda: bool(walk.drawn["shapes"]), f"a picture in {id}")
        desk.picture(f"walk-{id.replace(':', '-')}")
    walk.stage("chains")
    desk.page.get_by_role("button", name="Play or pause (space)").click()
    begun = walk.place
    desk.until(lambda: walk.place != begun, "playing to go on")
    desk.page.get_by_role("button", name="Play or pause (space)").click()
    address = desk.page.url
    shown = walk.drawn
    walk.open(address)
    assert walk.drawn == shown, "an address restores its view"
    desk.page.get_by_role("link", name="Next stop").click()
    desk.page.get_by_text("stop 5 of").wait_for()


def test_merging_is_a_tree_one_can_enter(desk: Any, server: Any) -> None:
    """A dot of the tree leads to its step, and the step into the integration itself, and back."""
    walk = Walk(desk)
    walk.open(f"{server.url}/walk?sample=laboratory&merge=0.0-0.3&mode=verified&stage=tree")
    desk.page.locator(".knot").last.click()
    desk.page.get_by_role("button", name="Go into this integration").click()
    desk.page.wait_for_url("**node=tree**")
    desk.page.locator("[data-stage=evaluation]").wait_for()
    desk.page.get_by_role("link", name="Back to the merge").click()
    desk.page.locator("[data-stage=tree]").wait_for()
    walk.stage("graph")
    desk.picture("walk-graph")


def test_race_and_sweep(desk: Any, server: Any) -> None:
    """The race lists each heuristic with what it found; another parameter is swept when chosen."""
    Walk(desk).open(f"{server.url}/walk?sample=laboratory&heuristic=consecutive")
    desk.page.get_by_role("button", name="Race and sweep").click()
    race = desk.page.get_by_role("region", name="Race of the heuristics")
    race.locator("tbody tr").nth(9).wait_for()
    assert race.locator(".dot").count() == 10
    desk.page.get_by_label("Parameter to sweep").select_option("angle_difference_tolerance")
    sweep = desk.page.get_by_role("region", name="Sweep of a parameter")
    sweep.get_by_role("columnheader", name="angle_difference_tolerance").wait_for()
    desk.picture("walk-race")


def test_a_real_pair(desk: Any, server: Any, datasets: Path) -> None:
    """Two scans of the Intel log, in a project of one's own: from the selected pair to its walkthrough."""
    with gzip.open(datasets / "intel" / "intel-corrected.log.gz", "rt") as log:
        lines = [line for line in log if line.startswith("FLASER")][:5]
    made = httpx.post(f"{server.url}/api/projects", files={"files": ("intel.log", "".join(lines).encode())}).json()
    server.wait_until_matched(made["url"])
    desk.open(server.url + made["url"], scene=False)
    desk.row("0.2-0.3").click()
    desk.until(lambda: "0.2-0.3" in (desk.page.locator("#walk-open").get_attribute("href") or ""), "the link")
    walk = Walk(desk)
    walk.open(server.url + str(desk.page.locator("#walk-open").get_attribute("href")))
    assert "intel" in desk.page.locator("#name").inner_text()
    for id in [stage.get_attribute("data-stage") for stage in desk.page.locator("[data-stage]").all()]:
        walk.stage(id)
        desk.until(lambda: bool(walk.drawn["shapes"]), f"a picture in {id}")
        desk.picture(f"walk-intel-{id.replace(':', '-')}")
    first = walk.drawn
    walk.press("One step on (right arrow)")
    walk.press("One step back (left arrow)")
    assert walk.drawn == first


def test_a_low_window_shows_what_a_step_changes(new_desk: Any, server: Any) -> None:
    """Words and the tree of integrations are in sight without scrolling; what the method is stands below them."""
    walk = Walk(new_desk(1280, 720))
    walk.open(f"{server.url}/walk?sample=laboratory&merge=0.0-0.3&mode=verified&stage=pivot&step=2")
    told, tree = walk.page.locator(".walk-told"), walk.page.locator(".walk-told svg.chart")
    tree.wait_for()
    shown, drawn = told.bounding_box(), tree.bounding_box()
    assert drawn["y"] + drawn["height"] <= shown["y"] + shown["height"] + 1.0


def test_a_class_follows_its_teacher(new_desk: Any, server: Any) -> None:
    """Who opens the link sees each step of the teacher's, and has nothing to press."""
    teacher, pupil = Walk(new_desk()), Walk(new_desk())
    teacher.open(f"{server.url}/walk?sample=laboratory&heuristic=consecutive&stage=chains")
    teacher.page.get_by_role("button", name="Share with a class").click()
    link = re.search(r"http\S+/follow/walk/\S+", teacher.page.locator(".notice.link").inner_text())
    assert link
    pupil.open(link[0])
    pupil.desk.until(lambda: pupil.told == teacher.told, "the teacher's view")
    teacher.press("One step on (right arrow)")
    pupil.desk.until(lambda: pupil.told == teacher.told, "the teacher's step")
    teacher.stage("result")
    pupil.desk.until(lambda: pupil.told == teacher.told, "the teacher's stage")
    assert not pupil.page.locator(".controls").is_visible()
    pupil.desk.picture("walk-followed")


def test_a_file_plays_without_a_network(desk: Any, server: Any, tmp_path: Path) -> None:
    """The saved page opens from disk with the network off, and plays."""
    asked = {"sample": "laboratory", "heuristic": "consecutive"}
    page = httpx.get(f"{server.url}/api/walk/file/html", params=asked).raise_for_status()
    (tmp_path / "walk.html").write_bytes(page.content)
    desk.page.context.set_offline(True)
    fetched: list[str] = []
    desk.page.on("request", lambda request: fetched.append(request.url))
    walk = Walk(desk)
    walk.open((tmp_path / "walk.html").as_uri())
    begun = walk.drawn
    desk.page.get_by_role("button", name="Play or pause (space)").click()
    desk.until(lambda: walk.drawn != begun, "the file to play")
    for id in [stage.get_attribute("data-stage") for stage in desk.page.locator("[data-stage]").all()]:
        walk.stage(id)
        desk.until(lambda: bool(walk.drawn["shapes"]), f"a picture in {id}")
    assert [url for url in fetched if not url.startswith("file:")] == []
    desk.picture("walk-offline")
