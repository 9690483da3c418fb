"""The project page: queue, threshold, bulk decisions, parameters, keyboard."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest


@pytest.fixture(scope="module")
def project(server: Any) -> str:
    """The path of a project whose pairs are all matched."""
    path = server.open_sample("hall")
    server.wait_until_matched(path)
    return str(path)


@pytest.fixture(scope="module")
def window(make_desk: Callable[..., Any], server: Any, project: str) -> Iterator[Any]:
    """A window on that project, for one test after the other."""
    desk = make_desk()
    desk.open(server.url + project)
    yield desk
    desk.page.context.close()


@pytest.fixture
def desk(window: Any) -> Iterator[Any]:
    """That window, with everything closed and the first pair selected; nothing may complain in it."""
    window.page.evaluate("for (const dialog of document.querySelectorAll('dialog[open]')) dialog.close()")
    window.page.locator("#search").fill("")
    window.page.locator("[data-filter=all]").click()
    window.page.locator("#queue").focus()
    window.page.keyboard.press("End")
    window.page.keyboard.press("Home")
    window.errors.clear()
    yield window
    assert window.errors == []


def test_queue(desk: Any, server: Any, project: str) -> None:
    """The queue has the server's order; keys, search and filters move in it, and typing is not a hotkey."""
    order = [row["id"] for row in server.get(f"/api{project}/integrations")["integrations"]]
    desk.until(lambda: desk.selected == order[0], "the first pair")
    for key, place in (("j", 1), ("j", 2), ("k", 1)):
        desk.page.keyboard.press(key)
        desk.until(lambda place=place: desk.selected == order[place], f"{key} to select {order[place]}")
    desk.page.locator("#queue").focus()
    desk.page.keyboard.press("ArrowDown")
    desk.until(lambda: desk.selected == order[2], "the arrow to move")
    desk.page.keyboard.press("End")
    desk.until(lambda: desk.selected == order[-1], "the end")
    assert desk.row(order[-1]).is_visible()
    desk.page.keyboard.press("/")
    desk.page.keyboard.type("jnyx")
    desk.page.get_by_text("No integration passes this filter.").wait_for()
    desk.page.locator("#search").fill(order[3])
    desk.until(lambda: desk.row(order[3]).is_visible() and not desk.row(order[-1]).is_visible(), "the search")
    desk.page.locator("#search").fill("")
    assert desk.count("pending") + desk.count("none") == len(order)
    desk.page.locator("[data-filter=accepted]").click()
    assert desk.page.locator(".item:not([hidden])").count() == 0


def test_threshold(desk: Any, server: Any, project: str) -> None:
    """The slider says what would flip before it is let go; bulk decisions say how many, and are one step back."""
    before = server.get(f"/api{project}")["threshold"]
    slide(desk, "1")
    desk.page.get_by_text("would no longer pass").wait_for()
    flips = server.get(f"/api{project}/threshold?value=1")["would_fail"]
    assert f"{len(flips)} would no longer pass" in desk.page.locator("#threshold-preview").inner_text()
    assert "would fail" in desk.page.locator("#queue").inner_text()
    assert server.get(f"/api{project}")["threshold"] == before
    desk.picture("threshold")
    slide(desk, "0.5")
    desk.page.locator("#threshold").dispatch_event("change")
    desk.until(lambda: server.get(f"/api{project}")["threshold"] == 0.5, "the threshold")
    above = sum(row["above"] for row in server.get(f"/api{project}/integrations")["integrations"])
    desk.page.get_by_role("button", name=f"Accept {above} above").click()
    desk.until(lambda: desk.count("accepted") == above, "the bulk decision")
    desk.page.locator(".notice").get_by_role("button", name="Undo").click()
    desk.until(lambda: desk.count("accepted") == 0, "the undo")
    desk.page.locator("#threshold-exact").fill(str(before))
    desk.page.keyboard.press("Enter")
    desk.until(lambda: server.get(f"/api{project}")["threshold"] == before, "the threshold typed in")


def slide(desk: Any, value: str) -> None:
    """Move the slider of the threshold, and hold it there."""
    move = "(slider, value) => { slider.value = value; slider.dispatchEvent(new Event('input', { bubbles: true })); }"
    desk.page.locator("#threshold").evaluate(move, value)


