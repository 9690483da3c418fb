"""Views of two people: each their own, one they share, and one that a class follows without being able to touch it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest


@pytest.fixture(scope="module")
def project(server: Any) -> str:
    """The path of a project whose pairs are all matched."""
    path = server.open_sample("laboratory")
    server.wait_until_matched(path)
    return str(path)


def test_own_views_shared_views_and_followed_views(new_desk: Callable[..., Any], server: Any, project: str) -> None:
    """Own views differ; a shared one is the same for both, also after a reload; who follows sees it and cannot act."""
    teacher, other = new_desk(), new_desk()
    teacher.open(server.url + project)
    other.open(server.url + project)
    first = teacher.selected
    other.page.keyboard.press("j")
    other.until(lambda: other.selected != first, "another pair in one's own view")
    assert teacher.selected == first

    teacher.page.locator("#share").click()
    teacher.page.get_by_text("Whoever opens it sees what you see").wait_for()
    teacher.picture("share")
    follow, steer = (teacher.page.locator(f"#share-{way}").input_value() for way in ("follow", "steer"))
    teacher.page.get_by_role("button", name="Close", exact=True).click()
    other.open(steer)
    other.until(lambda: other.selected == first, "the shared pair")
    other.page.locator("#queue").focus()
    other.page.keyboard.press("j")
    other.until(lambda: other.selected != first, "the next pair")
    teacher.until(lambda: teacher.selected == other.selected, "the same pair on the other page")
    teacher.page.reload()
    teacher.wait_for_scene()
    teacher.until(lambda: teacher.selected == other.selected, "the shared view after a reload")

    student = new_desk(1000, 700)
    student.follow(follow)
    teacher.page.locator("#queue").focus()
    teacher.page.keyboard.press("1")
    student.until(lambda: student.page.locator("#what").inner_text().endswith("scans"), "the stage in words")
    student.until(lambda: student.nodes["/first/returns"]["shown"], "the stage in the scene")
    assert student.scene.get_by_role("button", name="Accept").count() == 0
    before = server.get(f"/api{project}")["revision"]
    box = student.page.locator("#scene").bounding_box()
    student.page.mouse.click(box["x"] + 250, box["y"] + 300)
    student.page.keyboard.press("y")
    student.page.keyboard.press("3")
    teacher.page.keyboard.press("v")
    student.until(lambda: student.camera["fov"] > 5.0, "the camera of 3D")
    ours, theirs = teacher.camera["ahead"], student.camera["ahead"]
    student.until(
        lambda: student.camera["ahead"] == pytest.approx(teacher.camera["ahead"], abs=0.02), f"{ours}, {theirs}"
    )
    box = teacher.page.locator("#scene").bounding_box()
    teacher.page.mouse.move(box["x"] + 250, box["y"] + 300)
    teacher.page.mouse.wheel(0, -600)
    student.until(
        lambda: student.camera["distance"] == pytest.approx(teacher.camera["distance"], rel=0.02), "the distance"
    )
    student.picture("following")
    assert student.page.locator("#what").inner_text().endswith("scans")
    assert server.get(f"/api{project}")["revision"] == before
    assert server.get(f"/api{project}")["counts"]["accepted"] == 0


def test_the_end_of_a_view_is_told(new_desk: Callable[..., Any], server: Any) -> None:
    """When the view is closed, whoever follows is told so in words."""
    desk = new_desk()
    desk.page.goto(f"{server.url}/follow/nobody")
    desk.page.get_by_text("The view you follow has ended").wait_for()
    assert all("404" in error for error in desk.errors)
    desk.errors.clear()
