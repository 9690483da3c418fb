"""The report, saved from the page and opened from disk without a network."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pages import photograph


def test_report_from_the_menu(desk: Any, server: Any, chromium: Any, pictures: Path, tmp_path: Path) -> None:
    """It is saved from the export menu, opens offline without a word in the console, and nothing runs off the page."""
    project = server.open_sample("office")
    server.wait_until_matched(project)
    desk.open(server.url + project, scene=False)
    desk.page.locator("#accept-above").click()
    desk.until(lambda: desk.count("accepted") > 3, "the decisions")
    desk.page.locator("#export > summary").click()
    with desk.page.expect_download() as saved:
        desk.page.get_by_role("link", name="Report, HTML").click()
    path = tmp_path / saved.value.suggested_filename
    saved.value.save_as(path)
    assert path.suffix == ".html"
    for scheme, width in (("light", 1280), ("dark", 768)):
        context = chromium.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme, offline=True)
        page, errors = context.new_page(), list[str]()
        page.on("console", lambda message, errors=errors: errors.append(message.text))
        page.goto(path.as_uri())
        assert page.locator("h2").first.inner_text() == "How far can I trust this map?"
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        drawn = page.locator("figure svg").first.bounding_box()
        assert drawn["height"] > 100
        photograph(page, pictures / f"report-{scheme}.png")
        assert errors == []
        context.close()