def test_parameters(desk: Any, server: Any, project: str) -> None:
    """The form has every parameter with unit and help; a wrong value is refused with the reason."""
    desk.page.get_by_role("button", name="Parameters", exact=True).click()
    described = server.get("/api/parameters")["parameters"]
    desk.until(lambda: desk.page.locator("#parameters-list li").count() == len(described), "the form")
    assert desk.page.get_by_label("Split tolerance").input_value() == "0.03"
    desk.picture("parameters")
    desk.page.get_by_label("Random rounds").fill("3")
    desk.page.get_by_label("Seed").fill("7")
    desk.page.get_by_role("button", name="Apply 2 changes").click()
    desk.until(lambda: server.get(f"/api{project}")["parameters"]["seed"] == 7, "the parameters")
    desk.until(lambda: desk.page.get_by_role("button", name="Apply", exact=True).is_disabled(), "nothing to apply")
    desk.page.locator("#parameters-form").evaluate("form => { form.noValidate = true; }")
    desk.page.get_by_label("Split tolerance").fill("-1")
    desk.page.get_by_role("button", name="Apply 1 change").click()
    desk.page.locator("#parameters-error").wait_for()
    assert "split_tolerance" in desk.page.locator("#parameters-error").inner_text()
    desk.errors.clear()
    desk.page.keyboard.press("Escape")
    desk.page.locator("#parameters").wait_for(state="hidden")


def test_mode(desk: Any, server: Any, project: str) -> None:
    """In the paper's mode everything is about the value in metres, with the paper's heuristics."""
    choose_mode(desk, "paper")
    desk.until(lambda: desk.page.locator("#threshold-title").inner_text() == "Threshold of value", "the value")
    server.wait_until_matched(project)
    desk.until(lambda: desk.page.locator("#queue .item .value").first.inner_text().endswith(" m"), "values in metres")
    desk.picture("paper-mode")
    choose_mode(desk, "verified")
    desk.until(lambda: "confidence" in desk.page.locator("#threshold-title").inner_text(), "the confidence")
    server.wait_until_matched(project)


def choose_mode(desk: Any, mode: str) -> None:
    """Choose a mode in the drawer of the parameters."""
    desk.page.get_by_role("button", name="Parameters", exact=True).click()
    desk.page.locator("#parameters-mode").select_option(mode)
    desk.page.get_by_role("button", name="Apply 1 change").click()
    desk.until(lambda: desk.page.get_by_role("button", name="Apply", exact=True).is_disabled(), "the mode")
    desk.page.keyboard.press("Escape")


def test_help(desk: Any) -> None:
    """The sheet of keys opens on ? from the page and from the scene; no key decides while it is open."""
    desk.page.keyboard.press("?")
    desk.page.locator("#help").wait_for()
    desk.picture("help")
    desk.page.keyboard.press("y")
    desk.page.keyboard.press("Escape")
    desk.page.locator("#help").wait_for(state="hidden")
    assert desk.count("accepted") == 0
    desk.page.mouse.click(600, 700)
    desk.page.keyboard.press("?")
    desk.page.locator("#help").wait_for()


def test_two_people(desk: Any, new_desk: Callable[..., Any], server: Any, project: str) -> None:
    """A second browser sees a decision at once, and keeps its own selection."""
    other = new_desk()
    other.open(server.url + project, scene=False)
    other.page.keyboard.press("j")
    chosen = desk.selected
    desk.until(lambda: other.selected != chosen, "the other selection")
    kept = other.selected
    desk.page.keyboard.press("x")
    other.until(lambda: other.count("rejected") == 1, "the decision")
    assert chosen in (other.page.locator("#undo").get_attribute("title") or "")
    assert other.selected == kept
    other.page.locator("#undo").click()
    desk.until(lambda: desk.count("rejected") == 0, "the undo of the other")


def test_tablet(new_desk: Callable[..., Any], server: Any, project: str) -> None:
    """At the width of a tablet nothing is cut off."""
    desk = new_desk(width=820, height=1100, scheme="dark")
    desk.open(server.url + project)
    assert desk.page.evaluate("document.documentElement.scrollWidth") <= 820
    assert desk.nodes["/first/sensor"]["colours"] != []
    desk.picture("tablet")


def test_second_thoughts(desk: Any) -> None:
    """A decision can be taken back where it stands; a map of nothing is not exported, and the page says why."""
    desk.page.locator("#export summary").click()
    desk.page.get_by_text("Merged map, SVG").click()
    desk.page.locator(".notice.error").wait_for()
    assert "accept" in desk.page.locator(".notice.error p").inner_text().lower()
    desk.errors.clear()
    chosen = desk.selected
    desk.page.keyboard.press("y")
    desk.until(lambda: desk.count("accepted") == 1 and desk.selected != chosen, "the decision")
    desk.page.locator("[data-filter=accepted]").click()
    desk.row(chosen).click()
    desk.page.get_by_role("button", name="Decide again").click()
    desk.until(lambda: desk.count("accepted") == 0, "the undecided pair")
    desk.page.get_by_text("No integration passes this filter.").wait_for()
