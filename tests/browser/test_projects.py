"""Projects on the home page and on their own: named, copied, deleted and had back, given more logs, saved, opened."""

from __future__ import annotations

import io
import sqlite3
from pathlib import Path
from typing import Any

import httpx

SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"


def first_scans(sample: str, number: int) -> bytes:
    lines = (SAMPLES / f"{sample}.log").read_bytes().splitlines(keepends=True)
    return b"".join([line for line in lines if line.startswith((b"FLASER", b"ROBOTLASER1"))][:number])


def file(name: str, sample: str, number: int) -> dict[str, Any]:
    return {"name": name, "mimeType": "text/plain", "buffer": first_scans(sample, number)}


def card(desk: Any, name: str) -> Any:
    return desk.page.locator("#projects .card", has=desk.page.get_by_role("heading", name=name, exact=True))


def choose(desk: Any, name: str, item: str) -> None:
    card(desk, name).locator(".menu > summary").click()
    card(desk, name).get_by_text(item).click()


def test_keeping_projects(desk: Any, server: Any, tmp_path: Path) -> None:
    """From an empty project through more logs, another name and a copy, to deletion, undo and a file of its own."""
    page = desk.page
    page.goto(server.url)
    page.locator("#project-new").click()
    page.get_by_role("textbox", name="Name", exact=True).fill("East <b>wing</b>")
    page.get_by_role("button", name="Create").click()
    page.wait_for_url("**/projects/**")
    page.get_by_text("There is nothing to show").wait_for()
    desk.picture("project-empty")
    page.locator("#tab-logs").click()
    page.locator("#logs-files").set_input_files([file("monday.log", "hall", 5), file("tuesday.log", "hall", 3)])
    page.locator(".item").first.wait_for()
    desk.wait_for_scene()
    page.locator("#logs h3", has_text="1: tuesday").wait_for()
    page.locator("#logs-files").set_input_files([file("wednesday.log", "laboratory", 3)])
    page.locator("#logs h3", has_text="2: wednesday").wait_for()
    desk.picture("project-logs")
    page.locator("#rename").click()
    page.get_by_role("textbox", name="Name", exact=True).fill("East wing")
    page.keyboard.press("Enter")
    desk.until(lambda: page.locator("#name").inner_text() == "East wing", "the new name")
    path = page.evaluate("location.pathname")
    server.wait_until_matched(path)
    page.locator(".item").first.click()
    page.keyboard.press("y")
    desk.until(lambda: desk.count("accepted") == 1, "the decision")

    page.goto(server.url)
    choose(desk, "East wing", "Duplicate")
    card(desk, "East wing (copy)").wait_for()
    desk.until(lambda: card(desk, "East wing").locator("img").count() == 1, "the picture of the map")
    choose(desk, "East wing (copy)", "Rename")
    page.get_by_role("textbox", name="Name", exact=True).fill("Second try")
    page.get_by_role("button", name="Rename", exact=True).click()
    card(desk, "Second try").wait_for()
    card(desk, "Second try").locator(".menu > summary").click()
    desk.picture("home-menu")
    with page.expect_download() as saved:
        card(desk, "Second try").get_by_text("Download").click()
    content = saved.value.path().read_bytes()
    assert saved.value.suggested_filename == "Second try.segmap"
    held = sqlite3.connect(":memory:")
    held.deserialize(content)
    assert held.execute("SELECT count(*) FROM events").fetchone()[0] > 5

    choose(desk, "Second try", "Delete")
    card(desk, "Second try").wait_for(state="detached")
    assert page.evaluate("document.activeElement.id") == "projects-title"
    desk.picture("home-deleted")
    page.get_by_role("button", name="Undo").click()
    card(desk, "Second try").wait_for()
    choose(desk, "Second try", "Delete")
    page.locator("#deleted > summary").click()
    page.get_by_role("button", name="Delete Second try for good").click()
    desk.picture("home-for-good")
    page.get_by_role("button", name="Delete for good", exact=True).click()
    desk.until(lambda: "Second try" not in page.locator("main").inner_text(), "nothing left of it")

    saved_file = {"name": "back.segmap", "mimeType": "application/octet-stream", "buffer": io.BytesIO(content).read()}
    page.locator("#files").set_input_files([saved_file])
    page.locator(".item").first.wait_for()
    assert page.locator("#name").inner_text() == "Second try"
    assert desk.count("accepted") == 1


def test_deleted_under_ones_eyes(new_desk: Any, server: Any) -> None:
    """Whoever looks at a project that another person deletes is told, and can have it back."""
    desk, other = new_desk(), new_desk()
    url = server.open_sample("hall")
    httpx.patch(f"{server.url}/api{url}", json={"name": "For a moment"}).raise_for_status()
    server.wait_until_matched(url)
    desk.open(server.url + url)
    other.page.goto(server.url)
    choose(other, "For a moment", "Delete")
    desk.page.get_by_text("This project was deleted").wait_for()
    desk.picture("project-deleted")
    desk.page.get_by_role("button", name="Restore it").click()
    desk.page.locator(".item").first.wait_for()
    assert server.get(f"/api{url}")["name"] == "For a moment"
