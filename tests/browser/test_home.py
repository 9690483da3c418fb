"""The home page: what is there, what can be opened, and what is said about files that cannot."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"


def scans_of(sample: str, number: int) -> str:
    """The first scans of a sample log, as text."""
    lines = (SAMPLES / f"{sample}.log").read_text(encoding="utf-8").splitlines(keepends=True)
    first = [place for place, line in enumerate(lines) if line.startswith(("FLASER", "ROBOTLASER1"))][:number]
    return "".join(lines[: first[-1] + 1])


def named(name: str, text: str) -> dict[str, Any]:
    return {"name": name, "mimeType": "text/plain", "buffer": text.encode()}


@pytest.mark.quick
def test_first_visit(desk: Any, server: Any) -> None:
    """An empty workbench says how to start, and shows the samples with their pictures; one click opens one."""
    empty = '{"projects": []}'
    desk.page.route(
        re.compile("/api/projects$"), lambda r: r.fulfill(body=empty) if r.request.method == "GET" else r.continue_()
    )
    desk.page.goto(server.url)
    desk.page.get_by_text("None yet. Drop a log above, or open a sample.").wait_for()
    cards = desk.page.locator("#samples .card:not(.placeholder)")
    desk.until(lambda: cards.count() == 4, "the samples")
    drawn = "image => image.complete && image.naturalWidth > 0"
    desk.until(lambda: all(image.evaluate(drawn) for image in cards.locator("img").all()), "the pictures")
    desk.picture("home-empty")
    desk.page.get_by_role("button", name="Open A hall with long walls").click()
    desk.page.wait_for_url("**/projects/**")
    desk.page.locator(".item").first.wait_for()
    name = desk.page.locator("#name")  # it comes by a request of its own, perhaps after the queue
    desk.until(lambda: name.inner_text() == "A hall with long walls", "the project's name")


def test_files(desk: Any, server: Any) -> None:
    """A file that is no log is refused with its name and a remedy; a log with wrong lines is read, and says so."""
    desk.page.goto(server.url)
    drop, files = desk.page.locator("#drop"), desk.page.locator("#files")
    files.set_input_files([named("holiday.jpg", "\xff\xd8 not a log")])
    drop.locator(".message.error").wait_for()
    assert "holiday.jpg" in drop.locator(".message.error").inner_text()
    assert all("400" in error or "422" in error for error in desk.errors)
    desk.errors.clear()
    desk.picture("home-refused")
    name = "<b onclick=alert(1)>bold.log"
    wrong = "FLASER 180 1.0 2.0 nonsense\n"
    files.set_input_files([named(name, wrong + scans_of("hall", 3)), named("second.log", scans_of("laboratory", 2))])
    drop.get_by_text("had to be left out").wait_for()
    assert re.search(r"line 1\b", drop.inner_text())
    desk.picture("home-left-out")
    desk.page.get_by_role("button", name="Open the project").click()
    desk.page.wait_for_url("**/projects/**")
    desk.page.locator(".item").first.wait_for()
    desk.page.locator("#tab-logs").click()
    logs = desk.page.locator("#logs")
    assert name in logs.inner_text()
    assert "second.log" in logs.inner_text()
    assert logs.locator("b").count() == 0
    assert desk.page.locator(".item:not([hidden])").count() == 3


def test_nothing_to_integrate(desk: Any, server: Any) -> None:
    """A log of one scan opens, and the page says why there is nothing to decide."""
    desk.page.goto(server.url)
    desk.page.locator("#files").set_input_files([named("single.log", scans_of("hall", 1))])
    desk.page.get_by_text("1 scan cannot make a pair").wait_for()
    desk.page.get_by_text("There is nothing to show").wait_for()
    desk.picture("nothing")


def test_dropping(desk: Any, server: Any) -> None:
    """Files dropped anywhere on the page are read."""
    desk.page.goto(server.url)
    desk.page.locator("#drop button").wait_for()
    transfer = desk.page.evaluate_handle(
        "text => { const data = new DataTransfer(); data.items.add(new File([text], 'dropped.log')); return data; }",
        scans_of("hall", 2),
    )
    desk.page.dispatch_event("main", "dragenter", {"dataTransfer": transfer})
    assert desk.page.locator("#drop.over").count() == 1
    desk.page.dispatch_event("main", "drop", {"dataTransfer": transfer})
    desk.page.wait_for_url("**/projects/**")
    desk.until(lambda: "dropped" in desk.page.locator("#name").inner_text(), "the name of the log")


def test_unreachable(desk: Any, server: Any) -> None:
    """Lists that cannot be loaded say why, and load when the server is back."""
    desk.page.route("**/api/projects", lambda route: route.abort())
    desk.page.goto(server.url)
    desk.page.locator("#projects .message.error").wait_for()
    desk.errors.clear()
    desk.page.unroute("**/api/projects")
    desk.page.locator("#projects").get_by_role("button", name="Try again").click()
    desk.page.locator("#projects .message.error").wait_for(state="detached")
