"""One person's way with a real log: dropped, matched, decided, kept, reported, shared; all of it in one browser."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pages import photograph


def laser_lines(datasets: Path, first: int, last: int) -> bytes:
    """Some scans of the corrected Intel log."""
    lines = gzip.decompress((datasets / "intel" / "intel-corrected.log.gz").read_bytes()).splitlines(keepends=True)
    return b"".join([line for line in lines if line.startswith(b"FLASER")][first:last])


def file(name: str, content: bytes) -> dict[str, Any]:
    return {"name": name, "mimeType": "text/plain", "buffer": content}


def test_a_real_log_from_drop_to_report(
    new_desk: Callable[..., Any], server: Any, datasets: Path, chromium: Any, pictures: Path, tmp_path: Path
) -> None:
    """100 scans, and 20 more later: projects, map, report, views and looks on what a robot saw."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is missing").Axe()
    desk = new_desk(1440, 900)
    page = desk.page
    page.goto(server.url)
    page.locator("#files").set_input_files([file("intel-100.log", laser_lines(datasets, 0, 100))])
    page.locator(".item").first.wait_for()
    path = page.evaluate("location.pathname")
    page.locator("#rename").click()
    page.get_by_role("textbox", name="Name", exact=True).fill("Intel, first floor")
    page.keyboard.press("Enter")
    desk.until(lambda: page.locator("#name").inner_text() == "Intel, first floor", "the new name")
    server.wait_until_matched(path)
    page.locator("#accept-above").click()
    desk.until(lambda: desk.count("accepted") > 70, "the decisions")
    accepted = desk.count("accepted")
    page.locator("#tab-logs").click()
    page.locator("#logs-files").set_input_files([file("intel-more.log", laser_lines(datasets, 100, 120))])
    page.locator("#logs h3", has_text="1: intel-more").wait_for()
    server.wait_until_matched(path)
    desk.until(lambda: page.locator("#holds").inner_text() == "120 scans, 118 integrations", "the new pairs")
    assert desk.count("accepted") == accepted
    desk.until(lambda: not server.get(f"/api{path}")["merging"], "the map")
    desk.picture("real-logs")

    page.locator("#export > summary").click()
    with page.expect_download() as saved:
        page.get_by_role("link", name="Report, HTML").click()
    saved.value.save_as(tmp_path / "report.html")
    context = chromium.new_context(viewport={"width": 1100, "height": 900}, offline=True)
    report, said = context.new_page(), list[str]()
    report.on("console", lambda message: said.append(message.text))
    report.goto((tmp_path / "report.html").as_uri())
    text = report.locator("main").inner_text()
    assert f"{accepted} integrations accepted" in text
    assert "of 120 scans" in text
    assert [
        node
        for one in axe.run(report).response["violations"]
        if one["impact"] in ("serious", "critical")
        for node in one["nodes"]
    ] == []
    photograph(report, pictures / "real-report.png")
    assert said == []
    context.close()

    page.locator("#share").click()
    follow = page.locator("#share-follow").input_value()
    page.get_by_role("button", name="Close", exact=True).click()
    student = new_desk(900, 700)
    student.follow(follow)
    page.locator("#queue").focus()
    page.keyboard.press("6")
    student.until(lambda: student.page.locator("#what").inner_text() == "the merged map", "the stage of the other")
    student.until(lambda: any(name.startswith("/map/component") for name in student.nodes), "the map of the other")
    student.picture("real-following")

    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
        page.mouse.move(1, 1)
        found = axe.run(page, context={"exclude": [["iframe"]]}).response["violations"]
        assert [one["id"] for one in found if one["impact"] in ("serious", "critical")] == []

    page.goto(server.url)
    card = page.locator("#projects .card", has=page.get_by_role("heading", name="Intel, first floor", exact=True))
    card.locator(".menu > summary").click()
    card.get_by_text("Duplicate").click()
    page.get_by_role("heading", name="Intel, first floor (copy)").wait_for()
    card.locator(".menu > summary").click()
    card.get_by_text("Delete").click()
    page.get_by_role("button", name="Undo").click()
    card.wait_for()
    desk.until(lambda: card.locator("img").evaluate("i => i.complete && i.naturalWidth > 0"), "the picture of the map")
    desk.picture("real-home")
