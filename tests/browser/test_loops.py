"""Loop closures on the page: search, look, accept, see the graph, undo; import, and pairs by hand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture(scope="module")
def project(server: Any) -> str:
    """The path of a project whose pairs are all matched."""
    path = server.open_sample("office")
    server.wait_until_matched(path)
    return str(path)


def menu(desk: Any, choice: str) -> None:
    """Choose from the menu of loops."""
    desk.page.locator("#loops > summary").click()
    desk.page.locator(f"#loops-{choice}").click()


def test_closures_are_found_accepted_and_seen_in_the_graph(
    new_desk: Callable[..., Any], server: Any, project: str
) -> None:
    """From the menu to the map: found, previewed, accepted, drawn by residual, clicked, undone."""
    desk = new_desk(1440, 900)
    desk.open(server.url + project)
    desk.page.locator("#accept-above").click()
    desk.until(lambda: desk.count("accepted") > 40, "the neighbours")
    menu(desk, "search")
    desk.page.locator("#searching").wait_for()
    desk.page.get_by_text("Searching for loops, ").first.wait_for()
    desk.picture("loops-searching")
    desk.page.locator("#searching-cancel").click()
    desk.page.get_by_text("What it matched is kept").first.wait_for(timeout=120_000)
    assert desk.count("loops") == 0
    menu(desk, "search")
    desk.page.get_by_text("loop closures are proposed").first.wait_for(timeout=120_000)
    desk.until(lambda: desk.count("loops") > 3, "the closures")
    server.wait_until_matched(project)
    desk.page.locator("[data-filter=loops]").click()
    accepted = desk.count("accepted")
    closure = far_apart(server, project)
    desk.page.locator("#search").fill(closure)
    desk.row(closure).click()
    desk.page.locator("#detail-graph").get_by_text("It closes a loop of").wait_for()
    assert "If you accept the candidate shown" in desk.page.locator("#detail-graph").inner_text()
    desk.picture("loops-preview")
    desk.page.keyboard.press("y")
    desk.until(lambda: desk.count("accepted") == accepted + 1, "the closure accepted")
    desk.until(lambda: row(server, project, closure)["chi"] is not None, "its residual")
    desk.row(closure).click()
    desk.page.get_by_text("and the graph agrees").wait_for()
    desk.page.locator("#search").fill("")
    desk.page.locator("#queue").focus()
    desk.page.keyboard.press("6")
    desk.until(lambda: any(name.startswith("/map/edges/") for name in desk.nodes), "the edges in the scene")
    desk.until(lambda: "/map/closures" in desk.nodes, "the closures that wait")
    desk.page.locator("#tab-map").click()
    desk.page.get_by_text("How firmly component 1 holds").wait_for()
    assert "The largest loop closure error is" in desk.page.locator("#graph-strength").inner_text()
    desk.until(lambda: not server.get(f"/api{project}")["merging"], "the map")
    desk.picture("loops-map")
    desk.page.locator("#undo").click()
    desk.until(lambda: row(server, project, closure)["state"] == "pending", "the undo")
    desk.page.locator("#tab-candidates").click()
    desk.page.locator("#order").select_option("residual")
    rows = server.get(f"/api{project}/integrations")["integrations"]
    worst = max((one for one in rows if one["kind"] != "neighbour"), key=lambda one: one["residual"] or -1.0)
    desk.until(lambda: desk.row(worst["id"]).is_visible(), "the farthest off at the top")


def row(server: Any, project: str, integration: str) -> dict[str, Any]:
    """A row, as the API has it."""
    return dict(server.get(f"/api{project}/integrations/{integration}")["row"])


def far_apart(server: Any, project: str) -> str:
    """A closure between scans far from each other in the log, which the program would accept."""
    rows = server.get(f"/api{project}/integrations")["integrations"]
    closures = [one for one in rows if one["kind"] == "closure" and one["above"] and one["residual"] is not None]
    return str(max(closures, key=lambda one: scan(one["second"]) - scan(one["first"]))["id"])


def scan(name: str) -> int:
    """The number of a scan in its log."""
    return int(name.partition(".")[2])


def show_the_claim(desk: Any) -> None:
    """Choose the pose that the pose graph claims, the last in the table, and wait until it is drawn."""
    last = desk.page.locator("#candidates-body tr").last
    desk.until(lambda: desk.selected == "0.2-0.8" and "claimed" in last.inner_text(), "the pose claimed in the table")
    last.click()
    desk.until(lambda: desk.nodes["/second"]["at"][:2] == pytest.approx([1.5, 0.25], abs=1e-3), "the pose claimed")


def test_pairs_by_hand_and_from_a_file(desk: Any, server: Any, tmp_path: Path) -> None:
    """Two scans typed in are a row; a pose graph chosen or dropped brings rows with the pose it claims."""
    project = server.open_sample("laboratory")
    desk.open(server.url + project)
    server.wait_until_matched(project)
    menu(desk, "pair")
    desk.page.locator("#pair-first").fill("0.9")
    desk.page.locator("#pair-second").fill("nine")
    desk.page.get_by_role("button", name="Add", exact=True).click()
    assert "12, or 0.12" in desk.page.locator("#pair-error").inner_text()
    desk.page.locator("#pair-second").fill("4")
    desk.page.get_by_role("button", name="Add", exact=True).click()
    desk.until(lambda: desk.selected == "0.4-0.9", "the pair asked for")
    assert row(server, project, "0.4-0.9")["kind"] == "manual"
    graph = tmp_path / "other.graph"
    scans = server.get(f"/api{project}")["logs"][0]["scans"]
    vertices = [f"VERTEX2 {i} {i} 0 0\n" for i in range(scans)]
    edges = ["#SEQUENTIAL EDGES", "EDGE2 2 3 1 0 0 400 0 400 1000 0 0", "#LOOP EDGES"]
    edges.append("EDGE2 2 8 1.5 0.25 0.1 400 0 400 1000 0 0")
    graph.write_text("".join(vertices) + "\n".join(edges) + "\n")
    desk.page.locator("#graph-file").set_input_files(graph)
    desk.page.get_by_text("Of 2 edges in other.graph, 1 close loops").wait_for()
    desk.page.locator("#search").fill("imported")
    desk.row("0.2-0.8").click()
    desk.page.get_by_text("Imported from other.graph").wait_for()
    show_the_claim(desk)
    desk.picture("loops-imported")
    desk.page.locator("#search").fill("")
    desk.page.locator("#accept-above").click()
    desk.until(lambda: desk.count("accepted") >= scans - 1, "the neighbours")
    desk.page.locator("#search").fill("imported")
    desk.row("0.2-0.8").click()
    show_the_claim(desk)
    desk.page.locator("#queue").focus()
    desk.page.keyboard.press("y")
    desk.until(lambda: row(server, project, "0.2-0.8")["silenced"], "what the optimiser makes of it")
    desk.row("0.2-0.8").click()
    desk.page.locator("#detail-graph").get_by_text("the optimiser silences it").wait_for()
    desk.picture("loops-silenced")
    desk.page.locator("#tab-map").click()
    desk.page.get_by_text("The optimiser silences 1 accepted integration").wait_for()
